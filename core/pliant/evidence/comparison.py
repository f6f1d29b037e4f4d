"""Model against measurement: how large the error is, against which noise, and where.

Residuals are measured − predicted throughout.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pliant.errors import UserError
from pliant.evidence.covariates import covariates
from pliant.evidence.importance import importance
from pliant.evidence.noise import noise_of
from pliant.evidence.places import Place, Residuals, find_places, worst_places
from pliant.evidence.scores import (
    NONE,
    GroupError,
    Interval,
    OutputError,
    conditions,
    group_error,
    output_error,
    overall,
    run_words,
)
from pliant.formatting import unit_of
from pliant.measurements.effective import clock_of
from pliant.measurements.floors import Floor, floor_remarks, noise_floors
from pliant.measurements.repeats import repeat_groups
from pliant.records.design import Array
from pliant.records.measurement import MeasuredRun, Measurement

AGAINST = -0.5  # a correlation below it is no missing effect: it is a sign
FEWEST = 10


def sense_remarks(
    measurement: Measurement, predicted: Sequence[Mapping[str, Array]], names: Sequence[str]
) -> list[str]:
    """A sentence for each output whose readings go the other way than the model's."""
    found = []
    for name in names:
        pairs = [
            (run.outputs[name], model[name]) for run, model in zip(measurement.runs, predicted, strict=True)
        ]
        read, said = (np.concatenate([np.asarray(pair[k], float) for pair in pairs]) for k in (0, 1))
        there = np.isfinite(read) & np.isfinite(said)
        if there.sum() < FEWEST or np.ptp(read[there]) == 0.0 or np.ptp(said[there]) == 0.0:
            continue
        correlation = float(np.corrcoef(read[there], said[there])[0, 1])
        if correlation < AGAINST:
            found.append(
                f"The readings of {unit_of(name).label} go the other way than the model (correlation "
                f"{correlation:.2f}): before looking for an effect look at the sign of the sensor"
                f"{_swapped(measurement)}."
            )
    return found


def _swapped(measurement: Measurement) -> str:
    inputs = sorted({name for run in measurement.runs for name in run.history.actuation})
    if len(inputs) < 2:
        return ""
    return f", and at which chamber is which: {', '.join(inputs)} and their signs in 'chain.actuators'"


