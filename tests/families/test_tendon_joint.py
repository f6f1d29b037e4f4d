"""The tendon joint as a solid: conforming faces, masses, the tendon's path, invalid designs."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.errors import InvalidDesignError
from pliant.meshing.hexahedra import area_vector, enclosed_volume
from pliant.records.shape import TriangleMesh
from pliant_plugins.families.reference import TENDON_JOINT
from pliant_plugins.families.tendon_joint.family import (
    JointGeometry,
    TendonJoint,
    TendonJointConfig,
    link_mesh,
    link_surface,
)

ANGLES = (-0.6, -1e-5, 0.0, 3e-5, 0.2, 0.9, 1.6)


def joint(**changes: object) -> TendonJoint:
    return TendonJoint(TendonJointConfig.model_validate({**TENDON_JOINT, **changes}))


@pytest.fixture(scope="module")
def geometry() -> JointGeometry:
    return joint().geometry


def turned(geometry: JointGeometry, point: tuple[float, float], angle: float) -> np.ndarray:
    """Return (x, z) of a point of the end link after the flexure bent as an arc; the middle section stays at rest."""
    c, half = geometry.flexure_length_m, angle / 2
    end = c / angle * np.array([np.sin(half), -(1 - np.cos(half))])
    x, z = point[0] - c / 2, point[1]
    return end + np.array([x * np.cos(half) + z * np.sin(half), z * np.cos(half) - x * np.sin(half)])


def outline(geometry: JointGeometry) -> np.ndarray:
    """Return the end link's outline in the plane y = 0, counter-clockwise."""
    half, edge = geometry.flexure_thickness_m / 2, geometry.link_height_m / 2
    back, span = geometry.module_length_m / 2, geometry.span_m
    upper, lower = (geometry.upper_edge_x_m, edge), (geometry.lower_edge_x_m, -edge)
    return np.array([(back, -edge), (back, edge), upper, (span, half), (span, -half), lower])


def area(polygon: np.ndarray) -> float:
    x, z = polygon.T
    return 0.5 * float(np.sum(x * np.roll(z, -1) - np.roll(x, -1) * z))


def test_the_links_edges_meet_at_the_stated_angles(geometry: JointGeometry) -> None:
    edge = geometry.link_height_m / 2
    lower, upper = (geometry.lower_edge_x_m, -edge), (geometry.upper_edge_x_m, edge)
    assert abs(turned(geometry, lower, geometry.closing_angle_rad)[0]) < 1e-15
    assert abs(turned(geometry, upper, -geometry.opening_angle_rad)[0]) < 1e-15
    assert turned(geometry, lower, 0.9 * geometry.closing_angle_rad)[0] > 1e-5
    assert turned(geometry, upper, -0.5 * geometry.opening_angle_rad)[0] > 1e-6


@pytest.mark.parametrize("angle", ANGLES)
def test_the_arm_is_the_tendon_length_slope(geometry: JointGeometry, angle: float) -> None:
    step = 1e-4
    slope = (geometry.tendon_length_m(angle + step) - geometry.tendon_length_m(angle - step)) / (2 * step)
    assert geometry.tendon_arm_m(angle) == pytest.approx(-slope, rel=1e-7)


@pytest.mark.parametrize("angle", [a for a in ANGLES if a != 0])
def test_the_tendon_is_the_line_between_the_turned_holes(geometry: JointGeometry, angle: float) -> None:
    hole = turned(geometry, (geometry.hole_x_m, -geometry.tendon_offset_m), angle)
    assert geometry.tendon_length_m(angle) == pytest.approx(2 * hole[0], rel=1e-12)


def test_a_short_flexure_is_a_hinge() -> None:
    hinge = joint(flexure_length="0.02 mm", flexure_thickness="0.01 mm").geometry
    h, b = hinge.tendon_offset_m, hinge.tendon_setback_m
    assert hinge.tendon_length_m(0.8) == pytest.approx(2 * (b * np.cos(0.4) - h * np.sin(0.4)), rel=2e-3)
    assert hinge.tendon_arm_m(0.8) == pytest.approx(h * np.cos(0.4) + b * np.sin(0.4), rel=1e-3)


