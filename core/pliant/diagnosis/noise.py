"""How noisy the readings are once a model is taken off: floors, effective size, repeatability, drift.

Drift: repeats that differ in proportion to what they read, because something changes over the session or the
specimens differ. An offset between repeats is seen as scatter. A change of scale is not: it is small at small angles,
large at large ones, and swells the floor by which everything else is weighed. For each group of repeats the difference
of a later run from an earlier one is regressed on their mean reading; the slopes of all groups are then asked by
Student's t whether they have one sign. The residuals of a model are used, so that what an effect explains (damage by
the runs between) is no drift.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pliant.evidence.places import Residuals, padded
from pliant.measurements.effective import clock_of, effective_samples
from pliant.measurements.floors import Floor, noise_floors
from pliant.measurements.repeats import RepeatGroup
from pliant.records.design import Array
from pliant.records.measurement import Measurement

# Mean squares below this, a thousandth of the scales, are those of data without noise.
LEAST_SQUARE = 1e-6
# Groups of repeats from which on a common sign means anything, and t from which on it does.
FEWEST, SURE = 5, 5.0


@dataclass(frozen=True)
class Drift:
    """What later repeats read more than earlier ones.

    Attributes:
        output: its name.
        share: of the reading.
        size: that, root mean square over the readings of repeats, in units of the floor.
        t: the mean slope over its standard error.
    """

    output: str
    share: float
    size: float
    t: float


def drift_between(
    measurement: Measurement,
    residuals: Residuals,
    scales: Mapping[str, float],
    groups: Sequence[RepeatGroup],
) -> Drift | None:
    """The largest drift that is beyond doubt, over the outputs; None without any.

    Args:
        measurement: the runs, in the order in which they were done.
        residuals: of the best model, per run by output (t,); repeats that are not sampled alike are left out.
        scales: floor of each output.
        groups: repeats.
    """
    found = [_of(measurement, residuals, name, scale, groups) for name, scale in scales.items()]
    return max((one for one in found if one is not None), key=lambda one: one.size, default=None)


def _of(
    measurement: Measurement, residuals: Residuals, name: str, scale: float, groups: Sequence[RepeatGroup]
) -> Drift | None:
    found = []
    for group in groups:
        known = [_slope(measurement, residuals, name, *pair) for pair in combinations(group.runs, 2)]
        of_pairs = [one for one in known if one is not None]
        if of_pairs:
            found.append(np.mean(of_pairs, axis=0))
    if len(found) < FEWEST:
        return None
    b, w, counts = np.array(found).T.copy()
    mean = float(np.average(b, weights=w))
    error = float(np.sqrt(np.sum(w * (b - mean) ** 2) / (len(b) - 1) / w.sum()))
    if abs(mean) <= SURE * error:
        return None
    size = abs(mean) * float(np.sqrt(w.sum() / np.sum(counts))) / scale
    return Drift(name, mean, size, mean / error if error > 0.0 else np.inf)


def _slope(
    measurement: Measurement, residuals: Residuals, name: str, early: int, late: int
) -> tuple[float, float, int] | None:
    """Slope of the difference of two repeats over their mean reading, Σ of squares of that reading, and how many."""
    runs = (measurement.runs[early], measurement.runs[late])
    if len(runs[0]) != len(runs[1]):
        return None
    difference: Array = residuals[late][name] - residuals[early][name]
    reading: Array = 0.5 * (runs[0].outputs[name] + runs[1].outputs[name])
    there = np.isfinite(difference) & np.isfinite(reading)
    if there.sum() < 3:
        return None
    y, m = difference[there] - difference[there].mean(), reading[there] - reading[there].mean()
    square = float(m @ m)
    return (float(y @ m) / square, square, int(there.sum())) if square > 0.0 else None


# Sources of a floor that show slow noise and offsets between runs too.
WHOLE = ("repeats", "stated sigma")
# The lower end of a central 90 % interval, in standard errors.
NINETY_BELOW = 1.6449


@dataclass(frozen=True)
class NoiseView:
    """Noise as a model's residuals show it.

    Attributes:
        floors: by output.
        n_effective: independent readings over all outputs, coloured noise counted.
        floor_square: mean squared noise over all outputs, in units of the scales; nan if nothing tells it.
        judged: the floors hold slow noise and run offsets, so that an error above them is the model's.
        between_run_scatter: how much more, at least, readings scatter between repeats than within a run: the largest
            over outputs of between / within at the lower end of its 90 % interval; 1 without repeats.
        drift: by how much later repeats read more than earlier ones, where that is beyond doubt.
    """

    floors: Mapping[str, Floor]
    n_effective: float
    floor_square: float
    judged: bool
    between_run_scatter: float
    drift: Drift | None = None


def noise_view(
    measurement: Measurement, residuals: Residuals, scales: Mapping[str, float], groups: Sequence[RepeatGroup]
) -> NoiseView:
    """Noise from the residuals of a model: what repeats have in common is not noise.

    Args:
        measurement: the runs.
        residuals: per run by output (t,).
        scales: unit of each output, for the mean over outputs.
        groups: repeats.
    """
    residuals = padded(measurement, residuals)
    found = noise_floors(measurement, residuals, groups)
    floors = {name: floor for name, floor in found.items() if name in scales}
    deviations = _deviations(residuals, groups)
    counted = effective_samples(deviations, measurement)
    squares = [(floors[name].value / scale) ** 2 for name, scale in scales.items()]
    shares = [sum(int(np.isfinite(run[name]).sum()) for run in residuals) for name in scales]
    between = [_between_run_scatter(floor) for floor in floors.values()]
    return NoiseView(
        floors=floors,
        n_effective=float(
            sum(_of_all_runs(name, counted[name], residuals, deviations, measurement) for name in scales)
        ),
        floor_square=float(np.average(squares, weights=shares)) if any(shares) else np.nan,
        judged=all(floor.source in WHOLE for floor in floors.values()),
        between_run_scatter=max([1.0, *between]),
        drift=drift_between(measurement, residuals, scales, groups),
    )


def _of_all_runs(
    name: str, counted: float, residuals: Residuals, deviations: Residuals, measurement: Measurement
) -> float:
    """Independent readings of all runs, when those of runs with repeats were counted.

    A run that was done once has as many per second as the others (per reading without clocks), and not more than
    its readings.
    """
    rests, seconds, used = [], 0.0, 0
    for run, all_of, kept in zip(measurement.runs, residuals, deviations, strict=True):
        n, m = (int(np.isfinite(values[name]).sum()) for values in (all_of, kept))
        clock = clock_of(run)
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


def _between_run_scatter(floor: Floor) -> float:
    """Scatter between repeats over that within a run, less what few repeats may show by chance."""
    if floor.between is None or not floor.within > 0 or not floor.value > 0:
        return 1.0
    standard_error = NINETY_BELOW * floor.se / floor.value
    return floor.between * max(1.0 - standard_error, 0.0) / floor.within


def _deviations(
    residuals: Sequence[Mapping[str, Array]], groups: Sequence[RepeatGroup]
) -> list[dict[str, Array]]:
    """Residuals less the mean of their repeats, runs without repeats as they are if there are no others.

    Their correlation in time is that of the noise, whatever the model misses. A group whose runs are not
    sampled alike is left as it is.
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
