"""Skins, boxes and collision shapes: closed surfaces, volumes by closed form, shapes merged and stretched."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from pliant.mechanics.rotations import exp_map
from pliant.meshing.surfaces import box, half_boxes, half_skins, merged, stretched, support, welded
from pliant.records.design import Array
from pliant.records.shape import Shape, TriangleMesh
from pliant.report.contact_charts import outline
from pliant_plugins.families.bellow_bending.family import BellowBending, BellowBendingConfig
from pliant_plugins.solids import read_solid, write_stl

ALONG_X = exp_map(np.array([0.0, np.pi / 2, 0.0]))


@pytest.fixture(scope="module")
def bellow() -> BellowBending:
    return BellowBending(
        BellowBendingConfig(inner_radius_m=2e-3, average_radius_m=6e-3, wall_m=1.5e-3, module_length_m=11e-3)
    )


def closed(surface: TriangleMesh) -> trimesh.Trimesh:
    """Return the surface as trimesh loads it, equal vertices merged."""
    return trimesh.Trimesh(surface.vertices_m, surface.faces)


def test_halves_are_closed_and_hold_half_the_solid(bellow: BellowBending) -> None:
    halves = bellow.surface()
    for half in (halves.start, halves.end):
        mesh = closed(half)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        # flat triangles on curved walls lose about a percent
        assert mesh.volume == pytest.approx(bellow.geometry.solid_volume() / 2, rel=0.015)
    assert closed(halves.start).bounds[:, 0] == pytest.approx([-5.5e-3, 0.0], abs=1e-9)


def test_halves_and_modules_are_welded_to_one_skin(bellow: BellowBending) -> None:
    halves = bellow.surface()
    module = halves.start.joined(halves.end)
    skin = closed(welded(module))
    assert skin.is_watertight
    assert skin.volume == pytest.approx(closed(halves.start).volume * 2, rel=1e-9)
    inner = closed(halves.start).area * 2 - skin.area
    assert inner > 1e-5  # the two sides of the section between them were removed
    two = module.joined(module.placed(np.eye(3), np.array([11e-3, 0, 0])))
    assert closed(welded(two)).is_watertight
    assert closed(welded(two)).volume == pytest.approx(2 * skin.volume, rel=1e-9)


def test_a_skin_survives_stl(bellow: BellowBending, tmp_path: Path) -> None:
    halves = bellow.surface()
    path = tmp_path / "module.stl"
    write_stl(welded(halves.start.joined(halves.end)), path)
    solid = read_solid(path)
    assert solid.volume_m3 == pytest.approx(bellow.geometry.solid_volume(), rel=0.015)
    assert solid.unit_mass.com_m[:2] == pytest.approx([0, 0], abs=1e-7)


def test_plate_and_bellow_lie_where_the_design_has_them(bellow: BellowBending) -> None:
    halves = bellow.shapes()
    shapes = merged([*halves.start, *halves.end])
    assert len(shapes) == 2
    plate, tube = shapes

    def reach(shape: Shape, axis: Array) -> float:
        return support(shape, axis)

    x, y, z = np.eye(3)
    assert reach(plate, x) == pytest.approx(5.5e-3)
    assert reach(plate, y) == pytest.approx(6e-3)
    assert reach(plate, -z) == pytest.approx(1.5e-3)  # the face that grips
    assert 2 * reach(tube, y) == pytest.approx(2 * (2 * 6e-3 - 2e-3) + 2 * 1.5e-3)
    assert reach(tube, z) + reach(plate, -z) == pytest.approx(2 * 10e-3 + 3 * 1.5e-3)
    # the shapes enclose the mesh: no part of it is outside the box around both
    points = bellow.surface().end.vertices_m
    assert points[:, 2].max() <= reach(tube, z) + 1e-9
    assert points[:, 2].min() >= -reach(plate, -z) - 1e-9
    assert np.abs(points[:, 1]).max() <= reach(tube, y) + 1e-9


def test_boxes_hold_the_mesh(bellow: BellowBending) -> None:
    mesh = bellow.problem().mesh
    boxes, skins = half_boxes(mesh), half_skins(mesh)
    for (shape,), skin in ((boxes.start, skins.start), (boxes.end, skins.end)):
        for axis in (*np.eye(3), *-np.eye(3)):
            assert support(shape, axis) == pytest.approx(float((skin.vertices_m @ axis).max()), abs=1e-9)


TURNED = exp_map(np.array([0.3, -0.2, 0.5]))


@pytest.mark.parametrize(
    "shape",
    [
        Shape("box", (1.0, 2.0, 3.0), np.zeros(3), TURNED),
        Shape("ellipsoid", (1.0, 2.0, 3.0), np.ones(3), TURNED),
        Shape("cylinder", (1.0, 2.0), np.ones(3), TURNED),
        Shape("capsule", (1.0, 2.0), np.ones(3), TURNED),
        Shape("sphere", (1.5,), np.ones(3), TURNED),
    ],
    ids=lambda shape: shape.kind,
)
def test_support_is_the_farthest_among_many_points(shape: Shape) -> None:
    cloud = outline(shape)
    for direction in np.random.default_rng(0).normal(size=(20, 3)):
        unit = direction / np.linalg.norm(direction)
        farthest = float((cloud @ unit).max())
        assert farthest <= support(shape, unit) + 1e-9
        assert farthest == pytest.approx(support(shape, unit), abs=0.03)


def test_only_what_continues_is_merged() -> None:
    first = box(np.array([0.0, -1, -1]), np.array([1.0, 1, 1]))
    second = box(np.array([1.0, -1, -1]), np.array([3.0, 1, 1]))
    (one,) = merged([first, second])
    assert one.size_m == pytest.approx((1.5, 1, 1))
    assert one.position_m == pytest.approx([1.5, 0, 0])
    apart = box(np.array([3.5, -1, -1]), np.array([4.0, 1, 1]))
    wider = box(np.array([3.0, -2, -1]), np.array([4.0, 2, 1]))
    turned = Shape("box", (1, 1, 1), np.array([4.0, 0, 0]), exp_map(np.array([0.2, 0, 0])))
    for other in (apart, wider, turned):
        assert len(merged([first, second, other])) == 2
    tubes = [Shape("cylinder", (2.0, 0.5), np.array([x, 0, 1]), ALONG_X) for x in (0.5, 1.5, 2.5)]
    (tube,) = merged(tubes)
    assert tube.size_m == pytest.approx((2.0, 1.5))
    assert tube.position_m == pytest.approx([1.5, 0, 1])
    upright = [Shape("cylinder", (2.0, 0.5), np.array([x, 0, 1]), np.eye(3)) for x in (0.0, 0.5)]
    assert len(merged(upright)) == 2


def test_stretching_multiplies_x_only() -> None:
    tube = stretched(Shape("cylinder", (2.0, 1.0), np.array([3.0, 0, 1]), ALONG_X), 2.0)
    assert tube.size_m == (2.0, 2.0)
    assert tube.position_m == pytest.approx([6.0, 0, 1])
    brick = stretched(box(np.array([0.0, -1, -1]), np.array([1.0, 1, 1])), 3.0)
    assert (support(brick, np.eye(3)[0]), -support(brick, -np.eye(3)[0])) == pytest.approx((3.0, 0.0))
    ball = stretched(Shape("sphere", (1.0,), np.array([1.0, 0, 0]), np.eye(3)), 2.0)
    assert ball.kind == "box"  # the box around it
    assert support(ball, np.eye(3)[0]) == pytest.approx(4.0)
    assert support(ball, np.eye(3)[2]) == pytest.approx(1.0)
