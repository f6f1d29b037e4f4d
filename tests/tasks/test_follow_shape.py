"""Targets of follow_shape: the position of a helix, unreachable targets, the length of a chain."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from pliant import api
from pliant.errors import UserError
from pliant.pipeline.segments import chain_length_m
from pliant_plugins.families.reference import FINGER
from pliant_plugins.tasks import curves
from pliant_plugins.tasks.follow_shape import FollowShape, FollowShapeConfig, TargetConfig
from pliant_plugins.tasks.ramp import FreeBending, FreeBendingConfig

HELIX = {"radius": "18 mm", "height": "60 mm"}


def target(**keys: Any) -> np.ndarray:
    return TargetConfig.model_validate({**HELIX, **keys}).curve()


def torsion_sign(points: np.ndarray) -> float:
    return float(np.sign(np.linalg.det([points[k + 1] - points[k] for k in (0, 200, 400)])))


def test_a_helix_begins_62_degrees_off_its_axis() -> None:
    first = target()[1] - target()[0]
    off = np.degrees(np.arccos(first[0] / np.linalg.norm(first)))
    assert off == pytest.approx(np.degrees(np.arctan2(2 * np.pi * 18, 60)), abs=0.01)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_with_its_tangent_along_the_base_it_is_the_same_curve(hand) -> None:
    axis, tangent = target(handedness=hand), target(handedness=hand, start="tangent")
    first = tangent[1] - tangent[0]
    np.testing.assert_allclose(first[1:], 0.0, atol=1e-15)
    assert first[0] > 0
    apart = [np.linalg.norm(p[::100, None] - p[None, ::100], axis=-1) for p in (axis, tangent)]
    np.testing.assert_allclose(apart[1], apart[0], atol=1e-15)
    assert torsion_sign(axis) == torsion_sign(tangent) == (1.0 if hand == "right" else -1.0)


def test_points_that_leave_along_x_and_files_stand_as_they_are(tmp_path) -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    np.testing.assert_array_equal(curves.leaving_along_x(points), points)
    with pytest.raises(ValidationError, match="'start: tangent' is for a helix"):
        TargetConfig.model_validate({"points": tmp_path / "curve.csv", "start": "tangent"})


def test_an_unreachable_target_is_refused_with_both_lengths() -> None:
    """√((2π · 18)² + 60²) mm = 128.03 mm."""
    task = FollowShape(FollowShapeConfig.model_validate({"pressure": "10 kPa", "target": HELIX}))
    task.check_reach(0.086)
    with pytest.raises(UserError, match=r"128 mm long, and the longest chain .* 85 mm"):
        task.check_reach(0.085)
    FreeBending(FreeBendingConfig.model_validate({"pressure": "10 kPa"})).check_reach(0.0)


def opened(tmp_path: Path, overrides: tuple[str, ...] = (), **blocks: Any) -> api.OpenStudy:
    path = tmp_path / "study.yaml"
    path.write_text(json.dumps({"pliant": 1, "name": "long", **blocks}))
    return api.open_study(path, overrides, store=tmp_path / "store")


LAW = {
    "kind": "polynomial",
    "form": "study",
    "coefficients": {"k_n": 1.6e-6, "m_a": 0, "b_a": 0, "m_e": 0, "b_e": 0.05},
}


def test_the_base_rolls_under_a_target_that_follows_its_direction(tmp_path) -> None:
    base = {"direction": [0.8, 0, -0.6], "roll": 0}
    chain = {"modules": 4, "module_length": "11 mm", "gravity": [0, 0, 0], "base": base}
    task = {"kind": "follow_shape", "pressure": 0, "steps": 1, "target": HELIX}

    def points(alignment: str, roll: int) -> np.ndarray:
        changes = (f"task.alignment={alignment}", f"chain.base.roll={roll}")
        done = api.simulate(opened(tmp_path, changes, surrogate=LAW, chain=chain, task=task))
        return np.array(done.engines[0].result.metrics["target_points_m"])

    runs = {key: points(*key) for key in (("base", 0), ("base", 1), ("direction", 0), ("direction", 1))}
    np.testing.assert_allclose(runs["direction", 1], runs["direction", 0], atol=1e-12)
    np.testing.assert_allclose(runs["base", 0], runs["direction", 0], atol=1e-12)
    assert np.abs(runs["base", 1] - runs["base", 0]).max() > 0.01


def test_the_chain_length_needs_no_law(tmp_path: Path) -> None:
    segments = [
        {"rigid": {"length": "6.5 mm"}},
        {"modules": 4},
        {"modules": 2, "family": {"module_length": "9 mm"}},
        {"rigid": {"module_lengths": 1, "length": "3 mm", "section": "module"}},
    ]
    study = opened(tmp_path, family={"kind": "bellow_bending", **FINGER}, chain={"segments": segments})
    assert chain_length_m(study.context, study.study) == pytest.approx(0.0065 + 0.044 + 0.018 + 0.012)


def test_the_length_equals_the_chain_that_is_built(tmp_path: Path) -> None:
    segments = [
        {"modules": 3},
        {"modules": 2, "module_length": "7 mm"},
        {"rigid": {"module_lengths": 0.5}},
    ]
    chain = {"module_length": "11 mm", "segments": segments}
    study = opened(tmp_path, surrogate=LAW, chain=chain, task={"kind": "free_bending", "pressure": 0})
    built = api.simulate(study).chain
    assert built is not None
    assert chain_length_m(study.context, study.study) == pytest.approx(built.length_m)
