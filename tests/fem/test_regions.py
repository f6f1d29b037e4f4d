"""Regions of different materials in a module: laws of composites, and refused inputs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from pliant.errors import UserError
from pliant.meshing.grids import block as positions
from pliant.meshing.grids import grid_cells, grid_faces, module_sets, numbered
from pliant.meshing.hexahedra import CENTRE, boundary_faces
from pliant.meshing.masses import half_masses, meshed_mass
from pliant.meshing.stacking import mirrored_mesh, moved_mesh, welded_meshes
from pliant.records.fem import ModuleMesh, ModuleProblem
from pliant.testing.box import Y, Z, box_problem, layered_box_problem, tetrahedral
from pliant_plugins.fem.config import SkfemConfig
from pliant_plugins.fem.skfem.backend import Skfem, SkfemSolver
from pliant_plugins.materials.neo_hookean import NeoHookean, NeoHookeanConfig

MU, NU, PRESSURE_PA, ANGLE_RAD = 240e3, 0.3, 8e3, 0.15


def rubber(factor: float = 1.0) -> NeoHookean:
    return NeoHookean(NeoHookeanConfig(shear_modulus_pa=factor * MU, poisson_ratio=NU))


def solver(problem: ModuleProblem, floor: float | None = None, **options: object) -> SkfemSolver:
    material = rubber() if floor is None else rubber().with_regions({"floor": rubber(floor)})
    config = SkfemConfig.model_validate({"kind": "skfem", "pressure_max_pa": PRESSURE_PA, **options})
    return Skfem(config).solver(problem, material)


def test_a_region_with_the_body_material_changes_no_bit() -> None:
    plain, same = solver(box_problem()), solver(layered_box_problem(), 1.0)
    a, b = (s.constrained(PRESSURE_PA, ANGLE_RAD, s.rest()) for s in (plain, same))
    assert np.array_equal(a.solution, b.solution)
    assert (a.moment_n_m, a.energy_j, a.dmoment_du) == (b.moment_n_m, b.energy_j, b.dmoment_du)


@pytest.mark.slow
def test_two_halves_that_are_half_as_stiff_are_one_region_half_as_stiff() -> None:
    problem = box_problem()
    cells = np.arange(len(problem.mesh.cells))
    two = replace(problem, mesh=replace(problem.mesh, regions={"a": cells[::2], "b": cells[1::2]}))
    one = replace(problem, mesh=replace(problem.mesh, regions={"a": cells}))
    states = []
    for split, names in ((two, "ab"), (one, "a")):
        material = rubber().with_regions({name: rubber(0.5) for name in names})
        made = Skfem(SkfemConfig(pressure_max_pa=PRESSURE_PA)).solver(split, material)
        states.append(made.constrained(PRESSURE_PA, ANGLE_RAD, made.rest()))
    assert states[0].moment_n_m == pytest.approx(states[1].moment_n_m, rel=1e-9)
    whole = Skfem(SkfemConfig(pressure_max_pa=PRESSURE_PA)).solver(problem, rubber(0.5))
    state = whole.constrained(PRESSURE_PA, ANGLE_RAD, whole.rest())
    assert states[0].moment_n_m == pytest.approx(state.moment_n_m, rel=1e-9)


def composite(floor: float) -> tuple[float, float]:
    """Return Σ E I about the stiffness-weighted centroid, and Σ E A, of the box in Pa m⁴ and Pa m²."""
    young = 2 * MU * (1 + NU)
    parts = (  # modulus, width, low and high; the cavity counts negative
        (young * floor, 2 * Y[2], Z[0], Z[1]),
        (young, 2 * Y[2], Z[1], Z[3]),
        (-young, 2 * Y[1], Z[1], Z[2]),
    )
    EA = sum(E * b * (h - g) for E, b, g, h in parts)
    centre = sum(E * b * (h**2 - g**2) / 2 for E, b, g, h in parts) / EA
    return sum(E * b * (h**3 - g**3) / 3 for E, b, g, h in parts) - EA * centre**2, EA


@pytest.mark.parametrize("dilatation", ["cell", "continuous", "point"])
@pytest.mark.parametrize("floor", [10.0, 0.1])
def test_small_bends_match_a_composite_beam(floor: float, dilatation: str) -> None:
    """For equal Poisson ratios the beam's solution, σ = E(z) ε, is exact and in the space of the cells."""
    bending, _ = composite(floor)
    rest = solver(layered_box_problem(), floor, dilatation=dilatation).rest()
    assert rest.dmoment_du == pytest.approx(-bending / (2 * box_problem().span_m), rel=1e-6)


