"""From solved states to measurement files: what a bench would have recorded of each body.

    python -m benchmarks.evidence_structure.series states.jsonl --out examples/clamped_chain

One file per number of modules, all with the same four runs (a pressure sweep without a force, forces of both signs
without pressure, and three pressures under each force) and, in `<name>_unseen.csv`, forces twice as large.

The training file gets noise, Gaussian with the standard deviations in its `sigma_` columns, its seed the number of
modules: those of a camera that sees a point to 0.1 mm and therefore the turn of a module of 11 mm to about 0.01 rad.
The other files are the FEM's own numbers, since they are what predictions are judged by.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.families.chain_hypothesis import TO_WORLD
from benchmarks.output import parser_of

from pliant.records.design import Array

TRAINING = 4
NAMES = {2: "two", 3: "three", 4: "four", 6: "six", 8: "eight"}
SIGMA_ANGLE_RAD, SIGMA_TIP_M = 1e-2, 1e-4


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("states", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    states = [json.loads(line) for line in given.states.read_text().splitlines()]
    for modules in sorted({state["modules"] for state in states}):
        mine = [state for state in states if state["modules"] == modules]
        noise = np.random.default_rng(modules) if modules == TRAINING else None
        write(given.out / f"{NAMES[modules]}.csv", seen_runs(mine), modules, noise)
        if unseen := unseen_runs(mine):
            write(given.out / f"{NAMES[modules]}_unseen.csv", unseen, modules, None)


def force(state: dict[str, Any]) -> float:
    """Across the body, in the world's x: toward where pressure bends it."""
    return float((TO_WORLD @ np.array(state["tip_force_n"]))[0])


def seen_runs(states: Sequence[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """The four runs, each in the order in which a bench would do them."""
    along = sorted((s for s in states if abs(force(s)) <= 0.05), key=lambda s: s["pressure_pa"])
    passive = sorted((s for s in along if s["pressure_pa"] == 0.0), key=force)
    runs = {
        "sweep": [s for s in along if force(s) == 0.0],
        "passive": passive if len(passive) > 1 else [],
        "assisted": [s for s in along if force(s) == 0.05],
        "opposed": [s for s in along if force(s) == -0.05],
    }
    return {name: rows for name, rows in runs.items() if rows}


def unseen_runs(states: Sequence[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Forces that no other file has."""
    strong = sorted((s for s in states if abs(force(s)) > 0.05), key=lambda s: s["pressure_pa"])
    runs = {
        "strongly_assisted": [s for s in strong if force(s) > 0],
        "strongly_opposed": [s for s in strong if force(s) < 0],
    }
    return {name: rows for name, rows in runs.items() if rows}


def write(
    path: Path, runs: dict[str, list[dict[str, Any]]], modules: int, random: np.random.Generator | None
) -> None:
    """The CSV; with noise it states its standard deviations."""
    outputs = [*(f"joint_{k}_angle_rad" for k in range(1, modules + 1)), "tip_x_m", "tip_z_m"]
    sigma = np.array([*[SIGMA_ANGLE_RAD] * modules, SIGMA_TIP_M, SIGMA_TIP_M])
    noise = [] if random is None else [f"sigma_{name}" for name in outputs]
    made = "direct FEM" if random is None else "direct FEM, with the noise of a camera added"
    lines = [f"# {modules} modules by {made}; clamped at the base, closed by a cap, no weight."]
    lines.append(",".join(["run", "pressure_pa", "tip_force_x_n", *outputs, *noise]))
    for name, readings in rows(runs):
        seen = readings[2:] if random is None else readings[2:] + sigma * random.standard_normal(len(sigma))
        numbers = [f"{value:g}" for value in readings[:2]]
        numbers += [f"{value:.5f}" for value in seen[:modules]] + [f"{value:.6f}" for value in seen[modules:]]
        lines.append(",".join([name, *numbers, *(f"{value:g}" for value in (sigma if noise else ()))]))
    path.write_text("\n".join(lines) + "\n")


def rows(runs: dict[str, list[dict[str, Any]]]) -> Iterator[tuple[str, Array]]:
    """Run, and pressure, force, joint angles, tip x and z of each state."""
    for name, states in runs.items():
        for state in states:
            tip = TO_WORLD @ np.array(state["markers_m"][-1])
            turns = np.diff(state["turns_rad"])
            yield name, np.array([state["pressure_pa"], force(state), *turns, tip[0], tip[2]])


if __name__ == "__main__":
    main()
