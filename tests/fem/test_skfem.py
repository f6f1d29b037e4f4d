"""The scikit-fem backend by law: derivatives, patch tests, exact solutions, reciprocity, controls, restarts."""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import ContractError, UserError
from pliant.interfaces.fem import StateNotConvergedError
from pliant.meshing.grids import grid_cells, grid_faces
from pliant.meshing.hexahedra import boundary_faces
from pliant.records.fem import FemState, ModuleMesh, ModuleProblem
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.assembly import Assembler
from pliant_plugins.fem.skfem.backend import Skfem, SkfemSolver
from pliant_plugins.fem.skfem.basis import cell_data
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

MU, NU = 240e3, 0.49
SIZE = np.array([4e-3, 2e-3, 3e-3])  # of the box
WALL_Y = 1e-3  # the box is this far from the mirror plane: the gap is its cavity


def material(mu: float = MU, nu: float = NU) -> NeoHookean:
    return NeoHookean(NeoHookeanConfig(shear_modulus_pa=mu, poisson_ratio=nu))


def backend(**options: object) -> Skfem:
    return Skfem(SkfemConfig.model_validate({"pressure_max_pa": 15e3, **options}))


def bellow() -> BellowBending:
    lengths = {"inner_radius": 2e-3, "average_radius": 6e-3, "wall": 1.5e-3, "module_length": 11e-3}
    return BellowBending(BellowBendingConfig.model_validate(lengths))


def box(distortion: float = 0.0) -> ModuleProblem:
    """Return a block of 2 × 2 × 2 cells at y ∈ [1, 3] mm, z ∈ [0, 3] mm, inner nodes moved at random."""
    axes = [np.linspace(0, size, 5) for size in SIZE]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    moved = distortion * SIZE * np.random.default_rng(0).uniform(-1, 1, (3, 3, 3, 3))
    nodes[1:-1, 1:-1, 1:-1] += moved
    nodes[..., 1] += WALL_Y
    ids = np.arange(125).reshape(5, 5, 5)
    cells = grid_cells(ids)
    x = nodes.reshape(-1, 3)
    sets = {
        "start": ids[0].ravel(),
        "end": ids[-1].ravel(),
        "pin": ids[0, 0, :1],
        "symmetry": ids[0, 0, :1],
    }
    mesh = ModuleMesh(x, cells, grid_faces(ids[:, 0]), boundary_faces(cells)[0], sets)
    fixed = {"start": (0,), "end": (0,), "pin": (2,), "symmetry": (1,)}
    # the second pinned height removes the rotation about x, the first the rise
    sets["level"] = ids[0, -1, :1]
    return ModuleProblem(mesh, SIZE[0], 0.5e-3, 1.0, 1.0, {**fixed, "level": (2,)})


@pytest.fixture(scope="module")
def solver() -> SkfemSolver:
    return backend().solver(bellow().problem(), material())


@pytest.fixture(scope="module")
def states(solver: SkfemSolver) -> dict[str, FemState]:
    """Return rest, a free state at 6 kPa, and one constrained 0.05 rad below it."""
    rest = solver.rest()
    free = solver.free(6e3, solver.free(2e3, rest))
    return {"rest": rest, "free": free, "held": solver.constrained(6e3, free.angle_rad - 0.05, free)}


def uniform(assembler: Assembler, volume: float, pressure: float) -> np.ndarray:
    """Return the unknowns from which a mixed element interpolates ϑ − 1 = volume and q/K = pressure."""
    data = assembler.cells.pressure
    if data is None:
        return np.zeros(0)
    one = np.ones(data.count)
    if data.vertices is None:
        # the first of a cell's functions is constant
        one[:] = 0.0
        one[data.places[:, 0]] = 1 / data.value[:, 0, 0]
    return np.concatenate([volume * one, pressure * one])


