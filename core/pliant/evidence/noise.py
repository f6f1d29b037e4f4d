"""From a noise floor to what noise does to a mean: offsets of runs, noise within them, how long it remembers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.measurements.effective import autocorrelation, clock_of
from pliant.measurements.floors import Floor
from pliant.measurements.repeats import Aligned, RepeatGroup, aligned
from pliant.records.design import Array
from pliant.records.measurement import Measurement

SMALLEST_OFFSET = 0.5  # of the variance of a run's mean: repeats cannot rule out offsets below
LONGEST = 0.995  # lag-one correlation that a short record can tell
OUTLIER = 4.0  # differences beyond so many robust sigmas are steps of the signal


@dataclass(frozen=True)
class Noise:
    """What the noise of one output is like.

    Attributes:
        within: standard deviation inside a run, SI.
        between: standard deviation of the offsets between repeated runs, SI; 0 where it is not known.
        memory_s: time after which the noise inside a run has forgotten 63 % of itself (in samples where runs have
            no clock); 0 for white noise.
        floor: what errors are divided by; the two together where it is not given.
        freedom_within, freedom_between: degrees of freedom behind the two.
    """

    within: float
    between: float = 0.0
    memory_s: float = 0.0
    floor: float | None = None
    freedom_within: float = np.inf
    freedom_between: float = np.inf

    @property
    def total(self) -> float:
        """The unit of errors: the floor, else the scatter of one reading against the truth."""
        return float(np.hypot(self.within, self.between)) if self.floor is None else self.floor

    def correlation(self, step_s: float) -> float:
        """Correlation of neighbouring readings so far apart."""
        return float(np.exp(-step_s / self.memory_s)) if self.memory_s > 0 else 0.0


def noise_of(
    floor: Floor | None, measurement: Measurement, groups: Sequence[RepeatGroup], residuals: Sequence[Array]
) -> Noise:
    """The noise of one output.

    With repeats, offsets and memory are those of the repeats' deviations from their mean, which no model enters.
    With a stated sigma alone, the memory follows from neighbours: Var(r_i − r_{i−1}) = 2 σ² (1 − φ). With neither, the
    residual stands for the noise, model error included: then only what stands out of it can be significant.

    Args:
        residuals: for each run (t,) measured − predicted.
    """
    if floor is None or floor.source not in ("repeats", "stated sigma"):
        return _of_residual(floor, measurement, residuals)
    if floor.between is None:
        memory = _memory_beside(floor.value, measurement, residuals)
        return Noise(floor.value, memory_s=memory, floor=floor.value)
    within = min(floor.within, floor.value)
    scale, memory = _colour_of_repeats(floor.output, measurement, groups)
    longest = max(len(run) for run in measurement.runs)
    offsets = max(floor.between, floor.value) ** 2 - within**2
    unseen = SMALLEST_OFFSET * within**2 * scale / longest
    freedom = max(floor.n_runs - floor.n_groups, 1)
    known = floor.value**2 / (2 * floor.se**2) if floor.se > 0 else np.inf
    return Noise(
        within=within,
        between=float(np.sqrt(max(offsets, unseen))),
        memory_s=memory,
        floor=floor.value,
        freedom_within=max(known, freedom),
        freedom_between=freedom,
    )


def _of_residual(floor: Floor | None, measurement: Measurement, residuals: Sequence[Array]) -> Noise:
    there = np.concatenate(residuals)
    rms = float(np.sqrt(np.nanmean(there**2)))
    unit = floor.value if floor is not None and floor.value > 0 else rms
    found = autocorrelation([clock_of(run) for run in measurement.runs], list(residuals))
    memory = _memory(found.time_scale, found.slot_s)
    return Noise(rms if rms > 0 else 1.0, memory_s=memory, floor=unit if unit > 0 else 1.0)


def _memory(scale: float, step_s: float) -> float:
    """Time constant of the first-order noise that shrinks a sample as much: n/n_eff = (1 + φ)/(1 − φ)."""
    phi = (scale - 1) / (scale + 1)
    return float(-step_s / np.log(min(phi, LONGEST))) if phi > 0 else 0.0


def _colour_of_repeats(
    output: str, measurement: Measurement, groups: Sequence[RepeatGroup]
) -> tuple[float, float]:
    """n / n_eff and memory of what repeats do not share, each run's offset taken off.

    Taking offsets off n readings hides a share (n/n_eff)/n of the noise's slow part, which is given back.
    """
    clocks, series = [], []
    for group in groups:
        runs = [measurement.runs[k] for k in group.runs]
        table: Aligned = aligned(runs, [run.outputs[output] for run in runs])
        if table.values.shape[1] < 4:
            continue
        wander = table.values - table.values.mean(axis=0)
        wander = wander - wander.mean(axis=1, keepdims=True)
        step = float(np.median(np.diff(clock_of(runs[0]))))
        clocks += [step * np.arange(wander.shape[1])] * len(wander)
        series += list(wander)
    if not series:
        return 1.0, 0.0
    found = autocorrelation(clocks, series)
    length = float(np.mean([len(values) for values in series]))
    scale = max(found.time_scale / max(1 - found.time_scale / length, 0.5), 1.0)
    return scale, _memory(scale, found.slot_s)


def _memory_beside(sigma: float, measurement: Measurement, residuals: Sequence[Array]) -> float:
    """Memory of noise of known standard deviation, from differences of neighbours."""
    differences = np.concatenate([np.diff(values) for values in residuals])
    differences = differences[np.isfinite(differences)]
    steps = np.concatenate([np.diff(clock_of(run)) for run in measurement.runs])
    if len(differences) < 8 or sigma <= 0:
        return 0.0
    robust = float(np.median(np.abs(differences))) / 0.6745
    kept = differences[np.abs(differences) <= OUTLIER * robust] if robust > 0 else differences
    phi = 1 - float(np.mean(kept**2)) / (2 * sigma**2)
    return float(-np.median(steps) / np.log(min(phi, LONGEST))) if phi > 0 else 0.0
