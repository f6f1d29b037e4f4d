"""Comparison of model and measurement: the size of the error, the noise it is compared with, and where it is.

Residuals are measured − predicted throughout.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pliant.errors import UserError
from pliant.evidence.bookkeeping.mistake import Mistake
from pliant.evidence.covariates import covariates
from pliant.evidence.error_bins import (
    ErrorBin,
    Residuals,
    bin_errors,
    output_noise,
    padded,
    run_residuals,
    worst_places,
)
from pliant.evidence.importance import importance
from pliant.evidence.scores import (
    NONE,
    GroupError,
    Interval,
    OutputError,
    group_error,
    output_error,
    overall,
    run_words,
)
from pliant.measurements.effective import independent_readings, run_clock
from pliant.measurements.floors import floor_remarks, noise_floors
from pliant.measurements.repeats import repeat_groups
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.records.remark import Rank, Remark

NO_NOISE = "no noise"
ROUNDING = 1e-7  # of the readings: smaller floors come from computed data
JUDGED_BY = ("repeats", "stated sigma")  # floors that include the scatter of the test rig


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model against a measurement.

    Attributes:
        outputs: by name, see `OutputError`.
        rmse_over_floor: root mean square error in units of the floor, over all readings; NaN without a floor.
        rmse_over_floor_interval: its 95 % interval.
        runs, conditions: errors per run, and with repeats combined.
        places: every bin of every covariate; shares of one covariate sum to 1.
        worst: places with more than their share of the error, the worst first.
        depends_on: covariate → share of the error's variance that it explains (see `importance`), largest first.
        labels: covariate → words.
        n_places: (bin, output) pairs that were tested; significance is corrected for this number.
        n_samples, n_effective: number of readings, and their effective sample size.
        judged: every floor comes from repeats or a stated sigma, so that the model can be accepted or rejected.
        remarks: what limits the comparison, in sentences.
        bookkeeping: probable mistakes of the record, before any physics.
    """

    outputs: Mapping[str, OutputError]
    rmse_over_floor: float
    rmse_over_floor_interval: Interval
    runs: tuple[GroupError, ...]
    conditions: tuple[GroupError, ...]
    places: tuple[ErrorBin, ...]
    worst: tuple[ErrorBin, ...]
    depends_on: Mapping[str, float]
    labels: Mapping[str, str]
    n_places: int
    n_samples: int
    n_effective: float
    judged: bool
    remarks: tuple[str, ...]
    bookkeeping: tuple[Mistake, ...] = ()

    @property
    def has_floor(self) -> bool:
        """Return whether every output has a floor of some source."""
        return bool(np.isfinite(self.rmse_over_floor))

    @property
    def significant(self) -> tuple[ErrorBin, ...]:
        """Return places where the mean error exceeds the noise, corrected for all places tested."""
        return tuple(place for place in self.places if place.significant)


def _residuals(measurement: Measurement, predicted: Sequence[Mapping[str, Array]]) -> Residuals:
    """Return the residuals of the outputs with comparable readings; raise `UserError` without one."""
    residuals = run_residuals(measurement, predicted)
    names = [n for n in residuals[0] if any(np.isfinite(run[n]).any() for run in residuals)]
    if not residuals[0]:
        has = ", ".join(sorted({name for run in predicted for name in run})) or "none"
        raise UserError(
            f"{measurement.source or 'the measurement'} has the outputs {', '.join(measurement.outputs) or 'none'}, "
            f"the model has {has}: nothing to compare."
        )
    if not names:
        raise UserError("no reading can be compared: every reading or prediction is missing.")
    return [{name: run[name] for name in names} for run in residuals]


