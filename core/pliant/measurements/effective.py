"""Effective sample size: the number of independent readings equivalent to an autocorrelated residual."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.measurements.repeats import RepeatGroup
from pliant.records.design import Array
from pliant.records.measurement import MeasuredRun, Measurement

MOST_SLOTS = 1 << 21  # lags that a run is sorted into


@dataclass(frozen=True, eq=False)
class Autocorrelation:
    """Autocorrelation pooled over runs, up to the lag where noise dominates.

    Attributes:
        rho: (lags,) correlation at lags 1, 2, … steps.
        pairs: (lags,) number of pairs of readings that far apart.
        n: readings.
        excess: correlation summed over pairs of readings within one step, both orders.
        slot_s: the step.
    """

    rho: Array
    pairs: Array
    n: int
    excess: float
    slot_s: float

    @property
    def time_scale(self) -> float:
        """Return n / n_eff for a mean: 1 + 2 Σ (pairs/n) ρ."""
        return 1.0 + (self.excess + 2.0 * float(self.pairs @ self.rho)) / self.n

    @property
    def square_scale(self) -> float:
        """Return n / n_eff for a variance: 1 + 2 Σ (pairs/n) ρ² (Bartlett)."""
        return 1.0 + 2.0 * float(self.pairs @ self.rho**2) / self.n


def independent_readings(
    measurement: Measurement,
    residuals: Sequence[Mapping[str, Array]],
    names: Sequence[str],
    groups: Sequence[RepeatGroup],
) -> dict[str, float]:
    """Return the number of independent readings of each output in a model's residuals.

    The common part of repeats is not noise and is removed first; runs without repeats, if others have some, get as
    many per second as those. Without any repeats a smooth error of the model counts as noise.

    Args:
        measurement: the runs.
        residuals: per run by output (t,).
        names: of the outputs.
        groups: repeats.
    """
    deviations = repeat_deviations(residuals, groups)
    counted = effective_samples(deviations, measurement)
    return {
        name: _extrapolate_to_all_runs(name, counted[name], residuals, deviations, measurement)
        for name in names
    }


def effective_samples(residuals: Sequence[Mapping[str, Array]], measurement: Measurement) -> dict[str, float]:
    """Return the effective number of readings of each output.

    n_eff = n / (1 + 2 Σ_k (n_k / n) ρ_k), with n_k the pairs at lag k within runs and ρ_k their correlation
    about the mean of all runs, summed as Geyer's initial monotone positive sequence (Geyer 1992, "Practical
    Markov chain Monte Carlo", section 3.3). Lags are times, so gaps and unequal steps are accounted for.
    A residual that is a constant offset of each run counts as one reading per run.

    Args:
        residuals: for each run (t,) by output, NaN where nothing was read.
        measurement: the runs, for their clocks.

    Returns:
        by output, between the number of runs with readings and the number of readings; 0 without readings.
    """
    found = {}
    for name in measurement.outputs:
        series = [np.asarray(run[name], float) for run in residuals]
        there = [int(np.isfinite(values).sum()) for values in series]
        n, runs = sum(there), sum(map(bool, there))
        scale = autocorrelation([run_clock(run) for run in measurement.runs], series).time_scale
        found[name] = float(np.clip(n / scale if scale > 0 else n, runs, n))
    return found


def autocorrelation(clocks: Sequence[Array], series: Sequence[Array]) -> Autocorrelation:
    """Return the autocorrelation within runs, pooled, truncated by Geyer's rule.

    Args:
        clocks: (t,) increasing, for each run.
        series: (t,) for each run, NaN where missing.
    """
    there = [np.isfinite(values) for values in series]
    clocks = [clock[good] for clock, good in zip(clocks, there, strict=True)]
    kept = [values[good] for values, good in zip(series, there, strict=True)]
    n = sum(values.size for values in kept)
    mean = sum(float(values.sum()) for values in kept) / max(n, 1)
    square = sum(float(((values - mean) ** 2).sum()) for values in kept)
    # the usual step between readings, coarser if the longest run would have too many
    steps, slot = [np.diff(clock) for clock in clocks if clock.size > 1], 1.0
    if steps:
        longest = max(float(clock[-1] - clock[0]) for clock in clocks if clock.size)
        slot = max(float(np.median(np.concatenate(steps))), longest / MOST_SLOTS)
    if n < 3 or square <= 0:
        return Autocorrelation(np.zeros(0), np.zeros(0), max(n, 1), 0.0, slot)
    sums = [
        _pooled(clock, values - mean, slot) for clock, values in zip(clocks, kept, strict=True) if values.size
    ]
    length = max(products.size for products, _ in sums)
    products, pairs = np.zeros((2, length))
    for product, count in sums:
        products[: product.size] += product
        pairs[: count.size] += count
    rho = np.divide(products, pairs, out=np.zeros(length), where=pairs > 0.5) / (square / n)
    cut = _geyer(rho[1:], pairs[1:])
    excess = (products[0] - square) / (square / n)
    return Autocorrelation(cut, pairs[1 : cut.size + 1], n, excess, slot)


def run_clock(run: MeasuredRun) -> Array:
    """Return (t,) seconds from the run's start; sample numbers if it has no clock."""
    time_s = run.history.time_s
    return np.arange(len(run), dtype=float) if time_s is None else time_s - time_s[0]


