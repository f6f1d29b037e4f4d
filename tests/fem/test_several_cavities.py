"""Modules of several chambers in skfem: exact slopes, one energy of all pressures, and the symmetries of the body."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.pipeline.sampling.strategies import SeveralPlan
from pliant.registry.discovery import discover
from pliant_plugins.families.reference import THREE_CHAMBER, TWO_CHAMBER
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

KINDS = {"two_chamber": TWO_CHAMBER, "three_chamber": THREE_CHAMBER}
MATERIAL = NeoHookean(NeoHookeanConfig.model_validate({"kind": "neo_hookean", "shear_modulus": "240 kPa"}))
PRESSURES = np.array([9e3, 4e3, 13e3])
HELD = {"x": 0.1, "y": 0.06, "z": -0.04}
BACKEND = Skfem(SkfemConfig.model_validate({"kind": "skfem", "pressure_max": "20 kPa"}))


def make_solver(kind: str, **keys: object):
    component = discover().get("family", kind)
    family = component.build(component.config_model().model_validate({"kind": kind, **KINDS[kind], **keys}))
    problem = family.problem()
    held = {axis: HELD.get(axis, 1e-4) for axis in problem.axes}
    return BACKEND.checked_solver(problem, MATERIAL), problem, held, PRESSURES[: len(problem.actuations)]


@pytest.mark.parametrize("kind", KINDS)
def test_slopes_are_exact_and_travels_are_conjugate(kind: str) -> None:
    """∂τ/∂a and ∂τ/∂u by differences; dU = τ du + Σ a dtravel; ∂travel_j/∂u_i = ∂τ_i/∂a_j (one energy)."""
    solver, problem, held, p = make_solver(kind)
    state = solver.constrained(p, held, solver.rest())
    size = np.abs(state.dtau_dp).max()
    for j in range(len(p)):
        step = np.zeros(len(p))
        step[j] = 20.0
        up, down = (solver.constrained(p + sign * step, held, state) for sign in (1, -1))
        np.testing.assert_allclose((up.tau - down.tau) / 40.0, state.dtau_dp[:, j], atol=1e-5 * size)
        work = p @ (up.travel - down.travel)
        assert up.energy_j - down.energy_j == pytest.approx(work, rel=1e-4)
    for i, axis in enumerate(problem.axes):
        near = [{**held, axis: held[axis] + sign * 1e-4} for sign in (1, -1)]
        up, down = (solver.constrained(p, at, state) for at in near)
        by_u = (up.tau - down.tau) / 2e-4
        np.testing.assert_allclose(by_u, state.dtau_du[:, i], atol=1e-5 * np.abs(state.dtau_du).max())
        np.testing.assert_allclose((up.travel - down.travel) / 2e-4, state.dtau_dp[i], atol=1e-5 * size)
        wanted = p @ (up.travel - down.travel) - (up.tau[i] + down.tau[i]) / 2 * 2e-4
        assert up.energy_j - down.energy_j == pytest.approx(wanted, abs=1e-7 * state.energy_j)


def test_two_chambers_that_change_places_bend_the_other_way() -> None:
    """τ(p₂, p₁, −u) = −τ(p₁, p₂, u)."""
    solver, _, _, _ = make_solver("two_chamber")
    rest = solver.rest()
    one = solver.constrained([9e3, 4e3], 0.06, rest)
    other = solver.constrained([4e3, 9e3], -0.06, rest)
    assert other.moment_n_m == pytest.approx(-one.moment_n_m, rel=1e-7)
    np.testing.assert_allclose(other.dtau_dp[0, ::-1], -one.dtau_dp[0], rtol=1e-6)
    assert solver.free([6e3, 6e3], rest).angle_rad == pytest.approx(0.0, abs=1e-9)


def test_three_chambers_that_change_places_turn_the_bend_by_120_degrees() -> None:
    """τ(P a, R u) = R τ(a, u) with R a turn by 120° about x and P the pressures moved to the next chamber."""
    solver, _, held, p = make_solver("three_chamber")
    rest = solver.rest()
    c, s = np.cos(2 * np.pi / 3), np.sin(2 * np.pi / 3)
    R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    u = np.array([held[axis] for axis in "xyz"])
    one = solver.constrained(p, held, rest)
    moved = dict(zip("xyz", R @ u, strict=True))
    other = solver.constrained(np.roll(p, 1), moved, rest)
    np.testing.assert_allclose(other.tau, R @ one.tau, atol=1e-7 * np.abs(one.tau).max())


def test_more_pressures_than_chambers_are_one_sentence() -> None:
    solver, problem, _, _ = make_solver("two_chamber")
    with pytest.raises(
        UserError, match="3 inputs are given, and the module has 2: pressure_1_pa, pressure_2_pa"
    ):
        solver.free([1e3, 2e3, 3e3], solver.rest())
    wider = problem.__class__(**{**problem.__dict__, "actuation": f"{problem.actuation}, pressure_3_pa"})
    with pytest.raises(UserError, match="no cavity for 'pressure_3_pa'"):
        BACKEND.checked_solver(wider, MATERIAL)


def test_limits_apply_to_each_input() -> None:
    config = SkfemConfig.model_validate({"pressure_max": "20 kPa", "limits": {"pressure_2_pa": "8 kPa"}})
    np.testing.assert_array_equal(config.actuation_max("pressure_1_pa, pressure_2_pa"), [20e3, 8e3])
    assert "limits" not in SkfemConfig.model_validate({"pressure_max": "20 kPa"}).canonical()
    with pytest.raises(UserError, match="'limits' names pressure_2_pa"):
        config.actuation_max("pressure_pa")
    with pytest.raises(UserError, match="is for modules of one actuation"):
        grid = SkfemConfig.model_validate({"pressure_max": "20 kPa", "sampling": "grid"})
        SeveralPlan(grid, np.ones(2)).carry_out(None)  # type: ignore[arg-type]


def test_three_equal_pressures_make_an_extending_module_longer_and_nothing_else() -> None:
    """The symmetry is threefold; −∂F/∂e times the extension is to first order the axial force that prevents it."""
    solver, problem, _, _ = make_solver("three_chamber", extends=True)
    assert (problem.joint, problem.axes) == ("extensible", ("x", "y", "z", "e"))
    rest = solver.rest()
    free = solver.free([9e3, 9e3, 9e3], rest)
    np.testing.assert_allclose(free.deformation[:3], 0.0, atol=1e-8)
    assert free.deformation[3] > 1e-5
    held = solver.constrained([9e3, 9e3, 9e3], dict.fromkeys("xyze", 0.0), rest)
    np.testing.assert_allclose(held.tau[:3], 0.0, atol=1e-9)
    assert held.tau[3] == pytest.approx(-rest.dtau_du[3, 3] * free.deformation[3], rel=0.05)


def test_an_extending_module_without_a_force_along_it_is_the_one_that_does_not() -> None:
    ball, _, held, p = make_solver("three_chamber")
    long = make_solver("three_chamber", extends=True)[0]
    one, other = (solver.constrained(p, held, solver.rest()) for solver in (ball, long))
    np.testing.assert_allclose(other.tau[:3], one.tau, rtol=1e-6, atol=1e-9)
    assert other.tau[3] == pytest.approx(0.0, abs=1e-6)
