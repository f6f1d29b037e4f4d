"""Mismatch of two recorders' clocks: readings that lead their inputs, or lag behind them increasingly.

A constant delay may be physical (a supply, a filter, a damper) and is left to the effects. A lead of the readings or a
delay that grows along a run cannot be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pliant.evidence.bookkeeping.mistake import Mistake
from pliant.evidence.bookkeeping.static_model import GAINS, StaticModel
from pliant.evidence.prediction import Predictor
from pliant.formatting import number
from pliant.records.design import Array
from pliant.records.measurement import MeasuredRun, Measurement

MOST_SAMPLES = 800
LONGEST_S, OF_RUN = 10.0, 0.1  # longest shifts that are tried: seconds, and share of a run's length
STEPS = 1.5  # samples by which readings lead at least
# A shift must leave at most this share of the squared error without it, with a free gain and zero.
LOWER = 0.35
WINDOWS, FEWEST = 4, 16  # of a run, and samples of each
STRAIGHT = 0.9  # of the variance of the delays that a straight line must explain
MOVES = 0.2  # of an output's range: a window with less motion does not determine a delay
GRID = 81


@dataclass(frozen=True, eq=False)
class _Timed:
    """One run: clock (t,), read and predicted (t, m) in units of their range."""

    time_s: Array
    read: Array
    predicted: Array

    def part(self, first: int, last: int) -> _Timed:
        return _Timed(self.time_s[first:last], self.read[first:last], self.predicted)

    def square(self, delay_s: Array | float, clock_s: Array) -> float:
        """Return the residual sum of squares with the prediction delayed by `delay_s`, with free gain and zero."""
        at = self.time_s - delay_s
        total = 0.0
        for k in range(self.read.shape[1]):
            said, read = np.interp(at, clock_s, self.predicted[:, k]), self.read[:, k]
            there = np.isfinite(said) & np.isfinite(read)
            if there.sum() > 2:
                x, y = said[there] - said[there].mean(), read[there] - read[there].mean()
                gain = float(np.clip(x @ y / (x @ x), *GAINS)) if x @ x > 0.0 else 1.0
                total += float(np.sum((y - gain * x) ** 2))
        return total


def clock_mistakes(predictor: Predictor) -> list[Mistake]:
    """Return the mistake of a clock with an offset or a drift; empty where readings follow their inputs."""
    runs = _timed(predictor)
    if not runs:
        return []
    step_s = min(float(np.median(np.diff(run.time_s))) for run in runs)
    longest = min(LONGEST_S, OF_RUN * max(float(np.ptp(run.time_s)) for run in runs))
    grid = np.linspace(-longest, longest, GRID)
    squares = np.array([sum(run.square(delay, run.time_s) for run in runs) for delay in grid])
    best = int(np.argmin(squares))
    before = squares[GRID // 2]
    if before <= 0.0:
        return []
    drift = _drift(runs, grid, squares[best], step_s)
    if drift is not None:
        return [drift]
    delay = _vertex(grid, squares, best)
    lag = max(abs(delay) - STEPS * step_s, 0.0)
    if delay < 0.0 and lag > 0.0 and squares[best] <= LOWER * before and 0 < best < GRID - 1:
        words = (
            f"Readings move {number(-delay, 2)} s before the inputs that cause them: the clocks of inputs and "
            "readings are apart."
        )
        remedy = (
            f"Shift the inputs by {number(delay, 2)} s (of a joined file by 'join: {{shift: …}}'), or give both "
            "recorders one trigger; the effect 'clock_offset' fits it. A slow filter of the pressure gauge does the "
            "same."
        )
        return [Mistake("clock", ("time_s",), words, remedy, *_errors(runs, before, squares[best]))]
    return []


def _drift(runs: Sequence[_Timed], grid: Array, constant: float, step_s: float) -> Mistake | None:
    """Return a delay that grows along the runs, by a straight line through the delays of windows, or None."""
    times, delays = [], []
    for run in runs:
        for first, last in _windows(run):
            part = run.part(first, last)
            squares = np.array([part.square(delay, run.time_s) for delay in grid])
            best = int(np.argmin(squares))
            if 0 < best < len(grid) - 1:
                times.append(float(part.time_s.mean() - run.time_s[0]))
                delays.append(_vertex(grid, squares, best))
    if len(times) < WINDOWS or np.ptp(times) == 0.0:
        return None
    rate, offset = np.polyfit(times, delays, 1)
    left = np.array(delays) - np.polyval([rate, offset], times)
    grows = abs(rate) * max(float(np.ptp(run.time_s)) for run in runs)
    if grows < 2 * STEPS * step_s or np.var(left) > (1.0 - STRAIGHT) * np.var(delays):
        return None
    after = sum(run.square(offset + rate * (run.time_s - run.time_s[0]), run.time_s) for run in runs)
    if after > LOWER * constant:
        return None
    way = "later and later" if rate > 0.0 else "earlier and earlier"
    words = (
        f"Readings come {way} along a run, by {number(abs(rate) * 1e3, 2)} ms a second: the clocks of inputs and "
        "readings run at different rates."
    )
    remedy = (
        "Record one signal with both recorders and stretch one clock in the file; the effect 'clock_drift' fits "
        "it."
    )
    return Mistake("clock", ("time_s",), words, remedy, *_errors(runs, constant, after))


def _windows(run: _Timed) -> list[tuple[int, int]]:
    """Return windows of equal length in which an output moves."""
    n = len(run.time_s) // WINDOWS
    if n < FEWEST:
        return []
    spans = [(k * n, (k + 1) * n) for k in range(WINDOWS)]
    return [(a, b) for a, b in spans if np.nanmax(np.ptp(run.predicted[a:b], axis=0)) > MOVES]


def _vertex(grid: Array, squares: Array, best: int) -> float:
    """Return the minimum of the parabola through the best point and its neighbours."""
    if not 0 < best < len(grid) - 1:
        return float(grid[best])
    left, middle, right = squares[best - 1 : best + 2]
    curvature = left - 2.0 * middle + right
    return float(
        grid[best] + (0.5 * (left - right) / curvature if curvature > 0.0 else 0.0) * (grid[1] - grid[0])
    )


def _errors(runs: Sequence[_Timed], before: float, after: float) -> tuple[float, float]:
    count = sum(run.read.size for run in runs)
    return float(np.sqrt(before / count)), float(np.sqrt(after / count))


def _timed(predictor: Predictor) -> list[_Timed]:
    """Return runs with a clock and their predictions at equilibrium, the first ones up to a number of samples."""
    measurement, count = predictor.measurement, 0
    chosen: list[MeasuredRun] = []
    for run in measurement.runs:
        moves = any(np.ptp(values) > 0.0 for values in run.history.actuation.values())
        if run.history.time_s is not None and moves and len(run) >= FEWEST:
            if chosen and count + len(run) > MOST_SAMPLES:
                break
            chosen.append(run.at(np.arange(min(len(run), MOST_SAMPLES))))
            count += len(run)
    if not chosen:
        return []
    part: Measurement = replace(measurement, runs=tuple(chosen))
    model = StaticModel.from_predictor(predictor, part)
    if model is None:
        return []
    predicted, names = model.predict(), list(model.readings)
    spans = {
        name: float(np.nanmax(v) - np.nanmin(v)) for name, v in model.readings.items() if np.isfinite(v).any()
    }
    most = max(spans.values(), default=0.0)
    names = [name for name in names if spans.get(name, 0.0) > 0.05 * most]
    if not names:
        return []
    found, first = [], 0
    for run in chosen:
        rows = slice(first, first + len(run))
        first += len(run)
        read = np.column_stack([model.readings[name][rows] / spans[name] for name in names])
        said = np.column_stack([predicted[name][rows] / spans[name] for name in names])
        assert run.history.time_s is not None
        if np.isfinite(said).all():
            found.append(_Timed(run.history.time_s, read, said))
    return found
