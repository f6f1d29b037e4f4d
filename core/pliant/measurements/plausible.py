"""Wrong units noticed: a column that is a thousand times too small or too large for what it says it is."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from pliant.measurements.columns import unit_of
from pliant.records.measurement import Doubt
from pliant.tabular.units import conversion

# Units that people record in, by SI unit.
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
# Largest magnitudes that soft robots on a bench reach; below the first or above the second is a wrong unit.
USUAL = {
    "Pa": (300.0, 1e7),
    "rad": (0.0, 4 * math.pi),
    "m": (0.0, 10.0),
    "N": (0.0, 2e3),
    "N*m": (0.0, 100.0),
    "kg": (0.0, 30.0),
    "dimensionless": (0.0, 5.0),
}
# What they usually reach, to tell which unit was meant.
TYPICAL = {"Pa": 3e4, "rad": 0.5, "m": 0.05, "N": 1.0, "N*m": 0.05, "kg": 0.03, "dimensionless": 0.2}
TO_CHECK = "Unit to check"
HOT_C = 200.0
LONGEST_STEP_S = 8.0
# How far beyond the caller's range a column may reach, as a factor.
BEYOND = {"rad": 15.0, "dimensionless": 50.0}
BEYOND_OTHERWISE = 100.0


def out_of_range(
    largest: Mapping[str, float], expected: Mapping[str, tuple[float, float]], notes: str
) -> list[Doubt]:
    """A doubt for each column whose largest magnitude does not fit its unit.

    Args:
        largest: the largest magnitude of each column in SI; the unit is in its name.
        expected: the range that the caller knows of some: a law's domain, the chain's length. Without it the usual
            range of benches decides, which is wide. Columns that have the same range share a unit.
        notes: name of the YAML file to write the unit into.
    """
    alike: dict[tuple[float, float], float] = {}
    for name in largest.keys() & expected.keys():
        alike[expected[name]] = max(largest[name], alike.get(expected[name], 0.0))
    sentences = {
        name: _sentence(
            name, value, expected.get(name), notes, alike.get(expected.get(name, (0.0, 0.0)), 0.0)
        )
        for name, value in largest.items()
        if value > 0
    }
    return [Doubt(name, "unit", text) for name, text in sentences.items() if text]


def _sentence(
    name: str, largest: float, expected: tuple[float, float] | None, notes: str, alike: float
) -> str:
    unit = unit_of(name)
    if unit == "degC":
        text = f"{name} reaches {largest:.4g} °C; kelvin?"
        return _advice(text, name, "K", notes) if largest > HOT_C else ""
    reference = max(map(abs, expected)) if expected is not None else 0.0
    if reference > 0:
        beyond = BEYOND.get(unit, BEYOND_OTHERWISE)
        if reference / BEYOND_OTHERWISE <= largest <= reference * beyond:
            return ""
        # a position or a load may well be small; an actuation far below its law's domain may not
        if largest < reference and unit != "Pa" and not name.startswith("tendon_force"):
            return ""
        ratio = largest / reference
        size = f"{ratio:.0f} times" if ratio >= 1 else f"1/{1 / ratio:.0f} of"
        text = f"{name} reaches {largest:.4g}, {size} what the model expects ({reference:.4g})"
    else:
        of_one_joint = re.match(r"joint|base", name)
        low, high = (0.0, math.pi * 1.5) if of_one_joint else USUAL.get(unit, (0.0, math.inf))
        if low <= largest <= high:
            return ""
        reference = TYPICAL[unit]
        written = "" if unit == "dimensionless" else f" {unit}"
        text = f"{name} reaches {'only ' if largest < low else ''}{largest:.4g}{written}, which is unlikely"
    largest = max(largest, alike)

    def distance(factor: float) -> float:
        return abs(math.log(largest * factor / reference))

    nearest = {distance(conversion(other, unit, "")[0]): other for other in reversed(WRITTEN.get(unit, ()))}
    best = min(nearest, default=math.inf)
    return _advice(text, name, nearest[best] if best < distance(1.0) else "", notes)


def time_doubts(step_s: float, whole: bool, notes: str) -> list[Doubt]:
    """One doubt where the usual step of the clock is no time in seconds: whole numbers, far apart."""
    if step_s < LONGEST_STEP_S or not whole:
        return []
    return [
        Doubt(
            "time_s", "unit", _advice(f"time_s steps by {step_s:g}, in whole numbers", "time_s", "ms", notes)
        )
    ]


def as_remark(doubt: Doubt) -> str:
    """A doubt's sentence among the remarks."""
    return f"{TO_CHECK}: {doubt.sentence}" if doubt.kind == "unit" else doubt.sentence


def _advice(text: str, name: str, written: str, notes: str) -> str:
    if not written:
        return f"{text}. Nothing was changed."
    by = "" if written == "K" else f", a factor of {conversion(written, unit_of(name), name)[0]:g}"
    return (
        f"{text}. If the file is in {written}{by}, write 'units: {{{name}: {written}}}' in {notes}. "
        "Nothing was changed."
    )
