"""The tendon joint's FEM by law: beam theory, virtual work, an elastica by another method, symmetry."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root
from tests.families.solvers import make_solver, rubber

from pliant.interfaces.fem import ModuleSolver
from pliant_plugins.families.reference import TENDON_JOINT
from pliant_plugins.families.tendon_joint.family import TendonJoint, TendonJointConfig

MU, NU = 70e6, 0.49
E = 2 * MU * (1 + NU)
SLENDER = {
    "flexure_length": "10 mm",
    "flexure_thickness": "0.5 mm",
    "flexure_width": "0.5 mm",
    "tendon_setback": "9 mm",
}


def joint(**changes: object) -> TendonJoint:
    return TendonJoint(TendonJointConfig.model_validate({**TENDON_JOINT, **changes}))


@cache
def solver(slender: bool) -> ModuleSolver:
    return make_solver(joint(**(SLENDER if slender else {})).problem(), rubber(MU, poisson_ratio=NU))


def bending_stiffness(family: TendonJoint) -> float:
    """Return E I of the flexure."""
    g = family.geometry
    return E * g.flexure_width_m * g.flexure_thickness_m**3 / 12


def test_at_rest_it_is_a_beam_with_the_tendons_offset_for_an_arm() -> None:
    """A slender flexure is a beam, except that bonded ends cannot contract; a wide one is between beam and plate."""
    for slender, most in ((True, 1.02), (False, 1.02 / (1 - NU**2))):
        family, rest = joint(**(SLENDER if slender else {})), solver(slender).rest()
        beam = bending_stiffness(family) / family.geometry.flexure_length_m
        assert beam < -rest.dmoment_du < most * beam
    assert rest.dmoment_dp == pytest.approx(joint().geometry.tendon_offset_m, rel=1e-9)


def test_bent_by_a_couple_the_tendon_follows_the_arc() -> None:
    model, g = solver(True), joint(**SLENDER).geometry
    state = model.rest()
    for angle in (0.4, 0.8):
        state = model.constrained(0.0, angle, state)
        drawn = g.tendon_length_m(0.0) - g.tendon_length_m(angle)
        assert state.travel == pytest.approx(drawn, rel=2e-3)
        assert state.dmoment_dp == pytest.approx(g.tendon_arm_m(angle), rel=2e-3)


def test_without_a_tendon_it_bends_alike_both_ways() -> None:
    model = solver(False)
    up, down = (model.constrained(0.0, angle, model.rest()) for angle in (0.3, -0.3))
    assert up.moment_n_m == pytest.approx(-down.moment_n_m, rel=1e-8)
    assert up.energy_j == pytest.approx(down.energy_j, rel=1e-8)
    assert up.moment_n_m < 0 < up.energy_j


def test_slopes_match_moment_travel_and_energy() -> None:
    """∂τ/∂T = ∂W/∂u, ∂τ/∂u by differences, and dU = T dW − τ du along a change of angle."""
    model, step = solver(False), 1e-3
    here = model.constrained(4.0, 0.35, model.free(4.0, model.rest()))
    near = {n: model.constrained(4.0, 0.35 + n * step, here) for n in (-2, -1, 1, 2)}

    def slope(name: str) -> float:
        values = {n: getattr(state, name) for n, state in near.items()}
        return (8 * (values[1] - values[-1]) - (values[2] - values[-2])) / (12 * step)

    assert here.dmoment_dp == pytest.approx(slope("travel"), rel=1e-6)
    assert here.dmoment_du == pytest.approx(slope("moment_n_m"), rel=1e-6)
    assert slope("energy_j") == pytest.approx(4.0 * slope("travel") - here.moment_n_m, rel=1e-6)
    more, less = (model.constrained(4.0 + d, 0.35, here).moment_n_m for d in (0.01, -0.01))
    assert here.dmoment_dp == pytest.approx((more - less) / 0.02, rel=1e-6)


def elastica_angle(family: TendonJoint, force: float, guess: float) -> float:
    """Return the free angle of an extensible elastica between rigid links: κ = T (z − z_hole)/EI, ε = −T cos φ/EA.

    The middle section stays at rest; the height z_hole of the taut tendon follows from the end section's position.
    """
    g = family.geometry
    EI = bending_stiffness(family)
    EA = E * g.flexure_width_m * g.flexure_thickness_m

    def end(height: float) -> np.ndarray:
        def slope(_: float, y: np.ndarray) -> list[float]:
            phi, z = y
            return [force * (z - height) / EI, -np.sin(phi) * (1 - force * np.cos(phi) / EA)]

        return solve_ivp(slope, (0.0, g.span_m), [0.0, 0.0], rtol=1e-9, atol=1e-14).y[:, -1]

    def miss(height: np.ndarray) -> float:
        phi, z = end(float(height[0]) * g.tendon_offset_m)
        hole = z - g.tendon_offset_m * np.cos(phi) - g.tendon_setback_m * np.sin(phi)
        return float(height[0] - hole / g.tendon_offset_m)

    half = guess / 2
    start = -np.cos(half) - g.tendon_setback_m / g.tendon_offset_m * np.sin(half)
    found = root(miss, [start], tol=1e-12)
    assert found.success
    return 2 * float(end(float(found.x[0]) * g.tendon_offset_m)[0])


def test_the_free_branch_is_an_elasticas() -> None:
    family, model = joint(**SLENDER), solver(True)
    stiffness = -model.rest().dmoment_du
    # the beam's own error, bonded ends, is eliminated by scaling the force
    excess = stiffness * family.geometry.flexure_length_m / bending_stiffness(family)
    unit = bending_stiffness(family) / family.geometry.flexure_length_m / family.geometry.tendon_offset_m
    state = model.rest()
    for share in (0.2, 0.4, 0.55):
        state = model.free(share * unit * excess, state)
        assert state.angle_rad == pytest.approx(
            elastica_angle(family, share * unit, state.angle_rad), rel=0.01
        )
    assert state.angle_rad > 0.8


def test_states_in_which_the_links_meet_are_marked() -> None:
    model, g = solver(False), joint().geometry
    inside = model.constrained(2.0, 0.5, model.free(2.0, model.rest()))
    beyond = model.constrained(2.0, g.closing_angle_rad + 0.02, inside)
    under = model.constrained(0.0, -g.opening_angle_rad - 0.01, model.rest())
    statuses = [s.status for s in (model.rest(), inside, beyond, under)]
    assert statuses == ["ok", "ok", "self_contact", "self_contact"]


def test_another_code_agrees() -> None:
    pytest.importorskip(
        "pliant_plugins.fem.ngsolve.library",
        reason="an extra: pip install 'pliant[ngsolve]'",
        exc_type=ImportError,
    )
    from pliant_plugins.fem.config import NgsolveConfig
    from pliant_plugins.fem.ngsolve.backend import Ngsolve

    config = NgsolveConfig.model_validate({"tendon_force_max_n": 8.0, "order": 2})
    other = Ngsolve(config).solver(joint().problem(), rubber(MU, poisson_ratio=NU))
    states = [model.constrained(3.0, 0.3, model.free(3.0, model.rest())) for model in (solver(False), other)]
    for name in ("moment_n_m", "dmoment_dp", "dmoment_du", "travel", "energy_j"):
        ours, theirs = (getattr(state, name) for state in states)
        assert ours == pytest.approx(theirs, rel=3e-3), name