@pytest.mark.parametrize("cut", [tetrahedral, lambda mesh: mesh], ids=["tetrahedra", "hexahedra"])
def test_a_confined_laminate_has_a_closed_form(cut: Callable[[ModuleMesh], ModuleMesh]) -> None:
    """Pressed to 3/4 between walls, F is diag(λ, 1, 1) in each layer with one P_xx; volume and pressure jump."""
    soft, hard, length = rubber(), rubber(10.0), 2e-3
    nodes, ids = numbered(positions(*(np.linspace(0, size, 5) for size in (length, 2e-3, 2e-3))))
    cells = grid_cells(ids)
    layer = np.flatnonzero(nodes[cells[:, CENTRE], 0] < length / 2)
    sets = {**module_sets(nodes, length), "all": np.arange(len(nodes))}
    whole = ModuleMesh(nodes, cells, grid_faces(ids[:, 0]), boundary_faces(cells)[0], sets, {"layer": layer})
    fixed = {"start": (0,), "end": (0,), "all": (1, 2)}
    problem = ModuleProblem(
        cut(whole), length, 0.0, 1.0, 1.0, fixed, axes=("x",), main_axis="x", joint="prismatic"
    )
    fem = SkfemConfig(pressure_max_pa=PRESSURE_PA, dilatation="continuous", tolerance=1e-10)
    made = Skfem(fem).solver(problem, soft.with_regions({"layer": hard}))
    state = made.constrained(0.0, -length / 4, made.rest())

    def stress(material: NeoHookean, stretch: float) -> float:
        return float(material.evaluate(np.diag([stretch, 1.0, 1.0])).stress[0, 0])

    stretch = brentq(lambda s: stress(soft, s) - stress(hard, 1.5 - s), 0.5, 1.0, xtol=1e-15)
    # the effort opposes the work of the laminate's stress
    assert state.moment_n_m == pytest.approx(-4e-6 * stress(soft, stretch), rel=1e-8)


def test_a_composite_bar_is_as_stiff_as_the_sum() -> None:
    bar = replace(layered_box_problem(), axes=("x",), main_axis="x", joint="prismatic")
    rest = solver(bar, 10.0).rest()
    assert rest.dmoment_du == pytest.approx(-composite(10.0)[1] / (2 * bar.span_m), rel=1e-6)


def test_a_region_that_becomes_rigid_stops_what_it_holds() -> None:
    """The distance to the limit falls as 1 / stiffness; in the limit the floor keeps its length and shape."""
    problem = layered_box_problem()
    floor = np.unique(problem.mesh.cells[problem.mesh.regions["floor"]])
    angles, moves = [], []
    for factor in (1e3, 1e4, 1e5):
        made = solver(problem, factor)
        state = made.free(PRESSURE_PA, made.rest())
        angles.append(state.angle_rad)
        moves.append(np.abs(made.deformed_nodes(state) - problem.mesh.nodes_m)[floor].max())
    assert angles[2] == pytest.approx(angles[1] / 10, rel=0.05)
    assert moves[2] == pytest.approx(moves[1] / 10, rel=0.05)


def test_slopes_with_two_materials_are_exact() -> None:
    made = solver(layered_box_problem(), 10.0)
    state, step = made.constrained(PRESSURE_PA, ANGLE_RAD, made.rest()), 1e-3
    more, less = (made.constrained(PRESSURE_PA, ANGLE_RAD + s, state) for s in (step, -step))
    assert state.dmoment_du == pytest.approx((more.moment_n_m - less.moment_n_m) / (2 * step), rel=1e-5)


def test_masses_count_each_region_with_its_density() -> None:
    mesh = layered_box_problem().mesh
    floor = Y[2] * Z[1] * box_problem().span_m
    wall = meshed_mass(mesh, 1.0).mass_kg - floor
    mass = half_masses(mesh, 1000.0, regions={"floor": 3000.0})
    assert mass.end.mass_kg == pytest.approx(2 * (3000 * floor + 1000 * wall), rel=1e-12)
    light = half_masses(mesh, 1000.0)
    assert mass.end.com_m[2] < light.end.com_m[2]
    same = half_masses(mesh, 1000.0, regions={"floor": 1000.0})
    assert np.array_equal(same.end.inertia_kg_m2, light.end.inertia_kg_m2)


def test_regions_survive_mirroring_and_welding() -> None:
    half = layered_box_problem().mesh
    both = welded_meshes([mirrored_mesh(half), moved_mesh(half, 0.0)])
    weight = meshed_mass(both, 1.0, {"floor": 2.0}).mass_kg - meshed_mass(both, 1.0).mass_kg
    assert weight == pytest.approx(2 * Y[2] * Z[1] * box_problem().span_m, rel=1e-12)


def test_what_is_not_known_is_refused_by_name() -> None:
    backend = Skfem(SkfemConfig(pressure_max_pa=PRESSURE_PA))
    strange = replace(box_problem(), requires=frozenset({"bottom_stiffness"}))
    with pytest.raises(UserError, match="fem 'skfem' does not know 'bottom_stiffness'"):
        backend.solver(strange, rubber())
    with pytest.raises(UserError, match="the region 'floor' .* has no material"):
        backend.solver(layered_box_problem(), rubber())
    with pytest.raises(UserError, match=r"'material.regions.flor' is no region .* did you mean 'floor'"):
        backend.solver(layered_box_problem(), rubber().with_regions({"flor": rubber()}))
