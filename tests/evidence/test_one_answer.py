"""compare and diagnose give the same numbers for the same recording."""

from dataclasses import replace

import numpy as np
import pytest
from tests.evidence.test_compare import bench

from pliant.diagnosis.noise import noise_view
from pliant.evidence.comparison import compare
from pliant.measurements.repeats import repeat_groups


@pytest.mark.parametrize("which", ["repeats", "one large loop", "offsets between runs"])
def test_readings_are_worth_the_same_in_both(which) -> None:
    """Compare once stated 843 effective readings and diagnose 6, as compare used the noise of neighbours alone."""
    measurement, predicted = bench(0)
    if which == "one large loop":
        measurement, predicted = replace(measurement, runs=measurement.runs[:1]), predicted[:1]
        loop = np.linspace(0.0, 2.0 * np.pi, len(measurement.runs[0]))
        predicted = [{"angle_rad": predicted[0]["angle_rad"] + 0.05 * np.sin(loop)}]
    if which == "offsets between runs":
        shift = np.random.default_rng(3).normal(0.0, 0.05, len(predicted))
        predicted = [{"angle_rad": one["angle_rad"] + s} for one, s in zip(predicted, shift, strict=True)]
    found = compare(measurement, predicted)
    residuals = [
        {"angle_rad": run.outputs["angle_rad"] - one["angle_rad"]}
        for run, one in zip(measurement.runs, predicted, strict=True)
    ]
    noise = noise_view(measurement, residuals, {"angle_rad": 1.0}, repeat_groups(measurement))
    assert found.n_effective == pytest.approx(noise.n_effective)
    if which != "repeats":
        assert found.n_effective < 0.1 * found.n_samples
