"""The measured success table of the published gripper: measured, published simulation, ours, 30 trials a cell.

python benchmarks/grasp/experiment.py [--quick]    prints, and writes benchmarks/out/grasp_experiment.json; resumes

Some values of the set-up are not published. They are listed with a plausible range each; ONE set serves all cells.
It is chosen on the egg's cells only: the nominal set if its error there is no larger than counting alone explains,
else the best change of one value, then, if need be, of a second one. The cylinder's cells are simulated after the
choice and judge it. Sensitivities are those of the egg's error.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
from benchmarks.grasp.gripper import REFERENCE, engine, finger, grasp, read, registry, write
from scipy.stats import spearmanr

from pliant.store.fingerprint import code_fingerprint

TABLE = REFERENCE / "grasp_experiment.csv"
TRIALS, SCREENING = 30, 12
CHANGES = 2  # at most: with more, the egg's six cells would be fitted, not explained
BAR = 25
SEED = 20260


@dataclass(frozen=True)
class Unknown:
    """A value of the set-up that is not published: what we take, and what else it may be."""

    name: str
    nominal: float
    others: tuple[float, ...]
    unit: str
    why: str


UNKNOWNS = (
    Unknown(
        "base_radius", 14e-3, (12.5e-3, 15.5e-3), "m", "to the plate's mid-plane, or to one of its faces"
    ),
    Unknown(
        "grasp_height", 8e-3, (5e-3, 11e-3), "m", "of the tip's edge, or of its middle, sagging or straight"
    ),
    Unknown("friction", 0.8, (0.7, 0.9), "", "stated for the simulation; the gripper's own was not measured"),
    Unknown("inclination", 30.0, (28.0, 32.0), "deg", "printed mount"),
    Unknown(
        "shear_modulus", 249e3, (240.5e3, 257e3), "Pa", "material law not published; fitted to the free curve"
    ),
    Unknown("weights_height", 0.5, (0.2, 0.8), "of the height", "where the extra weights are in the object"),
    Unknown(
        "pressure_noise", 0.5e3, (0.25e3, 0.87e3), "Pa", "half width, or that of the same standard deviation"
    ),
    Unknown(
        "placement_noise", 0.05, (0.0, 0.1), "of the radius", "radius of the disc, or a standard deviation"
    ),
    Unknown("foot_radius", 8e-3, (4e-3, 12e-3), "m", "what the egg stands on"),
)
NOMINAL = {unknown.name: unknown.nominal for unknown in UNKNOWNS}


@dataclass(frozen=True)
class Cell:
    """One cell of the table, successes of 30."""

    object: str
    kpa: int
    weights: int
    measured: int
    published: int


def main() -> None:
    """Sensitivity and choice on the egg, then the whole table."""
    if not TABLE.is_file():
        print(f"skipped: {TABLE} is not here")
        return
    trials, screening = (6, 3) if "--quick" in sys.argv else (TRIALS, SCREENING)
    bench = Runs()
    cells = read_table(TABLE)
    egg = [cell for cell in cells if cell.object == "egg"]
    allowed = counting_error(egg)
    print(f"error on the egg that counting alone explains: {allowed:.1f} of {30 * len(egg)}")
    changes = sensitivities(bench, egg, NOMINAL, screening)
    chosen = choose(bench, egg, changes, allowed, trials, screening)
    result = judge(bench, cells, chosen, trials)
    moved = {name: value for name, value in chosen.items() if value != NOMINAL[name]}
    result.update({"nominal": NOMINAL, "chosen": chosen, "moved": moved, "sensitivity": changes})
    bench.save(result)


class Runs:
    """Successes and mean rises by set and cell, kept in the output file while the code is the same."""

    def __init__(self) -> None:
        modules = ["pliant_plugins.tasks.grasp.task", "pliant_plugins.physics.mujoco.backend"]
        self.code = code_fingerprint(modules, {"pliant", "pliant_plugins"})
        earlier = read("grasp_experiment")
        self.found: dict[str, Any] = earlier.get("runs", {}) if earlier.get("code") == self.code else {}

    def cell(self, setup: Mapping[str, float], cell: Cell, trials: int) -> dict[str, float]:
        """Share of successes and mean z_max of one cell."""
        key = f"{sorted(setup.items())} {cell.object} {cell.kpa} {cell.weights} {trials}"
        if key not in self.found:
            self.found[key] = simulate(setup, cell, trials)
            self.save({})
        found: dict[str, float] = self.found[key]
        return found

    def error(self, setup: Mapping[str, float], cells: Sequence[Cell], trials: int) -> float:
        """Σ |ours − measured| over the cells, scaled to 30 trials."""
        return sum(abs(30 * self.cell(setup, cell, trials)["share"] - cell.measured) for cell in cells)

    def save(self, result: Mapping[str, Any]) -> None:
        write("grasp_experiment", {**result, "code": self.code, "runs": self.found})


def simulate(setup: Mapping[str, float], cell: Cell, trials: int) -> dict[str, float]:
    """One cell in MuJoCo; the same seed in every cell and set, so that differences are those of the set."""
    chain = finger(f"material.shear_modulus={setup['shear_modulus']:g}")
    height = {"egg": 0.065, "cylinder": 0.035}[cell.object]
    item: dict[str, Any] = {"shape": cell.object}
    if cell.object == "egg":
        item["foot_radius"] = setup["foot_radius"]
    task = grasp(
        object=item,
        extra_weights=cell.weights,
        weights_height=setup["weights_height"] * height,
        pressure=1e3 * cell.kpa,
        base_radius=setup["base_radius"],
        grasp_height=setup["grasp_height"],
        friction=setup["friction"],
        inclination=f"{setup['inclination']} deg",
        noise={"friction": 0.05, "pressure": setup["pressure_noise"], "placement": setup["placement_noise"]},
        trials=trials,
        seed=SEED,
    )
    metrics = task.run(chain, engine("mujoco").build_scene).metrics
    return {"share": metrics["success_share"], "z_max_m": metrics["z_max_m"]}


def sensitivities(
    bench: Runs, egg: Sequence[Cell], start: Mapping[str, float], trials: int
) -> dict[str, dict[str, float]]:
    """The egg's error with each unknown changed alone."""
    found = {"nominal": {"": bench.error(start, egg, trials)}}
    print(f"\negg error of 180, {trials} trials a cell: start {found['nominal']['']:.0f}")
    for unknown in UNKNOWNS:
        values = [v for v in (unknown.nominal, *unknown.others) if v != start[unknown.name]]
        errors = {str(value): bench.error({**start, unknown.name: value}, egg, trials) for value in values}
        found[unknown.name] = errors
        texts = ", ".join(f"{float(value):g} {unknown.unit}: {error:.0f}" for value, error in errors.items())
        print(f"  {unknown.name:<16} {start[unknown.name]:g} → {texts}   ({unknown.why})", flush=True)
    return found


