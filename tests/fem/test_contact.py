"""Walls that touch, by law: closed forms of pressed blocks, energy, symmetry, and no force without contact."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import brentq

from pliant.errors import UserError
from pliant.interfaces.fem import FemConfig
from pliant.meshing.grids import grid_cells, grid_faces
from pliant.meshing.hexahedra import boundary_faces
from pliant.records.fem import FemState, ModuleMesh, ModuleProblem
from pliant.testing.box import box_problem
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.fem.config import NgsolveConfig, SkfemConfig
from pliant_plugins.fem.ngsolve.backend import Ngsolve
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.backend import Skfem, SkfemSolver
from pliant_plugins.fem.skfem.contact import DEEPEST, GIVE, ContactSkin, PlaneContact
from pliant_plugins.fem.skfem.pattern import Terms
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

MU = 240e3
BLOCK = np.array([3e-3, 2e-3, 2e-3])  # its end is before the plane
GAP = 1e-3
TOUCH_PA = 7.5e3  # the thin bellow's folds meet a little below


def material(modulus_pa: float = MU) -> NeoHookean:
    return NeoHookean(NeoHookeanConfig(shear_modulus_pa=modulus_pa, poisson_ratio=0.49))


def solver(problem: ModuleProblem, how: str = "solve", modulus_pa: float = MU) -> SkfemSolver:
    config = SkfemConfig.model_validate({"pressure_max_pa": 15e3, "self_contact": how, "tolerance": 1e-8})
    return Skfem(config).solver(problem, material(modulus_pa))


def block() -> ModuleProblem:
    """Return a block on the start plane, one of two that meet, whose end has the distance `GAP` to the end plane."""
    nodes = np.stack(np.meshgrid(*[np.linspace(0, size, 5) for size in BLOCK], indexing="ij"), axis=-1)
    ids = np.arange(125).reshape(5, 5, 5)
    cells = grid_cells(ids)
    # a face that pressure would act on; it is not pressed
    cavity = grid_faces(ids[:, 0])
    sets = {
        "start": ids[0].ravel(),
        "end": ids[:0, 0, 0],
        "symmetry": ids[:, 0].ravel(),
        "level": ids[:, :, 0].ravel(),
    }
    mesh = ModuleMesh(nodes.reshape(-1, 3), cells, cavity, boundary_faces(cells)[0], sets)
    return ModuleProblem(
        mesh,
        span_m=BLOCK[0] + GAP,
        reference_z_m=0.0,
        deformation_scale=1.0,
        energy_scale=1.0,
        fixed={"start": (0,), "symmetry": (1,), "level": (2,)},
        axes=("x",),
        main_axis="x",
        joint="prismatic",
    )


def thin_bellow() -> ModuleProblem:
    """Return a bellow whose folds meet within its working range."""
    lengths = {"inner_radius": 2e-3, "average_radius": 6e-3, "wall": 0.8e-3, "module_length": 6e-3}
    return BellowBending(BellowBendingConfig.model_validate(lengths)).problem()


def uniaxial_pa(stretch: float) -> float:
    """Return the nominal stress of a bar of the material with free sides."""
    law = material()

    def stress(side: float) -> np.ndarray:
        return np.asarray(law.evaluate(np.diag([stretch, side, side])).stress)

    side = brentq(lambda s: stress(s)[1, 1], 0.5, 2.0, xtol=1e-14)
    return float(stress(side)[0, 0])


@pytest.mark.parametrize("pressed_m", [0.05e-3, 0.6e-3])
def test_two_blocks_pressed_have_a_closed_form(pressed_m: float) -> None:
    """The force is that of a bar whose end pressure φ' = μ (d/h)² equals its own stress, and zero before contact."""
    problem = block()
    here = solver(problem)
    contact = here.assembler.contacts
    assert contact is not None
    apart = here.constrained(0.0, -GAP / 2, here.rest())
    assert apart.moment_n_m == pytest.approx(0.0, abs=1e-15)
    assert apart.status == "ok"
    state = here.constrained(0.0, -GAP - pressed_m, apart)

    def unbalanced(depth: float) -> float:
        end = BLOCK[0] - pressed_m + depth
        return MU * (depth / (GIVE * contact.skin.wall_m)) ** 2 + uniaxial_pa(end / BLOCK[0])

    depth = brentq(unbalanced, 0.0, DEEPEST * contact.skin.wall_m, xtol=1e-16)
    force = uniaxial_pa(1 - (pressed_m - depth) / BLOCK[0]) * BLOCK[1] * BLOCK[2]
    # the effort opposes the work of the blocks' stress
    assert state.moment_n_m == pytest.approx(-force, rel=1e-6)
    assert state.status == "touching"
    assert contact.deepest(state.solution, state.axial_strain) == pytest.approx(
        depth / contact.skin.wall_m, rel=1e-5
    )


