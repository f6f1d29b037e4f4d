"""Data that the pictures of a comparison and of a diagnosis show: runs, outputs, the model before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN, Kinds
from pliant.evidence.comparison import Comparison, compare
from pliant.evidence.covariates import Covariates, covariates
from pliant.evidence.error_bins import Residuals, run_residuals
from pliant.evidence.measured_model import RunReadings
from pliant.evidence.scores import GroupError
from pliant.formatting import NamedUnit, display_unit, output_unit
from pliant.records.design import Array
from pliant.records.measurement import MeasuredRun, Measurement

if TYPE_CHECKING:  # imported here: pages of file contents need no diagnosis
    from pliant.diagnosis.bands import Bands
    from pliant.diagnosis.diagnosis import Diagnosis

MOST_POINTS = 1200  # points of one line; more cannot be distinguished


@dataclass(frozen=True, eq=False)
class Compared:
    """A measurement, the model's outputs per run, the comparison, and the model's bands if it has some."""

    measurement: Measurement
    predicted: Sequence[Mapping[str, Array]]
    comparison: Comparison
    bands: Bands | None = None

    @cached_property
    def residuals(self) -> Residuals:
        """Measured − predicted per run."""
        return run_residuals(self.measurement, self.predicted)

    @cached_property
    def covariates(self) -> Covariates:
        """The covariates that vary."""
        return covariates(self.measurement, self.predicted)

    def run(self, name: str) -> tuple[MeasuredRun, Mapping[str, Array]]:
        """Return a run and the model's outputs for it."""
        k = next(k for k, run in enumerate(self.measurement.runs) if run.name == name)
        return self.measurement.runs[k], self.predicted[k]

    def outputs_by_error(self) -> list[str]:
        """Return the outputs, the one with the largest error over its noise first."""
        errors = self.comparison.outputs
        return sorted(errors, key=lambda name: -errors[name].rmse / errors[name].noise.total)

    def worst_runs(self, count: int) -> tuple[list[str], bool]:
        """Return runs to show, worst first, and whether they are all; of too many, one per condition."""
        runs = self.comparison.runs
        if len(runs) <= count:
            return [run.name for run in runs], True
        error = {run.name: run.share_of_error / max(run.n, 1) for run in runs}
        one_each = [max(c.runs, key=lambda name: error[name]) for c in self.comparison.conditions]
        return sorted(one_each, key=lambda name: -error[name])[:count], False

    def title(self, name: str) -> str:
        """Return a run's name with its error in units of the floor."""
        return with_ratio(next(run for run in self.comparison.runs if run.name == name))

    def band(self, name: str, output: str) -> tuple[Array, Array] | None:
        """Return the ends (t,) of the model's band in a run, SI; None without a band."""
        if self.bands is None:
            return None
        k = next(k for k, run in enumerate(self.measurement.runs) if run.name == name)
        low, high = (end[k].get(output) for end in (self.bands.low, self.bands.high))
        return None if low is None or high is None or not np.isfinite(low).any() else (low, high)

    def words(self, name: str) -> str:
        """Return a description of a run."""
        return next(run for run in self.comparison.runs if run.name == name).words


def with_ratio(group: GroupError) -> str:
    """Return a run's or condition's name with its error in units of the floor."""
    ratio = group.rmse_over_floor
    if not np.isfinite(ratio):
        return group.name
    return f"{group.name}: {ratio:.1f} × noise" if ratio < 10 else f"{group.name}: {ratio:.0f} × noise"


def clock(run: MeasuredRun) -> tuple[Array, str]:
    """Return (t,) time from the run's start in its display unit, or sample numbers, and the axis' label."""
    label, symbol = clock_words(run)
    if run.history.time_s is None:
        return np.arange(1.0, len(run) + 1), label
    time = np.asarray(run.history.time_s, float)
    return display_unit("s").factor * (time - time[:1]), f"{label} ({symbol})"


def clock_words(run: MeasuredRun) -> tuple[str, str]:
    """Return name and unit of the time axis, or of sample numbers."""
    return ("sample", "") if run.history.time_s is None else ("time in the run", display_unit("s").symbol)


def abscissa(compared: Compared) -> tuple[str, NamedUnit] | None:
    """Return the abscissa of loops: the first actuation that varies, else the moment; None without either."""
    runs = compared.measurement.runs
    for name in dict.fromkeys(name for run in runs for name in run.history.actuation):
        if any(len(run) and np.ptp(run.history.actuation.get(name, [0.0])) > 0 for run in runs):
            return name, output_unit(name)
    if any(len(run) and np.ptp(run.history.moment_n_m) > 0 for run in runs):
        return "moment_n_m", output_unit("moment_n_m")
    return None


