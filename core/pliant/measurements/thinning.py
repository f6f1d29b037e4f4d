"""Long recordings by the samples that matter: evenly chosen readings, and the samples at which inputs turn.

A few thousand readings decide which effect is missing as well as a hundred thousand do, and the model is integrated
from sample to sample. Between the samples that are kept every input, load and condition is still a straight line to
within a small share of its range (Douglas & Peucker, Cartographica 10, 1973): what reaches the chain is the same.
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

# Readings of all runs above which a recording is long, several outputs of a sample counted each, and about which are
# kept; but so many samples are never thinned, and about so many are kept, for what moves is seen between them.
LONG, KEPT = 12_000, 6_000
FEW, FEWEST = 4_000, 2_000
# What inputs may part from straight lines by, as a share of their range: the smallest that keeps few enough is taken.
TOLERANCES = (0.005, 0.01, 0.02)


def thinned(measurement: Measurement) -> tuple[Measurement, tuple[str, ...]]:
    """A long measurement by a part of its samples, and a sentence about it; a short one as it is.

    Measurements whose inputs turn at too many samples stay as they are, too.
    """
    samples, each = sum(map(len, measurement.runs)), max(len(measurement.outputs), 1)
    if each * samples <= LONG or (each > 1 and samples <= FEW):
        return measurement, ()
    stride = -(-samples // max(KEPT // each, min(FEWEST, KEPT)))
    spans = _spans(measurement)
    for tolerance in TOLERANCES:
        kept = [_samples(run, stride, spans, tolerance) for run in measurement.runs]
        count = sum(map(len, kept))
        if each * count <= LONG or 4 * count <= samples:
            runs = tuple(run.at(places) for run, places in zip(measurement.runs, kept, strict=True))
            said = (
                f"The recording is long: of {plural(samples, 'sample')} {number(count)} are used, about one in "
                f"{stride} and those at which inputs turn."
            )
            return replace(measurement, runs=runs), (said,)
    return measurement, ()


def _spans(measurement: Measurement) -> dict[str, float]:
    """Range of each signal over all runs; inputs of one unit share the largest: the noise of a held one is no turn."""
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
    """Places of the samples that are kept: both ends, every so-many-th reading, and where inputs turn."""
    n = len(run)
    if n < 3:
        return np.arange(n)
    read = np.flatnonzero(np.any([np.isfinite(values) for values in run.outputs.values()], axis=0))
    kept = np.zeros(n, bool)
    kept[[0, 1, 2, -1, *read[::stride]]] = True  # the first three tell whether it begins in motion
    signals = run.history.signals()
    valve = signals.pop("valve_open", None)
    if valve is not None:  # a switch, no line
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
