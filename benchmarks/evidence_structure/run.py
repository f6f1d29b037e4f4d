"""Structural error instead of an injected effect: `improve` on direct FEM of four modules, scored on other lengths.

    python -m benchmarks.evidence_structure.run [--extended STUDY] [--solve STATES] [--picture FILE]

`pliant improve` gets the recording of four modules (examples/clamped_chain/four.csv) and the chain of single-module
laws. The study that it writes then predicts, with `chain.modules` overridden, bodies and forces that it has not
seen. `--extended` takes a study that `improve` wrote before instead of running it. `--solve` recomputes the FEM states
(hours), each written when it is found, and the measurement files of examples/clamped_chain from them.

The bodies are those of `benchmarks/families/chain_hypothesis.py`: clamped all over the base section, closed by a plate
of the same rubber, no weight, the mesh and the material of the single-module law. A state is one JSON object a line:
modules, pressure_pa, tip_force_n (3,) in the body's frame, turns_rad (N + 1,), markers_m (N + 2, 3), wall_s.

One measurement file per number of modules, all with the same four runs (a pressure sweep without a force, forces of
both signs without pressure, and three pressures under each force) and, in `<name>_unseen.csv`, forces twice as large.
The training file gets noise, Gaussian with the standard deviations in its `sigma_` columns, its seed the number of
modules: those of a camera that sees a point to 0.1 mm and therefore the turn of a module of 11 mm to about 0.01 rad.
The other files are FEM results without noise, since predictions are scored with them.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.families import chain_hypothesis
from benchmarks.output import Bar, make_parser, write

from pliant import api
from pliant.evidence.opening import read_study_measurement
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import EffectConfig
from pliant.records.design import Array

EXAMPLE = Path(__file__).parents[2] / "examples" / "clamped_chain"
STUDY = EXAMPLE / "arm.yaml"
TRAINING = 4
SEEN = {2: "two", 3: "three", 4: "four", 6: "six", 8: "eight"}
FALL = 3.0
SOLVED = (4, 6, 2, 3, 8)
LEVELS_PA = (2.5e3, 5e3, 7.5e3, 10e3, 12.5e3, 15e3)
# Pressure (Pa) and tip force (N) of the states under a force: without pressure, under it, and twice as large ones.
FORCED = tuple((0.0, force) for force in (0.025, 0.05, -0.025, -0.05))
FORCED += tuple((level, force) for force in (0.05, -0.05) for level in (5e3, 10e3, 15e3))
FORCED += tuple((level, force) for force in (0.1, -0.1) for level in (7.5e3, 15e3))
SIGMA_ANGLE_RAD, SIGMA_TIP_M = 1e-2, 1e-4
State = dict[str, Any]


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--extended", type=Path, default=None)
    parser.add_argument("--solve", type=Path, default=None)
    parser.add_argument("--picture", type=Path, default=None)
    given = parser.parse_args()
    if given.solve:
        if given.solve.exists():
            parser.error(
                f"{given.solve} exists; states are appended as they are found, so begin with a new file."
            )
        solve(given.solve)
        record([json.loads(line) for line in given.solve.read_text().splitlines()], EXAMPLE)
    with tempfile.TemporaryDirectory() as folder:
        extended, found = given.extended, {}
        if extended is None:
            extended = Path(folder) / "improved.yaml"
            found = improved(extended, Path(folder) / "store")
        rows = [error_row(name, modules, extended, Path(folder) / "store") for modules, name in files()]
    for row in rows:
        print(sentence(row))
    write("evidence_structure", {"improve": found, "cases": rows}, [error_reduction_bar(rows)])
    if given.picture:
        draw(rows, given.picture)


def solve(out: Path) -> None:
    """Solve all states of each body, free ones first: each is the start of those with a force at its pressure."""
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study.yaml"
        study.write_text(chain_hypothesis.STUDY)
        opened = api.open_study(study, [], store=Path(folder) / "store")
        backend, family, material = (
            opened.context.build(name, getattr(opened.study, name)) for name in ("fem", "family", "material")
        )
        for modules in SOLVED:
            body = backend.structure(family.structure(modules), material)
            state = body.rest()
            free = {0.0: state}
            append(modules, state, out)
            for level in LEVELS_PA:
                state = free[level] = body.equilibrium(level, np.zeros(3), state)
                append(modules, state, out)
            for level, force in FORCED:
                append(modules, body.equilibrium(level, np.array([0.0, 0.0, force]), free[level]), out)


def append(modules: int, state: Any, out: Path) -> None:
    """Append one line of results."""
    row = {"modules": modules, "pressure_pa": state.pressure_pa}
    row |= {name: getattr(state, name).tolist() for name in ("tip_force_n", "turns_rad", "markers_m")}
    with out.open("a") as file:
        file.write(json.dumps({**row, "wall_s": state.wall_s}) + "\n")
    print(modules, row["pressure_pa"], row["tip_force_n"], f"{state.wall_s:.0f} s", flush=True)


def record(states: Sequence[State], folder: Path) -> None:
    """Write the measurement files of solved states: the recording of each body on a bench."""
    for modules in sorted({state["modules"] for state in states}):
        mine = sorted((s for s in states if s["modules"] == modules), key=lambda s: s["pressure_pa"])
        noise = np.random.default_rng(modules) if modules == TRAINING else None
        passive = sorted((s for s in mine if s["pressure_pa"] == 0.0 and abs(force(s)) <= 0.05), key=force)
        seen = {
            "sweep": pushed(mine, lambda f: f == 0.0),
            "passive": passive if len(passive) > 1 else [],
            "assisted": pushed(mine, lambda f: f == 0.05),
            "opposed": pushed(mine, lambda f: f == -0.05),
        }
        save(folder / f"{SEEN[modules]}.csv", seen, modules, noise)
        unseen = {
            "strongly_assisted": pushed(mine, lambda f: f > 0.05),
            "strongly_opposed": pushed(mine, lambda f: f < -0.05),
        }
        if any(unseen.values()):
            save(folder / f"{SEEN[modules]}_unseen.csv", unseen, modules, None)


def force(state: State) -> float:
    """Return the force across the body, in the world's x, in the direction of bending by pressure."""
    return float((chain_hypothesis.TO_WORLD @ np.array(state["tip_force_n"]))[0])


