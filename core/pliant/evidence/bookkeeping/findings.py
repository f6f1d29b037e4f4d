"""All bookkeeping mistakes of a recording that are visible before any dynamics, the gravest first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pliant.evidence.bookkeeping.clocks import clock_mistakes
from pliant.evidence.bookkeeping.columns import column_corrections, load_corrections
from pliant.evidence.bookkeeping.mistake import Correction, Mistake, ReadingsByName, applied_to
from pliant.evidence.bookkeeping.orientation import base_corrections, gravity_corrections
from pliant.evidence.bookkeeping.payloads import payload_mistakes
from pliant.evidence.bookkeeping.rest_pose import rest_mistake, rest_pose
from pliant.evidence.bookkeeping.static_model import (
    StaticModel,
    gain_and_offset,
    spread_error,
    zeroed_error,
)
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.prediction import POSITION, POSITIONS, Predictor
from pliant.formatting import number, whole_percent
from pliant.measurements.floors import noise_floors
from pliant.mechanics.full_scale import full_scale
from pliant.mechanics.prescribed import is_held
from pliant.records.measurement import Measurement

# Units, signs and axes are examined where this error remains even with a free gain and zero of each output.
UNLIKE = 0.35
# A correction is reported if its error is at most this share of the spread, of the error before, and of the error
# with a free gain and zero of each output.
GOOD, LOWER, LOWER_THAN_GAIN = 0.45, 0.4, 0.6
# Among corrections within this factor of the best the first is reported.
ABOUT = 1.05
# Weight of the error without free zeros: prefers, among corrections that differ by zeros alone, one that needs none.
OF_ZEROS = 0.1
# A correction of columns with at most this error needs no comparison with corrections that are simulated.
CLEAR = 0.1
# Corrections are tried on all samples if their error on a few is within this factor of the least or the allowed one.
NEARLY = 1.5
# Of the largest input that the laws cover, or that would bend a joint by one radian.
BEYOND = 3.0
CLEARLY = 1.4  # the first gravity is reported unless another one has an error smaller by this factor
MOST_AT_ONCE = 3
FEWEST = 8
# Payloads and clocks are examined from this ratio of error to noise.
ABOVE_NOISE = 1.5


def find_mistakes(predictor: MeasuredModel) -> tuple[Mistake, ...]:
    """Return the probable bookkeeping mistakes of a recording and its notes; empty without any.

    Each finding is judged by the model at equilibrium on a small part of the samples, which takes about a second.
    Recordings whose joints are held by the test rig are not examined, nor those of other models than chains.
    """
    if not isinstance(predictor, Predictor) or any(
        is_held(run.history) for run in predictor.measurement.runs
    ):
        return ()
    model = StaticModel.downsampled(predictor)
    if model is None or min(np.isfinite(v).sum() for v in model.readings.values()) < FEWEST:
        return ()
    plain = model.predict()
    gross = _gross(model)
    if gross:  # findings that depend on the same columns would only repeat it
        return tuple(gross)
    if not all(np.isfinite(values).any() for values in plain.values()):
        return ()
    found: list[Mistake] = _loads(model, plain)
    above = _above_noise(model, plain, predictor.measurement)
    clocks = clock_mistakes(predictor) if above > ABOVE_NOISE else []
    # with another clock the first samples are not at rest
    rest = None if clocks else rest_pose(predictor)
    if rest is not None and (mistake := rest_mistake(rest, model, plain)) is not None:
        found.append(mistake)
    if above > ABOVE_NOISE:
        found += [one for one in _gravity(model, plain) if one.kind not in {other.kind for other in found}]
        found += [] if any(one.where == ("payload_kg",) for one in found) else payload_mistakes(model)
    return (*found, *clocks)


def _above_noise(model: StaticModel, plain: ReadingsByName, measurement: Measurement) -> float:
    """Return the error over the noise between neighbouring readings: repeats may deviate by a wrong label."""
    floors = noise_floors(measurement, groups=())
    known = [name for name in model.readings if floors[name].value > 0.0]
    errors = [(model.readings[name] - plain[name]) / floors[name].value for name in known]
    return float(np.sqrt(np.nanmean(np.concatenate(errors) ** 2))) if known else np.inf


def _gross(model: StaticModel) -> list[Mistake]:
    """Return mistakes of units, signs, axes, chambers, gravity and base, while each lowers the error a lot."""
    done: list[Correction] = []
    found: list[Mistake] = []
    for _ in range(MOST_AT_ONCE):
        readings, plain = applied_to(model.readings, done), model.predict(done)
        fitted = gain_and_offset(readings, plain)
        alike = spread_error(readings, plain, fitted=fitted, worst=True) <= UNLIKE
        best = None if alike else _best(model, done, plain, spread_error(readings, plain, fitted=fitted))
        if best is None:
            break
        done.append(best[0])
        found.append(_mistake(*best))
    return found


def _best(
    model: StaticModel, done: Sequence[Correction], plain: ReadingsByName, free: float
) -> tuple[Correction, float, float] | None:
    """Return the correction with the least error under a free zero of each output, and its error before and after.

    All are tried on a few samples, and the best of them on all samples. None if no correction is good enough.
    """
    before = zeroed_error(applied_to(model.readings, done), plain)
    most = min(GOOD, LOWER * before, LOWER_THAN_GAIN * free)
    short = model.part()
    largest = _largest_factor(model)
    every = [one for one in _corrections(model) if one.drive <= largest]
    lead: list[Correction] = []
    for simulated in (False, True):
        errors = [(_corrected_error(short, [*done, one]), one) for one in every if one.simulated == simulated]
        least = min((error for error, _ in errors), default=np.inf)
        lead += [one for error, one in errors if error <= NEARLY * min(least, most)]
        if least <= CLEAR:  # another reading of the columns is enough: no equilibria need be solved
            break
    best, lowest = None, np.inf
    for one in lead:
        error = _corrected_error(model, [*done, one])
        if error <= most and ABOUT * error < lowest:
            best, lowest = one, error
    if best is None:
        return None
    tried = [*done, best]
    return best, before, zeroed_error(applied_to(model.readings, tried), model.predict(tried))


def _corrections(model: StaticModel) -> Iterator[Correction]:
    chain = model.predictor.chain
    yield from column_corrections(model.measurement, tuple(model.readings))
    positions = {match[3] for name in model.readings if (match := POSITION.fullmatch(name))}
    weighs = bool(np.any(chain.gravity_m_s2))
    if weighs or any(body.mass_kg for body in chain.bodies):
        yield from gravity_corrections(chain)
    if weighs or 0 < len(positions) < len(POSITIONS):
        yield from base_corrections(chain)


def _largest_factor(model: StaticModel) -> float:
    """Return the factor on the inputs beyond which they cannot be a recording of this actuator."""
    largest = max(float(np.abs(v).max(initial=0.0)) for h in model.histories for v in h.actuation.values())
    end = full_scale(model.predictor.chain)
    return BEYOND * end / largest if largest > 0.0 else np.inf


def _corrected_error(model: StaticModel, corrections: Sequence[Correction]) -> float:
    """Return the error of corrections with a free zero of each output, plus a small penalty for needing one."""
    readings, predicted = applied_to(model.readings, corrections), model.predict(corrections)
    return zeroed_error(readings, predicted) + OF_ZEROS * min(spread_error(readings, predicted), 1.0)


def _gravity(model: StaticModel, plain: ReadingsByName) -> list[Mistake]:
    """Return another gravity if it removes most of the error that a gain and a zero of each output would leave."""
    before = spread_error(model.readings, plain)
    free = spread_error(model.readings, plain, fitted=gain_and_offset(model.readings, plain))
    tried = [
        (spread_error(model.readings, model.predict([one])), one)
        for one in gravity_corrections(model.predictor.chain)
    ]
    lowest = min(error for error, _ in tried)
    after, best = next(pair for pair in tried if pair[0] <= CLEARLY * lowest)
    return [_mistake(best, before, after)] if after <= LOWER * min(before, free) else []


def _loads(model: StaticModel, plain: ReadingsByName) -> list[Mistake]:
    """Return mistakes in units and signs of loads, judged by the samples at which they act."""
    found: dict[str, tuple[Correction, float, float]] = {}
    for one in load_corrections(model.measurement):
        acts = model.loaded(one.of_load)
        before = spread_error(model.readings, plain, acts)
        free = spread_error(model.readings, plain, acts, gain_and_offset(model.readings, plain))
        if before <= GOOD:
            continue
        after = spread_error(model.readings, model.predict([one]), acts)
        if (
            after <= min(GOOD, LOWER * before, LOWER_THAN_GAIN * free)
            and after < found.get(one.of_load, (one, 0, np.inf))[2]
        ):
            found[one.of_load] = one, before, after
    return [_mistake(*entry) for entry in found.values()]


def _mistake(correction: Correction, before: float, after: float) -> Mistake:
    size = f"{whole_percent(before)}" if before < 10 else f"{number(before, 2)} times"
    words = (
        f"By the model {correction.words}: the error at equilibrium falls from {size} to {whole_percent(after)} of the "
        "readings' spread."
    )
    return Mistake(correction.kind, correction.where, words, correction.remedy, before, after)