def compare(
    measurement: Measurement,
    predicted: Sequence[Mapping[str, Array]],
    *,
    seed: int = 0,
    bookkeeping: Sequence[Mistake] = (),
) -> Comparison:
    """Return the errors per output, run and condition against the noise floor, and where they are.

    Args:
        measurement: the recorded runs.
        predicted: for each run the model's outputs by name, (t,) each.
        seed: of the bootstrap.
        bookkeeping: mistakes of the record that the model shows (`find_mistakes`).

    Raises:
        UserError: no output in common, or no reading that can be compared.
    """
    residuals = _residuals(measurement, predicted)
    names, groups = list(residuals[0]), repeat_groups(measurement)
    every = noise_floors(measurement, padded(measurement, residuals), groups)
    floors = {name: every[name] for name in names}
    readings = {n: np.concatenate([run.outputs[n] for run in measurement.runs]) for n in floors}
    smallest = {name: ROUNDING * float(np.sqrt(np.nanmean(read**2))) for name, read in readings.items()}
    noiseless = [name for name, floor in floors.items() if floor.value <= smallest[name]]  # computed data
    floors = {name: floor for name, floor in floors.items() if name not in noiseless}
    noise = {
        n: output_noise(floors.get(n), measurement, groups, [run[n] for run in residuals]) for n in names
    }
    steps_s = [float(np.median(np.diff(run_clock(run)))) if len(run) > 1 else 1.0 for run in measurement.runs]
    found = covariates(measurement, predicted)
    places = bin_errors(residuals, found, noise, steps_s)
    worth = independent_readings(measurement, padded(measurement, residuals), names, groups)
    outputs = {n: output_error(n, residuals, floors.get(n), noise[n], steps_s, worth[n], seed) for n in names}
    outputs |= {name: replace(outputs[name], source=NO_NOISE) for name in noiseless}
    known = all(np.isfinite(error.noise_floor) for error in outputs.values())
    ratio, ratio_interval = overall(residuals, noise, steps_s, seed) if known else (np.nan, NONE)
    runs = [(k,) for k in range(len(measurement.runs))]
    repeats = {k: group.runs for group in groups for k in group.runs}
    conditions = dict.fromkeys(repeats.get(k, run) for k, run in enumerate(runs))
    score = partial(group_error, measurement, run_words(found, len(runs)), residuals, noise, known)
    return Comparison(
        outputs=outputs,
        rmse_over_floor=ratio,
        rmse_over_floor_interval=ratio_interval,
        runs=tuple(map(score, runs)),
        conditions=tuple(map(score, conditions)),
        places=places,
        worst=worst_places(places),
        depends_on=importance(residuals, found, {name: one.total for name, one in noise.items()}),
        labels={
            "position": "position along the chain",
            **{item.name: item.shown.label for item in found.items},
        },
        n_places=sum(len(place.outputs) for place in places),
        n_samples=sum(error.n for error in outputs.values()),
        n_effective=sum(error.n_effective for error in outputs.values()),
        judged=all(error.source in JUDGED_BY for error in outputs.values()),
        remarks=(
            *measurement.remarks,
            *floor_remarks(floors),
            *_remarks(measurement, names, residuals, noiseless),
        ),
        bookkeeping=tuple(bookkeeping),
    )


def _remarks(
    measurement: Measurement, names: Sequence[str], residuals: Residuals, noiseless: Sequence[str]
) -> list[str]:
    remarks: list[str] = []
    if noiseless:
        remarks.append(
            Remark(
                f"{', '.join(noiseless)}: readings without any noise; there is no floor to compare with.",
                Rank.FLOOR,
            )
        )
    lost = sum(
        int((np.isfinite(run.outputs[name]) & ~np.isfinite(error[name])).sum())
        for run, error in zip(measurement.runs, residuals, strict=True)
        for name in names
    )
    if lost:
        remarks.append(f"{lost} readings are left out, because the model has no finite prediction there.")
    if left := [name for name in measurement.outputs if name not in names]:
        remarks.append(f"Not compared, because the model or the file has no values of it: {', '.join(left)}.")
    if len(measurement.runs) == 1:
        remarks.append(
            "There is one run only: offsets between runs cannot be distinguished from errors of the model."
        )
    return remarks