def test_press_work_is_what_the_blocks_store() -> None:
    """∫ τ du over closing, touching and pressing, by Gauss points, is the change of stored energy."""
    here = solver(block())
    ends = -np.array([0.9, 1.0, 1.02, 1.1, 1.6]) * GAP
    node, weight = np.polynomial.legendre.leggauss(5)
    state, work = here.constrained(0.0, float(ends[0]), here.rest()), 0.0
    for low, high in itertools.pairwise(ends):
        for s, w in zip((node + 1) / 2, weight / 2, strict=True):
            state = here.constrained(0.0, float(low + s * (high - low)), state)
            work -= float(w * (high - low) * state.moment_n_m)
    end = here.constrained(0.0, float(ends[-1]), state)
    assert work == pytest.approx(end.energy_j, rel=2e-5)
    assert end.energy_j > 0


def test_contact_has_exact_derivatives_and_a_symmetric_tangent() -> None:
    """Gradient and Hessian of the contact energy, at a body pushed through both planes, against differences."""
    problem = replace(box_problem(), axes=("y", "z"), joint="spherical")
    assembler = Assembler(problem, material(), contact=True)
    random, G = np.random.default_rng(0), assembler.globals.count
    x = np.zeros(assembler.count)
    nodes = problem.mesh.nodes_m
    x[assembler.displacements] = 1e-5 * random.standard_normal(nodes.size)
    x[assembler.displacements][::3] += 0.36 * (nodes[:, 0] - problem.span_m / 2)
    x[-G:] = 0.1, -0.05, -0.01
    pattern = assembler.pattern
    inner, globals_ = 1e-5 * random.standard_normal(pattern.size), 1e-2 * random.standard_normal(G)
    step = np.concatenate([pattern.expand(inner), globals_])

    def stored(s: float) -> Terms:
        both, alone = (f(x + s * step) for f in (assembler.elastic_energy, assembler.strain_energy))
        assert both is not None and alone is not None
        return both.plus(-1.0, alone)

    here, h = stored(0.0), 1e-4
    above, below = stored(h), stored(-h)
    assert (above.value - below.value) / (2 * h) == pytest.approx(float(here.gradient @ step), rel=1e-5)

    upper = sparse.csr_matrix((here.matrix, pattern.indices, pattern.indptr), shape=(pattern.size,) * 2)
    inside = (upper + sparse.triu(upper, 1).T) @ inner + pattern.reduce(here.border[:-G]) @ globals_
    change = (above.gradient - below.gradient) / (2 * h)
    numeric = pattern.reduce(change[:-G, None])[:, 0]
    assert np.abs(inside - numeric).max() < 1e-5 * np.abs(numeric).max()
    of_globals = here.border[:-G].T @ step[:-G] + here.border[-G:] @ globals_
    assert np.abs(of_globals - change[-G:]).max() < 1e-5 * np.abs(change[-G:]).max()
    assert np.allclose(here.border[-G:], here.border[-G:].T, rtol=1e-12, atol=0)


