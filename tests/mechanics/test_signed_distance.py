"""Signed distances of spheres, boxes and hulls: values by hand, and slopes by differences."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.mechanics.rotations import exp_map
from pliant.mechanics.signed_distance import nearest, solid_from_shape
from pliant.records.shape import Shape, TriangleMesh

TURN = exp_map(np.array([0.3, -0.5, 0.2]))
PLACE = np.array([0.01, -0.02, 0.03])
HALF = (0.03, 0.02, 0.01)
CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3) * HALF
SHAPES = {
    "sphere": Shape("sphere", (0.02,), PLACE, np.eye(3)),
    "box": Shape("box", HALF, PLACE, TURN),
    "mesh": Shape("mesh", (), PLACE, TURN, TriangleMesh(CORNERS, np.zeros((0, 3), np.int64))),
}


def points(count: int = 200, size: float = 0.08) -> np.ndarray:
    return np.random.default_rng(0).uniform(-size, size, (count, 3))


@pytest.mark.parametrize(
    ("local", "distance"),
    [
        ((0.05, 0.0, 0.0), 0.02),  # a face
        ((0.03 + 0.003, 0.02 + 0.004, 0.0), 0.005),  # an edge
        ((0.03 + 0.002, 0.02 + 0.003, 0.01 + 0.006), 0.007),  # a corner
        ((0.0, 0.0, 0.008), -0.002),  # inside
    ],
)
@pytest.mark.parametrize("kind", ["box", "mesh"])
def test_distance_from_a_box(kind: str, local: tuple[float, ...], distance: float) -> None:
    found = solid_from_shape(SHAPES[kind]).distance((PLACE + TURN @ np.array(local))[None])
    assert found.value_m[0] == pytest.approx(distance, abs=1e-12)


def test_the_hull_of_a_boxes_corners_is_the_box() -> None:
    box, hull = (solid_from_shape(SHAPES[kind]).distance(points()) for kind in ("box", "mesh"))
    np.testing.assert_allclose(hull.value_m, box.value_m, atol=1e-12)
    outside = box.value_m > 1e-6
    np.testing.assert_allclose(hull.normal[outside], box.normal[outside], atol=1e-6)


@pytest.mark.parametrize("kind", SHAPES)
def test_normals_and_curvatures_are_slopes(kind: str) -> None:
    solid, where, step = solid_from_shape(SHAPES[kind]), points(), 1e-6
    value, normal = solid.distance(where)
    outside = value > 1e-3
    for axis in range(3):
        up, down = (solid.distance(where + sign * step * np.eye(3)[axis]) for sign in (1.0, -1.0))
        slope = (up.value_m - down.value_m) / (2 * step)
        np.testing.assert_allclose(normal[outside, axis], slope[outside], atol=1e-5)
        bent = (up.normal - down.normal) / (2 * step)
        kinks = np.abs(bent).max(axis=1) > 1.01 / np.maximum(value, 1e-3)  # the step crossed an edge's region
        good = outside & ~kinks
        np.testing.assert_allclose(solid.curvature(where[good])[:, :, axis], bent[good], atol=0.05)


def test_the_nearest_of_several_counts() -> None:
    one, other = (solid_from_shape(SHAPES[kind]) for kind in ("sphere", "box"))
    both = nearest((one, other), points())
    least = np.minimum(one.distance(points()).value_m, other.distance(points()).value_m)
    np.testing.assert_array_equal(both.value_m, least)
    assert np.isinf(nearest((), points()).value_m).all()


def test_a_cylinder_is_refused() -> None:
    with pytest.raises(UserError, match="'cylinder' has no signed distance; use box, sphere or mesh"):
        solid_from_shape(Shape("cylinder", (0.01, 0.02), PLACE, TURN))