def choose(
    bench: Runs,
    egg: Sequence[Cell],
    changes: Mapping[str, Mapping[str, float]],
    allowed: float,
    trials: int,
    screening: int,
) -> dict[str, float]:
    """The set for all cells; see the head of this file."""
    chosen, errors = dict(NOMINAL), changes
    for changed in range(CHANGES + 1):
        error = bench.error(chosen, egg, trials)
        print(f"egg error of the present set, {trials} trials a cell: {error:.0f}")
        if error <= allowed or changed == CHANGES:
            break
        if changed:
            errors = sensitivities(bench, egg, chosen, screening)
        options = {(n, float(v)): e for n, of in errors.items() if n != "nominal" for v, e in of.items()}
        (name, value), best = min(options.items(), key=lambda option: option[1])
        if best >= errors["nominal"][""]:
            break
        print(f"changed: {name} = {value:g}")
        chosen[name] = value
    return chosen


def judge(bench: Runs, cells: Sequence[Cell], chosen: Mapping[str, float], trials: int) -> dict[str, Any]:
    """The table of all cells under the chosen set."""
    rows = []
    print("\nobject    kPa  weights  measured  published  ours   z_max mm")
    for cell in cells:
        run = bench.cell(chosen, cell, trials)
        ours = 30 * run["share"]
        rows.append({**vars(cell), "ours": ours, "z_max_m": run["z_max_m"]})
        print(
            f"{cell.object:<9}{cell.kpa:>4}{cell.weights:>9}{cell.measured:>10}{cell.published:>11}{ours:>6.0f}"
            f"{1e3 * run['z_max_m']:>11.1f}"
        )
    measured = np.array([cell.measured for cell in cells])
    totals = {"published": 0.0, "ours": 0.0}
    for name in ("egg", "cylinder"):
        of = [row for row in rows if row["object"] == name]
        errors = {which: float(sum(abs(r[which] - r["measured"]) for r in of)) for which in totals}
        totals = {which: totals[which] + errors[which] for which in totals}
        print(
            f"error on the {name}: published {errors['published']:.0f}, ours {errors['ours']:.0f} of {30 * len(of)}"
        )
    rank = float(spearmanr([row["z_max_m"] for row in rows], measured).statistic)
    print(
        f"total: published {totals['published']:.0f}, ours {totals['ours']:.0f} of {30 * len(rows)}; at most {BAR} "
        f"was the aim. Counting alone explains {counting_error(cells):.1f}.\n"
        f"rank correlation of z_max and measured success over {len(rows)} cells: {rank:.2f}"
    )
    return {"cells": rows, "total_error": totals, "bar": BAR, "z_max_rank_correlation": rank}


def counting_error(cells: Sequence[Cell]) -> float:
    """Expected Σ |a − b| of two counts of 30 with the measured share of success, one for each side."""
    random = np.random.default_rng(0)
    shares = np.array([cell.measured / 30 for cell in cells])
    ours, theirs = random.binomial(30, shares, (2, 20_000, len(cells)))
    return float(np.abs(ours - theirs).sum(axis=1).mean())


def read_table(path: Path) -> list[Cell]:
    """The reference table, groups of ten added."""
    with path.open() as file:
        return [
            Cell(
                row["object"],
                int(row["pressure_kpa"]),
                int(row["extra_weights_20g"]),
                sum(int(row[f"experiment_g{k}"]) for k in (1, 2, 3)),
                sum(int(row[f"paper_sim_g{k}"]) for k in (1, 2, 3)),
            )
            for row in csv.DictReader(file)
        ]


if __name__ == "__main__":
    registry()
    main()
