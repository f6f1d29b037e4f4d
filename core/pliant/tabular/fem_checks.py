"""What is plausible in a table from elsewhere: pressures in pascals, states that agree with each other."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from pliant.errors import UserError

# A soft robot's largest pressure lies between these; a gauge in kPa or a pressure in mPa does not.
LEAST_PA, MOST_PA = 500.0, 5e6
LEAST_IN_KPA = 0.5  # what is less was hardly written in kPa; in bar or MPa it may be
MOST_N = 5000.0  # of a soft robot's tendon
# Of the effort's change along a line of states: what stated slopes may leave of it.
SLOPE_MISS, LEAST_CHANGE = 0.3, 0.1
# Of the moment's range: repeats of a bench scatter, a tenth is a mistake.
CONTRADICTION = 0.1
FEWEST = 6  # states: of less there is no law, and nothing to judge
Row = tuple[int, dict[str, str]]


def check_pressure(path: Path, rows: Sequence[Row], stated: Mapping[str, str], notes: str) -> None:
    """Raise `UserError` where `pressure_pa` can hardly be in pascals and nobody said that it is."""
    if len(rows) < FEWEST or "pressure_pa" in stated or "pressure_pa" not in rows[0][1]:
        return
    values = [value for _, row in rows if math.isfinite(value := _value(row["pressure_pa"]))]
    largest = max(map(abs, values), default=0.0)
    if largest == 0.0 or LEAST_PA <= largest <= MOST_PA:
        return
    if largest > MOST_PA:
        raise UserError(
            f"{path}: column pressure_pa reaches {largest:g} Pa ({largest / 1e6:g} MPa), which no soft robot bears; "
            f"correct it, or write 'units: {{pressure_pa: Pa}}' into {notes} beside it if it is right."
        )
    guess, asked = (
        ("kPa", "is it in kPa?") if largest >= LEAST_IN_KPA else ("MPa", "is it in MPa, or in bar?")
    )
    raise UserError(
        f"{path}: column pressure_pa reaches only {largest:g} Pa; {asked} Write into {notes} beside it the line "
        f"'units: {{pressure_pa: {guess}}}', or 'units: {{pressure_pa: Pa}}' if it is right."
    )


def check_tendon(path: Path, rows: Sequence[Row], stated: Mapping[str, str], notes: str) -> None:
    """Raise `UserError` where `tendon_force_n` can hardly be in newtons and nobody said that it is."""
    if len(rows) < FEWEST or "tendon_force_n" in stated or "tendon_force_n" not in rows[0][1]:
        return
    values = [value for _, row in rows if math.isfinite(value := _value(row["tendon_force_n"]))]
    largest = max(map(abs, values), default=0.0)
    if largest > MOST_N:
        raise UserError(
            f"{path}: column tendon_force_n reaches {largest:g} N; is it in mN? Write into {notes} beside it the line "
            "'units: {tendon_force_n: mN}', or 'units: {tendon_force_n: N}' if it is right."
        )


def check_slopes(path: Path, rows: Sequence[Row], along: str, fixed: str, effort: str, slope: str) -> None:
    """Raise `UserError` where a column of slopes contradicts how the effort changes between neighbouring states.

    Neighbours along `along` have the same `fixed` and axis; between two of them the effort changes by the mean of
    their slopes times the step, to second order. A sign or a unit that is wrong misses by much more.
    """
    if slope not in rows[0][1]:
        return
    lines: dict[tuple[float, str], list[tuple[float, float, float, int]]] = {}
    efforts = []
    for line, row in rows:
        place = (_value(row[along]), _value(row[effort]), _value(row[slope]))
        if all(map(math.isfinite, place)):
            lines.setdefault((_value(row[fixed]), row.get("axis", "")), []).append((*place, line))
            efforts.append(place[1])
    steps = [
        pair
        for states in lines.values()
        for pair in itertools.pairwise(sorted(states))
        if pair[0][0] < pair[1][0]
    ]
    changes = [b[1] - a[1] for a, b in steps]
    told = [(a[2] + b[2]) / 2 * (b[0] - a[0]) for a, b in steps]
    change, missed = sum(map(abs, changes)), sum(abs(c - t) for c, t in zip(changes, told, strict=True))
    if not steps or missed <= SLOPE_MISS * change or change <= LEAST_CHANGE * (max(efforts) - min(efforts)):
        return
    worst = max(range(len(steps)), key=lambda k: abs(changes[k] - told[k]))
    (_, _, _, first), (_, _, _, second) = steps[worst]
    raise UserError(
        f"{path}: column {slope} contradicts {effort}: from line {first} to line {second} it changes by "
        f"{changes[worst]:.3g} (SI), by the slopes by {told[worst]:.3g}. Slopes are in the units and signs of the "
        "columns that they are of; correct the column, or leave it out."
    )


def check_agreement(path: Path, rows: Sequence[Row], actuation: str, deformation: str, effort: str) -> None:
    """Raise `UserError` with the lines of two states that are at one place and have other efforts."""
    states = [
        (_value(row[actuation]), _value(row[deformation]), _value(row[effort]), row.get("axis", ""), line)
        for line, row in rows
    ]
    efforts = [state[2] for state in states if math.isfinite(state[2])]
    allowed = CONTRADICTION * (max(efforts) - min(efforts)) if efforts else 0.0
    first: dict[tuple[float, float, str], tuple[float, int]] = {}
    for p, u, moment, axis, line in states:
        other, before = first.setdefault((p, u, axis), (moment, line))
        if abs(moment - other) > allowed:
            raise UserError(
                f"{path}, lines {before} and {line} contradict each other: at {actuation} = {p:g} and {deformation} = "
                f"{u:g} one has {effort} = {other:g}, the other {moment:g}"
            )


def _value(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
