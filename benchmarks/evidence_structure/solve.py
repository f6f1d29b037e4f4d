"""Direct FEM of bodies of several bending modules under pressure and a dead force at the tip.

    python -m benchmarks.evidence_structure.solve --modules 4 6 2 3 8 --out states.jsonl

The bodies of `benchmarks/families/chain_hypothesis.py`: clamped all over the base section, closed by a plate of the
same rubber, no weight, the mesh and the material of the single-module law. Every state is written as it is found, one
JSON object a line: modules, pressure_pa, tip_force_n (3,) in the body's frame, turns_rad (N + 1,), markers_m
(N + 2, 3), wall_s.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.families.chain_hypothesis import STUDY
from benchmarks.output import parser_of

from pliant import api
from pliant.interfaces.fem import FEMBackend
from pliant.records.structure import StructureState

LEVELS_PA = (2.5e3, 5e3, 7.5e3, 10e3, 12.5e3, 15e3)
PASSIVE_N = (0.025, 0.05, -0.025, -0.05)
LOADED_PA = (5e3, 10e3, 15e3)
LOADS_N = (0.05, -0.05)
UNSEEN_PA, UNSEEN_N = (7.5e3, 15e3), (0.1, -0.1)


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--modules", type=int, nargs="+", default=[4, 6, 2, 3, 8])
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    if given.out.exists():
        parser.error(f"{given.out} exists; states are appended as they are found, so begin with a new file.")
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study.yaml"
        study.write_text(STUDY)
        opened = api.open_study(study, [], store=Path(folder) / "store")
        backend: FEMBackend = opened.bench.build("fem", opened.study.fem)
        family = opened.bench.build("family", opened.study.family)
        material = opened.bench.build("material", opened.study.material)
        for modules in given.modules:
            solve(backend, material, family.structure(modules), given.out)


def solve(backend: FEMBackend, material: Any, problem: Any, out: Path) -> None:
    """All states of one body, free ones first: each is the start of those with a force at its pressure."""
    body = backend.structure(problem, material)
    rest = body.rest()
    free = {0.0: rest}
    write(problem.modules, rest, out)
    state = rest
    for level in LEVELS_PA:
        state = free[level] = body.equilibrium(level, np.zeros(3), state)
        write(problem.modules, state, out)
    cases = [(0.0, force) for force in PASSIVE_N]
    cases += [(level, force) for force in LOADS_N for level in LOADED_PA]
    cases += [(level, force) for force in UNSEEN_N for level in UNSEEN_PA]
    for level, force in cases:
        write(problem.modules, body.equilibrium(level, np.array([0.0, 0.0, force]), free[level]), out)


def write(modules: int, state: StructureState, out: Path) -> None:
    """Append one line of results."""
    row = {
        "modules": modules,
        "pressure_pa": state.pressure_pa,
        "tip_force_n": state.tip_force_n.tolist(),
        "turns_rad": state.turns_rad.tolist(),
        "markers_m": state.markers_m.tolist(),
        "wall_s": state.wall_s,
    }
    with out.open("a") as file:
        file.write(json.dumps(row) + "\n")
    print(modules, row["pressure_pa"], row["tip_force_n"], f"{state.wall_s:.0f} s", flush=True)


if __name__ == "__main__":
    main()
