"""The bending bellow: validity, mesh, volumes, masses, against closed forms and the divergence theorem."""

from __future__ import annotations

import csv
import itertools
from pathlib import Path

import numpy as np
import pytest

from pliant.errors import InvalidDesignError
from pliant.meshing.hexahedra import enclosed_volume, quadrature
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.families.bellow_bending.mesh import BellowGeometry, build_mesh

COEFFICIENTS = Path(__file__).parents[3] / "shared/data/reference/gripper_poly_coefficients.csv"
GRID = list(itertools.product((2, 5), (6, 7.5, 9), (1.5, 2), (8, 10, 12)))


def bellow(r: float, R: float, t: float, l: float) -> BellowGeometry:  # noqa: E741
    return BellowGeometry(*(1e-3 * value for value in (r, R, t, l)))


def family(r: float = 2, R: float = 6, t: float = 1.5, l: float = 11) -> BellowBending:  # noqa: E741
    names = ("inner_radius", "average_radius", "wall", "module_length")
    values = dict(zip(names, (f"{value} mm" for value in (r, R, t, l)), strict=True))
    return BellowBending(BellowBendingConfig.model_validate(values))


def valid(designs: list[tuple[float, ...]]) -> list[BellowGeometry]:
    found = [bellow(*design) for design in designs]
    return [geometry for geometry in found if all(need.is_kept for need in geometry.needs())]


def check_mesh(geometry: BellowGeometry, refinement: int = 1) -> None:
    """Check positive Jacobians, a closed skin, and the exact solid's volume except for the foot's fillet."""
    mesh = build_mesh(geometry, refinement)
    _, volume = quadrature(mesh.nodes_m, mesh.cells)
    assert volume.min() > 0
    assert enclosed_volume(mesh.nodes_m, mesh.skin) == pytest.approx(volume.sum(), rel=1e-12)
    assert 4 * volume.sum() == pytest.approx(geometry.solid_volume(), rel=4e-3)
    # every node belongs to a cell: a stray one would make the stiffness singular
    assert np.array_equal(np.unique(mesh.cells), np.arange(len(mesh.nodes_m)))


@pytest.mark.parametrize("geometry", valid(GRID), ids=str)
def test_mesh_over_the_study_range(geometry: BellowGeometry) -> None:
    check_mesh(geometry)


def test_mesh_for_every_published_design() -> None:
    if not COEFFICIENTS.exists():
        pytest.skip(f"reference data absent: {COEFFICIENTS}")
    with COEFFICIENTS.open() as file:
        rows = [tuple(float(row[k]) for k in ("r", "R", "t", "l")) for row in csv.DictReader(file)]
    designs = valid(rows)
    assert len(rows) == 87
    assert len(designs) > 60
    for geometry in designs:
        check_mesh(geometry)


def test_refined_mesh_and_its_cavity() -> None:
    geometry = bellow(2, 6, 1.5, 11)
    check_mesh(geometry, refinement=2)
    mesh = build_mesh(geometry, 2)
    axis = np.array([geometry.half_length_m, 0.0, geometry.axis_height_m])
    # seen from the axis at mid-trough the end plane, which the wetted faces leave open, adds nothing
    start = np.pi * geometry.crest_radius_m**2 / 2 * geometry.half_length_m / 3
    cavity = -enclosed_volume(mesh.nodes_m - axis, mesh.cavity) + start
    assert 4 * cavity == pytest.approx(geometry.cavity_volume(), rel=1e-5)


@pytest.mark.parametrize(("r", "R", "t", "l"), [(2, 6, 1.5, 11), (2.75, 9, 1.5, 9), (5, 7.5, 1.5, 10)])
def test_the_published_volume_equals_the_mid_surface(r: float, R: float, t: float, l: float) -> None:  # noqa: E741
    geometry = bellow(r, R, t, l)
    f = 2 * R - 2 * r - l / 2
    v1 = 2 * np.pi * t * (l / 4) * ((r + l / 4) * np.pi / 2 - l / 4)
    v2 = 2 * np.pi * t * ((r + l / 4) * f + f**2 / 2)
    v3 = 2 * np.pi * t * (l / 4) * ((r + l / 4 + f) * np.pi / 2 + l / 4)
    published = 2 * (v1 + v2 + v3) * 1e-9
    half = geometry.wall_m / 2
    assert geometry.wall_volume(-half, half) == pytest.approx(published, rel=1e-12)