@pytest.mark.parametrize("dilatation", ["cell", "continuous", "point"])
def test_patch(dilatation: str) -> None:
    """For a homogeneous deformation the energy is W · volume with no force inside, on distorted cells."""
    law = material()
    assembler = Assembler(box(0.06), law, dilatation)  # type: ignore[arg-type]
    nodes = assembler.problem.mesh.nodes_m
    gradient = np.array([[0.0, 0.0, 0.0], [0.02, 0.03, -0.05], [0.01, 0.04, -0.02]])
    F = np.eye(3) + gradient
    F[0, 0] += 0.07
    J = float(np.linalg.det(F))
    pressure = float(np.sum(law.evaluate(F).stress * F)) / (3 * J * law.bulk_modulus_pa)
    x = np.concatenate([(nodes @ gradient.T).ravel(), uniform(assembler, J - 1, pressure), [0.0, 0.07]])
    terms = assembler.strain_energy(x)
    assert terms is not None
    assert terms.value == pytest.approx(float(law.energy(F)) * np.prod(SIZE), rel=1e-12)
    forces = terms.gradient[: nodes.size].reshape(5, 5, 5, 3)
    assert (
        np.abs(terms.gradient[assembler.pressures]).max(initial=0.0)
        < 1e-12 * law.bulk_modulus_pa * SIZE.prod()
    )
    assert np.abs(forces[1:-1, 1:-1, 1:-1]).max() < 1e-12 * np.abs(forces).max()


def test_rigid_shift_is_free() -> None:
    assembler = Assembler(box(), material())
    x = np.zeros(assembler.count)
    v = slice(0, assembler.problem.mesh.nodes_m.size)
    x[v][1::3], x[v][2::3] = 1e-3, -2e-3
    terms = assembler.strain_energy(x)
    assert terms is not None
    assert abs(terms.value) < 1e-15
    assert np.abs(terms.gradient[v]).max() < 1e-9


@pytest.mark.parametrize("nu", [0.3, 0.49])
def test_pure_bending_in_a_bar_is_exact(nu: float) -> None:
    """dM/dθ at rest is −E I / L (St. Venant), whichever line the strain e is measured on."""
    state = backend().solver(box(), material(nu=nu)).rest()
    young, inertia = 2 * MU * (1 + nu), SIZE[1] * SIZE[2] ** 3 / 12
    assert state.dmoment_du == pytest.approx(-young * inertia / SIZE[0], rel=1e-9)


def test_bent_box_cavity_in_closed_form() -> None:
    """V = ∫ y₀ λ ds dz between the mirror plane and the wall y = y₀."""
    assembler = Assembler(box(), material())
    x = np.zeros(assembler.count)
    theta, strain, z0 = 0.3, 0.05, assembler.problem.reference_z_m
    x[-2:] = theta, strain
    length = (1 + strain) * SIZE[0]
    exact = WALL_Y * length * (SIZE[2] + theta / length * ((SIZE[2] - z0) ** 2 - z0**2) / 2)
    assert assembler.cavity(x).value == pytest.approx(exact, rel=1e-12)


def test_bellow_cavity_at_rest(solver: SkfemSolver, states: dict[str, FemState]) -> None:
    assert solver.cavity_volume(states["rest"]) == pytest.approx(bellow().geometry.cavity_volume(), rel=5e-4)


def test_maxwell(solver: SkfemSolver, states: dict[str, FemState]) -> None:
    """∂V/∂u at constant p is ∂τ/∂p at constant u: both are −∂²Π/∂p∂u."""
    held, du = states["held"], 1e-3
    ahead, behind = (
        solver.cavity_volume(solver.constrained(held.actuation, held.angle_rad + s * du, held))
        for s in (1, -1)
    )
    assert (ahead - behind) / (2 * du) == pytest.approx(held.dmoment_dp, rel=1e-5)


@pytest.mark.slow
def test_only_pressure_over_modulus_matters(states: dict[str, FemState]) -> None:
    stiff = backend().solver(bellow().problem(), material(mu=2 * MU))
    free = stiff.free(12e3, stiff.rest())
    assert free.angle_rad == pytest.approx(states["free"].angle_rad, rel=1e-9)
    assert free.energy_j == pytest.approx(2 * states["free"].energy_j, rel=1e-9)


@pytest.mark.slow
def test_rotation_control_both_ways_and_back(solver: SkfemSolver, states: dict[str, FemState]) -> None:
    free = states["free"]
    back = solver.constrained(6e3, -0.05, solver.constrained(6e3, 0.05, free))
    beyond = solver.constrained(6e3, 1.2 * free.angle_rad, free)
    assert back.angle_rad == pytest.approx(-0.05, abs=1e-15)
    assert back.moment_n_m > states["held"].moment_n_m > 0 > beyond.moment_n_m
    at_free = solver.constrained(6e3, free.angle_rad, beyond)
    assert at_free.moment_n_m == pytest.approx(0, abs=1e-8)
    released = solver.free(6e3, back)
    assert released.angle_rad == pytest.approx(free.angle_rad, abs=1e-8)
    assert np.allclose(released.solution, free.solution, atol=1e-9)


