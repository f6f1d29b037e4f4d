"""Repeats: runs that had the same inputs, and their readings on one clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pliant.measurements.highpass import noise_variance
from pliant.records.design import Array
from pliant.records.history import BASE, History
from pliant.records.measurement import MeasuredRun, Measurement

SAME = 0.03  # two inputs are the same if they differ by less than this share of the input's span (RMS)
SAME_DURATION = 0.05
SAME_TEMPERATURE_K = 1.0
SAME_ANGLE_RAD = np.deg2rad(1.0)
GRID = 2000  # maximum number of instants at which inputs are compared
GAP = 2.5  # gaps longer than this number of usual steps are not interpolated


@dataclass(frozen=True)
class RepeatGroup:
    """Runs with the same inputs.

    Attributes:
        runs: their indices in the measurement, two or more.
        specimens_differ: more than one specimen was used, so that their scatter includes that of fabrication.
    """

    runs: tuple[int, ...]
    specimens_differ: bool


@dataclass(frozen=True, eq=False)
class Aligned:
    """One output of a group on a common clock.

    Attributes:
        values: (runs, t) readings at the instants where every run has one.
        lost: variance of white noise that interpolation took out of `values`, averaged over runs.
    """

    values: Array
    lost: float


@dataclass(frozen=True, eq=False)
class _Driven:
    """The inputs of a run.

    Attributes:
        signals: (t,) by name.
        clock: (t,) seconds from the start; None without one.
        step: the usual one of the clock.
        n: samples.
    """

    signals: dict[str, Array]
    clock: Array | None
    step: float
    n: int
    _noise: dict[str, float] = field(default_factory=dict)

    @staticmethod
    def from_history(history: History) -> _Driven:
        if history.time_s is None:
            return _Driven(history.signals(), None, 0.0, len(history))
        clock = history.time_s - history.time_s[0]
        step = float(np.median(np.diff(clock))) if clock.size > 1 else 0.0
        return _Driven(history.signals(), clock, step, len(history))

    def at(self, grid: Array, name: str) -> Array:
        """Return a signal at these seconds from the start."""
        assert self.clock is not None
        return np.interp(grid, self.clock, self.signals[name])

    def noise(self, name: str) -> float:
        """Return the variance of a signal's white noise, cached because a run is compared with many."""
        if name not in self._noise:
            assert self.clock is not None
            self._noise[name] = noise_variance(self.clock, self.signals[name])[0]
        return self._noise[name]


def repeat_groups(measurement: Measurement) -> tuple[RepeatGroup, ...]:
    """Return groups of runs with the same inputs, loads, orientation and temperature.

    Two runs are repeats where their durations agree within 5 % and every signal agrees within 3 % of its span
    over the measurement (root mean square over the run, minus the part explained by its own noise; spans include 0,
    and inputs of one unit share theirs), the temperature within 1 K and the base within 1 degree. Each run is
    compared with the first run of each group.
    """
    driven = [_Driven.from_history(run.history) for run in measurement.runs]
    tolerances = _tolerances([one.signals for one in driven])
    groups: list[list[int]] = []
    for index, one in enumerate(driven):
        for group in groups:
            if _same(driven[group[0]], one, tolerances):
                group.append(index)
                break
        else:
            groups.append([index])
    return tuple(
        RepeatGroup(tuple(group), len({measurement.runs[i].history.specimen for i in group}) > 1)
        for group in groups
        if len(group) > 1
    )


