"""Bodies from FEM shapes: arcs unroll and bend exactly, modules meet, pictures cover what they should."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pliant.report.figures import body, rendering

LENGTH, FREE = 0.011, 0.36


def test_unrolled_shapes_bend_back_to_themselves(kit: Any) -> None:
    shapes = kit.tube_shapes()
    for shape, section in zip(shapes, body.unrolled(shapes), strict=True):
        again = section.bent(shape.angle_rad / 2, ()).points
        assert np.abs(again - shape.points_m).max() < 1e-15


def test_negative_angles_unroll_too(kit: Any) -> None:
    rest = kit.tube_shapes()[0]
    section = body.unrolled([rest])[0]
    points = section.bent(-0.15, ()).points
    bent = type(rest)(0.0, -0.3, points, rest.faces)
    found = body.unrolled([rest, bent])[1]
    assert np.abs(found.section - rest.points_m).max() < 1e-14
    assert found.length_m == pytest.approx(LENGTH / 2)


def test_arc_tube_keeps_its_centre_line_and_stretches_outside(kit: Any) -> None:
    section = body.unrolled(kit.tube_shapes())[-1]
    assert section.length_m == pytest.approx(LENGTH / 2, rel=1e-12)
    assert section.values.max() == pytest.approx(1 + FREE / LENGTH * 0.012, rel=1e-3)


def test_a_finger_made_from_arcs_ends_on_the_circle(kit: Any) -> None:
    section = body.unrolled(kit.tube_shapes())[-1]
    count = 5
    _, path = body.finger([section] * count, np.full(count, FREE), np.zeros(count), np.zeros(3), np.eye(3))
    radius, turn = LENGTH / FREE, count * FREE
    assert path[-1] == pytest.approx([radius * np.sin(turn), 0, radius * (np.cos(turn) - 1)], abs=1e-15)


def test_a_half_turned_segment_bends_the_other_way(kit: Any) -> None:
    section = body.unrolled(kit.tube_shapes())[-1]
    angles, zero = np.full(2, FREE), np.zeros(3)
    _, one = body.finger([section] * 2, angles, np.zeros(2), zero, np.eye(3))
    _, other = body.finger([section] * 2, angles, np.full(2, np.pi), zero, np.eye(3))
    assert other * [1, 1, -1] == pytest.approx(one, abs=1e-15)


def test_shape_between_levels_is_interpolated(kit: Any) -> None:
    shapes = kit.tube_shapes()
    sections = body.unrolled(shapes)
    level = shapes[1].actuation
    assert body.at_actuation(shapes, sections, level).section == pytest.approx(sections[1].section)
    beyond = body.at_actuation(shapes, sections, 10 * level)
    assert beyond.section == pytest.approx(sections[-1].section)


def test_a_face_picture_has_its_area_and_faces_away_are_not_drawn() -> None:
    x, y = np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0])
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    square = rendering.Surface(points, np.arange(9)[None], np.ones(9))
    camera = rendering.Camera.looking(np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]))
    window = rendering.Window((-0.5, 1.5, -0.5, 1.5), 100)
    image = rendering.draw(square, camera, window, rendering.Look())
    assert image.shape == (200, 200, 4)
    assert image[..., 3].sum() == pytest.approx(100 * 100, rel=0.02)
    away = rendering.Surface(points, np.arange(9)[None][:, rendering.TRANSPOSED], np.ones(9))
    assert rendering.draw(away, camera, window, rendering.Look())[..., 3].sum() == 0
