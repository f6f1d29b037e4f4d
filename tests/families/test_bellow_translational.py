"""The translational bellow: validity, meshes, and its force by symmetry, reciprocity and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.families.solvers import make_solver, rubber

from pliant.errors import InvalidDesignError
from pliant.interfaces.fem import ModuleSolver
from pliant.records.fem import ModuleProblem
from pliant_plugins.families.bellow.revolved import RevolvedCounts, sector
from pliant_plugins.families.bellow_translational.family import BellowTranslational, BellowTranslationalConfig

NAMES = ("inner_radius", "average_radius", "wall", "module_length")


def family(r: float = 5, R: float = 8, t: float = 1.5, l: float = 10) -> BellowTranslational:  # noqa: E741
    lengths = dict(zip(NAMES, (f"{value} mm" for value in (r, R, t, l)), strict=True))
    return BellowTranslational(BellowTranslationalConfig.model_validate(lengths))


def solver(problem: ModuleProblem) -> ModuleSolver:
    return make_solver(problem, rubber(240e3))


@pytest.fixture(scope="module")
def model() -> ModuleSolver:
    return solver(family().problem())


def test_bad_designs_name_the_inequality() -> None:
    with pytest.raises(
        InvalidDesignError, match="bellow_translational needs module_length/4 > wall/2.*0.1 mm"
    ):
        family(t=2.2, l=4)


def test_mass_equals_the_published_volume() -> None:
    design = family()
    mass = design.mass(1150.0)
    geometry = design.geometry
    wall = geometry.wall_volume(-geometry.wall_m / 2, geometry.wall_m / 2)
    assert mass.start.mass_kg + mass.end.mass_kg == pytest.approx(1150.0 * wall, rel=1e-3)
    assert mass.end.com_m[1:] == pytest.approx(0.0, abs=1e-9)
    # a body of revolution: equal moments about y and z
    inertia = np.diag(mass.end.inertia_kg_m2)
    assert inertia[1] == pytest.approx(inertia[2], rel=1e-6)


@pytest.mark.slow
def test_quarter_and_half_section_agree(model: ModuleSolver) -> None:
    """Symmetry about y = 0 and about z = 0 alike; the half section rests on one node along z."""
    design = family()
    halves = replace(
        design.problem(),
        mesh=sector(
            design.geometry, RevolvedCounts.from_profile(design.geometry, 1, arc=3, quarter=4), quarters=2
        ),
        energy_scale=4.0,
        fixed={"start": (0,), "end": (0,), "symmetry": (1,), "pin": (2,)},
    )
    other = solver(halves)
    quarter, half = (m.free(5e3, m.rest()) for m in (model, other))
    assert half.angle_rad == pytest.approx(quarter.angle_rad, rel=1e-6)
    assert half.dmoment_du == pytest.approx(quarter.dmoment_du, rel=1e-6)
    assert half.travel == pytest.approx(quarter.travel, rel=1e-6)


def test_thrust_is_the_cavity_slope(model: ModuleSolver) -> None:
    """∂τ/∂p at constant u = ∂V/∂u at constant p: both are −∂²Π/∂p∂u."""
    here = model.constrained(4e3, 0.3e-3, model.rest())
    low, high = (model.constrained(4e3, 0.3e-3 + s * 1e-5, here) for s in (-1, 1))
    assert here.dmoment_dp == pytest.approx((high.travel - low.travel) / 2e-5, rel=1e-5)
    # between the areas inside trough and crest
    geometry = family().geometry
    assert np.pi * geometry.inner_radius_m**2 < here.dmoment_dp < np.pi * geometry.crest_radius_m**2


def test_pressure_extends_and_a_pull_helps(model: ModuleSolver) -> None:
    state = model.free(5e3, model.rest())
    assert 0 < state.angle_rad < family().module_length_m
    assert state.tau == pytest.approx(0.0, abs=1e-6)
    # an opposing force compresses it: positive below the free extension
    assert model.constrained(5e3, 0.5 * state.angle_rad, state).moment_n_m > 0
    assert state.dmoment_du < 0


@pytest.mark.slow
def test_default_mesh_is_converged(model: ModuleSolver) -> None:
    fine = solver(family().problem(refinement=2))
    assert model.rest().dmoment_du == pytest.approx(fine.rest().dmoment_du, rel=0.01)
    assert model.rest().dmoment_dp == pytest.approx(fine.rest().dmoment_dp, rel=0.01)
