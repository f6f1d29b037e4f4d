"""The helical bellow: validity, masses, meshes, and its three axes by symmetry and by laws that need no data."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from tests.families.solvers import make_solver, rubber

from pliant.errors import InvalidDesignError
from pliant.interfaces.fem import ModuleSolver
from pliant.meshing.hexahedra import cell_volumes, enclosed_volume
from pliant.records.fem import FemState, ModuleProblem
from pliant_plugins.families.bellow.revolved import RevolvedCounts, ring, sector
from pliant_plugins.families.bellow_helical.family import (
    BellowHelical,
    BellowHelicalConfig,
    rod_chord,
    thread_points,
)

NAMES = ("inner_radius", "average_radius", "wall", "module_length")


def family(
    r: float = 3.09, R: float = 5.66, t: float = 1.51, length: float = 4.72, **others: str
) -> BellowHelical:
    lengths = dict(zip(NAMES, (f"{value} mm" for value in (r, R, t, length)), strict=True))
    return BellowHelical(BellowHelicalConfig.model_validate({**lengths, **others}))


def solver(problem: ModuleProblem) -> ModuleSolver:
    return make_solver(problem, rubber(237e3))


def test_designs_in_the_study_are_valid() -> None:
    """The study counts 24 valid designs; no inequality of the geometry shows which of the 25 it omitted."""
    for R, length in itertools.product((5, 5.5, 6, 6.5, 7), (4, 4.5, 5, 5.5, 6)):
        mesh = family(3, R, 1.5, length).problem().mesh
        assert (cell_volumes(mesh.nodes_m, mesh.cells) > 0).all()


@pytest.mark.parametrize(
    ("design", "others", "words"),
    [
        ((3, 4, 1.5, 5), {}, ("average_radius − inner_radius ≥ module_length/4", "0.25 mm")),
        ((3, 5, 1.5, 2.9), {}, ("module_length/4 > wall/2", "0.725 mm", "0.025 mm")),
        ((0.7, 5, 1.5, 5), {}, ("inner_radius > wall/2", "short by 0.05 mm")),
        (
            (3, 5, 1.5, 5),
            {"constraint_offset": "3.8 mm"},
            ("constraint_offset < inner_radius", "over by 0.05 mm"),
        ),
        ((3, 5, 1.5, 5), {"constraint_offset": "-1 mm"}, ("constraint_offset > 0, but it is −1 mm",)),
        ((3, 5, 1.5, 5), {"constraint_width": "9 mm"}, ("constraint_width ≤", "over by")),
        ((3, 5, 1.5, 5), {"constraint_stiffness": "0 N"}, ("constraint_stiffness > 0",)),
        ((3, 5, 0, 5), {}, ("wall > 0",)),
    ],
)
def test_bad_designs_name_the_inequality(design, others, words) -> None:
    with pytest.raises(InvalidDesignError, match="^bellow_helical needs ") as caught:
        family(*design, **others)
    assert [word for word in words if word not in str(caught.value)] == []


@pytest.mark.parametrize(("R", "length", "published_kg"), [(5.66, 4.72, 0.868e-3), (5.71, 4.77, 0.892e-3)])
def test_published_masses(R: float, length: float, published_kg: float) -> None:
    design = family(R=R, length=length)
    mass = design.mass(1150.0)
    assert mass.start.mass_kg + mass.end.mass_kg == pytest.approx(published_kg, rel=2e-3)
    exact = 1150.0 * (design.geometry.wall_volume(-0.755e-3, 0.755e-3) + design.unmeshed_volume_m3)
    assert exact == pytest.approx(published_kg, rel=1e-3)


def test_a_rod_outside_the_wall_by_the_area_between_two_circles() -> None:
    """The rod's part in the cavity is at each x the lens of two circles, in closed form."""
    geometry = family().geometry
    q = (geometry.average_radius_m - geometry.wall_m) / 2
    apart = geometry.inner_radius_m - q
    points, volume = thread_points(geometry)
    assert rod_chord(geometry, apart) == pytest.approx(2 * q)
    assert rod_chord(geometry, geometry.inner_radius_m) == pytest.approx(0.0, abs=1e-6)
    x = np.linspace(0, geometry.half_length_m, 20001)
    rho = geometry.radius_at(x, -geometry.wall_m / 2)
    lens = np.full_like(x, np.pi * q**2)
    cut = rho < apart + q
    p = rho[cut]
    first = q**2 * np.arccos((apart**2 + q**2 - p**2) / (2 * apart * q))
    second = p**2 * np.arccos((apart**2 + p**2 - q**2) / (2 * apart * p))
    root = np.sqrt((-apart + q + p) * (apart + q - p) * (apart - q + p) * (apart + q + p)) / 2
    lens[cut] = first + second - root
    assert volume.sum() == pytest.approx(np.trapezoid(lens, x), rel=2e-4)
    assert abs(volume @ points[:, 1]) < 1e-9 * volume.sum() * q
    assert (np.hypot(points[:, 1], points[:, 2]) <= rho.max()).all()


def test_profile_wall_at_x() -> None:
    """`radius_at` is compared with the profile's own points."""
    geometry = family().geometry
    for depth in (-geometry.wall_m / 2, 0.0, geometry.wall_m / 2):
        for part in (geometry.crest, geometry.trough):
            x, radius = part(np.linspace(0.01, 1.5, 40), np.array(depth))
            assert geometry.radius_at(x, depth) == pytest.approx(radius, rel=1e-12)