def aligned(runs: Sequence[MeasuredRun], readings: Sequence[Array]) -> Aligned:
    """Return readings of repeats at the instants of the first run, by linear interpolation.

    Args:
        runs: the repeats.
        readings: (t,) for each of them, NaN where missing.
    """
    if runs[0].history.time_s is None:
        table = np.array(list(readings))
        return Aligned(table[:, np.isfinite(table).all(axis=0)], 0.0)
    clocks = [run.history.time_s - run.history.time_s[0] for run in runs if run.history.time_s is not None]
    end = min(clock[-1] for clock in clocks)
    grid = clocks[0][clocks[0] <= end]
    table = np.full((len(runs), grid.size), np.nan)
    lost = []
    for i, (clock, values) in enumerate(zip(clocks, readings, strict=True)):
        there = np.isfinite(values)
        if there.sum() < 2:
            return Aligned(np.empty((len(runs), 0)), 0.0)
        table[i], share = _bridged(grid, clock[there], values[there])
        lost.append((1 - share) * (noise_variance(clock[there], values[there])[0] if share < 1 else 0.0))
    return Aligned(table[:, np.isfinite(table).all(axis=0)], float(np.mean(lost)))


def _bridged(grid: Array, clock: Array, values: Array) -> tuple[Array, float]:
    """Return values on a grid, NaN across gaps, and the share of white noise variance that interpolation retains."""
    right = np.clip(np.searchsorted(clock, grid), 1, clock.size - 1)
    step = clock[right] - clock[right - 1]
    weight = np.clip((grid - clock[right - 1]) / step, 0.0, 1.0)
    weight = np.where(np.minimum(weight, 1 - weight) < 1e-6, np.round(weight), weight)
    on_grid = (1 - weight) * values[right - 1] + weight * values[right]
    bridged = (step > GAP * np.median(np.diff(clock))) & (weight > 0) & (weight < 1)
    outside = (grid < clock[0] - step) | (grid > clock[-1] + step)
    good = ~(bridged | outside)
    left = float(np.mean((1 - weight[good]) ** 2 + weight[good] ** 2)) if good.any() else 1.0
    return np.where(good, on_grid, np.nan), left


def _tolerances(signals: Sequence[dict[str, Array]]) -> dict[str, float]:
    spans: dict[str, float] = {}
    for name in sorted({name for run in signals for name in run}):
        values = [run[name] for run in signals if name in run and run[name].size]
        low, high = min(v.min() for v in values), max(v.max() for v in values)
        spans[name] = float(max(high, 0.0) - min(low, 0.0))
    tolerances: dict[str, float] = {
        **dict.fromkeys(BASE, float(SAME_ANGLE_RAD)),
        "temperature_c": SAME_TEMPERATURE_K,
    }
    for name in spans.keys() - tolerances.keys():
        alike = [span for other, span in spans.items() if _family(other) == _family(name)]
        tolerances[name] = SAME * max(alike)
    return tolerances


def _family(name: str) -> str:
    """Return the family of signals that share a span: all pressures, all tendon forces, all forces at the tip."""
    return next(
        (
            kind
            for kind in ("pressure", "tendon_force", "tendon_travel", "tip_force")
            if name.startswith(kind)
        ),
        name,
    )


def _same(a: _Driven, b: _Driven, tolerances: dict[str, float]) -> bool:
    if (a.clock is None) != (b.clock is None) or set(a.signals) != set(b.signals):
        return False
    if a.clock is None or b.clock is None:
        return a.n == b.n and all(
            bool(np.sqrt(np.mean((a.signals[name] - b.signals[name]) ** 2)) <= tolerances[name])
            for name in a.signals
        )
    if abs(a.clock[-1] - b.clock[-1]) > max(SAME_DURATION * a.clock[-1], 2 * max(a.step, b.step)):
        return False
    grid = np.linspace(0.0, min(a.clock[-1], b.clock[-1]), min(GRID, max(a.n, b.n)))
    return all(_alike(grid, name, a, b, tolerances[name]) for name in a.signals)


def _alike(grid: Array, name: str, a: _Driven, b: _Driven, tolerance: float) -> bool:
    """Return whether two signals agree within the tolerance and their noise, plus four sigma of its sampling error."""
    square = float(np.mean((a.at(grid, name) - b.at(grid, name)) ** 2))
    if square <= tolerance**2:
        return True
    noise = sum(one.noise(name) for one in (a, b))
    return bool(square <= tolerance**2 + noise * (1 + 4 * np.sqrt(3 / grid.size)))
