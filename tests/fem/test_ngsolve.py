"""The second FEM backend against the first, closed forms and its own differences; its refusals."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.slow import slow_among

pytest.importorskip(
    "pliant_plugins.fem.ngsolve.library",
    reason="the extra pliant[ngsolve] is not installed",
    exc_type=ImportError,
)

from pliant.errors import ContractError, MissingDependencyError, UserError
from pliant.interfaces.fem import ModuleSolver, StateNotConvergedError
from pliant.interfaces.material import Material
from pliant.meshing.hexahedra import cell_volumes, gauss_cube, jacobians, shapes
from pliant.records.fem import FemState, Link, ModuleProblem, Ribbon
from pliant.registry import component as registry
from pliant.testing.box import box_problem, prismatic_box_problem, spatial_box_problem, tendon_box_problem
from pliant.testing.stand_ins import sample_material
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.fem.config import NgsolveConfig, SkfemConfig
from pliant_plugins.fem.ngsolve.backend import Ngsolve, NgsolveSolver
from pliant_plugins.fem.ngsolve.forms import density
from pliant_plugins.fem.ngsolve.library import ngs
from pliant_plugins.fem.ngsolve.mesh import CAVITY, curved_mesh, eliminate, nodal_table
from pliant_plugins.fem.skfem.backend import Skfem
from pliant_plugins.manifest import pliant_components
from pliant_plugins.materials.mooney_rivlin import MooneyRivlin, MooneyRivlinConfig
from pliant_plugins.materials.named import Named, NamedConfig
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig
from pliant_plugins.materials.ogden import Ogden, OgdenConfig
from pliant_plugins.materials.yeoh import Yeoh, YeohConfig

LENGTHS = {"inner_radius": 2e-3, "average_radius": 6e-3, "wall": 1.5e-3, "module_length": 11e-3}
MIXED_RAD = {"x": 0.1, "y": 0.15, "z": -0.12}


def solver(problem: ModuleProblem, material: Material | None = None, **options: Any) -> NgsolveSolver:
    config = NgsolveConfig.model_validate({"pressure_max_pa": 15e3, "order": 2, **options})
    return Ngsolve(config).solver(problem, material or sample_material())


def plain_skfem(problem: ModuleProblem) -> ModuleSolver:
    """Return the first backend with plain displacement cells: the same elements for a compressible solid."""
    config = SkfemConfig.model_validate({"pressure_max_pa": 15e3, "dilatation": "point"})
    return Skfem(config).solver(problem, sample_material())


def rubber(nu: float = 0.49) -> NeoHookean:
    return NeoHookean(NeoHookeanConfig(shear_modulus_pa=240e3, poisson_ratio=nu))


@pytest.fixture(scope="module")
def bellow() -> BellowBending:
    return BellowBending(BellowBendingConfig.model_validate(LENGTHS))


def test_the_curved_mesh_has_the_nodes_volumes(bellow: BellowBending) -> None:
    mesh = bellow.problem().mesh
    made = curved_mesh(mesh)
    found = np.array(ngs.Integrate(ngs.CF(1), made, order=6, element_wise=True))
    assert found == pytest.approx(cell_volumes(mesh.nodes_m, mesh.cells), rel=1e-10)
    n = ngs.specialcf.normal(3)
    inside = -ngs.Integrate(ngs.y * n[1] * ngs.ds(CAVITY, bonus_intorder=4), made)
    # facets of the mesh's quadratic arcs against the closed form
    assert inside == pytest.approx(bellow.geometry.cavity_volume() / 4, rel=1e-4)


def test_nodal_values_equal_the_field(bellow: BellowBending) -> None:
    mesh = bellow.problem().mesh
    made = curved_mesh(mesh)
    space = ngs.H1(made, order=3)
    field = ngs.GridFunction(space)
    field.Set(ngs.x / 1e-3 + 2 * ngs.z / 1e-3)
    values = nodal_table(space, mesh) @ field.vec.FV().NumPy()
    # isoparametric cells represent linear functions of the position exactly
    assert values == pytest.approx((mesh.nodes_m[:, 0] + 2 * mesh.nodes_m[:, 2]) / 1e-3, abs=1e-9)


def pressed(s: ModuleSolver) -> FemState:
    return s.constrained(8e3, 0.15, s.rest())


CASES = {
    "pressure": (box_problem, pressed),
    "tendon": (tendon_box_problem, lambda s: s.constrained(0.2, 0.1, s.rest())),
    "three axes": (
        lambda: replace(spatial_box_problem(), ribbons=(Ribbon(3e-3, 2.0),)),
        lambda s: s.constrained(8e3, MIXED_RAD, s.rest()),
    ),
    "prismatic": (prismatic_box_problem, lambda s: s.constrained(4e3, 2e-4, s.rest())),
}


@pytest.mark.parametrize("case", slow_among(CASES, "three axes", "prismatic"))
def test_both_codes_agree_to_rounding_on_the_same_elements(case: str) -> None:
    make, solve = CASES[case]
    problem = make()
    ours, theirs = solver(problem), plain_skfem(problem)
    a, b = solve(ours), solve(theirs)
    for name in ("deformation", "tau", "dtau_dp", "dtau_du", "energy_j", "travel", "axial_strain"):
        value = np.asarray(getattr(b, name))
        assert np.asarray(getattr(a, name)) == pytest.approx(value, rel=1e-6, abs=1e-7 * np.abs(value).max())
    assert ours.deformed_nodes(a) == pytest.approx(theirs.deformed_nodes(b), abs=1e-10)
    assert a.held == b.held and a.main == b.main and a.status == b.status


@pytest.mark.slow
def test_both_codes_agree_on_the_coarse_bellow(bellow: BellowBending) -> None:
    problem, material, pressure = bellow.problem(), rubber(), 3e3
    config = SkfemConfig.model_validate({"pressure_max_pa": 15e3})
    states = []
    for s in (solver(problem, material), Skfem(config).solver(problem, material)):
        free = s.free(pressure, s.rest())
        states.append((free, s.constrained(pressure, 0.1, free)))
    (free, held), (free_2, held_2) = states
    assert free.angle_rad == pytest.approx(free_2.angle_rad, rel=5e-3)
    # of the range: the moment when blocked is about p ∂τ/∂p
    assert held.moment_n_m == pytest.approx(held_2.moment_n_m, abs=5e-3 * pressure * held.dmoment_dp)
    for name in ("dmoment_dp", "energy_j", "travel"):
        assert getattr(held, name) == pytest.approx(getattr(held_2, name), rel=5e-3)


@pytest.mark.slow
def test_nearly_incompressible_bellows_do_not_lock(bellow: BellowBending) -> None:
    problem = bellow.problem()
    soft, hard = (-solver(problem, rubber(nu)).rest().dmoment_du for nu in (0.49, 0.4995))
    assert hard / soft == pytest.approx(1.01, abs=0.02)


LAWS: list[Material] = [
    rubber(0.45),
    MooneyRivlin(MooneyRivlinConfig(c10_pa=9e4, c01_pa=3e4)),
    Yeoh(YeohConfig(c10_pa=1.2e5, c20_pa=-4e3, c30_pa=1.5e3)),
    Ogden(OgdenConfig(mu_pa=(2e5, 4e4, 1e4), alpha=(2.0, -2.0, 4.0))),
    sample_material(),
]


@pytest.mark.parametrize("material", slow_among(LAWS, *LAWS[1:]), ids=lambda m: m.config.canonical()["kind"])
def test_symbols_and_numbers_are_one_law(material: Material) -> None:
    F = np.eye(3) + np.array([[0.2, 0.1, 0.0], [-0.1, 0.05, 0.3], [0.0, 0.15, -0.1]])
    mesh = _cube()
    # at q = K (J − 1) the mixed form is the law itself
    pressure = material.bulk_modulus_pa * (np.linalg.det(F) - 1)
    symbol = density(material, ngs.CF(tuple(F.ravel()), dims=(3, 3)), ngs.CF(pressure))
    assert symbol(mesh(0.3, 0.3, 0.3)) == pytest.approx(float(material.energy(F)), rel=1e-12)


def _cube() -> Any:
    from netgen.csg import unit_cube

    return ngs.Mesh(unit_cube.GenerateMesh(maxh=1))


@pytest.mark.parametrize("signs", [(1.0, 1.0, 1.0), (-1.0, 1.0, -1.0)])
def test_linked_fields_agree_all_over_the_faces(signs: tuple[float, float, float]) -> None:
    problem = spatial_box_problem()
    mesh = problem.mesh
    ends = problem.links[0]
    link = Link(ends.first, ends.second, dict(enumerate(signs)))
    made = curved_mesh(mesh)
    space = ngs.VectorH1(made, order=3)
    scalar = ngs.H1(made, order=3)
    left = eliminate(replace(problem, links=(link,)), scalar, space.ndof)
    field = ngs.GridFunction(space)
    field.vec.FV().NumPy()[:] = left.spread @ np.random.default_rng(0).standard_normal(len(left.first))
    tiny = 1e-9
    for y, z in ((1.1e-3, 0.7e-3), (3.4e-3, 5e-3), (-4.2e-3, 7.9e-3)):
        start, end = (np.array(field(made(x, y, z))) for x in (tiny, problem.span_m - tiny))
        assert end == pytest.approx(np.array(signs) * start, abs=1e-4)
        assert np.abs(start).max() > 0.05


def test_a_fixed_face_is_at_rest_all_over() -> None:
    problem = box_problem()
    made = curved_mesh(problem.mesh)
    space = ngs.VectorH1(made, order=3)
    left = eliminate(problem, ngs.H1(made, order=3), space.ndof)
    field = ngs.GridFunction(space)
    field.vec.FV().NumPy()[:] = left.spread @ np.random.default_rng(1).standard_normal(len(left.first))
    value = np.array(field(made(problem.span_m - 1e-9, 0.7e-3, 1.9e-3)))
    assert abs(value[0]) < 1e-4 and np.abs(value[1:]).min() > 0.01


@pytest.mark.slow
def test_threads_change_nothing() -> None:
    alone, four = solver(box_problem()), solver(box_problem(), threads=2)
    assert pressed(four).moment_n_m == pytest.approx(pressed(alone).moment_n_m, rel=1e-9)


def test_fields_equal_the_state() -> None:
    problem, material = box_problem(), rubber()
    s = solver(problem, material)
    state = s.constrained(15e3, 0.1, s.rest())
    found = s.fields(state)
    mesh = problem.mesh
    assert found.displacement_m == pytest.approx(s.deformed_nodes(state) - mesh.nodes_m, abs=1e-15)
    # nodal averages on a coarse mesh, integrated, are nearly the state's energy
    places, weights = gauss_cube(4)
    density_there = found.point_data["energy_j_m3"][mesh.cells] @ shapes(places).T
    volumes = jacobians(mesh.nodes_m, mesh.cells, places) * weights
    assert problem.energy_scale * np.sum(density_there * volumes) == pytest.approx(state.energy_j, rel=0.05)
    # pressure and volume ratio are one law, and the pressure pushes on the cavity's wall
    K = material.bulk_modulus_pa
    assert found.point_data["hydrostatic_pa"] == pytest.approx(
        K * (found.point_data["volume_ratio"] - 1), rel=1e-6, abs=1.0
    )
    rest = s.fields(s.rest()).point_data
    assert rest["largest_stretch"] == pytest.approx(1.0, abs=1e-12)
    assert rest["von_mises_pa"] == pytest.approx(0.0, abs=1e-6)


def test_a_stretched_bar_has_its_law_stress() -> None:
    # free of pressure, stretched by hand: uniaxial tension, σ = 2 C10 (λ² − 1/λ) where incompressible
    problem = prismatic_box_problem()
    material = rubber(0.4995)
    s = solver(problem, material)
    state = s.constrained(0.0, 0.2 * problem.span_m, s.rest())
    found = s.fields(state).point_data
    stress = material.shear_modulus_pa * (1.2**2 - 1 / 1.2)
    assert found["von_mises_pa"] == pytest.approx(stress, rel=5e-3)
    assert found["hydrostatic_pa"] == pytest.approx(stress / 3, rel=5e-3)
    assert found["largest_stretch"] == pytest.approx(1.2, rel=2e-3)


@pytest.mark.slow
def test_solvers_in_python_s_threads_do_not_disturb_each_other() -> None:
    def solve(pressure: float) -> float:
        s = solver(box_problem())
        return s.constrained(pressure, 0.1, s.rest()).moment_n_m

    pressures = [0.0, 2e3, 4e3]
    with ThreadPoolExecutor(3) as threads:
        at_once = list(threads.map(solve, pressures))
    assert at_once == pytest.approx([solve(p) for p in pressures], rel=1e-12)


def test_rigid_parts_that_meet_are_marked() -> None:
    s = solver(replace(tendon_box_problem(), contact_range=(-0.05, 0.08), contact_planes=()))
    apart = s.constrained(0.1, 0.05, s.rest())
    assert apart.status == "ok"
    assert s.constrained(0.1, 0.1, apart).status == "self_contact"


def test_a_named_rubber_has_its_law_symbols() -> None:
    latex = Named(NamedConfig(name="latex"))
    here, law = (solver(box_problem(), solid).rest().dmoment_du for solid in (latex, latex.resolved))
    assert here == law


def test_laws_without_symbols_are_refused() -> None:
    with pytest.raises(UserError, match=r"even powers up to ±8 only, not for alpha = 1\.8"):
        solver(box_problem(), Ogden(OgdenConfig(mu_pa=(2e5,), alpha=(1.8,))))

    class ForeignConfig(NeoHookeanConfig):
        kind: Any = "foreign"

    with pytest.raises(UserError, match="none for material 'foreign'; it has 'neo_hookean', 'mooney_rivlin'"):
        solver(box_problem(), NeoHookean(ForeignConfig(shear_modulus_pa=1e5)))


def test_foreign_problems_and_states_are_refused() -> None:
    problem = box_problem()
    with pytest.raises(UserError, match="frame"):
        solver(replace(problem, frame="spatial"))  # type: ignore[arg-type]
    with pytest.raises(UserError, match="voltage_v"):
        solver(replace(problem, actuation="voltage_v"))
    with pytest.raises(UserError, match="only axis is y"):
        solver(replace(problem, actuation="tendon_force_n"))
    s = solver(problem)
    with pytest.raises(UserError, match="'z' is none of this module's: y"):
        s.constrained(0.0, {"z": 0.1}, s.rest())
    with pytest.raises(UserError, match="another mesh, order or backend"):
        s.free(1e3, replace(s.rest(), solution=np.zeros(7)))
    with pytest.raises(StateNotConvergedError, match=r"no free equilibrium at 1e\+08 Pa"):
        s.free(1e8, s.rest())


def test_sets_and_links_it_cannot_hold_are_refused() -> None:
    problem = spatial_box_problem()
    mesh = problem.mesh
    middle = replace(mesh, node_sets={**mesh.node_sets, "pin": mesh.cells[0, [1]]})
    with pytest.raises(ContractError, match="node set 'pin' holds node"):
        solver(replace(problem, mesh=middle))
    ends = problem.links[0]
    with pytest.raises(UserError, match="links whole faces of the mesh; 1 of 1 linked nodes are on none"):
        solver(replace(problem, links=(Link(ends.first[:1], ends.second[:1], {0: 1.0}),)))


def test_inverted_cells_are_the_family_s_fault() -> None:
    problem = box_problem()
    with pytest.raises(ContractError, match="inverted"):
        solver(replace(problem, mesh=replace(problem.mesh, cells=problem.mesh.cells[:, ::-1])))


def test_the_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = next(c for c in pliant_components() if c.kind == "ngsolve")
    monkeypatch.setattr(registry, "_is_installed", lambda module: False)
    with pytest.raises(MissingDependencyError, match=r"pip install 'pliant\[ngsolve\]'"):
        entry.build(NgsolveConfig(pressure_max_pa=1e3))
