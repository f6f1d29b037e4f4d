"""Noise floors: the errors that no model can explain, within a run and between repeats."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pliant.config.measurements import PER_RUN
from pliant.measurements.columns import column_si_unit
from pliant.measurements.effective import autocorrelation, run_clock
from pliant.measurements.highpass import noise_variance
from pliant.measurements.repeats import Aligned, RepeatGroup, aligned, repeat_groups
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.records.remark import Rank, Remark, detail

Source = Literal["repeats", "stated sigma", "high-frequency residual", "unknown"]
CLEARLY = 2.0  # standard errors by which the scatter of repeats must exceed the stated sigma to replace it


@dataclass(frozen=True)
class Floor:
    """Noise of one output, as standard deviations.

    Attributes:
        output, unit: the output and its SI unit.
        within: noise within a run, each run's own offset subtracted; nan if it is unknown.
        between: total scatter of single readings between repeats (noise and offset of the run); None without
            repeats.
        sigma: the sigma stated in the file (root mean square), or None.
        value: the floor that errors are compared with; nan if it is unknown.
        source: where `value` comes from.
        se: standard error of `value`, which accounts for autocorrelation and few repeats; 0 for a stated sigma.
        n_groups, n_runs: groups of repeats and runs in them that have readings.
        specimens_differ: repeats were done with different specimens, so that the floor includes their scatter.
    """

    output: str
    unit: str
    within: float
    between: float | None
    sigma: float | None
    value: float
    source: Source
    se: float
    n_groups: int
    n_runs: int
    specimens_differ: bool = False


@dataclass(frozen=True)
class _Variance:
    """A variance, its degrees of freedom, and how much the repeats contributed."""

    value: float
    dof: float

    @property
    def sd(self) -> float:
        return math.sqrt(self.value) if self.value >= 0 else math.nan

    @property
    def se(self) -> float:
        """Return the standard error of the standard deviation: s / √(2ν)."""
        return self.sd / math.sqrt(2 * self.dof) if self.dof > 0 else math.nan


def noise_floors(
    measurement: Measurement,
    residuals: Sequence[Mapping[str, Array]] | None = None,
    groups: Sequence[RepeatGroup] | None = None,
) -> dict[str, Floor]:
    """Return the two floors of every output.

    Between repeats, readings y_r(t) of R runs scatter about their mean with variance Σ (y_r − ȳ)² / (T (R − 1)).
    Within a run the same is done after each run's own mean deviation has been subtracted, with n_eff − 1 in the
    place of T − 1 for autocorrelated noise. Both are pooled over groups by their degrees of freedom. Without repeats
    the noise within a run is that of third differences, which exclude slow noise and offsets.

    Args:
        measurement: the runs.
        residuals: for each run (t,) by output, instead of the readings: variation that a model of the history
            explains is then not counted as noise.
        groups: repeats, if they are known already.

    Returns:
        by output, in the measurement's order. `value` is the stated sigma if there is one, unless repeats
        scatter clearly more; else the scatter between repeats; else the noise of third differences.
    """
    groups = repeat_groups(measurement) if groups is None else groups
    tables = _own_zeros(measurement) if residuals is None else residuals
    return {
        name: _floor(name, measurement, [table[name] for table in tables], groups)
        for name in measurement.outputs
    }


def _own_zeros(measurement: Measurement) -> list[Mapping[str, Array]]:
    """Return the readings of each run, minus its mean if the zero of each run is unknown."""
    free = [name for name, how in measurement.free_zeros.items() if how == PER_RUN]
    tables: list[Mapping[str, Array]] = []
    for run in measurement.runs:
        there = {name: run.outputs[name][np.isfinite(run.outputs[name])] for name in free}
        own = {name: run.outputs[name] - values.mean() for name, values in there.items() if len(values)}
        tables.append({**run.outputs, **own})
    return tables


def floor_remarks(floors: Mapping[str, Floor]) -> tuple[str, ...]:
    """Return sentences on the limitations of the floors."""
    remarks: list[str] = []
    for source, text in _OPEN.items():
        names = [floor.output for floor in floors.values() if floor.source == source]
        if names:
            rank = Rank.DETAIL if source == "stated sigma" else Rank.FLOOR
            remarks.append(Remark(f"{', '.join(names)}: {text}", rank))
    scattered = [f.output for f in floors.values() if f.source == "repeats" and f.sigma is not None]
    if scattered:
        said = f"{', '.join(scattered)}: repeats scatter more than the stated sigma, so their scatter is the floor."
        remarks.append(detail(said))
    if any(floor.specimens_differ for floor in floors.values()):
        remarks.append(
            "Repeats were done with different specimens: the floor holds the scatter of making them."
        )
    return tuple(remarks)


_OPEN: dict[Source, str] = {
    "high-frequency residual": (
        "no repeats and no sigma. The floor is the noise between neighbouring readings, to which slow noise and "
        "offsets between runs are invisible: an error above it may still be noise, and whether the bench repeats "
        "cannot be judged. Do one run twice."
    ),
    "unknown": (
        "no repeats, no sigma and too few readings per run to estimate their noise. Whether the error is more than "
        "noise cannot be judged. Do one run twice, or state 'sigma' in the YAML."
    ),
    "stated sigma": (
        "the floor is the stated sigma. What the bench adds to the sensor's noise (slip, offsets between runs) is in "
        "it only if it was stated so."
    ),
}


def _floor(
    name: str, measurement: Measurement, readings: Sequence[Array], groups: Sequence[RepeatGroup]
) -> Floor:
    repeats = []
    for group in groups:
        read = [i for i in group.runs if np.isfinite(readings[i]).any()]
        chosen = read if len(read) > 1 else group.runs
        table = aligned([measurement.runs[i] for i in chosen], [readings[i] for i in chosen])
        if min(table.values.shape) > 1:
            repeats.append((group, table))
    within, between = _fast(measurement, readings), None
    value, se = within.sd, within.se
    source: Source = "high-frequency residual" if within.dof > 0 else "unknown"
    if repeats:
        within, between = _pooled([table for _, table in repeats])
        value, source, se = between.sd, "repeats", between.se
    sigma = _stated(name, measurement)
    if sigma is not None and (between is None or between.sd - CLEARLY * between.se <= sigma):
        value, source, se = sigma, "stated sigma", 0.0
    return Floor(
        output=name,
        unit=column_si_unit(name),
        within=within.sd,
        between=None if between is None else between.sd,
        sigma=sigma,
        value=value,
        source=source,
        se=se,
        n_groups=len(repeats),
        n_runs=sum(len(group.runs) for group, _ in repeats),
        specimens_differ=any(group.specimens_differ for group, _ in repeats),
    )


def _stated(name: str, measurement: Measurement) -> float | None:
    """Return the root mean square of the stated sigmas where something was read."""
    stated = [
        run.sigma[name][np.isfinite(run.outputs[name])] for run in measurement.runs if name in run.sigma
    ]
    squares = np.concatenate(stated) ** 2 if stated else np.zeros(0)
    squares = squares[np.isfinite(squares)]
    return float(np.sqrt(squares.mean())) if squares.size else None


def _fast(measurement: Measurement, readings: Sequence[Array]) -> _Variance:
    """Return the noise of third differences, pooled over all runs."""
    total = dof = 0.0
    for run, values in zip(measurement.runs, readings, strict=True):
        there = np.isfinite(values)
        clock = run_clock(run)
        variance, freedom = noise_variance(clock[there], values[there])
        if freedom > 0:
            total, dof = total + variance * freedom, dof + freedom
    return _Variance(total / dof, dof) if dof else _Variance(math.nan, 0.0)


def _pooled(tables: Sequence[Aligned]) -> tuple[_Variance, _Variance]:
    """Return variance within runs and total variance between repeats, with effective degrees of freedom.

    The total is that of run means (R − 1 degrees of freedom per group) plus that within; its degrees of freedom follow
    Satterthwaite (1946).
    """
    squares = freedom = effective = offsets = offset_freedom = 0.0
    for table in tables:
        n_runs, n_times = table.values.shape
        deviation = table.values - table.values.mean(axis=0)
        offset = deviation.mean(axis=1, keepdims=True)
        wander = deviation - offset
        colour = autocorrelation([np.arange(n_times, dtype=float)] * n_runs, list(wander))
        independent = max(n_times / max(colour.time_scale, 1.0), 2.0)
        share = n_times * (1.0 - 1.0 / independent)  # expected Σ of squares per free run, in σ²
        squares += float((wander**2).sum()) + table.lost * (n_runs - 1) * share
        freedom += (n_runs - 1) * share
        effective += (n_runs - 1) * max(n_times / max(colour.square_scale, 1.0) - 1.0, 1.0)
        offsets += float((offset**2).sum())
        offset_freedom += n_runs - 1
    within = _Variance(squares / freedom, effective)
    mean_square = offsets / offset_freedom
    # the offset's square includes the mean of the noise, which `squares / freedom` also includes
    wander_square = (
        within.value * freedom / sum((len(table.values) - 1) * table.values.shape[1] for table in tables)
    )
    total = mean_square + wander_square
    spread = mean_square**2 / offset_freedom + wander_square**2 / within.dof
    return within, _Variance(total, total**2 / spread if spread > 0 else offset_freedom)
