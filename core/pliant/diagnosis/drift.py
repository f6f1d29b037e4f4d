"""Repeats that differ in proportion to what they read: something drifts over the session, or the specimens differ.

An offset between repeats is seen as scatter. A change of scale is not: it is small at small angles, large at large
ones, and swells the floor by which everything else is weighed. For each group of repeats the difference of a later run
from an earlier one is regressed on their mean reading; the slopes of all groups are then asked by Student's t whether
they have one sign. The residuals of a model are used, so that what an effect explains (damage by the runs between) is
no drift.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pliant.measurements.repeats import RepeatGroup
from pliant.records.design import Array
from pliant.records.measurement import Measurement

Residuals = Sequence[Mapping[str, Array]]
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
    slopes, weights, counts = [], [], []
    for group in groups:
        known = [_slope(measurement, residuals, name, *pair) for pair in combinations(group.runs, 2)]
        of_pairs = [one for one in known if one is not None]
        if of_pairs:
            slope, weight, count = np.mean(of_pairs, axis=0)
            slopes.append(slope)
            weights.append(weight)
            counts.append(count)
    if len(slopes) < FEWEST:
        return None
    b, w = np.array(slopes), np.array(weights)
    mean = float(np.average(b, weights=w))
    error = float(np.sqrt(np.sum(w * (b - mean) ** 2) / (len(b) - 1) / w.sum()))
    if abs(mean) <= SURE * error:
        return None
    return Drift(
        name,
        mean,
        abs(mean) * float(np.sqrt(w.sum() / np.sum(counts))) / scale,
        mean / error if error > 0.0 else np.inf,
    )


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
