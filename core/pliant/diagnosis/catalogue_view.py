"""Predictions of hypotheses for the runs of a menu: readings over their noise, their slopes, effective sample sizes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.fitting import STEP
from pliant.diagnosis.law_discrepancy import LawReference, law_columns
from pliant.diagnosis.readings import SHARE_OF_RANGE, ReadingVector
from pliant.evidence.measured_model import MeasuredModel
from pliant.experiments.planned_run import PlannedRun, unread_run
from pliant.records.design import Array
from pliant.records.history import History, held
from pliant.records.measurement import MeasuredRun, Measurement

# A measured specimen is no longer virgin: before a run of the menu it is cycled, unread, to the extreme readings of its
# measured runs, or to the run's largest actuation where no run names the specimen.
CONDITIONING_S, CONDITIONING_STEP_S = 20.0, 1.0
MOST_EXTREMES = 6


@dataclass(frozen=True, eq=False)
class CataloguePrediction:
    """Predictions of a hypothesis in the menu: values (M,) over the noise, slopes (M, k) d value / dx; or NaN."""

    values: Array
    slopes: Array


@dataclass(frozen=True, eq=False)
class CatalogueView:
    """The model driven through a menu.

    Attributes:
        runs: the menu.
        predictor: the study's model under these runs.
        readings: positions of their readings and the noise of each output; the values are zeros.
        worth: (M,) number of independent readings that each reading counts for.
        place: (M,) index of the menu's run that each reading belongs to.
        law_columns: (M, m) changes by the coefficients of the law's own error; (M, 0) without one.
        predictions: cached predictions, by effects and parameters.
    """

    runs: tuple[PlannedRun, ...]
    predictor: MeasuredModel
    readings: ReadingVector
    worth: Array
    place: NDArray[np.intp]
    law_columns: Array
    predictions: dict[tuple[EffectSet, bytes], CataloguePrediction] = field(default_factory=dict, repr=False)

    @staticmethod
    def from_predictor(
        predictor: MeasuredModel,
        runs: Sequence[PlannedRun],
        scales: Mapping[str, float],
        reading_s: float | None,
    ) -> CatalogueView:
        """Return the view of the model driven through these runs.

        Args:
            predictor: the study's model.
            runs: the menu.
            scales: noise of the outputs that are measured in any case; for others, if a run adds them, 2 % of their
                range.
            reading_s: time per independent reading of an output; None where every sample is one.
        """
        done = predictor.measurement.runs if predictor.is_conditioned else None
        measurement = _unread(runs, tuple(scales), done)
        driven = predictor.for_planned_runs(measurement)
        added = [name for name in driven.outputs if name not in scales]
        every = dict(scales) | (_added_scales(driven, added) if added else {})
        outputs = [name for name in driven.outputs if name in every]
        readings = ReadingVector.from_measurement(measurement, outputs, every)
        worth = [
            _worth(run.history.time_s if reading_s else None, len(run), reading_s) for run in measurement.runs
        ]
        where = _sample_indices(measurement, outputs)
        return CatalogueView(
            tuple(runs),
            driven,
            readings,
            np.array([worth[r][t] for r, t in zip(readings.run, where, strict=True)]),
            readings.run // (2 if predictor.is_conditioned else 1),
            np.zeros((len(readings), 0)),
        )

    def with_law_error(self, law: LawReference | None) -> CatalogueView:
        """Return the view with the changes by the law's own error, as in the fits."""
        if law is None or law.basis is None:
            return self
        columns = law_columns(self.predictor, self.readings, (), law.basis)
        return self if columns is None else replace(self, law_columns=columns)

    def evaluate(self, candidate: EffectSet, x: Array) -> CataloguePrediction:
        """Return the readings that the candidate predicts at x, and their slopes."""
        key = (candidate, x.tobytes())
        if key not in self.predictions:
            self.predictions[key] = self._evaluate(candidate, x)
        return self.predictions[key]

    def _evaluate(self, candidate: EffectSet, x: Array) -> CataloguePrediction:
        steps = [-STEP if x[k] + STEP > high else STEP for k, high in enumerate(candidate.limits()[1])]
        towards = [candidate.configs(x + step * np.eye(len(x))[k]) for k, step in enumerate(steps)]
        prediction, changes = self.predictor.vary(candidate.configs(x), towards)
        slopes = np.empty((len(self.readings), len(x)))
        for k, (change, step) in enumerate(zip(changes, steps, strict=True)):
            slopes[:, k] = self.readings.pack(change) / step
        return CataloguePrediction(self.readings.pack(prediction.runs), slopes)

    def rows(self, chosen: Sequence[int]) -> NDArray[np.bool_]:
        """Return (M,) the readings of these runs of the menu."""
        return np.isin(self.place, chosen)

    @property
    def added(self) -> tuple[str, ...]:
        """Return outputs that were not measured and that some run reads."""
        names = {name for run in self.runs for name in run.adds}
        return tuple(name for name in self.readings.outputs if name in names)


