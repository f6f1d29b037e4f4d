"""A target that no chain of a search is long enough for is refused before the search, with both lengths."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from pliant import api
from pliant.errors import UserError
from pliant.pipeline.study import chain_length_m
from pliant_plugins.tasks.follow_shape import FollowShape, FollowShapeConfig

# √((2π · 18)² + 60²) mm = 128.03 mm
HELIX = {"radius": "18 mm", "height": "60 mm"}


def task(target: dict[str, Any]) -> FollowShape:
    return FollowShape(FollowShapeConfig.model_validate({"pressure": "10 kPa", "target": target}))


def test_a_target_within_reach_is_taken() -> None:
    task(HELIX).check_reach(0.129)
    task(HELIX).check_reach(0.086)


def test_a_target_out_of_reach_is_refused_with_both_lengths() -> None:
    with pytest.raises(UserError, match=r"128 mm long, and the longest chain .* 85 mm"):
        task(HELIX).check_reach(0.085)


def test_other_tasks_ask_for_nothing() -> None:
    from pliant_plugins.tasks.ramp import FreeBending, FreeBendingConfig

    FreeBending(FreeBendingConfig.model_validate({"pressure": "10 kPa"})).check_reach(0.0)


def opened(tmp_path: Path, **blocks: Any) -> api.OpenStudy:
    path = tmp_path / "study.yaml"
    path.write_text(json.dumps({"pliant": 1, "name": "long", **blocks}))
    return api.open_study(path, store=tmp_path / "store")


def test_the_length_of_a_chain_needs_no_law(tmp_path: Path) -> None:
    family = {
        "kind": "bellow_bending",
        "inner_radius": "2 mm",
        "average_radius": "6 mm",
        "wall": "1.5 mm",
        "module_length": "11 mm",
    }
    segments = [
        {"rigid": {"length": "6.5 mm"}},
        {"modules": 4},
        {"modules": 2, "family": {"module_length": "9 mm"}},
        {"rigid": {"module_lengths": 1, "length": "3 mm", "section": "module"}},
    ]
    study = opened(tmp_path, family=family, chain={"segments": segments})
    assert chain_length_m(study.bench, study.study) == pytest.approx(0.0065 + 0.044 + 0.018 + 0.012)


def test_the_length_is_that_of_the_chain_that_is_built(tmp_path: Path) -> None:
    law = {
        "kind": "polynomial",
        "form": "study",
        "coefficients": {"k_n": 1e-6, "m_a": 0, "m_e": 0, "b_e": 0.03},
    }
    chain = {
        "module_length": "11 mm",
        "segments": [
            {"modules": 3},
            {"modules": 2, "module_length": "7 mm"},
            {"rigid": {"module_lengths": 0.5}},
        ],
    }
    study = opened(tmp_path, surrogate=law, chain=chain, task={"kind": "free_bending", "pressure": 0})
    built = api.simulate(study).chain
    assert built is not None
    assert chain_length_m(study.bench, study.study) == pytest.approx(built.length_m)
