"""Noise estimated from residuals: floors, effective size, scatter and drift of repeats, on noise of known colour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.quick import P, colour, make_history, make_measurement, ramp
from tests.diagnosis.tables import table

from pliant.diagnosis.evidence_table import THRESHOLDS
from pliant.diagnosis.noise import (
    Drift,
    NoiseView,
    _between_run_scatter,
    drift_between,
    noise_view,
)
from pliant.diagnosis.verdict import judge
from pliant.measurements.effective import repeat_deviations
from pliant.measurements.floors import Floor
from pliant.measurements.highpass import CORRELATION
from pliant.measurements.repeats import RepeatGroup, repeat_groups
from pliant.records.measurement import Measurement

N = 6_000  # readings of a run, so that the estimated noise scatters by a few percent
SCALES = {"angle_rad": 1.0}


def three_sd(independent: float) -> float:
    """Return three relative standard deviations of a variance estimated from `independent` readings."""
    return 3.0 * np.sqrt(2.0 / independent)


def runs(conditions: int, repeats: int) -> Measurement:
    """Return levels that differ, each repeated."""
    clock, ramp_ = 0.5 * np.arange(N), np.linspace(0, 1, N)
    histories = [
        make_history(f"r{c}{k}", clock, P * (c + 1) / conditions * ramp_)
        for c in range(conditions)
        for k in range(repeats)
    ]
    return make_measurement(histories, [{"angle_rad": np.zeros(N)} for _ in histories])


def view(
    conditions: int = 6, repeats: int = 2, *, phi: float, offset: float = 0.0, missed: float = 0.0
) -> NoiseView:
    """Return the view of noise of unit standard deviation, an offset ± of repeats, and a model error equal in both."""
    rng = np.random.default_rng(5)
    measurement = runs(conditions, repeats)
    residuals = []
    for k in range(len(measurement.runs)):
        noise = colour(rng, N, 1.0, phi) + offset * (-1) ** k
        residuals.append({"angle_rad": noise + missed * np.sin(np.arange(N) / 20.0 + k // repeats)})
    return noise_view(measurement, residuals, SCALES, repeat_groups(measurement))


@pytest.mark.parametrize("phi", [0.0, 0.6, 0.9])
def test_effective_readings_follow_from_the_noise_colour(phi: float) -> None:
    """The summed correlation scatters by √(2 (2 M + 1) / n) for M lags (Madras and Sokal 1988, appendix C)."""
    free = 6 * N  # two repeats less their mean are one series
    lags = (
        -np.log(np.sqrt(free)) / np.log(phi) if phi else 1.0
    )  # beyond this lag the correlation is below the noise
    tolerance = 3.0 * np.sqrt(2.0 * (2.0 * lags + 1.0) / free)
    assert view(phi=phi).n_effective == pytest.approx(12 * N * (1 - phi) / (1 + phi), rel=tolerance)


def test_what_the_model_misses_is_no_noise() -> None:
    plain, missed = view(phi=0.6), view(phi=0.6, missed=5.0)
    assert missed.floor_square == pytest.approx(plain.floor_square, rel=1e-6)
    assert missed.n_effective == pytest.approx(plain.n_effective, rel=1e-6)


def test_offsets_between_repeats_are_slip() -> None:
    """Offsets of ± 3/√2 add 9 to the variance of 1; six differences give it 10² / (9²/6) degrees of freedom."""
    still, slipping = view(phi=0.6), view(phi=0.6, offset=3.0 / np.sqrt(2.0))
    assert still.between_run_scatter == 1.0
    assert still.floor_square == pytest.approx(1.0, rel=three_sd(6 * N * (1 - 0.36) / (1 + 0.36)))
    assert slipping.floor_square == pytest.approx(10.0, rel=0.02)
    lower = 1.0 - 1.6449 / np.sqrt(2.0 * 100.0 / (81.0 / 6.0))
    assert slipping.between_run_scatter == pytest.approx(np.sqrt(10.0) * lower, rel=0.02)
    assert slipping.n_effective == pytest.approx(12 / 0.9, rel=0.02)  # nine tenths never change within a run


def test_without_repeats_nothing_is_judged() -> None:
    alone = view(repeats=1, phi=0.0)
    assert not alone.judged and alone.between_run_scatter == 1.0
    assert alone.floor_square == pytest.approx(1.0, rel=three_sd(6 * N / CORRELATION))
    assert view(phi=0.0).judged


def test_the_floor_unit_is_the_scale() -> None:
    measurement, rng = runs(3, 2), np.random.default_rng(0)
    residuals = [{"angle_rad": rng.normal(0, 0.01, N)} for _ in measurement.runs]
    one, other = (
        noise_view(measurement, residuals, {"angle_rad": scale}, repeat_groups(measurement)).floor_square
        for scale in (0.01, 0.005)
    )
    assert one == pytest.approx(1.0, rel=three_sd(3 * N)) and other == pytest.approx(4.0 * one)


def test_repeats_sampled_differently_and_runs_without_readings() -> None:
    """They raise no error, and the noise of the other runs still counts."""
    histories = [ramp("a", 3e3, 0.02), ramp("b", 3e3, 0.01), ramp("c", 1e3, 0.02), ramp("d", 1e3, 0.02)]
    rng = np.random.default_rng(0)
    residuals = [{"angle_rad": rng.normal(size=len(h))} for h in histories]
    measurement = make_measurement(histories, residuals)
    residuals[1]["angle_rad"][:] = np.nan
    found = noise_view(measurement, residuals, SCALES, repeat_groups(measurement))
    white = sum(map(len, histories)) - len(histories[1])
    assert found.n_effective == pytest.approx(white, rel=3.0 * np.sqrt(6.0 / white))
    assert found.floor_square == pytest.approx(1.0, rel=three_sd(len(histories[2])))


@pytest.mark.parametrize("phi", [0.0, 0.9])
def test_a_run_that_was_done_once_counts_as_much_as_others(phi: float) -> None:
    rng, whole = np.random.default_rng(6), runs(6, 2)
    residuals = [{"angle_rad": colour(rng, N, 1.0, phi)} for _ in whole.runs]

    def counted(n: int) -> float:
        part = replace(whole, runs=whole.runs[:n])
        return noise_view(part, residuals[:n], SCALES, repeat_groups(part)).n_effective

    assert counted(11) == pytest.approx(1.1 * counted(10), rel=1e-6)


def test_scatter_between_runs_is_told_with_its_doubt() -> None:
    """Between over within, less 1.6449 standard errors of the floor, and never negative."""
    floor = Floor("angle_rad", "rad", 1.0, 3.0, None, 3.0, "repeats", 0.6, 2, 4, False)
    assert _between_run_scatter(floor) == pytest.approx(3.0 * (1.0 - 1.6449 * 0.2))
    assert _between_run_scatter(replace(floor, se=3.0)) == 0.0
    assert _between_run_scatter(replace(floor, between=None)) == 1.0


@pytest.mark.parametrize("repeats", [2, 3, 5])
def test_deviations_from_the_repeat_mean_keep_the_scatter_in_one_run(repeats: int) -> None:
    """Deviations from the mean keep n − 1 of n parts of the variance, so the factor √(n/(n−1)) restores it."""
    rng = np.random.default_rng(8)
    residuals = [{"angle_rad": rng.normal(0.0, 1.0, 20_000)} for _ in range(repeats)]
    found = repeat_deviations(residuals, [RepeatGroup(tuple(range(repeats)), False)])
    assert [np.std(run["angle_rad"]) for run in found] == pytest.approx(
        [1.0] * repeats, rel=three_sd(20_000) / 2
    )


# -- repeats that differ in proportion to what they read ----------------------------------------------

DRIFT_SIGMA, DRIFT_N = 0.01, 60


def drifting(change: float, offset: float = 0.0, conditions: int = 8, seed: int = 1) -> Measurement:
    """Return each condition twice, first all first runs; the second ones have an angle larger by the share `change`."""
    rng, arch = np.random.default_rng(seed), np.sin(np.linspace(0.0, np.pi, DRIFT_N))
    histories, readings = [], []
    for again in range(2):
        for k in range(conditions):
            angle = (0.2 + 0.05 * k) * arch * (1.0 + again * change) + offset * rng.standard_normal()
            readings.append({"angle_rad": angle + DRIFT_SIGMA * rng.standard_normal(DRIFT_N)})
            histories.append(make_history(f"r{again}{k}", np.arange(float(DRIFT_N)), 1e3 * (k + 1) * arch))
    return make_measurement(histories, readings)


def find_drift(measurement: Measurement, explained: bool = False) -> Drift | None:
    residuals = [{"angle_rad": run.outputs["angle_rad"] * (not explained)} for run in measurement.runs]
    return drift_between(measurement, residuals, {"angle_rad": DRIFT_SIGMA}, repeat_groups(measurement))


def test_a_scale_change_is_identified_with_its_size() -> None:
    measurement = drifting(0.1)
    drift = find_drift(measurement)
    assert drift is not None
    assert drift.share == pytest.approx(0.1 / 1.05, rel=0.05)  # of the mean of both
    angles = [run.outputs["angle_rad"] for run in measurement.runs]
    spread = np.concatenate([angle - angle.mean() for angle in angles]).std()
    assert drift.size == pytest.approx(drift.share * spread / DRIFT_SIGMA, rel=0.05)


def test_noise_offsets_and_what_a_model_explains_are_no_drift_and_few_groups_tell_nothing() -> None:
    assert all(find_drift(drifting(0.0, offset=0.03, seed=seed)) is None for seed in range(5))
    assert find_drift(drifting(0.1), explained=True) is None
    assert find_drift(drifting(0.1, conditions=4)) is None


@pytest.mark.parametrize(("size", "verdict"), [(2.0, "not_repeatable"), (0.5, "missing_effect")])
def test_a_large_drift_is_the_verdict_and_a_small_one_is_not(size: float, verdict: str) -> None:
    plain = table({(): 3.0, ("a",): 1.0, ("b",): 2.9})
    noise = replace(plain.noise, drift=Drift("angle_rad", -0.04, size * THRESHOLDS.drift, -9.0))
    judged = judge(replace(plain, noise=noise), THRESHOLDS, 2)
    assert judged.verdict == verdict
    assert ("4.0% less angle_rad" in " ".join(judged.reasons)) is (verdict == "not_repeatable")
