"""Direct FEM of whole bodies: work, reciprocity, and agreement with the module's law away from the ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.interfaces.fem import StateNotConvergedError, StructureSolver
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

MU = 240e3


def family() -> BellowBending:
    lengths = {"inner_radius": 2e-3, "average_radius": 6e-3, "wall": 1.5e-3, "module_length": 11e-3}
    return BellowBending(BellowBendingConfig.model_validate(lengths))


def body(modules: int) -> StructureSolver:
    material = NeoHookean(NeoHookeanConfig(shear_modulus_pa=MU))
    return Skfem(SkfemConfig(pressure_max_pa=15e3)).structure(family().structure(modules), material)


@pytest.fixture(scope="module")
def one() -> StructureSolver:
    return body(1)


@pytest.mark.slow
def test_energy_is_the_work_by_pressure_and_force(one: StructureSolver) -> None:
    """Along a straight path in (p, F) dE = p dV + F·du; Gauss–Legendre in the load needs V and u there."""
    pressure, force = 400.0, np.array([4e-3, 0.0, -6e-3])
    node, weight = np.polynomial.legendre.leggauss(2)
    rest = one.rest()
    end = one.equilibrium(pressure, force, rest)
    # ∫ p dV = p V − ∫ V dp, and the same for the force
    work = pressure * end.volume_m3 + force @ end.markers_m[-1]
    for n, w in zip((node + 1) / 2, weight / 2, strict=True):
        there = one.equilibrium(n * pressure, n * force, rest)
        work -= w * (pressure * there.volume_m3 + force @ there.markers_m[-1])
    assert end.energy_j == pytest.approx(work, rel=1e-4)


def test_displacements_are_reciprocal(one: StructureSolver) -> None:
    """Maxwell–Betti: the volume gained per force is the displacement gained per pressure."""
    rest = one.rest()
    f, p = 1e-4, 1.0
    pushed = one.equilibrium(0.0, np.array([0.0, 0.0, -f]), rest)
    blown = one.equilibrium(p, np.zeros(3), rest)
    gained = (pushed.volume_m3 - rest.volume_m3) / f
    moved = -(blown.markers_m[-1, 2] - rest.markers_m[-1, 2]) / p
    assert gained == pytest.approx(moved, rel=1e-3)


def test_another_bodys_state_is_refused(one: StructureSolver) -> None:
    with pytest.raises(UserError, match="another body"):
        one.equilibrium(1.0, np.zeros(3), replace(one.rest(), solution=np.zeros(7)))


def test_what_does_not_converge_says_where_it_stopped(one: StructureSolver) -> None:
    with pytest.raises(StateNotConvergedError, match="stopped after"):
        one.equilibrium(1e8, np.zeros(3), one.rest())


@pytest.mark.slow
def test_inner_modules_bend_by_the_modules_law() -> None:
    """The middle one of five modules under pressure is not affected by clamp and cap."""
    solver = body(5)
    state = solver.equilibrium(5e3, np.zeros(3), solver.rest())
    material = NeoHookean(NeoHookeanConfig(shear_modulus_pa=MU))
    module = Skfem(SkfemConfig(pressure_max_pa=15e3)).solver(family().problem(), material)
    alone = module.free(5e3, module.rest()).angle_rad
    assert np.diff(state.turns_rad)[2] == pytest.approx(alone, rel=2e-3)