def test_the_links_skin_is_closed_and_holds_the_outlines_volume(geometry: JointGeometry) -> None:
    mesh = link_mesh(geometry)
    volume = area(outline(geometry)) * geometry.link_width_m
    assert enclosed_volume(mesh.nodes_m, mesh.skin) == pytest.approx(volume, rel=1e-12)
    assert np.abs(area_vector(mesh.nodes_m, mesh.skin)).max() < 1e-15
    assert triangles_volume(link_surface(mesh)) == pytest.approx(volume, rel=1e-12)


def triangles_volume(surface: TriangleMesh) -> float:
    corner = surface.vertices_m[surface.faces]
    return float(np.einsum("fi,fi->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6)


def test_the_shapes_fill_link_and_flexure(geometry: JointGeometry) -> None:
    shapes = joint().shapes()
    flexure = geometry.span_m * geometry.flexure_width_m * geometry.flexure_thickness_m
    whole = area(outline(geometry)) * geometry.link_width_m + flexure
    for half in (shapes.start, shapes.end):
        hulls = [shape.mesh for shape in half if shape.mesh is not None]
        assert sum(triangles_volume(hull) for hull in hulls) == pytest.approx(whole, rel=1e-12)
    surface = joint().surface()
    assert surface.rigid_start is not None
    volumes = triangles_volume(surface.start) + triangles_volume(surface.rigid_start)
    assert volumes == pytest.approx(whole, rel=1e-12)


def test_the_module_weighs_as_much_as_the_published_link() -> None:
    mass = joint().mass(1150.0)
    assert mass.start.mass_kg + mass.end.mass_kg == pytest.approx(10.94e-3, rel=1e-3)
    assert mass.start.com_m[0] == pytest.approx(-mass.end.com_m[0], rel=1e-12)
    # more of the link is cut away below the flexure than above it
    assert mass.end.com_m[2] > 0 and abs(mass.end.com_m[1]) < 1e-15


def test_the_links_have_a_separate_density(geometry: JointGeometry) -> None:
    light, heavy = joint().mass(500.0).end.mass_kg, joint().mass(1500.0).end.mass_kg
    flexure = geometry.span_m * geometry.flexure_width_m * geometry.flexure_thickness_m
    assert heavy - light == pytest.approx(1000 * flexure, rel=1e-9)
    link = 1290 * area(outline(geometry)) * geometry.link_width_m
    assert light == pytest.approx(500 * flexure + link, rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"flexure_length": "0 mm"}, r"flexure_length > 0"),
        ({"flexure_length": "30 mm"}, r"flexure_length < module_length"),
        ({"flexure_thickness": "18 mm"}, r"flexure_thickness < link_height"),
        ({"flexure_width": "21 mm"}, r"flexure_width ≤ link_width"),
        ({"flexure_length": "0.4 mm"}, r"flexure_thickness/2 .*< flexure_length"),
        ({"tendon_offset": "0.4 mm"}, r"flexure_thickness/2 < tendon_offset"),
        ({"tendon_offset": "9.1 mm"}, r"tendon_offset < link_height/2"),
        ({"tendon_setback": "12 mm"}, r"flexure_length/2 \+ tendon_setback ≤ module_length/2"),
        ({"tendon_setback": "0.1 mm"}, r"link's face at the tendon ≤ flexure_length/2 \+ tendon_setback"),
        ({"closing_angle": 3.2}, r"closing_angle < 180°"),
        ({"opening_angle": 0.0}, r"opening_angle > 0°"),
        ({"closing_angle": 2.4}, r"closing_angle < module_length/2"),
        ({"module_length": 28.0}, r"module_length ≤ 1 m"),
    ],
)
def test_what_cannot_be_built_is_refused_with_the_inequality(changes: dict[str, object], words: str) -> None:
    with pytest.raises(InvalidDesignError, match=words) as caught:
        joint(**changes)
    assert any(character.isdigit() for character in str(caught.value).split("but")[-1])
