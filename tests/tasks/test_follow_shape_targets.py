"""Where a target helix stands: its axis or its first tangent along the base's axis."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from pliant import api
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


STUDY = """\
pliant: 1
name: rolled
surrogate: {kind: polynomial, form: study, coefficients: {k_n: 1.6e-6, m_a: 0, b_a: 0, m_e: 0, b_e: 0.05}}
chain: {modules: 4, module_length: 11 mm, gravity: [0, 0, 0], base: {direction: [0.8, 0, -0.6], roll: 0}}
task: {kind: follow_shape, pressure: 0 Pa, steps: 1, target: {radius: 18 mm, height: 60 mm}, alignment: direction}
"""


def followed(path, *overrides: str) -> dict:
    path.write_text(STUDY)
    done = api.simulate(api.open_study(path, overrides, store=path.parent / "store"))
    result = done.engines[0].result
    assert result is not None
    return dict(result.metrics)


def test_the_base_rolls_under_a_target_that_follows_its_direction(tmp_path) -> None:
    runs = {
        (alignment, roll): np.array(
            followed(tmp_path / "s.yaml", f"task.alignment={alignment}", f"chain.base.roll={roll}")[
                "target_points_m"
            ]
        )
        for alignment in ("base", "direction")
        for roll in (0, 1)
    }
    np.testing.assert_allclose(runs["direction", 1], runs["direction", 0], atol=1e-12)
    np.testing.assert_allclose(runs["base", 0], runs["direction", 0], atol=1e-12)
    assert np.abs(runs["base", 1] - runs["base", 0]).max() > 0.01
