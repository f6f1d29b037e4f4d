"""Noise as residuals show it: floors, effective size, slip between repeats, on noise of known colour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.diagnosis.quick import P, colour, measurement_of, ramp, run_of

from pliant.diagnosis.noise import NoiseView, _between_run_scatter, _deviations, noise_view
from pliant.measurements.floors import Floor
from pliant.measurements.repeats import RepeatGroup, repeat_groups
from pliant.records.measurement import Measurement

N = 400


def runs(conditions: int, repeats: int) -> Measurement:
    """Levels that differ, each repeated."""
    histories = [
        run_of(f"r{c}{k}", 0.5 * np.arange(N), P * (c + 1) / conditions * np.linspace(0, 1, N))
        for c in range(conditions)
        for k in range(repeats)
    ]
    return measurement_of(histories, [{"angle_rad": np.zeros(N)} for _ in histories])


def view(
    conditions: int = 6, repeats: int = 2, *, phi: float, offset: float, missed: float = 0.0
) -> NoiseView:
    """Noise of unit standard deviation, offsets between runs, and what the model misses, alike in repeats."""
    rng = np.random.default_rng(5)
    measurement = runs(conditions, repeats)
    residuals = [
        {
            "angle_rad": colour(rng, N, 1.0, phi)
            + rng.normal(0, offset)
            + missed * np.sin(np.arange(N) / 20.0 + k // repeats)
        }
        for k in range(len(measurement.runs))
    ]
    return noise_view(measurement, residuals, {"angle_rad": 1.0}, repeat_groups(measurement))


@pytest.mark.parametrize("phi", [0.0, 0.6, 0.9])
def test_effective_readings_are_those_of_the_noise_s_colour(phi: float) -> None:
    wanted = 12 * N * (1 - phi) / (1 + phi)
    assert view(phi=phi, offset=0.0).n_effective == pytest.approx(wanted, rel=0.3)


def test_what_the_model_misses_is_no_noise() -> None:
    plain, missed = view(phi=0.6, offset=0.0), view(phi=0.6, offset=0.0, missed=5.0)
    assert missed.floor_square == pytest.approx(plain.floor_square, rel=1e-6)
    assert missed.n_effective == pytest.approx(plain.n_effective, rel=1e-6)


def test_offsets_between_repeats_are_slip() -> None:
    still, slipping = view(phi=0.6, offset=0.0), view(phi=0.6, offset=3.0)
    assert 1.0 <= still.between_run_scatter < 1.3
    assert slipping.between_run_scatter == pytest.approx(np.sqrt(10.0), rel=0.4)
    assert slipping.floor_square == pytest.approx(10.0, rel=0.7)
    assert slipping.n_effective < 0.2 * still.n_effective


def test_without_repeats_nothing_is_judged() -> None:
    alone = view(conditions=6, repeats=1, phi=0.0, offset=0.0)
    assert not alone.judged
    assert alone.between_run_scatter == 1.0
    assert alone.floor_square == pytest.approx(1.0, rel=0.15)
    assert view(phi=0.0, offset=0.0).judged


def test_the_unit_of_the_floor_is_the_scale() -> None:
    measurement = runs(3, 2)
    rng = np.random.default_rng(0)
    residuals = [{"angle_rad": rng.normal(0, 0.01, N)} for _ in measurement.runs]
    groups = repeat_groups(measurement)
    one = noise_view(measurement, residuals, {"angle_rad": 0.01}, groups)
    other = noise_view(measurement, residuals, {"angle_rad": 0.005}, groups)
    assert one.floor_square == pytest.approx(1.0, rel=0.1)
    assert other.floor_square == pytest.approx(4.0 * one.floor_square)


def test_repeats_sampled_differently_and_runs_without_readings() -> None:
    """No crash, and the noise of the others still counts."""
    histories = [ramp("a", 3e3, 0.5), ramp("b", 3e3, 0.25), ramp("c", 1e3, 0.5), ramp("d", 1e3, 0.5)]
    rng = np.random.default_rng(0)
    residuals = [{"angle_rad": rng.normal(size=len(h))} for h in histories]
    measurement = measurement_of(histories, residuals)
    residuals[1]["angle_rad"][:] = np.nan
    found = noise_view(measurement, residuals, {"angle_rad": 1.0}, repeat_groups(measurement))
    assert 10 < found.n_effective <= sum(map(len, histories)) - len(histories[1])
    assert found.floor_square == pytest.approx(1.0, rel=0.5)


@pytest.mark.parametrize("phi", [0.0, 0.9])
def test_a_run_that_was_done_once_counts_as_much_as_others(phi: float) -> None:
    rng = np.random.default_rng(6)
    whole = runs(6, 2)
    residuals = [{"angle_rad": colour(rng, N, 1.0, phi)} for _ in whole.runs]
    one_less = replace(whole, runs=whole.runs[:-1])
    scales = {"angle_rad": 1.0}
    pairs_only = replace(whole, runs=whole.runs[:-2])

    def counted(measurement: Measurement) -> float:
        n = len(measurement.runs)
        return noise_view(measurement, residuals[:n], scales, repeat_groups(measurement)).n_effective

    assert counted(one_less) == pytest.approx(1.1 * counted(pairs_only), rel=1e-6)


def test_scatter_between_runs_is_told_with_its_doubt() -> None:
    """Between over within, less 1.6449 standard errors of the floor; never below nothing."""
    floor = Floor("angle_rad", "rad", 1.0, 3.0, None, 3.0, "repeats", 0.6, 2, 4, False)
    assert _between_run_scatter(floor) == pytest.approx(3.0 * (1.0 - 1.6449 * 0.2))
    assert _between_run_scatter(replace(floor, se=3.0)) == 0.0
    assert _between_run_scatter(replace(floor, between=None)) == 1.0


@pytest.mark.parametrize("repeats", [2, 3, 5])
def test_deviations_from_the_mean_of_repeats_keep_the_scatter_of_one_run(repeats: int) -> None:
    """n − 1 of n parts of the variance are left beside the mean, so √(n/(n−1)) makes them whole."""
    rng = np.random.default_rng(8)
    residuals = [{"angle_rad": rng.normal(0.0, 1.0, 20_000)} for _ in range(repeats)]
    found = _deviations(residuals, [RepeatGroup(tuple(range(repeats)), False)])
    assert [np.std(run["angle_rad"]) for run in found] == pytest.approx([1.0] * repeats, rel=0.02)
