"""The published free-bending curve (COMSOL) with one fitted constant, the shear modulus."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from tests.solve_fem_states import RESULTS, solved

from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

CURVE = Path(__file__).parents[3] / "shared/data/reference/bellow_bending_fem.csv"
MU = 248e3


def test_free_bending_in_the_reference_design() -> None:
    if not CURVE.exists():
        pytest.skip(f"reference data absent: {CURVE}")
    with CURVE.open() as file:
        rows = [row for row in csv.DictReader(file) if float(row["edge_force_n"]) == 0]
    pressure = np.array([float(row["pressure_pa"]) for row in rows])
    published = np.array([float(row["half_angle_rad"]) for row in rows])

    lengths = {"inner_radius": 2e-3, "average_radius": 6e-3, "wall": 1.5e-3, "module_length": 11e-3}
    problem = BellowBending(BellowBendingConfig.model_validate(lengths)).problem()
    solver = Skfem(SkfemConfig(pressure_max_pa=15e3)).solver(
        problem, NeoHookean(NeoHookeanConfig(shear_modulus_pa=MU))
    )
    # θ depends on p/μ alone: one computed curve gives those of all moduli
    state, ratio, angle = solver.rest(), [0.0], [0.0]
    for p in (500.0, 1e3, 2e3, 3.5e3, 5.5e3, 8e3, 11e3, 13.5e3, 16e3):
        state = solver.free(p, state)
        assert state.status == "ok"
        ratio.append(p / MU)
        angle.append(state.angle_rad / 2)
    curve = CubicSpline(ratio, angle)

    def error(mu: float) -> float:
        return float(np.linalg.norm(curve(pressure / mu) - published) / np.linalg.norm(published))

    best = minimize_scalar(error, bounds=(236e3, 270e3), method="bounded")
    # converged cells give 0.59 %; plain displacement cells, which lock a little, come nearer (see the benchmark)
    assert best.fun < 0.007
    assert best.x == pytest.approx(249.3e3, rel=0.01)


def test_the_states_in_other_rooms_tests_still_equal_the_fem(
    fem_states: list[dict[str, float]],
) -> None:
    """One state of the table is solved again; `python tests/solve_fem_states.py` rewrites the table."""
    row = fem_states[0]
    (state,) = solved(row["wall_m"], (row["pressure_pa"],))
    for name in RESULTS:
        assert getattr(state, name) == pytest.approx(row[name], rel=1e-6), name