def _pooled(clock: Array, values: Array, slot: float) -> tuple[Array, Array]:
    """Return sum of products and number of pairs at each lag, in slots; lag 0 includes each reading with itself."""
    place = np.rint((clock - clock[0]) / slot).astype(int)
    size = int(place[-1]) + 1
    total = np.bincount(place, values, size).astype(np.float64)
    count = np.bincount(place, minlength=size).astype(np.float64)
    padded = 1 << (2 * size - 1).bit_length()

    def correlated(x: Array) -> Array:
        spectrum = np.fft.rfft(x, padded)
        return np.asarray(np.fft.irfft(np.abs(spectrum) ** 2, padded)[:size])

    return correlated(total), np.rint(correlated(count))


def _geyer(rho: Array, pairs: Array) -> Array:
    """Return lags 1… up to the first pair sum that is not positive, with pair sums made non-increasing.

    Pairs are (0, 1), (2, 3), …; lags without readings take the value of their partner.
    """
    whole = np.concatenate([[1.0], rho])
    seen = np.concatenate([[True], pairs > 0.5])
    even = len(whole) // 2 * 2
    couples, known = whole[:even].reshape(-1, 2), seen[:even].reshape(-1, 2)
    sums = np.where(known.any(axis=1), couples.sum(axis=1) * 2 / np.maximum(known.sum(axis=1), 1), np.nan)
    ends = np.flatnonzero(sums <= 0)
    end = int(ends[0]) if ends.size else len(sums)
    falling = np.fmin.accumulate(np.where(np.isnan(sums[:end]), np.inf, sums[:end]))
    shrink = np.divide(
        falling, sums[:end], out=np.ones(end), where=np.isfinite(sums[:end]) & (sums[:end] > 0)
    )
    shrunk = np.minimum(couples[:end] * shrink[:, None], couples[:end])
    return shrunk.reshape(-1)[1:]


def _extrapolate_to_all_runs(
    name: str,
    counted: float,
    residuals: Sequence[Mapping[str, Array]],
    deviations: Sequence[Mapping[str, Array]],
    measurement: Measurement,
) -> float:
    """Return the independent readings of all runs, from the count of those in runs with repeats.

    A run without repeats has as many per second as the others (per reading without clocks), and at most as many as
    readings.
    """
    rests, seconds, used = [], 0.0, 0
    for run, all_of, kept in zip(measurement.runs, residuals, deviations, strict=True):
        n, m = (int(np.isfinite(values[name]).sum()) for values in (all_of, kept))
        clock = run_clock(run)
        span = float(clock[-1] - clock[0])
        if m:
            seconds, used = seconds + span, used + m
        elif n:
            rests.append((n, span))
    if not rests or not used:
        return counted
    if seconds <= 0.0:
        return counted * (1.0 + sum(n for n, _ in rests) / used)
    return counted + sum(min(float(n), counted * span / seconds) for n, span in rests)


def repeat_deviations(
    residuals: Sequence[Mapping[str, Array]], groups: Sequence[RepeatGroup]
) -> list[dict[str, Array]]:
    """Return residuals minus the mean of their repeats; runs without repeats are unchanged if there are no others.

    Their correlation in time is that of the noise, independent of the model's error. A group whose runs differ in
    sampling is unchanged.
    """
    found = [dict(run) for run in residuals]
    repeated: set[int] = set()
    for group in groups:
        lengths = {len(next(iter(residuals[index].values()))) for index in group.runs}
        if len(lengths) > 1:
            continue
        repeated |= set(group.runs)
        for name in residuals[0]:
            rows = np.array([residuals[index][name] for index in group.runs])
            there = np.isfinite(rows).sum(axis=0)
            mean = np.where(there > 1, np.nansum(rows, axis=0) / np.maximum(there, 1), np.nan)
            for index, row in zip(group.runs, rows, strict=True):
                found[index][name] = (row - mean) * np.sqrt(len(rows) / (len(rows) - 1))
    if repeated:
        for index in set(range(len(found))) - repeated:
            found[index] = {name: np.full_like(row, np.nan) for name, row in found[index].items()}
    return found