def test_wall_volume_is_the_tube_growth() -> None:
    """The wall's closed form equals ∫ π ρ² dx of the outer profile less that of the inner one."""
    geometry = bellow(2, 6, 1.5, 11)
    node, weight = np.polynomial.legendre.leggauss(40)
    angle, weight = np.pi / 4 * (node + 1), np.pi / 4 * weight

    def tube(depth: float) -> float:
        c = geometry.crest_radius_m - geometry.arc_radius_m + (geometry.arc_radius_m + depth) * np.cos(angle)
        b = geometry.inner_radius_m + geometry.arc_radius_m
        b = b - (geometry.arc_radius_m - depth) * np.sin(angle)
        crest = np.sum(weight * c**2 * (geometry.arc_radius_m + depth) * np.cos(angle))
        trough = np.sum(weight * b**2 * (geometry.arc_radius_m - depth) * np.sin(angle))
        return float(2 * np.pi * (crest + trough))

    assert tube(0.0) == pytest.approx(geometry.cavity_volume(), rel=1e-12)
    assert tube(geometry.wall_m) - tube(0.0) == pytest.approx(geometry.wall_volume(0, geometry.wall_m))


def test_plate_is_full_width_at_full_height() -> None:
    """Also where the crest's foot is narrower than the plate the solid reaches the corner (l/2, R, ±t)."""
    geometry = bellow(5, 7.5, 1.5, 9)
    mesh = build_mesh(geometry)
    for x in (0.0, geometry.half_length_m):
        for z in (-geometry.wall_m, geometry.wall_m):
            corner = np.array([x, geometry.average_radius_m, z])
            assert np.linalg.norm(mesh.nodes_m - corner, axis=1).min() < 1e-12


def test_mass_equals_the_solid_and_mirrored() -> None:
    bend = family()
    mass = bend.mass(1150.0)
    whole = mass.start.joined(mass.end)
    assert whole.mass_kg == pytest.approx(1150 * bend.geometry.solid_volume(), rel=1e-3)
    assert mass.end.com_m[0] > 0 > mass.start.com_m[0]
    assert whole.com_m[0] == pytest.approx(0, abs=1e-15)
    assert np.linalg.eigvalsh(mass.end.inertia_kg_m2).min() > 0
    # nearer to the tube's axis than to the plate
    assert 0.4 * bend.geometry.axis_height_m < whole.com_m[2] < bend.geometry.axis_height_m


def test_inertia_against_parallel_axes_on_a_finer_mesh() -> None:
    bend = family()
    end = bend.mass(1000.0).end
    mesh = build_mesh(bend.geometry, 2)
    point, volume = quadrature(mesh.nodes_m, mesh.cells, order=4)
    x, m = point.reshape(-1, 3), 1000.0 * volume.ravel()
    both = np.vstack([x, x * (1, -1, 1)])
    about_joint = np.einsum("n,nij->ij", np.tile(m, 2), _inertia(both))
    arm = end.com_m
    shifted = end.inertia_kg_m2 + end.mass_kg * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    assert np.allclose(shifted, about_joint, rtol=1e-3, atol=1e-3 * about_joint.max())


def _inertia(x: np.ndarray) -> np.ndarray:
    return np.sum(x**2, axis=1)[:, None, None] * np.eye(3) - x[:, :, None] * x[:, None, :]


@pytest.mark.parametrize(
    ("design", "words"),
    [
        ((2, 4, 1.5, 11), ("average_radius − inner_radius ≥ module_length/4", "2 mm", "2.75 mm", "0.75 mm")),
        ((2, 6, 2, 8), ("module_length/4 > wall", "2 mm")),
        ((2, 6, 2.5, 8), ("module_length/4 > wall", "2 mm", "2.5 mm", "0.5 mm")),
        ((2, 6, -1.5, 11), ("wall > 0, but it is −1.5 mm",)),
        ((2, 6, 0, 11), ("wall > 0",)),
        ((2000, 6000, 1500, 11000), ("1000 mm", "units")),
    ],
)
def test_bad_designs_name_the_inequality(design: tuple[float, ...], words: tuple[str, ...]) -> None:
    with pytest.raises(InvalidDesignError) as caught:
        family(*design)
    message = str(caught.value)
    assert message.startswith("bellow_bending needs ")
    assert message.endswith(".")
    for word in words:
        assert word in message


def test_exactly_equal_arcs_are_valid() -> None:
    """R − r = l/4 leaves no flank; rounding must not reject it."""
    geometry = bellow(5, 7.5, 1.5, 10)
    assert all(need.is_kept for need in geometry.needs())
    assert geometry.flank_m == 0
    check_mesh(geometry)