NO_NOISE = "no noise"
ROUNDING = 1e-7  # of the readings: smaller floors come from computed data
JUDGED_BY = ("repeats", "stated sigma")  # floors that hold the bench's own scatter


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model against a measurement.

    Attributes:
        outputs: by name, see `OutputError`.
        rmse_over_floor: root mean square error in units of the floor, all readings; NaN without a floor.
        rmse_over_floor_interval: its 95 % interval.
        runs, conditions: errors run by run, and with repeats taken together.
        places: every bin of every covariate; shares of one covariate sum to 1.
        worst: places that hold more than their part of the error, the worst first.
        depends_on: covariate → share of the error's variance that it tells (see `importance`), largest first.
        labels: covariate → words.
        n_places: (bin, output) pairs that were tested; significance is corrected for so many.
        n_samples, n_effective: readings, and how many independent ones they are worth.
        judged: every floor comes from repeats or a stated sigma, so that "right" and "wrong" have a meaning.
        remarks: what limits the comparison, in sentences.
    """

    outputs: Mapping[str, OutputError]
    rmse_over_floor: float
    rmse_over_floor_interval: Interval
    runs: tuple[GroupError, ...]
    conditions: tuple[GroupError, ...]
    places: tuple[Place, ...]
    worst: tuple[Place, ...]
    depends_on: Mapping[str, float]
    labels: Mapping[str, str]
    n_places: int
    n_samples: int
    n_effective: float
    judged: bool
    remarks: tuple[str, ...]

    @property
    def has_floor(self) -> bool:
        """Whether every output has a floor of some source."""
        return bool(np.isfinite(self.rmse_over_floor))

    @property
    def significant(self) -> tuple[Place, ...]:
        """Places where the mean error is more than noise, after correction for all that were looked at."""
        return tuple(place for place in self.places if place.significant)


def residuals_of(measurement: Measurement, predicted: Sequence[Mapping[str, Array]]) -> Residuals:
    """Per run, measured − predicted for the outputs that both have; NaN where nothing was read.

    Raises:
        UserError: no output in common.
    """
    common = [name for name in measurement.outputs if all(name in run for run in predicted)]
    if not common:
        has = ", ".join(sorted({name for run in predicted for name in run})) or "none"
        raise UserError(
            f"{measurement.source or 'the measurement'} has the outputs {', '.join(measurement.outputs) or 'none'}, "
            f"the model has {has}: nothing to compare."
        )
    return [
        {name: np.asarray(run.outputs[name], float) - np.asarray(model[name], float) for name in common}
        for run, model in zip(measurement.runs, predicted, strict=True)
    ]


def compare(
    measurement: Measurement,
    predicted: Sequence[Mapping[str, Array]],
    floors: Mapping[str, Floor] | None = None,
    *,
    seed: int = 0,
) -> Comparison:
    """Errors per output, run and condition against the noise floor, and where they are.

    Args:
        measurement: what the bench recorded.
        predicted: for each run the model's outputs by name, (t,) each.
        floors: from `noise_floors`; made here by default.
        seed: of the bootstrap.

    Raises:
        UserError: no output in common, or no reading that can be compared.
    """
    residuals = residuals_of(measurement, predicted)
    names = [n for n in residuals[0] if any(np.isfinite(run[n]).any() for run in residuals)]
    if not names:
        raise UserError("no reading can be compared: every reading or prediction is missing.")
    residuals = [{name: run[name] for name in names} for run in residuals]
    floors = noise_floors(measurement, predicted_aside(measurement, residuals)) if floors is None else floors
    floors = {name: floors[name] for name in names if name in floors}
    noiseless = _without_noise(floors, measurement)
    floors = {name: floor for name, floor in floors.items() if name not in noiseless}
    groups = repeat_groups(measurement)
    noise = {n: noise_of(floors.get(n), measurement, groups, [run[n] for run in residuals]) for n in names}
    steps_s = [_step_s(run) for run in measurement.runs]
    found = covariates(measurement, predicted)
    places = find_places(residuals, found, noise, steps_s)
    outputs = {n: output_error(n, residuals, floors.get(n), noise[n], steps_s, seed) for n in names}
    outputs |= {name: replace(outputs[name], source=NO_NOISE) for name in noiseless}
    known = all(np.isfinite(error.noise_floor) for error in outputs.values())
    ratio, ratio_interval = overall(residuals, noise, steps_s, seed) if known else (np.nan, NONE)
    runs = [(k,) for k in range(len(measurement.runs))]
    score = partial(group_error, measurement, run_words(found, len(runs)), residuals, noise, known)
    return Comparison(
        outputs=outputs,
        rmse_over_floor=ratio,
        rmse_over_floor_interval=ratio_interval,
        runs=tuple(score(run) for run in runs),
        conditions=tuple(score(condition) for condition in conditions(runs, groups)),
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
            *sense_remarks(measurement, predicted, names),
        ),
    )


def _without_noise(floors: Mapping[str, Floor], measurement: Measurement) -> list[str]:
    """Outputs whose floor is only rounding: computed data."""
    found = []
    for name, floor in floors.items():
        readings = np.concatenate([run.outputs[name] for run in measurement.runs])
        if floor.value <= ROUNDING * float(np.sqrt(np.nanmean(readings**2))):
            found.append(name)
    return found


def predicted_aside(measurement: Measurement, residuals: Residuals) -> Residuals:
    """Residuals for every output of the measurement: NaN for those that the model does not have."""
    return [
        {name: run.get(name, np.full(len(m), np.nan)) for name in measurement.outputs}
        for m, run in zip(measurement.runs, residuals, strict=True)
    ]


def _step_s(run: MeasuredRun) -> float:
    return float(np.median(np.diff(clock_of(run)))) if len(run) > 1 else 1.0


def _remarks(
    measurement: Measurement, names: Sequence[str], residuals: Residuals, noiseless: Sequence[str]
) -> list[str]:
    remarks = []
    if noiseless:
        remarks.append(
            f"{', '.join(noiseless)}: readings without any noise; there is no floor to compare with."
        )
    left = [name for name in measurement.outputs if name not in names]
    lost = sum(
        int((np.isfinite(run.outputs[name]) & ~np.isfinite(error[name])).sum())
        for run, error in zip(measurement.runs, residuals, strict=True)
        for name in names
    )
    if lost:
        remarks.append(f"{lost} readings are left out, because the model found no equilibrium there.")
    if left:
        remarks.append(f"Not compared, because the model or the file has no values of it: {', '.join(left)}.")
    if len(measurement.runs) == 1:
        remarks.append("There is one run only: offsets between runs cannot be told from errors of the model.")
    return remarks
