"""Downsampling of long recordings: evenly chosen readings, and the samples at which inputs turn.

A few thousand readings are as decisive for the diagnosis as a hundred thousand, and the model is integrated from sample
to sample. Between the kept samples every input, load and condition is still a straight line to within a small share of
its range (Douglas & Peucker, Cartographica 10, 1973), so that the chain sees the same history.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import number, plural
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement

# A recording is long above the first number of readings in all runs, several outputs of a sample counted separately,
# and about the second is kept. Fewer samples than `FEW` are never thinned, and about `FEWEST` are kept to resolve
# motion.
LONG, KEPT = 12_000, 6_000
FEW, FEWEST = 4_000, 2_000
# The same for chains whose joints have several coordinates: a sample costs ten times as much there.
FEW_SPATIAL, FEWEST_SPATIAL = 1_500, 1_000
# Allowed deviation of inputs from straight lines, as a share of their range: the smallest with few enough samples.
TOLERANCES = (0.005, 0.01, 0.02)


def downsample(measurement: Measurement, spatial: bool = False) -> tuple[Measurement, tuple[str, ...]]:
    """Return a long measurement with a part of its samples, and a sentence about it; a short one unchanged.

    Measurements whose inputs turn at too many samples are also returned unchanged.

    Args:
        measurement: what was recorded.
        spatial: joints of the chain have several coordinates each, which lowers the limits.
    """
    samples, each = sum(map(len, measurement.runs)), max(len(measurement.outputs), 1)
    few, fewest = (FEW_SPATIAL, FEWEST_SPATIAL) if spatial else (FEW, FEWEST)
    long = few * each if spatial else LONG
    if each * samples <= long or (each > 1 and samples <= few):
        return measurement, ()
    stride = -(-samples // (fewest if spatial else max(KEPT // each, min(fewest, KEPT))))
    spans = _spans(measurement)
    for tolerance in TOLERANCES:
        kept = [_samples(run, stride, spans, tolerance) for run in measurement.runs]
        count = sum(map(len, kept))
        if each * count <= long or 4 * count <= samples:
            runs = tuple(run.at(places) for run, places in zip(measurement.runs, kept, strict=True))
            said = (
                f"The recording is long: of {plural(samples, 'sample')} {number(count)} are used, about one in "
                f"{stride} and those at which inputs turn."
            )
            return replace(measurement, runs=runs), (said,)
    return measurement, ()


def _spans(measurement: Measurement) -> dict[str, float]:
    """Return the range of each signal over all runs.

    Inputs of one unit share the largest range, so that the noise of a held one is not taken for a turn.
    """
    tables = [run.history.signals() for run in measurement.runs]
    names = dict.fromkeys(name for table in tables for name in table)
    found = {}
    for name in names:
        ends = [(np.nanmin(t[name]), np.nanmax(t[name])) for t in tables if name in t and len(t[name])]
        found[name] = float(max(high for _, high in ends) - min(low for low, _ in ends))
    inputs = {name for run in measurement.runs for name in run.history.actuation}
    for name in inputs:
        alike = (other for other in inputs if other.rpartition("_")[2] == name.rpartition("_")[2])
        found[name] = max(found[other] for other in alike)
    return found


def _samples(run: MeasuredRun, stride: int, spans: Mapping[str, float], tolerance: float) -> NDArray[np.intp]:
    """Return the indices of the samples that are kept: both ends, every `stride`-th reading, and where inputs turn."""
    n = len(run)
    if n < 3:
        return np.arange(n)
    read = np.flatnonzero(np.any([np.isfinite(values) for values in run.outputs.values()], axis=0))
    kept = np.zeros(n, bool)
    kept[[0, 1, 2, -1, *read[::stride]]] = True  # the first three show whether it begins in motion
    signals = run.history.signals()
    valve = signals.pop("valve_open", None)
    if valve is not None:  # a switch, not a line
        turns = np.flatnonzero(np.diff(valve))
        kept[turns] = kept[turns + 1] = True
    scaled = [v / (tolerance * spans[name]) for name, v in signals.items() if spans[name] > 0.0]
    if scaled:
        _add_turns(kept, _clock(run.history), np.array(scaled))
    return np.flatnonzero(kept)


def _clock(history: History) -> Array:
    return np.arange(float(len(history))) if history.time_s is None else history.time_s


def _add_turns(kept: NDArray[np.bool_], clock: Array, signals: Array) -> None:
    """Keep, gap by gap, the sample that is farthest from the straight lines, until none is farther than 1; in place."""
    while True:
        places = np.flatnonzero(kept)
        between = np.array([np.interp(clock, clock[places], row[places]) for row in signals])
        away = np.abs(signals - between).max(axis=0)
        if not np.any(away > 1.0):
            return
        gap = np.searchsorted(places, np.arange(len(clock)), side="right")
        order = np.lexsort((-away, gap))
        first = order[np.concatenate([[True], np.diff(gap[order]) > 0])]
        kept[first[away[first] > 1.0]] = True