def pushed(states: Sequence[State], wanted: Callable[[float], bool]) -> list[State]:
    """Return the states under some forces, by rising pressure."""
    return [state for state in states if wanted(force(state))]


def save(path: Path, runs: dict[str, list[State]], modules: int, random: np.random.Generator | None) -> None:
    """Write the CSV; with noise it states its standard deviations."""
    outputs = [*(f"joint_{k}_angle_rad" for k in range(1, modules + 1)), "tip_x_m", "tip_z_m"]
    sigma = np.array([*[SIGMA_ANGLE_RAD] * modules, SIGMA_TIP_M, SIGMA_TIP_M])
    noise = [] if random is None else [f"sigma_{name}" for name in outputs]
    made = "direct FEM" if random is None else "direct FEM, with the noise of a camera added"
    lines = [f"# {modules} modules by {made}; clamped at the base, closed by a cap, no weight."]
    lines.append(",".join(["run", "pressure_pa", "tip_force_x_n", *outputs, *noise]))
    for name, state in ((name, state) for name, states in runs.items() for state in states):
        tip = chain_hypothesis.TO_WORLD @ np.array(state["markers_m"][-1])
        seen = np.array([*np.diff(state["turns_rad"]), tip[0], tip[2]])
        if random is not None:
            seen = seen + sigma * random.standard_normal(len(sigma))
        numbers = [f"{value:g}" for value in (state["pressure_pa"], force(state))]
        numbers += [f"{value:.5f}" for value in seen[:modules]] + [f"{value:.6f}" for value in seen[modules:]]
        lines.append(",".join([name, *numbers, *(f"{value:g}" for value in (sigma if noise else ()))]))
    path.write_text("\n".join(lines) + "\n")


def files() -> list[tuple[int, str]]:
    """Return number of modules and stem of every recording, fitted ones first."""
    found = [(n, f"{word}{suffix}") for n, word in SEEN.items() for suffix in ("", "_unseen")]
    there = [(n, name) for n, name in found if (EXAMPLE / f"{name}.csv").is_file()]
    return sorted(there, key=lambda item: (item[0] != TRAINING, item))


def improved(out: Path, store: Path) -> dict[str, Any]:
    """Run `pliant improve` on the recording of four modules: its JSON result."""
    result = out.with_suffix(".json")
    options = {"--out": out, "--store": store, "--report": out.parent, "--json": result}
    words = [str(word) for option in options.items() for word in option]
    subprocess.run([sys.executable, "-m", "pliant", "improve", str(STUDY), *words], check=True)
    return json.loads(result.read_text())