def input_values(run: MeasuredRun, name: str) -> Array:
    """Return (t,) an input or load of a run by name."""
    if name == "moment_n_m":
        return run.history.moment_n_m
    return np.asarray(run.history.actuation.get(name, np.full(len(run), np.nan)), float)


def thin(count: int, most: int = MOST_POINTS) -> NDArray[np.int64]:
    """Return at most `most` indices below `count`, first and last included."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, most).astype(np.int64))


def fitting(text: str, width: int) -> str:
    """Return the text truncated to a width in characters."""
    return text if len(text) <= width else text[: width - 1].rstrip(", ") + "…"


def grid(count: int, columns: int) -> tuple[int, int]:
    """Return rows and columns of small multiples; few panels form one row."""
    wide = min(count, columns)
    rows = -(-count // wide)
    return rows, -(-count // rows)


MOST_EXPLANATIONS = 2
MOST_HYPOTHESES = 8


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """A measurement and its diagnosis."""

    measurement: Measurement
    found: Diagnosis

    @cached_property
    def explanations(self) -> tuple[Kinds, ...]:
        """Sets of effects to draw besides the present model: the best, or two if the data do not decide."""
        judgement = self.found.judgement
        if self.found.verdict != "ambiguous":
            return tuple(kinds for kinds in (self.found.explained,) if kinds != NOTHING)
        left = [kinds for kinds in judgement.credible if kinds not in (NOTHING, UNKNOWN)]
        return tuple(left[:MOST_EXPLANATIONS])

    @cached_property
    def before(self) -> Compared:
        """The present model against the measurement."""
        return self._compared(NOTHING)

    @cached_property
    def after(self) -> Compared | None:
        """The model with the best explanation, if there is one."""
        return self._compared(self.explanations[0]) if self.explanations else None

    def predicted(self, kinds: Kinds) -> tuple[RunReadings, ...]:
        """Return per run and output (t,) the model's prediction with these effects; NaN without a reading."""
        readings = self.found.readings
        return readings.unpack(readings.values - self.found.fits[kinds].residual)

    def floor(self, output: str) -> float:
        """Return the noise of an output, SI; NaN where it is unknown."""
        return self.found.noise.floors[output].value

    def hypotheses(self) -> list[Kinds]:
        """Return the hypotheses to show: the most probable, the present model, and an effect outside the list."""
        every = list(self.found.judgement.probability)
        kept = set(every[:MOST_HYPOTHESES]) | {NOTHING, UNKNOWN}
        return [kinds for kinds in every if kinds in kept]

    def left_out_error(self, kinds: Kinds) -> float:
        """Return the error on held-out runs over the floor; NaN for an effect outside the list."""
        return np.nan if kinds == UNKNOWN else self.found.left_out_ratio(kinds)

    def telling_runs(self, count: int) -> list[str]:
        """Return one run of each of the conditions in which the explanation lowers the squared error most.

        Without an explanation: of those with the largest error for its number of readings.
        """
        gain = self._gains()
        mean = {
            c.name: float(np.mean([gain[name] for name in c.runs])) for c in self.before.comparison.conditions
        }
        ranked = sorted(self.before.comparison.conditions, key=lambda c: -mean[c.name])
        return [max(c.runs, key=lambda name: gain[name]) for c in ranked[:count]]

    def outputs_by_gain(self) -> list[str]:
        """Return the fitted outputs, the one whose error falls most first."""
        readings, fits = self.found.readings, self.found.fits
        before = fits[NOTHING].residual ** 2
        after = fits[self.explanations[0]].residual ** 2 if self.explanations else 0.0 * before
        gain = np.bincount(readings.output, weights=before - after, minlength=len(readings.outputs))
        return [readings.outputs[k] for k in np.argsort(-gain, kind="stable")]

    def _gains(self) -> dict[str, float]:
        readings, fits = self.found.readings, self.found.fits
        gain = fits[NOTHING].residual ** 2
        if self.explanations:
            gain = gain - fits[self.explanations[0]].residual ** 2
        sums = np.bincount(readings.run, weights=gain, minlength=readings.n_runs)
        count = np.bincount(readings.run, minlength=readings.n_runs)
        return {
            run.name: float(s / max(n, 1))
            for run, s, n in zip(self.measurement.runs, sums, count, strict=True)
        }

    def _compared(self, kinds: Kinds) -> Compared:
        predicted = self.predicted(kinds)
        return Compared(self.measurement, predicted, compare(self.measurement, predicted))
