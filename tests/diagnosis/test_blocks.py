"""Which of two models predicts better, from the squares of blocks."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.diagnosis.unseen import block_squares, prediction_gain


def test_blocks_hold_all_squares_and_readings_that_lack_count_none() -> None:
    rng = np.random.default_rng(0)
    runs = tuple({"angle_rad": rng.normal(size=n), "tip_x_m": rng.normal(size=n)} for n in (50, 31))
    runs[1]["angle_rad"][3:9] = np.nan
    scales = {"angle_rad": 0.5, "tip_x_m": 2.0}
    blocks = block_squares(runs, scales)
    whole = sum(np.nansum((run[name] / scale) ** 2) for run in runs for name, scale in scales.items())
    assert blocks.sum() == pytest.approx(whole) and len(blocks) == 24


def test_a_gain_is_as_sure_as_the_t_of_a_paired_test() -> None:
    rng = np.random.default_rng(1)
    before, after = rng.chisquare(5, 24) + 1.0, rng.chisquare(5, 24)
    gain, d = prediction_gain(before, after), before - after
    assert gain.sure == pytest.approx(d.mean() / (d.std(ddof=1) / np.sqrt(24)))
    assert gain.share == pytest.approx(1.0 - after.sum() / before.sum())
    assert prediction_gain(after, before).sure == pytest.approx(-gain.sure)
    assert prediction_gain(before, before).sure == 0.0


def test_of_models_that_differ_by_chance_few_are_sure() -> None:
    rng = np.random.default_rng(2)
    sure = [prediction_gain(*rng.chisquare(10, (2, 24))).sure > 2.5 for _ in range(2000)]
    assert np.mean(sure) < 0.02
