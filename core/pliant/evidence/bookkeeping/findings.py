"""All mistakes of a record that can be seen before any dynamics, the gravest first."""

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
from pliant.evidence.prediction import POSITION, POSITIONS, Predictor
from pliant.formatting import number, whole_percent
from pliant.measurements.floors import noise_floors
from pliant.mechanics.full_scale import full_scale
from pliant.mechanics.held import is_held
from pliant.records.measurement import Measurement

# A record is asked about units, signs and axes where even a free gain and zero of each output leave so much.
UNLIKE = 0.35
# A correction is told where it leaves so little of the spread, this share of the error before, and this share of what
# a gain and a zero of each output would leave.
GOOD, LOWER, LOWER_THAN_GAIN = 0.45, 0.4, 0.6
# Of corrections that are about as good the first is told.
ABOUT = 1.05
# Of two that differ by zeros alone the one is told that needs none.
OF_ZEROS = 0.1
# So little is left by the right reading of a column.
CLEAR = 0.1
# Error on a few samples, over the least or over what is allowed, of corrections that are tried on all of them.
NEARLY = 1.5
# Of the largest input that the laws know, or that would turn a joint by a radian.
BEYOND = 3.0
CLEARLY = 1.4  # the first of gravities is told unless another leaves so many times less
MOST_AT_ONCE = 3
FEWEST = 8
# Error over the noise from which payloads and clocks are asked about.
ABOVE_NOISE = 1.5


def find_mistakes(predictor: Predictor) -> tuple[Mistake, ...]:
    """Return what is probably written down wrongly in a recording or beside it; empty for one that is in order.

    Each finding is judged by the model at equilibrium on a small part of the samples, so that it costs a second or so.
    Joints that the bench holds are not asked about.
    """
    if any(is_held(run.history) for run in predictor.measurement.runs):
        return ()
    model = StaticModel.thinned(predictor)
    if model is None or min(np.isfinite(v).sum() for v in model.readings.values()) < FEWEST:
        return ()
    plain = model.predict()
    gross = _gross(model)
    if gross:  # what rests on the same columns would only repeat it
        return tuple(gross)
    if not all(np.isfinite(values).any() for values in plain.values()):
        return ()
    found: list[Mistake] = _loads(model, plain)
    above = _above_noise(model, plain, predictor.measurement)
    clocks = clock_mistakes(predictor) if above > ABOVE_NOISE else []
    # by another clock the first samples are not at rest
    rest = None if clocks else rest_pose(predictor)
    if rest is not None and (mistake := rest_mistake(rest, model, plain)) is not None:
        found.append(mistake)
    if above > ABOVE_NOISE:
        found += [one for one in _gravity(model, plain) if one.kind not in {other.kind for other in found}]
        found += [] if any(one.where == ("payload_kg",) for one in found) else payload_mistakes(model)
    return (*found, *clocks)


def _above_noise(model: StaticModel, plain: ReadingsByName, measurement: Measurement) -> float:
    """The error over the noise between neighbouring readings: what repeats do not share may be a wrong label."""
    floors = noise_floors(measurement, groups=())
    known = [name for name in model.readings if floors[name].value > 0.0]
    errors = [(model.readings[name] - plain[name]) / floors[name].value for name in known]
    return float(np.sqrt(np.nanmean(np.concatenate(errors) ** 2))) if known else np.inf


def _gross(model: StaticModel) -> list[Mistake]:
    """Units, signs, axes, chambers, gravity and base, one after another while each lowers the error by a lot."""
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
    """The correction that leaves least beside a free zero of each output, and that error before and after it.

    All are tried on a few samples, and those that lead there on all of them.
    """
    before = zeroed_error(applied_to(model.readings, done), plain)
    most = min(GOOD, LOWER * before, LOWER_THAN_GAIN * free)
    short = model.part()
    largest = _largest_factor(model)
    every = [one for one in _corrections(model) if one.drive <= largest]
    lead: list[Correction] = []
    for simulated in (False, True):
        errors = [(_error_of(short, [*done, one]), one) for one in every if one.simulated == simulated]
        least = min((error for error, _ in errors), default=np.inf)
        lead += [one for error, one in errors if error <= NEARLY * min(least, most)]
        if least <= CLEAR:  # another reading of the columns is enough: nothing need be solved again
            break
    best, lowest = None, np.inf
    for one in lead:
        error = _error_of(model, [*done, one])
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
    """The factor on the inputs beyond which they are no recording of this actuator."""
    largest = max(float(np.abs(v).max(initial=0.0)) for h in model.histories for v in h.actuation.values())
    end = full_scale(model.predictor.chain)
    return BEYOND * end / largest if largest > 0.0 else np.inf


def _error_of(model: StaticModel, corrections: Sequence[Correction]) -> float:
    """What these corrections leave beside a free zero, and a little of what needs one."""
    readings, predicted = applied_to(model.readings, corrections), model.predict(corrections)
    return zeroed_error(readings, predicted) + OF_ZEROS * min(spread_error(readings, predicted), 1.0)


def _gravity(model: StaticModel, plain: ReadingsByName) -> list[Mistake]:
    """Another gravity, where it takes most of the error away that a gain and a zero of each output would leave."""
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
    """Units and signs of loads, by the samples at which they act."""
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
