"""The model at equilibrium under a small part of the samples, and its error there."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pliant.errors import ContractError, NotReachedError, UserError
from pliant.evidence.bookkeeping.mistake import Correction, ReadingsByName
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import Model
from pliant.interfaces.physics import HistoryBackend, PhysicsBackend
from pliant.records.design import Array
from pliant.records.history import History, held
from pliant.records.measurement import MeasuredRun, Measurement

MOST_SAMPLES, OF_A_TRIAL = 160, 40
# A gain within this range may be physical (a stiffness, a law that is off); beyond it another unit is considered.
GAINS = (0.65, 1.5)
# Error of a sample without an equilibrium, in units of the spread of the readings.
WITHOUT = 2.0
NUMBERED = re.compile(r"_\d+|_[xyz](?=_m$)")


@dataclass(frozen=True, eq=False)
class StaticModel:
    """A predictor of single states and the readings there.

    Attributes:
        predictor: of the chosen samples, each a separate state.
        measurement: the chosen samples.
        readings: (N,) by output, all runs one after another.
        histories: of the chosen samples, after closed valves are applied.
    """

    predictor: Predictor
    measurement: Measurement
    readings: ReadingsByName

    @staticmethod
    def from_predictor(predictor: Predictor, measurement: Measurement) -> StaticModel | None:
        """Return the model under these samples; None where no installed engine finds its equilibria."""
        engine = _static_engine(predictor)
        if engine is None:
            return None
        still = replace(measurement, runs=tuple(map(_untimed, measurement.runs)))
        model = predictor.with_engine(engine).for_runs(still)
        return StaticModel(model, still, _rows(still, model.outputs))

    @staticmethod
    def downsampled(predictor: Predictor, most: int = MOST_SAMPLES) -> StaticModel | None:
        """Return the model under about `most` samples, spread evenly over all runs."""
        measurement = predictor.measurement
        stride = max(1, -(-sum(map(len, measurement.runs)) // most))
        runs, offset = [], 0
        for run in measurement.runs:
            there = np.any([np.isfinite(run.outputs[name]) for name in predictor.outputs], axis=0)
            places = np.flatnonzero(there)[(-offset) % stride :: stride]
            offset += int(there.sum())
            if len(places):
                runs.append(run.at(places))
        return StaticModel.from_predictor(predictor, replace(measurement, runs=tuple(runs))) if runs else None

    def predict(self, corrections: Sequence[Correction] = ()) -> ReadingsByName:
        """Return (N,) by output under the corrections of inputs and model; NaN where there is no equilibrium."""

        def changed(model: Model) -> Model:
            maps = tuple(one.inputs for one in corrections if one.inputs is not None)
            model = model.with_(inputs=(*maps, *model.inputs))
            for one in corrections:
                model = model if one.model is None else one.model(model)
            return model

        try:
            runs = self.predictor.changed(changed).evaluate().runs
        except (NotReachedError, UserError):
            return {name: np.full_like(values, np.nan) for name, values in self.readings.items()}
        return {name: np.concatenate([run[name] for run in runs]) for name in self.readings}

    def part(self, most: int = OF_A_TRIAL) -> StaticModel:
        """Return the same model under about `most` of its samples."""
        stride, first, runs = max(1, -(-sum(map(len, self.histories)) // most)), 0, []
        for run in self.measurement.runs:
            places = np.arange(-first % stride, len(run), stride)
            first += len(run)
            if len(places):
                runs.append(run.at(places))
        short = replace(self.measurement, runs=tuple(runs))
        return StaticModel(self.predictor.for_runs(short), short, _rows(short, self.predictor.outputs))

    @property
    def histories(self) -> list[History]:
        """Return the inputs of the chosen samples."""
        return [run.history for run in self.measurement.runs]

    def loaded(self, name: str) -> NDArray[np.bool_]:
        """Return (N,) where a load (a name of `History.signals`) acts; everywhere for the empty name."""
        n = sum(map(len, self.histories))
        if not name:
            return np.ones(n, bool)
        columns = [history.signals().get(name, np.zeros(len(history))) for history in self.histories]
        return np.concatenate(columns) != 0.0


def spread_error(
    readings: ReadingsByName,
    predicted: ReadingsByName,
    where: NDArray[np.bool_] | None = None,
    fitted: Mapping[str, tuple[float, float]] | None = None,
    worst: bool = False,
) -> float:
    """Return the error as a share of the spread of the readings, root mean square over kinds of outputs."""
    kinds: dict[str, list[str]] = {}
    for name in readings:
        kinds.setdefault(NUMBERED.sub("", name), []).append(name)
    squares = []
    for names in kinds.values():
        variance = sum(_variance(readings[name]) for name in names)
        total = count = 0.0
        for name in names:
            gain, offset = (1.0, 0.0) if fitted is None else fitted[name]
            error = readings[name] - gain * predicted[name] - offset
            read = np.isfinite(readings[name]) if where is None else np.isfinite(readings[name]) & where
            lost = read & ~np.isfinite(error)
            total += float((error[read & ~lost] ** 2).sum()) + lost.sum() * WITHOUT**2 * variance
            count += float(read.sum())
        if count and variance > 0.0:
            squares.append(total * len(names) / count / variance)
    if not squares:
        return 0.0
    return float(np.sqrt(max(squares) if worst else np.mean(squares)))


def zeroed_error(readings: ReadingsByName, predicted: ReadingsByName) -> float:
    """Return `spread_error` with a free zero of each output."""
    return spread_error(readings, predicted, fitted=gain_and_offset(readings, predicted, (1.0, 1.0)))


def gain_and_offset(
    readings: ReadingsByName, predicted: ReadingsByName, gains: tuple[float, float] = GAINS
) -> dict[str, tuple[float, float]]:
    """Return the gain within `gains` and the offset of each output that bring the prediction nearest."""
    found = {}
    for name, read in readings.items():
        there = np.isfinite(read) & np.isfinite(predicted[name])
        if not there.any():
            found[name] = 1.0, 0.0
            continue
        x, y = predicted[name][there], read[there]
        slope = float(np.cov(x, y)[0, 1] / np.var(x, ddof=1)) if len(x) > 1 and np.ptp(x) > 0.0 else 1.0
        gain = float(np.clip(slope, *gains))
        found[name] = gain, float(np.mean(y - gain * x))
    return found


def _variance(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.var(finite)) if len(finite) else 0.0


def _rows(measurement: Measurement, names: Sequence[str]) -> dict[str, Array]:
    return {name: np.concatenate([run.outputs[name] for run in measurement.runs]) for name in names}


def _untimed(run: MeasuredRun) -> MeasuredRun:
    history = held(run.history).with_(time_s=None, valve_open=None, lead=0)
    return replace(run, history=history)


def _static_engine(predictor: Predictor) -> PhysicsBackend | None:
    """Return the predictor's engine, or another installed one if that one needs a clock; None without one."""
    if not predictor.backend.capabilities.dynamic:
        return predictor.backend
    if predictor.chain.mount is not None:
        return None
    context = predictor.context
    for component in context.registry.by_interface("physics"):
        with contextlib.suppress(ContractError):  # a broken engine is no reason to stop
            if component.missing() is None:
                engine: PhysicsBackend = component.build(component.config_model()(kind=component.kind))
                can, joint = engine.capabilities, predictor.chain.laws[0].joint
                if isinstance(engine, HistoryBackend) and not can.dynamic and joint in can.joints:
                    return engine
    return None