@pytest.mark.parametrize("refinement", [1, 2])
def test_pieces_have_the_walls_volume(refinement: int) -> None:
    geometry = family().geometry
    wall = geometry.wall_volume(-geometry.wall_m / 2, geometry.wall_m / 2)
    counts = RevolvedCounts.from_profile(geometry, refinement)
    pieces = ((sector(geometry, counts, 1), 8), (sector(geometry, counts, 2), 4), (ring(geometry, counts), 1))
    for mesh, scale in pieces:
        assert scale * cell_volumes(mesh.nodes_m, mesh.cells).sum() == pytest.approx(wall, rel=1e-3)
        assert scale * enclosed_volume(mesh.nodes_m, mesh.skin) == pytest.approx(wall, rel=1e-3)


def test_the_ring_cavity_is_what_the_profile_encloses() -> None:
    geometry = family().geometry
    mesh = ring(geometry, RevolvedCounts.from_profile(geometry, 2))
    # from the middle of the start section that plane adds nothing, the end plane π ρ² l / 3
    end = np.pi * (geometry.inner_radius_m - geometry.wall_m / 2) ** 2 * geometry.module_length_m / 3
    cavity = end - enclosed_volume(mesh.nodes_m, mesh.cavity)
    assert cavity == pytest.approx(geometry.enclosed_volume(-geometry.wall_m / 2), rel=1e-4)
    # the end sections' nodes correspond
    start, end = (mesh.nodes_m[mesh.node_sets[name]] for name in ("start", "end"))
    assert start[:, 1:] == pytest.approx(end[:, 1:], abs=1e-15)


def test_the_joint_stands_below_the_axis() -> None:
    design = family(constraint_offset="2.6 mm")
    assert design.offset_m == pytest.approx(2.6e-3)
    nodes = design.problem(axes=("y",)).mesh.nodes_m
    assert nodes[:, 2].max() - design.offset_m == pytest.approx(design.offset_m - nodes[:, 2].min())
    mass = design.mass(1150.0)
    assert 0.5 * design.offset_m < mass.end.com_m[2] < design.offset_m  # the rod is on the lower side


@pytest.fixture(scope="module")
def half() -> FemState:
    return solver(family().problem(axes=("y",))).rest()


@pytest.fixture(scope="module")
def whole() -> FemState:
    return solver(family().problem()).rest()


def test_half_and_whole_module_agree_about_y(half: FemState, whole: FemState) -> None:
    assert whole.dmoment_dp == pytest.approx(half.dmoment_dp, rel=1e-8)
    assert whole.dmoment_du == pytest.approx(half.dmoment_du, rel=1e-8)


def test_mirror_symmetry_uncouples_the_axes_at_rest(whole: FemState) -> None:
    K = -whole.dtau_du
    assert pytest.approx(np.diag(np.diag(K)), abs=1e-9 * K.max()) == K
    assert np.diag(K).min() > 0
    assert whole.dtau_dp[[0, 2]] == pytest.approx(0.0, abs=1e-9 * whole.dtau_dp[1])


@pytest.mark.slow
def test_constraint_width_is_a_stiffness_about_z(whole: FemState) -> None:
    """EA w²/12 / l, and nothing about the other axes at rest."""
    design = family()
    problem = design.problem()
    thread = replace(problem, ribbons=tuple(replace(r, width_m=0.0) for r in problem.ribbons))
    K, bare = -whole.dtau_du, -solver(thread).rest().dtau_du
    added = design.config.constraint_stiffness_n * design.constraint_width_m**2 / 12 / design.module_length_m
    assert K - bare == pytest.approx(np.diag([0.0, 0.0, added]), abs=1e-9 * added)


@pytest.mark.slow
def test_a_free_pivot_softens_twist_and_not_bending_about_y(whole: FemState) -> None:
    free = solver(family(twist_pivot="free").problem()).rest()
    assert free.dtau_du[1, 1] == pytest.approx(whole.dtau_du[1, 1], rel=1e-8)
    assert 0.5 < free.dtau_du[0, 0] / whole.dtau_du[0, 0] < 0.99


@pytest.mark.slow
def test_a_stiff_constraint_keeps_the_joint_line() -> None:
    """With increasing stiffness the axial strain under pressure decreases as 1/EA."""
    strains = []
    for stiffness in ("2000 N", "4000 N"):
        model = solver(family(constraint_stiffness=stiffness).problem(axes=("y",)))
        strains.append(model.constrained(5e3, 0.0, model.rest()).axial_strain)
    assert 0 < strains[1] < 2e-4
    assert strains[0] == pytest.approx(2 * strains[1], rel=0.01)


def test_the_module_is_closed_where_the_outermost_fibre_is_used_up() -> None:
    """Distances from the constraint to the wall's outer crests: 9.74 ∓ 2.55 mm; 15 % of 4.72 mm remains."""
    module = family()
    low, high = module.problem().contact_range or (0.0, 0.0)
    assert (module.problem(axes=("y",)).contact_range) == (low, high)
    assert high * (9.74e-3 - module.offset_m) == pytest.approx(0.85 * 4.72e-3)
    assert -low * (9.74e-3 + module.offset_m) == pytest.approx(0.85 * 4.72e-3)
    # bending sideways uses it up too
    closing = module.problem().closing
    assert closing is not None
    assert [closing.shortening_m(u) for u in closing.range] == pytest.approx([closing.free_m] * 2)
    assert closing.shortening_m(0.0, 0.2) == closing.shortening_m(0.0, -0.2) == pytest.approx(0.2 * 9.74e-3)
    assert closing.shortening_m(0.3, 0.3) > closing.shortening_m(0.3)