@pytest.mark.slow
def test_before_they_touch_nothing_is_changed() -> None:
    """Unknowns, effort, slopes and energy are equal bit for bit."""
    problem = thin_bellow()
    states = []
    for how in ("solve", "end"):
        here = solver(problem, how)
        state = here.rest()
        for pressure in (1e3, 2e3):
            state = here.free(pressure, state)
        states.append(state)
    solved, ended = states
    assert solved.status == ended.status == "ok"
    for name in ("solution", "tau", "dtau_dp", "dtau_du", "deformation"):
        assert np.array_equal(getattr(solved, name), getattr(ended, name)), name
    assert (solved.energy_j, solved.travel) == (ended.energy_j, ended.travel)


@pytest.fixture(scope="module")
def pressed() -> tuple[SkfemSolver, FemState]:
    """Return the thin bellow compressed by half more than where its folds meet."""
    here = solver(thin_bellow())
    state = here.rest()
    for pressure in (1e3, 2.5e3, 5e3, TOUCH_PA, 1.5 * TOUCH_PA):
        state = here.free(pressure, state)
    return here, state


@pytest.mark.slow
def test_folds_that_meet_hold_each_other(pressed: tuple[SkfemSolver, FemState]) -> None:
    here, state = pressed
    contact = here.assembler.contacts
    assert contact is not None
    assert state.status == "touching"
    assert 0 < contact.deepest(state.solution, state.axial_strain) < DEEPEST
    # nodes too, between which the contact points are, stay before the plane
    section = here._section(state.solution)[np.unique(here.problem.mesh.skin), 0]
    beyond = section.max() - (1 + state.axial_strain) * here.problem.span_m
    assert 0 < beyond < 2 * DEEPEST * contact.skin.wall_m


@pytest.mark.slow
def test_slopes_in_contact_equal_differences(pressed: tuple[SkfemSolver, FemState]) -> None:
    """∂τ/∂u, ∂τ/∂p, and Maxwell's ∂V/∂u = ∂τ/∂p, to 1e-5."""
    here, free = pressed
    at = here.constrained(free.actuation, free.angle_rad - 0.02, free)
    assert at.status == "touching"
    du, dp = 2e-4, 5.0
    more, less = (here.constrained(at.actuation, at.angle_rad + s * du, at) for s in (1, -1))
    assert (more.moment_n_m - less.moment_n_m) / (2 * du) == pytest.approx(at.dmoment_du, rel=1e-5)
    assert (more.travel - less.travel) / (2 * du) == pytest.approx(at.dmoment_dp, rel=1e-5)
    more, less = (here.constrained(at.actuation + s * dp, at.angle_rad, at) for s in (1, -1))
    assert (more.moment_n_m - less.moment_n_m) / (2 * dp) == pytest.approx(at.dmoment_dp, rel=1e-5)


def test_cuts_do_not_count_as_skin() -> None:
    """Faces in the sections and in the mirror plane y = 0 have no contact; the others have the skin's area."""
    problem = box_problem()
    skin = ContactSkin.from_problem(problem, MU, 1.0)
    assert skin is not None
    nodes = problem.mesh.nodes_m[skin.faces.nodes]
    assert not np.any(np.ptp(nodes[..., 0], axis=1) == 0)
    assert not np.any(np.all(nodes[..., 1] == 0, axis=1))
    inside, outside = 2 * 3e-3 + 4e-3, 2 * 4.5e-3 + 8.5e-3  # of half the section
    assert skin.weight.sum() == pytest.approx(6e-3 * (inside + outside), rel=1e-12)
    planes = PlaneContact.from_problem(problem, skin)
    assert planes is not None and len(planes.normal) == 3
    assert PlaneContact.from_problem(replace(problem, contact_planes=(), fixed={}), skin) is None


def test_the_earlier_name_is_read_and_kept_in_what_names_results() -> None:
    config = SkfemConfig.model_validate({"self_contact": "stop"})
    assert config.self_contact == "end" == FemConfig(kind="any").self_contact
    assert config.canonical()["self_contact"] == "stop"
    assert SkfemConfig.model_validate(config.canonical()) == config


def test_a_code_without_contact_says_so() -> None:
    with pytest.raises(UserError, match="'ngsolve' does not solve contact.*'skfem'"):
        Ngsolve(NgsolveConfig(self_contact="solve")).check(block(), material())
