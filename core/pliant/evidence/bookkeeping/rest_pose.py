"""The pose before any input is driven: the readings, the model's prediction, and a correction that reconciles them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pliant.evidence.bookkeeping.columns import headings
from pliant.evidence.bookkeeping.mistake import Correction, Mistake, ReadingsByName
from pliant.evidence.bookkeeping.orientation import gravity_corrections
from pliant.evidence.bookkeeping.static_model import StaticModel, spread_error, zeroed_error
from pliant.evidence.prediction import Predictor
from pliant.formatting import listed, output_unit, plural
from pliant.interfaces.effect import Model
from pliant.measurements.doubts import IDLE
from pliant.measurements.floors import noise_floors
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement

MOST_RUNS = 40
# Readings at rest disagree if they are off by this number of standard errors, of floors, and this share of a range.
SIGNIFICANT, FLOORS, OF_RANGE = 4.0, 1.5, 0.004
# A disagreement that no gravity explains is reported from this number of floors on (root mean square over outputs and
# conditions): stiffness and friction also move a loaded chain at rest.
UNEXPLAINED = 3.0
# A correction explains the rest pose when it leaves at most this share of the disagreement.
EXPLAINED, WELL_EXPLAINED = 0.35, 0.12
AS_NOISE, PARTLY = 0.7, 0.6  # or its error is no more than noise, and clearly smaller than before
# It may raise the error over all readings above that with a free zero of each sensor by at most this factor.
AS_GOOD_AS_A_ZERO = 1.2
# A disagreement is physical if weights scaled by another factor leave at most this share of it.
WEIGHT, BY_WEIGHT = 1.02, 0.6
FACTORS = (0.8, 1.25)
# Among several the first is reported unless another has a clearly smaller error.
CLEARLY = 0.7
ROUNDING = 1e-6
MOST_NAMED = 3


@dataclass(frozen=True, eq=False)
class RestPose:
    """The readings at rest and the model's predictions, run by run.

    Attributes:
        model: of the samples at rest, one for each run.
        predicted: (R,) by output.
        scales: noise of a reading by output, SI.
        off: (R,) by output that disagrees, read − predicted, SI.
    """

    model: StaticModel
    predicted: ReadingsByName
    scales: Mapping[str, float]
    off: Mapping[str, Array]

    def left(self, predicted: ReadingsByName) -> float:
        """Return the root mean square of read − predicted over the noise, with runs under one condition averaged."""
        values = self.errors(predicted)
        return float(np.sqrt(np.mean(np.square(values)))) if values else np.inf

    def errors(self, predicted: ReadingsByName) -> list[float]:
        """Return the mean of read − predicted over the noise, of each output under each condition."""
        values = []
        for name, scale in self.scales.items():
            error = self.model.readings[name] - predicted[name]
            for places in _conditions(self.model.histories):
                there = error[places][np.isfinite(error[places])]
                if len(there) and scale > 0.0:
                    values.append(float(np.mean(there)) / scale)
        return values


def rest_pose(predictor: Predictor) -> RestPose | None:
    """Return the readings at rest where they disagree with the model's.

    None where they agree, where no run starts at rest, or where the disagreement is one of weight or stiffness.
    """
    at_rest = _resting(predictor.measurement)
    if not at_rest.runs:
        return None
    model = StaticModel.from_predictor(predictor, at_rest)
    if model is None:
        return None
    predicted = model.predict()
    floors = noise_floors(predictor.measurement)
    found = RestPose(model, predicted, {name: floors[name].value for name in model.readings}, {})
    off = {
        name: error for name in model.readings if (error := _disagreement(predictor, found, name)) is not None
    }
    return None if not off or _weighs_otherwise(found) else replace(found, off=off)


def _weighs_otherwise(rest: RestPose) -> bool:
    """Return whether a common factor on loads and weights, or on a joint's stiffness, explains the disagreement.

    Such a factor is left to the effects. It is computed to first order.
    """
    more = Correction("rest_pose", (), "", "", inputs=_loaded, model=_heavier)
    slopes = {
        name: (values - rest.predicted[name]) / (WEIGHT - 1.0)
        for name, values in rest.model.predict([more]).items()
    }
    known = [name for name, scale in rest.scales.items() if scale > 0.0]
    slope = np.concatenate([slopes[name] / rest.scales[name] for name in known])
    error = np.concatenate([(rest.model.readings[n] - rest.predicted[n]) / rest.scales[n] for n in known])
    there = np.isfinite(slope) & np.isfinite(error)
    slope, error = slope[there], error[there]
    if not slope @ slope > 0.0:
        return False
    low, high = FACTORS
    left = error - np.clip(slope @ error / (slope @ slope), low - 1.0, high - 1.0) * slope
    return bool(left @ left < BY_WEIGHT**2 * (error @ error))


def _heavier(model: Model) -> Model:
    return model.with_(chain=model.chain.with_(gravity_m_s2=WEIGHT * np.asarray(model.chain.gravity_m_s2)))


def _loaded(history: History) -> History:
    return history.with_(moment_n_m=WEIGHT * history.moment_n_m, tip_force_n=WEIGHT * history.tip_force_n)


def rest_mistake(rest: RestPose, whole: StaticModel, plain: ReadingsByName) -> Mistake | None:
    """Return the rest pose as a mistake, with the gravity that would explain it.

    None where the disagreement is small and unexplained.

    Args:
        rest: the disagreement.
        whole: the model under samples of the whole recording.
        plain: its predictions there without a correction.
    """
    before, measurement = rest.left(rest.predicted), rest.model.measurement
    where = headings(measurement, tuple(rest.off))
    words = f"At rest the recording and the model disagree ({plural(len(measurement.runs), 'run')}): {_pairs(rest)}."
    named = _gravity(rest, whole, plain)
    if named is not None:
        correction, left = named
        return Mistake(
            "gravity", correction.where, f"{words} There {correction.words}.", correction.remedy, before, left
        )
    if before < UNEXPLAINED:
        return None
    remedy = (
        "Before any effect is accepted look at the zeros of sensor and gauge (state one as 'zero: {column: value}'), "
        "at how the base is mounted ('chain.base'), at gravity, and at what hangs at the tip."
    )
    return Mistake("rest_pose", where, words, remedy, before, before)


def _gravity(rest: RestPose, whole: StaticModel, plain: ReadingsByName) -> tuple[Correction, float] | None:
    """Return the gravity that explains the rest pose, and the error left there.

    Its error over the whole recording is at most slightly above that with a free zero; None without such a gravity.
    """
    before = rest.left(rest.predicted)
    zeroed = zeroed_error(whole.readings, plain)
    found: tuple[Correction, float] | None = None
    several = len(rest.errors(rest.predicted)) > 1
    for number, correction in enumerate(gravity_corrections(rest.model.predictor.chain)):
        if number and not several:  # a single number is matched by one direction or another
            break
        left = rest.left(rest.model.predict([correction]))
        # the first is zero gravity, or the standard one if there was none; any other direction has to fit better
        if (
            left > max((EXPLAINED if number == 0 else WELL_EXPLAINED) * before, AS_NOISE)
            or left > PARTLY * before
        ):
            continue
        if found is not None and left >= CLEARLY * found[1]:
            continue
        if spread_error(whole.readings, whole.predict([correction])) <= AS_GOOD_AS_A_ZERO * zeroed:
            found = correction, left
    return found


def _pairs(rest: RestPose) -> str:
    """Return ``bend angle is read as 0.27°, the model says 0°`` for the outputs with the largest disagreement.

    Each is given at the condition where it disagrees most.
    """
    order = sorted(rest.off, key=lambda name: -float(np.nanmax(np.abs(rest.off[name]))) / rest.scales[name])
    texts = []
    for name in order[:MOST_NAMED]:
        words = output_unit(name)
        there = np.isfinite(rest.off[name])
        conditions = [np.array(places)[there[places]] for places in _conditions(rest.model.histories)]
        worst = max(filter(len, conditions), key=lambda places: abs(float(np.mean(rest.off[name][places]))))
        read, said = (float(np.mean(values[name][worst])) for values in (rest.model.readings, rest.predicted))
        said = said if abs(said) > ROUNDING * abs(read) else 0.0
        texts.append(f"{words.label} is read as {words.text(read, 3)}, the model says {words.text(said, 3)}")
    return listed(texts)


def _disagreement(predictor: Predictor, rest: RestPose, name: str) -> Array | None:
    """Return (R,) read − predicted of an output that is off at rest under some condition; None if it agrees."""
    error, scale = rest.model.readings[name] - rest.predicted[name], rest.scales[name]
    if not scale > 0.0:
        return None
    read = np.concatenate([run.outputs[name] for run in predictor.measurement.runs])
    span = float(np.ptp(read[np.isfinite(read)]))
    for places in _conditions(rest.model.histories):
        values = error[places][np.isfinite(error[places])]
        if not len(values):
            continue
        mean, n = float(np.mean(values)), len(values)
        scatter = float(np.hypot(scale, np.std(values, ddof=1) if n > 1 else 0.0)) / np.sqrt(n)
        first = float(values[0])  # on a virgin specimen: a permanent change by the first loading is physical
        large = abs(mean) > max(SIGNIFICANT * scatter, FLOORS * scale, OF_RANGE * span)
        if large and first * mean > 0.0 and abs(first) > 0.5 * abs(mean):
            return error
    return None


def _conditions(histories: Sequence[History]) -> list[list[int]]:
    """Return the indices of samples that share their loads and the orientation of their base."""
    groups: dict[tuple[float, ...], list[int]] = {}
    for place, history in enumerate(histories):
        signals = history.signals()
        key = tuple(round(float(signals[name][0]), 6) for name in signals if name not in history.actuation)
        groups.setdefault(key, []).append(place)
    return list(groups.values())


def _resting(measurement: Measurement) -> Measurement:
    """Return one sample of each run that begins with all inputs idle: the mean of its readings until one moves."""
    highest: dict[str, float] = {}
    for run in measurement.runs:
        for name, values in run.history.actuation.items():
            highest[name] = max(float(np.abs(values).max(initial=0.0)), highest.get(name, 0.0))
    rested = [one for run in measurement.runs if (one := _first(run, highest)) is not None]
    stride = max(1, -(-len(rested) // MOST_RUNS))
    return replace(measurement, runs=tuple(rested[::stride]))


def _first(run: MeasuredRun, highest: Mapping[str, float]) -> MeasuredRun | None:
    history = run.history
    idle = np.all([np.abs(v) <= IDLE * highest[name] for name, v in history.actuation.items()], axis=0)
    if not len(run) or not idle[0]:
        return None
    count = len(idle) if idle.all() else int(np.argmin(idle))
    count = min(count, _unchanged(run, count))
    read = {name: values[:count] for name, values in run.outputs.items()}
    mean = {
        n: np.array([np.mean(v[np.isfinite(v)]) if np.isfinite(v).any() else np.nan]) for n, v in read.items()
    }
    return run.at(np.array([0])).with_outputs(mean)


def _unchanged(run: MeasuredRun, count: int) -> int:
    """Return how many of the first samples share the loads and the base of the first one."""
    signals: Sequence[Array] = [
        values
        for name, values in run.history.signals().items()
        if name not in run.history.actuation and name != "temperature_c"
    ]
    changed = np.any([np.abs(v[:count] - v[0]) > 1e-9 * (1.0 + abs(v[0])) for v in signals], axis=0)
    return int(np.argmax(changed)) if changed.any() else count
