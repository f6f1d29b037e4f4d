"""Drawn laws on the page of a run: the cloud, its intervals, failed runs; stored in the run's folder."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.report.pages import words

from pliant.report.render import page
from pliant.report.run import run_document, warnings
from pliant.report.tip_spread import tip_chart, uncertainty_section


def told(tip: np.ndarray, failed: int = 0) -> dict[str, Any]:
    """Return tips in a line along x, a tenth of that along z, in the record that `spread` writes."""
    along = np.linspace(-1e-3, 1e-3, 21)
    tips = tip + np.stack([along, 0 * along, 0.1 * along], axis=1)
    half = np.array([9e-4, 0, 9e-5])
    spreads = {"tip_x_m": (0.0, 1.0), "bend_angle_rad": (1.0, 1.1), "unsettled_levels": (0.0, 0.0)}
    metrics = {name: {"low": low, "high": high, "sd": high - low} for name, (low, high) in spreads.items()}
    tells = {
        "tips_m": tips,
        "tip_mean_m": tips.mean(axis=0),
        "tip_low_m": tip - half,
        "tip_high_m": tip + half,
    }
    counts = {"level": 0.9, "samples": 21 + failed, "failed": failed}
    return {**counts, **tells, "tip_radius_m": 9.1e-4, "metrics": metrics}


@pytest.fixture
def run(kit: SimpleNamespace) -> Any:
    whole = kit.full_run()
    bodiless = replace(whole.designs[0], fem=kit.dataset(shapes=False))
    return replace(whole, designs=(bodiless,), uncertainty=told(whole.engines[0].result.final.tip_m))


def test_intervals_equal_the_record(run: Any) -> None:
    section = uncertainty_section(run)
    assert section is not None and len(section.pictures) == 1
    assert "90 % of 21 runs in quasistatic" in section.text[0] and "910 µm" in section.text[0]
    rows = {row[0]: row[1:] for row in section.tables[0].rows}
    tip = 1e3 * run.engines[0].result.final.tip_m
    assert [float(v.replace("−", "-")) for v in rows["tip x (mm)"][:3]] == pytest.approx(
        [tip[0] - 0.9, tip[0], tip[0] + 0.9], abs=1e-4
    )
    assert rows["tip x (mm)"][3] == "900 µm"
    assert rows["bend angle (°)"][0] == "57.296" and rows["bend angle (°)"][2] == "63.025"
    assert len(rows) == 4  # the tip is listed once, constant metrics are not listed


def test_the_page_holds_the_cloud_and_says_what_did_not_settle(run: Any) -> None:
    run = replace(run, uncertainty=told(run.engines[0].result.final.tip_m, failed=3))
    made = page(run_document(run))
    text = words(made.html)
    assert "tip_cloud" in made.pictures
    assert "From the laws' error bars to the tip" in text
    assert "3 of 24 runs with laws drawn from their error bars did not settle." in text


def test_without_a_settled_run_there_is_a_sentence_and_no_picture(run: Any) -> None:
    nothing = replace(run, uncertainty={"level": 0.9, "samples": 8, "failed": 8, "tips_m": np.zeros((0, 3))})
    section = uncertainty_section(nothing)
    assert section is not None and not section.pictures and "None of 8 runs" in section.text[0]
    assert tip_chart(nothing.uncertainty, np.zeros(3)) is None
    unasked = replace(run, uncertainty=None)
    assert len(warnings(nothing)) == len(warnings(unasked)) + 1
    assert uncertainty_section(unasked) is None
