"""Noise of the readings, estimated from a model's residuals: floors, effective size, repeatability, drift.

Drift: repeats that differ in proportion to their readings, because something changes over the session or the specimens
differ. An offset between repeats appears as scatter. A change of scale does not: it is small at small angles, large at
large ones, and increases the floor against which everything else is weighed. For each group of repeats the difference
of a later run from an earlier one is regressed on their mean reading; Student's t then tests whether the slopes of all
groups have one sign. The residuals of a model are used, so that what an effect explains (damage by the runs between) is
not counted as drift.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pliant.evidence.error_bins import Residuals, padded
from pliant.measurements.effective import independent_readings
from pliant.measurements.floors import Floor, noise_floors
from pliant.measurements.repeats import RepeatGroup
from pliant.records.design import Array
from pliant.records.measurement import Measurement

# Mean squares below this, the square of 0.1 % of the scales, are those of data without noise.
LEAST_SQUARE = 1e-6
# Minimum number of groups of repeats for a test of a common sign, and its threshold of t.
FEWEST, SURE = 5, 5.0


@dataclass(frozen=True)
class Drift:
    """The difference of later repeats from earlier ones, in proportion to the reading.

    Attributes:
        output: its name.
        share: of the reading.
        size: of that difference, root mean square over the readings of repeats, in units of the floor.
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
    """Return the largest significant drift over the outputs, or None.

    Args:
        measurement: the runs, in the order in which they were done.
        residuals: of the best model, per run by output (t,); repeats with different sampling are left out.
        scales: floor of each output.
        groups: repeats.
    """
    found = [_output_drift(measurement, residuals, name, scale, groups) for name, scale in scales.items()]
    return max((one for one in found if one is not None), key=lambda one: one.size, default=None)


def _output_drift(
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
    """Return the slope of two repeats' difference over their mean reading, Σ of that reading's squares, and count."""
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


# Sources of a floor that include slow noise and offsets between runs.
WHOLE = ("repeats", "stated sigma")
# The lower end of a central 90 % interval, in standard errors.
NINETY_BELOW = 1.6449


@dataclass(frozen=True)
class NoiseView:
    """Noise estimated from a model's residuals.

    Attributes:
        floors: by output.
        n_effective: independent readings over all outputs, which accounts for autocorrelation.
        floor_square: mean squared noise over all outputs, in units of the scales; nan if it is unknown.
        judged: the floors include slow noise and run offsets, so that an error above them is the model's.
        between_run_scatter: minimum ratio of the scatter between repeats to that within a run: the largest over outputs
            of between / within at the lower end of its 90 % interval; 1 without repeats.
        drift: difference of later repeats from earlier ones, if it is significant.
        floor_square_se: standard error of `floor_square`; few repeats hardly determine it.
    """

    floors: Mapping[str, Floor]
    n_effective: float
    floor_square: float
    judged: bool
    between_run_scatter: float
    drift: Drift | None = None
    floor_square_se: float = 0.0


def noise_view(
    measurement: Measurement, residuals: Residuals, scales: Mapping[str, float], groups: Sequence[RepeatGroup]
) -> NoiseView:
    """Return noise from the residuals of a model; the common part of repeats is not noise.

    Args:
        measurement: the runs.
        residuals: per run by output (t,).
        scales: unit of each output, for the mean over outputs.
        groups: repeats.
    """
    residuals = padded(measurement, residuals)
    found = noise_floors(measurement, residuals, groups)
    floors = {name: floor for name, floor in found.items() if name in scales}
    squares = [(floors[name].value / scale) ** 2 for name, scale in scales.items()]
    shares = [sum(int(np.isfinite(run[name]).sum()) for run in residuals) for name in scales]
    errors = np.nan_to_num([2.0 * floors[name].value * floors[name].se / s**2 for name, s in scales.items()])
    between = [_between_run_scatter(floor) for floor in floors.values()]
    return NoiseView(
        floors=floors,
        n_effective=sum(independent_readings(measurement, residuals, list(scales), groups).values()),
        floor_square=float(np.average(squares, weights=shares)) if any(shares) else np.nan,
        judged=all(floor.source in WHOLE for floor in floors.values()),
        between_run_scatter=max([1.0, *between]),
        drift=drift_between(measurement, residuals, scales, groups),
        floor_square_se=float(np.linalg.norm(np.multiply(errors, shares)) / max(sum(shares), 1)),
    )


def _between_run_scatter(floor: Floor) -> float:
    """Return the scatter between repeats over that within a run, minus what few repeats may show by chance."""
    if floor.between is None or not floor.within > 0 or not floor.value > 0:
        return 1.0
    standard_error = NINETY_BELOW * floor.se / floor.value
    return floor.between * max(1.0 - standard_error, 0.0) / floor.within