def errors(
    study: Path, modules: int, name: str, store: Path, effects: Sequence[EffectConfig] = ()
) -> tuple[Array, Array, float]:
    """Return errors of a study's chain with `modules` modules and further effects against one file.

    Returns:
        Errors of the tip (t,) in m and of its turn (t,) in rad; the length of the chain, m.
    """
    overrides = [f"chain.modules={modules}", f"measurements.file={EXAMPLE / name}.csv"]
    opened = api.open_study(study, overrides, store=store)
    measured = read_study_measurement(opened.context, opened.study, None)
    predictor = Predictor.from_study(opened.context, opened.study, measured)
    tips, turns = [], []
    for run, said in zip(measured.runs, predictor.predict(effects), strict=True):
        missed = {key: run.outputs[key] - said[key] for key in said}
        tips.append(np.hypot(missed["tip_x_m"], missed["tip_z_m"]))
        turns.append(np.sum([missed[key] for key in missed if key.endswith("angle_rad")], axis=0))
    return np.concatenate(tips), np.concatenate(turns), predictor.chain.length_m


def error_row(name: str, modules: int, extended: Path, store: Path) -> dict[str, Any]:
    """Return root mean square and largest errors before and after; m and rad."""
    row: dict[str, Any] = {"file": name, "modules": modules}
    for word, used in (("plain", STUDY), ("improved", extended)):
        tip_m, turn_rad, row["length_m"] = errors(used, modules, name, store)
        row[f"tip_{word}_m"] = float(np.sqrt(np.mean(tip_m**2)))
        row[f"tip_{word}_worst_m"] = float(tip_m.max())
        row[f"turn_{word}_rad"] = float(np.sqrt(np.mean(turn_rad**2)))
    return {**row, "fall": row["tip_plain_m"] / row["tip_improved_m"]}


def error_reduction_bar(rows: list[dict[str, Any]]) -> Bar:
    """Return the reduction over all unseen numbers of modules together, in shares of the length."""
    unseen = [row for row in rows if row["modules"] != TRAINING]
    size = {
        word: np.sqrt(np.mean([(row[f"tip_{word}_m"] / row["length_m"]) ** 2 for row in unseen]))
        for word in ("plain", "improved")
    }
    fall = float(size["plain"] / size["improved"])
    return Bar("tip error on unseen numbers of modules falls by", fall, FALL, "x", at_most=False)


def sentence(row: dict[str, Any]) -> str:
    tip = [f"{1e3 * row[f'tip_{word}_m']:.2f}" for word in ("plain", "improved")]
    share = [f"{100 * row[f'tip_{word}_m'] / row['length_m']:.2f}" for word in ("plain", "improved")]
    turn = [f"{np.degrees(row[f'turn_{word}_rad']):.2f}" for word in ("plain", "improved")]
    return (
        f"{row['file']:13} tip {tip[0]} → {tip[1]} mm ({share[0]} → {share[1]} % of length), worst "
        f"{1e3 * row['tip_plain_worst_m']:.2f} → {1e3 * row['tip_improved_worst_m']:.2f} mm, turn of the tip "
        f"{turn[0]} → {turn[1]}°, fall {row['fall']:.1f} x"
    )


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw tip errors over the number of modules, before and after, for fitted forces and twice as large ones."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained", sharey=True)
    titles = {"": "forces as in training", "_unseen": "forces twice as large"}
    for panel, (suffix, title) in zip(panels, titles.items(), strict=True):
        mine = [r for r in rows if r["file"] == SEEN[r["modules"]] + suffix]
        mine.sort(key=lambda row: row["modules"])
        n = [row["modules"] for row in mine]
        for word, colour in (("plain", "tab:orange"), ("improved", "tab:blue")):
            label = {"plain": "chain of single-module laws", "improved": "after improve"}[word]
            panel.plot(n, [1e3 * row[f"tip_{word}_m"] for row in mine], "o-", color=colour, label=label)
        panel.axvline(TRAINING, color="0.7", linewidth=0.8, linestyle=":")
        panel.set(xlabel="modules", title=title, xticks=n)
    highest = max(row["tip_plain_m"] for row in rows)
    panels[0].set_ylim(0, 1.08e3 * highest)
    panels[0].annotate(
        "fitted here", (TRAINING, 0.02), xytext=(4, 3), textcoords="offset points", color="0.5"
    )
    panels[0].set_ylabel("tip error, rms (mm)")
    panels[0].legend(frameon=False, fontsize=9, loc="upper left")
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main()
