"""Solve the FEM states that other tests read from `data/fem_states.csv`: python tests/solve_fem_states.py

Modules of the first finger with three walls, vented and under pressure, held at one angle. `tests/fem` solves one of
them again and compares.
"""

from __future__ import annotations

import csv
from pathlib import Path

from pliant.records.fem import FemState
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

TABLE = Path(__file__).parent / "data" / "fem_states.csv"
WALLS_M, PRESSURES_PA, ANGLE_RAD = (1.35e-3, 1.5e-3, 1.65e-3), (0.0, 9e3), 0.25
RESULTS = ("moment_n_m", "dmoment_dp", "dmoment_du", "energy_j")


def solved(wall_m: float, pressures_pa: tuple[float, ...] = PRESSURES_PA) -> list[FemState]:
    """Return the states of a module with this wall."""
    lengths = {"inner_radius": 2e-3, "average_radius": 6e-3, "wall": wall_m, "module_length": 11e-3}
    family = BellowBending(BellowBendingConfig.model_validate(lengths))
    rubber = NeoHookean(NeoHookeanConfig(shear_modulus_pa=240e3, poisson_ratio=0.49))
    solver = Skfem(SkfemConfig.model_validate({"pressure_max_pa": 15e3})).solver(family.problem(), rubber)
    state, states = solver.constrained(0.0, ANGLE_RAD / 2, solver.rest()), []
    for pressure in pressures_pa:
        state = solver.constrained(pressure, ANGLE_RAD, state)
        states.append(state)
    return states


def main() -> None:
    """Write the table."""
    TABLE.parent.mkdir(exist_ok=True)
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["wall_m", "pressure_pa", "angle_rad", *RESULTS])
        for wall in WALLS_M:
            for state in solved(wall):
                row = [wall, state.actuation, state.angle_rad, *(getattr(state, name) for name in RESULTS)]
                writer.writerow([repr(float(value)) for value in row])


if __name__ == "__main__":
    main()