def seconds_per_reading(measurement: Measurement, n_outputs: int, n_effective: float) -> float | None:
    """Return the time per independent reading of one output in these data; None where runs have no clock."""
    seconds = 0.0
    for run in measurement.runs:
        clock = run.history.time_s
        if clock is None:
            return None
        seconds += float(clock[-1] - clock[0])
    return seconds * n_outputs / max(n_effective, 1.0)


def _unread(
    runs: Sequence[PlannedRun], outputs: tuple[str, ...], done: Sequence[MeasuredRun] | None
) -> Measurement:
    """Return each run, after its specimen's conditioning; readings are 0 where they will be read, else NaN.

    `done` are the runs that were measured; None where nothing is conditioned.
    """
    every = tuple(dict.fromkeys((*outputs, *(name for run in runs for name in run.adds))))
    measured = []
    for number, run in enumerate(runs):
        body = f"{run.history.specimen} {number}"
        if done is not None:
            before = _conditioning(run.history, done).with_(specimen="" if run.new_specimen else body)
            measured.append(unread_run(before, every))
        measured.append(unread_run(run.history.with_(specimen=body), every, (*outputs, *run.adds)))
    return Measurement(tuple(measured), every, source="the menu")


def _conditioning(history: History, done: Sequence[MeasuredRun]) -> History:
    """Return slow cycles to what took the run's specimen to its extreme readings.

    Without a measured run of that specimen it is one cycle to the run's largest actuation, without load, at the usual
    orientation of the base.
    """
    extremes = _extremes([one for one in done if one.history.specimen == history.specimen != ""])
    n = int(CONDITIONING_S / CONDITIONING_STEP_S)
    shape: Array = 1.0 - np.abs(2.0 * np.arange(n + 1) / n - 1.0)
    payload = None if history.payload_kg is None else float(history.payload_kg[0])
    if not extremes:
        tops = {name: values.max(initial=0.0) * shape for name, values in history.actuation.items()}
        clock: Array = CONDITIONING_STEP_S * np.arange(n + 1, dtype=float)
        return History.from_arrays(tops, clock, run=f"before {history.run}", payload_kg=payload)
    shapes = np.tile(shape, len(extremes))

    def rows(values: Sequence[Array]) -> Array:
        """Return one value for each extreme, (1, …) each, for all samples of its cycle."""
        return np.repeat(np.concatenate(values), n + 1, axis=0)

    payloads = [one.payload_kg for one in extremes if one.payload_kg is not None]
    return History.from_arrays(
        {name: rows([one.actuation[name] for one in extremes]) * shapes for name in history.actuation},
        np.arange(0.0, CONDITIONING_STEP_S * len(shapes), CONDITIONING_STEP_S),
        run=f"before {history.run}",
        tip_force_n=rows([one.tip_force_n for one in extremes]) * shapes[:, None],
        moment_n_m=rows([one.moment_n_m for one in extremes]) * shapes,
        temperature_c=rows([one.temperature_c for one in extremes]),
        base_angles_rad=rows([one.base_angles_rad for one in extremes]),
        payload_kg=rows(payloads) if len(payloads) == len(extremes) else payload,
    )


def _extremes(runs: Sequence[MeasuredRun]) -> list[History]:
    """Return the inputs at the largest and the smallest reading of every output, one sample each."""
    found: dict[tuple[int, int], History] = {}
    for name in runs[0].outputs if runs else ():
        for sign in (1.0, -1.0):
            tops = [np.nanmax(sign * one.outputs[name], initial=-np.inf) for one in runs]
            number = int(np.argmax(tops))
            if np.isfinite(tops[number]):
                sample = int(np.nanargmax(sign * runs[number].outputs[name]))
                inputs = held(runs[number].history).at_samples(np.array([sample], np.intp))
                found.setdefault((number, sample), inputs)
    return list(found.values())[:MOST_EXTREMES]


def _added_scales(predictor: MeasuredModel, names: Sequence[str]) -> dict[str, float]:
    """Return 2 % of the range that the model predicts where the output is read."""
    predicted, scales = predictor.predict(), {}
    for name in names:
        series = np.concatenate(
            [
                values[name][np.isfinite(run.outputs[name])]
                for run, values in zip(predictor.measurement.runs, predicted, strict=True)
            ]
        )
        there = series[np.isfinite(series)]
        span = float(np.ptp(there)) if len(there) else 0.0
        scales[name] = max(SHARE_OF_RANGE * span, predictor.least_noise(name)) or 1.0
    return scales


def _worth(time_s: Array | None, n: int, reading_s: float | None) -> Array:
    """Return (n,) independent readings per sample: its share of time over that of one reading, at most one."""
    if time_s is None or reading_s is None or n < 2:
        return np.ones(n)
    return np.minimum(np.gradient(time_s) / reading_s, 1.0)


def _sample_indices(measurement: Measurement, outputs: Sequence[str]) -> NDArray[np.intp]:
    """Return (M,) the sample within its run of every reading, in the order of a `ReadingVector`."""
    places = [np.flatnonzero(np.isfinite(run.outputs[name])) for name in outputs for run in measurement.runs]
    return np.concatenate(places).astype(np.intp)