@pytest.mark.skipif(importlib.util.find_spec("pypardiso") is None, reason="pypardiso is not installed")
def test_pardiso_and_superlu_agree(solver: SkfemSolver, states: dict[str, FemState]) -> None:
    other = backend(linear_solver="superlu").solver(bellow().problem(), material())
    assert (solver.linear.name, other.linear.name) == ("pardiso", "superlu")
    again = other.constrained(6e3, states["held"].angle_rad, states["held"])
    for name in ("moment_n_m", "dmoment_dp", "dmoment_du", "energy_j"):
        assert getattr(again, name) == pytest.approx(getattr(states["held"], name), rel=1e-8), name


@pytest.mark.slow
def test_plain_cells_lock_and_averaged_ones_do_not(states: dict[str, FemState]) -> None:
    """From ν = 0.49 to 0.4995 the plain cells stiffen several times more, hence the averaged dilatation."""

    def stiffness(dilatation: str, nu: float) -> float:
        solver = backend(dilatation=dilatation).solver(bellow().problem(), material(nu=nu))
        return -solver.rest().dmoment_du

    averaged = stiffness("cell", 0.4995) / -states["rest"].dmoment_du
    plain = stiffness("point", 0.4995) / stiffness("point", 0.49)
    assert averaged == pytest.approx(1.01, abs=0.02)
    assert plain - 1 > 3 * (averaged - 1)


@pytest.mark.slow
def test_both_mixed_elements_agree_on_the_free_angle() -> None:
    """Mean dilatation and Taylor–Hood, two stable elements, at 15 kPa on the coarse mesh."""
    angle = []
    for dilatation in ("cell", "continuous"):
        solver = backend(dilatation=dilatation).solver(bellow().problem(), material())
        state = solver.rest()
        for pressure in (5e3, 10e3, 15e3):
            state = solver.free(pressure, state)
        angle.append(state.angle_rad)
    assert angle[0] == pytest.approx(angle[1], rel=3e-3)
    assert angle[0] != pytest.approx(angle[1], rel=1e-6)


def test_convolutions_that_meet_are_marked(solver: SkfemSolver, states: dict[str, FemState]) -> None:
    bent, state = states["rest"], states["rest"]
    for angle in np.arange(-0.1, -1.0, -0.1):
        state = solver.constrained(0.0, float(angle), state)
        if state.status == "self_contact":
            break
        bent = state
    assert state.status == "self_contact"
    assert bent.status == "ok"
    skin = np.unique(solver.problem.mesh.skin)
    theta = state.angle_rad / 2
    placed = solver.deformed_nodes(state)[skin]
    hinge = solver.deformed_nodes(state)[solver.problem.mesh.node_sets["end"]].mean(axis=0)
    # material is beyond the end plane in space, or before the start plane
    beyond = (placed - hinge) @ np.array([np.cos(theta), 0.0, -np.sin(theta)])
    assert max(beyond.max(), -placed[:, 0].min()) > 1e-7


def test_an_impossible_state_is_an_error_that_names_it(
    solver: SkfemSolver, states: dict[str, FemState]
) -> None:
    with pytest.raises(
        StateNotConvergedError,
        match=r"no free equilibrium at 1e\+08 Pa from the state at 0 Pa and \w = 0 \w+: [^\[\]]*\.$",
    ):
        solver.free(1e8, states["rest"])
    # and the solver is not corrupted by it
    assert solver.free(6e3, states["rest"]).angle_rad == pytest.approx(states["free"].angle_rad, rel=1e-8)


def test_foreign_problems_and_states_are_refused(solver: SkfemSolver, states: dict[str, FemState]) -> None:
    problem = bellow().problem()
    with pytest.raises(UserError, match="needs its tendon"):
        backend().solver(replace(problem, actuation="tendon_force_n"), material())
    with pytest.raises(UserError, match="frame"):
        backend().solver(replace(problem, frame="spatial"), material())  # type: ignore[arg-type]
    with pytest.raises(UserError, match="another mesh"):
        solver.free(1e3, replace(states["rest"], solution=np.zeros(7)))


def test_a_fine_mesh_is_tabulated_without_a_word(caplog: pytest.LogCaptureFixture) -> None:
    cell_data(bellow().problem(refinement=2).mesh)
    assert caplog.records == []


def test_inverted_cells_are_the_family_s_fault() -> None:
    problem = box()
    mesh = replace(problem.mesh, cells=problem.mesh.cells[:, ::-1])
    with pytest.raises(ContractError, match="inverted"):
        backend().solver(replace(problem, mesh=mesh), material())
