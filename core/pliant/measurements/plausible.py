"""Detection of wrong units: columns a thousand times too small or too large for their stated unit."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import numpy as np

from pliant.records.design import Array
from pliant.records.measurement import Doubt
from pliant.records.remark import Rank, Remark
from pliant_tables.proposals import VACUUM, plain_words
from pliant_tables.schema import FileColumn
from pliant_tables.units import conversion

# Units in common use, by SI unit.
WRITTEN = {
    "Pa": ("kPa", "MPa", "bar", "mbar"),
    "rad": ("deg", "mrad"),
    "m": ("mm", "cm"),
    "N": ("mN", "kN"),
    "N*m": ("mN*m", "N*mm"),
    "kg": ("g",),
    "s": ("ms", "us"),
    "dimensionless": ("percent",),
}
# Largest magnitudes of soft robots in the laboratory; below the first or above the second is a wrong unit.
USUAL = {
    "Pa": (300.0, 1e7),
    "rad": (0.0, 4 * math.pi),
    "m": (0.0, 10.0),
    "N": (0.0, 2e3),
    "N*m": (0.0, 100.0),
    "kg": (0.0, 30.0),
    "dimensionless": (0.0, 5.0),
}
# Typical magnitudes, to infer which unit was meant.
TYPICAL = {"Pa": 3e4, "rad": 0.5, "m": 0.05, "N": 1.0, "N*m": 0.05, "kg": 0.03, "dimensionless": 0.2}
TO_CHECK = "Unit to check"
HOT_C = 200.0
# Steps per second of clocks that count from 1970, and the seconds since then in 2001 and 2065.
SINCE_1970, EPOCH_S = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}, (1e9, 3e9)
LONGEST_STEP_S = 8.0
LEAST, FEW = 0.2, 1.6  # largest angles between which an actuator's were hardly written in degrees
# A size's distance from the usual one, and the second unit's from the first, as logarithms of ratios.
FAR, CLEAR = math.log(5.0), math.log(2.0)
# How far beyond the caller's range a column may reach, as a factor.
BEYOND = {"rad": 15.0, "dimensionless": 50.0}
BEYOND_OTHERWISE = 100.0


def implausible_columns(
    largest: Mapping[str, float],
    expected: Mapping[str, tuple[float, float]],
    notes: str,
    columns: Mapping[str, FileColumn],
) -> list[Doubt]:
    """Return a doubt for each column whose largest magnitude does not fit its unit.

    Args:
        largest: the largest magnitude of each column in SI; the unit is in its name.
        expected: the range that the caller knows for some: a law's domain, the chain's length. Without it a wide range
            of usual values decides. Columns with the same range share a unit.
        notes: name of the YAML file to write the unit into.
        columns: those of the file, by Pliant's name; others are not judged.
    """
    alike: dict[tuple[float, float], float] = {}
    for name in largest.keys() & expected.keys():
        alike[expected[name]] = max(largest[name], alike.get(expected[name], 0.0))
    doubts = []
    for name, value in largest.items():
        if value > 0 and (column := columns.get(name)) is not None:
            span = expected.get(name)
            text = _sentence(column, value, span, notes, alike.get(span or (0.0, 0.0), 0.0))
            doubts += [Doubt(column.written, "unit", text)] if text else []
    return doubts


def _sentence(
    column: FileColumn, largest: float, expected: tuple[float, float] | None, notes: str, alike: float
) -> str:
    unit, name = column.unit, column.name
    if unit == "degC":
        text = f"{column.written} reaches {largest:.4g} °C; kelvin?"
        return _advice(text, column, "K", notes) if largest > HOT_C else ""
    reference = max(map(abs, expected)) if expected is not None else 0.0
    if _radians(column, largest, reference):
        text = f"{column.written} reaches only {largest / column.scale:.4g} {column.in_unit}"
        return _advice(text, column, "rad", notes)
    if reference > 0:
        beyond = BEYOND.get(unit, BEYOND_OTHERWISE)
        if reference / BEYOND_OTHERWISE <= largest <= reference * beyond:
            return ""
        # a position or a load may be small; an actuation far below its law's domain may not
        if largest < reference and unit != "Pa" and not name.startswith("tendon_force"):
            return ""
        ratio = largest / reference
        size = f"{ratio:.0f} times" if ratio >= 1 else f"1/{1 / ratio:.0f} of"
        text = f"{column.written} reaches {largest:.4g}, {size} what the model expects ({reference:.4g})"
    else:
        of_one_joint = re.match(r"joint|base", name)
        low, high = (0.0, math.pi * 1.5) if of_one_joint else USUAL.get(unit, (0.0, math.inf))
        if low <= largest <= high:
            return ""
        reference = TYPICAL[unit]
        written = "" if unit == "dimensionless" else f" {unit}"
        text = f"{column.written} reaches {'only ' if largest < low else ''}{largest:.4g}{written}, which is unlikely"
    largest = max(largest, alike)

    def distance(other: str) -> float:
        return abs(
            math.log(largest) - math.log(reference) + math.log(conversion(other, unit, "")[0] / column.scale)
        )

    others = [
        other for other in (*WRITTEN.get(unit, ()), unit) if conversion(other, unit, "")[0] != column.scale
    ]
    nearest = min(others, key=distance, default="")
    as_written = abs(math.log(largest) - math.log(reference))
    return _advice(text, column, nearest if nearest and distance(nearest) < as_written else "", notes)


def likely_unit(unit: str, largest: float) -> str:
    """Return the unit in which a magnitude is typical; "" where no unit, or more than one, fits."""
    if unit not in TYPICAL or not largest > 0:
        return ""

    def distance(written: str) -> float:
        return abs(math.log(conversion(written, unit, "")[0] * largest / TYPICAL[unit]))

    first, second = sorted((unit, *WRITTEN[unit]), key=distance)[:2]
    return first if distance(first) < FAR and distance(second) - distance(first) > CLEAR else ""


def epoch_unit(times: Array) -> str:
    """Return the unit in which a clock counts from 1970, as of computers and ROS; "" for other clocks."""
    seen = times[np.isfinite(times)]
    if not len(seen):
        return ""
    low, high = float(seen.min()), float(seen.max())
    return next(
        (unit for unit, per_s in SINCE_1970.items() if EPOCH_S[0] < low / per_s < high / per_s < EPOCH_S[1]),
        "",
    )


def _radians(column: FileColumn, largest: float, reference: float) -> bool:
    """Return whether an angle in degrees is so small that it can only be meant in radians."""
    raw = largest / column.scale
    if column.role != "output" or column.unit != "rad" or abs(column.scale - math.radians(1)) > 1e-12:
        return False
    if reference > 0:
        return raw < FEW and abs(math.log(raw / reference)) < abs(math.log(largest / reference))
    return LEAST < raw < FEW


def time_doubts(step_s: float, whole: bool, notes: str, clock: FileColumn) -> list[Doubt]:
    """Return a doubt if the usual step of the clock is implausible in seconds: whole numbers, far apart."""
    if step_s < LONGEST_STEP_S or not whole:
        return []
    text = f"{clock.written} steps by {step_s:g}, in whole numbers"
    return [Doubt(clock.written, "unit", _advice(text, clock, "ms", notes))]


def vacuum_doubts(usual: Mapping[str, float], notes: str, columns: Mapping[str, FileColumn]) -> list[Doubt]:
    """Return a doubt for each pressure that is called a vacuum and counts it positive.

    Args:
        usual: the mean value of each input, SI.
        notes: name of the YAML file to write the unit into.
        columns: those of the file, by Pliant's name.
    """
    doubts = []
    for name, value in usual.items():
        column = columns.get(name)
        if column is None or not VACUUM.search(plain_words(column.written)) or column.scale < 0 or value <= 0:
            continue
        unit = column.in_unit or column.unit
        text = (
            f"{column.written} is called a vacuum and is positive: pressures count from the surroundings. If it counts "
            f"downward, write 'units: {{{as_key(column.written)}: -1 {unit}}}' in {notes}. Nothing was changed."
        )
        doubts.append(Doubt(column.written, "sign", text))
    return doubts


def as_remark(doubt: Doubt) -> Remark:
    """Return a doubt's sentence as a remark."""
    if doubt.kind == "unit":
        return Remark(f"{TO_CHECK}: {doubt.sentence}", Rank.UNIT)
    return Remark(doubt.sentence, Rank.UNIT if doubt.kind == "beginning" else Rank.DATA)


def _advice(text: str, column: FileColumn, written: str, notes: str) -> str:
    if not written:
        return f"{text}. Nothing was changed."
    factor = conversion(written, column.unit, column.written)[0] / column.scale
    by = "" if written == "K" else f", a factor of {factor:g}"
    return (
        f"{text}. If the file is in {written}{by}, write 'units: {{{as_key(column.written)}: {written}}}' in {notes}. "
        "Nothing was changed."
    )


def as_key(written: str) -> str:
    """Return a column's name as a key of YAML."""
    return written if re.fullmatch(r"\w[\w.]*", written) else f'"{written}"'
