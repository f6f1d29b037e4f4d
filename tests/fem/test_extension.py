"""The extension as a coordinate of a module that bends and twists: rod theory, and the result of its elimination."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.records.fem import FemState, ModuleProblem
from pliant.records.law import EXTENSIBLE_AXES
from pliant.testing.box import spatial_box_problem
from pliant.testing.fem import BOX
from pliant.testing.stand_ins import sample_material
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem, SkfemSolver

PRESSURE = 4e3


def make_solver(problem: ModuleProblem) -> SkfemSolver:
    return Skfem(SkfemConfig()).solver(problem, sample_material())


def extensible() -> SkfemSolver:
    return make_solver(replace(spatial_box_problem(), axes=EXTENSIBLE_AXES, joint="extensible"))


def test_small_extensions_follow_rod_theory() -> None:
    """−∂F/∂e = E A / l, ∂F/∂p = (1 − 2ν) A_c of the cavity, in newtons and metres in the row after the turns."""
    rest = extensible().rest()
    assert -rest.dtau_du[3, 3] == pytest.approx(BOX.axial_stiffness_n_m, rel=1e-5)
    assert rest.dtau_dp[3] == pytest.approx(BOX.thrust_m2, rel=1e-5)
    np.testing.assert_allclose(rest.dtau_du, rest.dtau_du.T, atol=1e-12)


def test_without_a_force_along_it_it_is_the_ball_joint() -> None:
    """With e free the state is the same; its slopes are the extensible ones with e eliminated (Schur's complement)."""
    held = {"x": 0.06, "y": 0.1, "z": -0.08}
    ball, long = make_solver(spatial_box_problem()), extensible()
    wanted = ball.constrained(PRESSURE, held, ball.rest())
    found = long.constrained(PRESSURE, held, long.rest())
    length = spatial_box_problem().span_m
    assert found.deformation[3] == pytest.approx(wanted.axial_strain * length, rel=1e-6)
    assert abs(found.deformation[3]) > 1e-5
    np.testing.assert_allclose(found.tau[:3], wanted.tau, atol=1e-8)
    assert abs(found.tau[3]) < 1e-6
    k, by_p = found.dtau_du, found.dtau_dp
    without = k[:3, :3] - np.outer(k[:3, 3], k[3, :3]) / k[3, 3]
    np.testing.assert_allclose(without, wanted.dtau_du, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(by_p[:3] - k[:3, 3] * by_p[3] / k[3, 3], wanted.dtau_dp, rtol=1e-5, atol=1e-12)


def test_slopes_match_the_efforts_and_the_energy() -> None:
    """Around a state that is bent, twisted and stretched: differences of τ by e, and −∂Π/∂e = F."""
    long, step = extensible(), 2e-6
    held = {"x": 0.06, "y": 0.1, "z": -0.08, "e": 2e-4}
    middle = long.constrained(PRESSURE, held, long.rest())
    ahead, behind = (
        long.constrained(PRESSURE, {**held, "e": held["e"] + way}, middle) for way in (step, -step)
    )
    slope = (ahead.tau - behind.tau) / (2 * step)
    np.testing.assert_allclose(middle.dtau_du[:, 3], slope, rtol=1e-4, atol=1e-4 * np.abs(slope).max())

    def potential(state: FemState) -> float:
        return state.energy_j - PRESSURE * float(state.travel)

    force = -(potential(ahead) - potential(behind)) / (2 * step)
    assert middle.tau[3] == pytest.approx(force, rel=1e-4)


def test_a_line_that_does_not_stretch_has_no_extension() -> None:
    problem = replace(spatial_box_problem(), axes=EXTENSIBLE_AXES, joint="extensible", stretches=False)
    with pytest.raises(UserError, match="distinct ones of x, y, z, not"):
        make_solver(problem)
