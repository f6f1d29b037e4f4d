"""What is plausible in a table from elsewhere: pressures in pascals, states that agree with each other."""

from __future__ import annotations

from collections.abc import Container, Sequence
from pathlib import Path

import numpy as np

from pliant.errors import UserError
from pliant.records.actuation import kind_of
from pliant.records.design import Array

# A soft robot's largest pressure lies between these; a gauge in kPa or a pressure in mPa does not.
LEAST_PA, MOST_PA = 500.0, 5e6
LEAST_IN_KPA = 0.5  # what is less was hardly written in kPa; in bar or MPa it may be
MOST_N = 5000.0  # of a soft robot's tendon
# Of the effort's change along a line of states: what stated slopes may leave of it.
SLOPE_MISS, LEAST_CHANGE = 0.3, 0.1
# Of the moment's range: repeats of a bench scatter, a tenth is a mistake.
CONTRADICTION = 0.1
FEWEST = 6  # states: of less there is no law, and nothing to judge
Named = tuple[str, Array]  # a column's name and its numbers (n,), SI


def check_actuation(path: Path, name: str, values: Array, stated: Container[str], notes: str) -> None:
    """Raise `UserError` where an actuation can hardly be in its SI unit and nobody said that it is."""
    largest = float(np.abs(values).max())
    if len(values) < FEWEST or name in stated:
        return
    beside, kind = f"into {notes} beside it", kind_of(name).name
    if kind == "tendon_force_n" and largest > MOST_N:
        raise UserError(
            f"{path}: column {name} reaches {largest:g} N; is it in mN? Write {beside} the line "
            f"'units: {{{name}: mN}}', or 'units: {{{name}: N}}' if it is right."
        )
    if kind == "pressure_pa" and largest > MOST_PA:
        raise UserError(
            f"{path}: column {name} reaches {largest:g} Pa ({largest / 1e6:g} MPa), which no soft robot bears; "
            f"correct it, or write 'units: {{{name}: Pa}}' {beside} if it is right."
        )
    if kind == "pressure_pa" and 0 < largest < LEAST_PA:
        in_kpa = largest >= LEAST_IN_KPA
        guess, asked = ("kPa", "is it in kPa?") if in_kpa else ("MPa", "is it in MPa, or in bar?")
        raise UserError(
            f"{path}: column {name} reaches only {largest:g} Pa; {asked} Write {beside} the line "
            f"'units: {{{name}: {guess}}}', or 'units: {{{name}: Pa}}' if it is right."
        )


def check_slopes(
    path: Path, lines: Sequence[int], along: Array, fixed: Array, of: Named, stated: Named
) -> None:
    """Raise `UserError` where a column of slopes contradicts how the effort changes between neighbouring states.

    Neighbours along `along` (n,) have the same `fixed` (n, f); between two of them the effort changes by the mean of
    their slopes times the step, to second order. A sign or a unit that is wrong misses by much more.
    """
    (effort_name, efforts), (slope_name, slopes) = of, stated
    there = np.flatnonzero(np.isfinite(slopes))
    order = there[np.lexsort((slopes[there], efforts[there], along[there], *fixed[there].T))]
    a, b = order[:-1], order[1:]
    steps = np.all(fixed[a] == fixed[b], axis=1) & (along[a] < along[b])
    a, b = a[steps], b[steps]
    changes = efforts[b] - efforts[a]
    told = (slopes[a] + slopes[b]) / 2 * (along[b] - along[a])
    missed, change = np.abs(changes - told), float(np.abs(changes).sum())
    if not a.size or missed.sum() <= SLOPE_MISS * change or change <= LEAST_CHANGE * np.ptp(efforts[there]):
        return
    worst = int(np.argmax(missed))
    raise UserError(
        f"{path}: column {slope_name} contradicts {effort_name}: from line {lines[a[worst]]} to line {lines[b[worst]]} "
        f"it changes by {changes[worst]:.3g} (SI), by the slopes by {told[worst]:.3g}. Slopes are in the units and "
        "signs of the columns that they are of; correct the column, or leave it out."
    )


def check_agreement(path: Path, lines: Sequence[int], at: Sequence[Named], effort: Named) -> None:
    """Raise `UserError` with the lines of two states that are at one place and have other efforts."""
    allowed = CONTRADICTION * np.ptp(effort[1])
    first: dict[tuple[float, ...], tuple[float, int]] = {}
    for *place, moment, line in zip(*(values for _, values in at), effort[1], lines, strict=True):
        other, before = first.setdefault(tuple(place), (moment, line))
        if abs(moment - other) > allowed:
            where = " and ".join(f"{name} = {value:g}" for (name, _), value in zip(at, place, strict=True))
            raise UserError(
                f"{path}, lines {before} and {line} contradict each other: at {where} one has {effort[0]} = {other:g}, "
                f"the other {moment:g}"
            )
