"""The predicted start of the next state: interpolation of values and slopes, and states independent of it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pliant.records.fem import FemState
from pliant.testing.box import box_problem
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.newton import Control
from pliant_plugins.fem.predictor import Anchor, expected
from pliant_plugins.fem.skfem.backend import Skfem, SkfemSolver
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

PLACES = (1,)  # of the joint's one axis among two globals
# (p, u), first the five that a sampling begins with
KNOWN = np.array([[0.0, 0.0], [1.0, 0.4], [0.0, -0.5], [1.0, 1.0], [0.5, 0.1], [0.5, 0.6]])


def manifold(z: np.ndarray) -> Anchor:
    """Return x = (sin(p + u), p cos u, e, u) and f = p − u − u³/3 with their slopes."""
    p, u = z
    x = np.array([np.sin(p + u), p * np.cos(u), 0.1 * p * u, u])
    slopes = [[np.cos(p + u)] * 2, [np.cos(u), -p * np.sin(u)], [0.1 * u, 0.1 * p], [0.0, 1.0]]
    return Anchor(z, x, np.array(slopes), np.array([p - u - u**3 / 3]), np.array([[1.0, -1 - u**2]]))


def at(p: float, u: float | None) -> np.ndarray:
    held = np.array([False, u is not None])
    control = Control(p, held, np.array([0.0, u or 0.0]), np.zeros(2))
    x = expected(KNOWN, lambda i: manifold(KNOWN[i]), control, PLACES)
    assert x is not None
    return x


def test_known_places_are_met_and_others_far_better_than_by_the_tangent_plane() -> None:
    for z in KNOWN:
        np.testing.assert_allclose(at(*z), manifold(z).x, atol=1e-7)
    z = np.array([0.75, 0.55])
    near = manifold(KNOWN[5])
    plane = np.abs(near.x + near.x_by_z @ (z - near.z) - manifold(z).x).max()
    assert np.abs(at(*z) - manifold(z).x).max() < 0.05 * plane


def test_a_free_axis_is_expected_where_no_effort_acts() -> None:
    u = 0.6
    assert at(u + u**3 / 3, None)[-1] == pytest.approx(u, abs=2e-3)


def test_one_state_foretells_nothing() -> None:
    control = Control(1.0, np.array([False, True]), np.zeros(2), np.zeros(2))
    assert expected(KNOWN[:1], lambda i: manifold(KNOWN[i]), control, PLACES) is None


def solver() -> SkfemSolver:
    config = SkfemConfig(pressure_max_pa=20e3)
    return Skfem(config).solver(box_problem(), NeoHookean(NeoHookeanConfig(shear_modulus_pa=240e3)))


def walked(model: SkfemSolver, told: bool) -> list[FemState]:
    states = [model.rest()]
    for pressure, angle in ((4e3, None), (9e3, None), (9e3, 0.02), (5e3, 0.04), (7e3, 0.03)):
        if told:
            model.learn(states[-1])
        start = states[-1]
        states.append(
            model.free(pressure, start) if angle is None else model.constrained(pressure, angle, start)
        )
    return states


def test_the_same_states_with_fewer_corrections() -> None:
    plain, told = walked(solver(), told=False), walked(solver(), told=True)
    for name in ("deformation", "tau", "dtau_dp", "dtau_du", "energy_j", "solution"):
        wanted, found = (np.array([getattr(state, name) for state in walk]) for walk in (plain, told))
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())
    assert told[-1].iterations < plain[-1].iterations


def test_states_from_another_process_foretell_the_same_bits() -> None:
    whole = walked(solver(), told=True)
    again = solver()
    for state in whole[:-1]:
        again.learn(dataclasses.replace(state, wall_s=0.0))
    last = again.constrained(whole[-1].actuation, whole[-1].angle_rad, whole[-2])
    np.testing.assert_array_equal(last.solution, whole[-1].solution)
    np.testing.assert_array_equal(last.dtau_du, whole[-1].dtau_du)
