"""Where a target helix stands: its axis or its first tangent along the base's axis."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from pliant_plugins.tasks import curves
from pliant_plugins.tasks.follow_shape import TargetConfig

HELIX = {"radius": "18 mm", "height": "60 mm"}


def target(**keys) -> np.ndarray:
    return TargetConfig.model_validate({**HELIX, **keys}).curve()


def torsion_sign(points: np.ndarray) -> float:
    a, b, c = (points[k + 1] - points[k] for k in (0, 200, 400))
    return float(np.sign(np.linalg.det([a, b, c])))


def test_a_helix_begins_62_degrees_off_its_axis() -> None:
    first = target()[1] - target()[0]
    assert np.degrees(np.arccos(first[0] / np.linalg.norm(first))) == pytest.approx(
        np.degrees(np.arctan2(2 * np.pi * 18, 60)), abs=0.01
    )


@pytest.mark.parametrize("hand", ["right", "left"])
def test_with_its_tangent_along_the_base_it_is_the_same_curve(hand) -> None:
    axis, tangent = target(handedness=hand), target(handedness=hand, start="tangent")
    first = tangent[1] - tangent[0]
    np.testing.assert_allclose(first[1:], 0.0, atol=1e-15)
    assert first[0] > 0
    picked = slice(None, None, 100)
    apart = [np.linalg.norm(p[picked, None] - p[None, picked], axis=-1) for p in (axis, tangent)]
    np.testing.assert_allclose(apart[1], apart[0], atol=1e-15)
    assert torsion_sign(axis) == torsion_sign(tangent) == (1.0 if hand == "right" else -1.0)


def test_points_that_leave_along_x_stay() -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    np.testing.assert_array_equal(curves.leaving_along_x(points), points)


def test_a_file_stands_as_it_is(tmp_path) -> None:
    with pytest.raises(ValidationError, match="'start: tangent' is for a helix"):
        TargetConfig.model_validate({"points": tmp_path / "curve.csv", "start": "tangent"})
