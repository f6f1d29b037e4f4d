"""The invented joint with opposed chambers: its script reproduces the recording, and the loop reaches the noise."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from pliant import api

EXAMPLE = Path(__file__).parents[2] / "examples" / "opposed_chambers"
LOOK_ALIKES = ("supply_lag", "viscous_damping", "viscoelastic", "actuation_gain")


def test_the_recording_is_what_the_script_makes(tmp_path: Path) -> None:
    made = runpy.run_path(str(EXAMPLE / "make_bench.py"))
    again = tmp_path / "bench.csv"
    made["main"].__globals__["FILE"] = again
    made["main"]()
    assert again.read_text() == (EXAMPLE / "bench.csv").read_text()


def test_compare_sees_more_than_noise(tmp_path: Path) -> None:
    opened = api.open_study(EXAMPLE / "joint.yaml", store=tmp_path / "store")
    found = api.compare(opened)
    assert found.judged
    assert found.rmse_over_floor > 2


@pytest.mark.slow
def test_improve_finds_both_and_ends_at_the_noise(tmp_path: Path) -> None:
    opened = api.open_study(EXAMPLE / "joint.yaml", store=tmp_path / "store")
    found = api.improve(opened, kinds=LOOK_ALIKES)
    assert {kind for step in found.steps for kind in step.added} == {"supply_lag", "viscoelastic"}
    assert found.stop == "law_off"  # the hidden elastic moment has a term that the stated law lacks
    assert found.steps[0].locked.over_floor > 1.7
    assert found.steps[-1].locked.over_floor < 1.15
    assert {len(found.locked.runs), len(found.locked.training.runs)} == {2, 8}
