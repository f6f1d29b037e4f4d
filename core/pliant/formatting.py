"""Formatting of SI numbers for people: rounded numbers, quantities in display units, lists.

`DISPLAY` decides in which unit each quantity is shown, on the terminal, on pages, in tables and in pictures:
change it here and nowhere else. A file in mbar is reported in mbar: `displayed_in` gives the units of a file precedence
over `DISPLAY` for a block of code. JSON, CSV and study files do not go through this module.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol

from pliant.units import split_unit
from pliant_tables.wording import listed as listed
from pliant_tables.wording import plural as plural


@dataclass(frozen=True)
class Unit:
    """A display unit: value shown = SI value × factor; `word` where a sentence spells the symbol out."""

    symbol: str
    factor: float = 1.0
    word: str = ""

    def text(self, value: float, digits: int = 4) -> str:
        """Return an SI value in this unit, e.g. ``15 kPa``."""
        return self.attached(number(value * self.factor, digits))

    def attached(self, text: str) -> str:
        """Return a text of numbers that are in this unit already, with the symbol: ``3 to 5 kPa``, ``12°``."""
        return f"{text}{'' if self.symbol == '°' else ' '}{self.symbol}".strip()


@dataclass(frozen=True)
class NamedUnit(Unit):
    """The display unit of a named quantity, such as a column of a table, and its name in words."""

    label: str = ""

    @property
    def axis(self) -> str:
        """The label of an axis or of a column: ``tip x (mm)``."""
        return f"{self.label} ({self.symbol})" if self.symbol else self.label


# SI unit → display unit. Units that are not listed are shown in SI.
DISPLAY = {
    "m": Unit("mm", 1e3),
    "Pa": Unit("kPa", 1e-3),
    "kg": Unit("g", 1e3),
    "rad": Unit("°", 180 / math.pi, "degrees"),
    "N*m": Unit("mN·m", 1e3),
    "kg/m^3": Unit("kg/m³"),
    "m/s^2": Unit("m/s²"),
    "strain": Unit("%", 100.0),
    "degC": Unit("°C"),
    "m^-1": Unit("1/m"),
    "s^-1": Unit("1/s"),
    "rad^-1": Unit("1/rad"),
    "K^-1": Unit("% per K", 100.0),
    "dimensionless": Unit(""),
    "1": Unit(""),
}
# Suffixes of columns and outputs only; the fields of a study have those of `pliant.units` alone.
OF_COLUMNS = {"_pa_s": "Pa/s", "_n_s": "N/s", "_m_s": "m/s", "_strain": "strain", "_c": "degC"}
ROUNDING = 1e-20  # no displayed number is this small
LABELS = {"angle": "bend angle"}  # labels of columns whose name is not readable


NO_UNITS: Mapping[str, Unit] = MappingProxyType({})
_displayed: ContextVar[Mapping[str, Unit]] = ContextVar("units of display", default=NO_UNITS)


def displayed() -> Mapping[str, Unit]:
    """Return the units that precede `DISPLAY` here: names of columns, and SI units, → display unit."""
    return _displayed.get()


@contextmanager
def displayed_in(units: Mapping[str, Unit]) -> Iterator[None]:
    """Show quantities in these units inside the block.

    A context, because sentences, tables and pictures call `display_unit` or `output_unit`: as a parameter the units
    would pass through a hundred functions that do not use them. The setting ends with the block and is not seen by
    other threads; later drawing enters the units that its document keeps.

    Args:
        units: names of columns (``angle_rad``) and SI units (``Pa``) → unit; a name precedes its SI unit.
    """
    token = _displayed.set(units)
    try:
        yield
    finally:
        _displayed.reset(token)


def display_unit(si: str) -> Unit:
    """Return the display unit of an SI unit, rates included: kPa for Pa, kPa/s for Pa/s."""
    if (written := _displayed.get().get(si)) is not None:
        return written
    if si.endswith("/s") and si not in DISPLAY:
        per = display_unit(si.removesuffix("/s"))
        return Unit(f"{per.symbol}/s", per.factor)
    return DISPLAY.get(si, Unit(si))


def named_unit(label: str, si: str = "") -> NamedUnit:
    """Return the display unit of an SI unit with this label."""
    unit = display_unit(si)
    return NamedUnit(unit.symbol, unit.factor, label=label)


def stem_and_unit(name: str) -> tuple[str, str]:
    """Return the name of a column or an output without its unit, and that unit: ``pressure_pa_s`` → pressure, Pa/s."""
    suffix = next((suffix for suffix in OF_COLUMNS if name.endswith(suffix)), "")
    return (name.removesuffix(suffix), OF_COLUMNS[suffix]) if suffix else split_unit(name)


def output_unit(name: str) -> NamedUnit:
    """Return the display unit and label of a column or an output, by its suffix: ``tip_x_m`` → "tip x" in mm."""
    stem, si = stem_and_unit(name)
    words = re.sub(r"_+", " ", stem).strip()
    unit = _displayed.get().get(name) or display_unit(si)
    return NamedUnit(unit.symbol, unit.factor, label=LABELS.get(words, words))


def field_stem_and_unit(field: str) -> tuple[str, Unit]:
    """Return a field's name without its unit, and its display unit: ``wall_m`` → wall, mm."""
    stem, si = split_unit(field)
    return stem, display_unit(si)


def quantity(value: Any, si: str = "", digits: int = 4) -> str:
    """Return a value of this SI unit as text: ``7 mm``, ``0.12 mm``; words and switches are not changed."""
    if value is None or isinstance(value, str | bool):
        return str(value)
    return display_unit(si).text(float(value), digits)


def quantities(values: Mapping[str, Any], units: Mapping[str, str]) -> str:
    """Return named values, each in its SI unit: ``n1 4, side 90°``."""
    return ", ".join(f"{name} {quantity(value, units.get(name, ''))}" for name, value in values.items())


def number(value: Any, digits: int = 4) -> str:
    """Return a number with `digits` significant digits, without trailing zeros; ``–`` for None, NaN and infinity."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return minus(str(value))
    value = float(value)
    if abs(value) < ROUNDING:
        return "0"
    if 1e-4 <= abs(value) < 1e6:
        decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
        text = f"{value:.{decimals}f}"
        return minus(text.rstrip("0").rstrip(".") if decimals else text)
    mantissa, exponent = f"{value:.{min(digits, 2) - 1}e}".split("e")
    return f"{minus(mantissa)}·10{str(int(exponent)).translate(SUPERSCRIPT)}"


SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def fixed(value: float, decimals: int) -> str:
    """Return a number with this many decimals."""
    text = f"{value:.{decimals}f}"
    return minus(text.lstrip("-") if float(text) == 0 else text)


def significant_decimals(value: float, sd: float, digits: int = 2) -> int | None:
    """Return the decimals of the sd's last significant digit; without an sd those of four digits of the value."""
    size = sd if 0 < sd < math.inf else abs(value) * 1e-2
    if not 0 < size < math.inf:
        return None
    return min(digits - 1 - math.floor(math.log10(size)), 15)


def rounded_to_sd(value: float, sd: float, digits: int = 2) -> str:
    """Return a value to the last digit of its standard deviation: 0.20 for 0.012, since "0.2" would hide a digit."""
    decimals = significant_decimals(value, sd, digits)
    return number(value, 3) if decimals is None else minus(f"{round(value, decimals):.{max(decimals, 0)}f}")


def with_sd(value: float, sd: float, unit: Unit) -> str:
    """Return an SI value ± its standard deviation in this unit: ``0.213 ± 0.004 kPa``."""
    value, sd = value * unit.factor, sd * unit.factor
    if not (math.isfinite(sd) and sd > 0):
        return unit.attached(number(value, 3))
    if sd > 10 * max(abs(value), 1e-300) or sd < 1e-9 * abs(value):
        return unit.attached(f"{number(value, 3)} ± {number(sd, 2)}")
    return unit.attached(f"{rounded_to_sd(value, sd)} ± {rounded_to_sd(sd, sd)}")


def seconds(value: float) -> str:
    """Return a duration: ``72.2 s``, ``14.0 ms``, ``3 min 20 s``."""
    if value >= 120:
        return f"{int(value // 60)} min {value % 60:.0f} s"
    if value >= 0.1:
        return f"{value:.1f} s"
    return f"{1e3 * value:.1f} ms" if value >= 1e-4 else f"{1e6 * value:.0f} µs"


def small_length(value_m: float) -> str:
    """Return a distance in mm, µm or nm."""
    for name, factor in (("mm", 1e3), ("µm", 1e6), ("nm", 1e9)):
        if abs(value_m) * factor >= 1:
            return f"{number(value_m * factor, 2)} {name}"
    return "less than 1 nm" if value_m else "0 mm"


def percent(share: float, digits: int = 2) -> str:
    """Return a share as a percentage; "less than 0.0001 %" for a share below a millionth."""
    if math.isfinite(share) and 0 < abs(share) < 1e-6:
        return "less than 0.0001 %"
    return f"{number(100 * share, digits)} %"


def whole_percent(share: float) -> str:
    """Return a probability or a share of cases in whole percent; "less than 1 %" where it would read as zero."""
    if 0 < share < 0.01:
        return "less than 1 %"
    return f"{100 * share:.0f} %"


def units_footer(**kinds: str) -> str:
    """Return the footer of a page: ``Lengths in mm, angles in degrees`` from ``lengths="m", angles="rad"``."""
    units = {word: display_unit(si) for word, si in kinds.items()}
    text = ", ".join(f"{word} in {unit.word or unit.symbol}" for word, unit in units.items())
    return text[:1].upper() + text[1:]


def unbroken(text: str) -> str:
    """Return the text without line breaks between a number and its unit."""
    shown = (unit.symbol for unit in (*DISPLAY.values(), *displayed().values()))
    symbols = sorted({"%", "m", "µm", "nm", "N", *shown} - {""}, reverse=True)
    known = "|".join(map(re.escape, symbols))
    return re.sub(rf"(?<=\d) (?=(?:{known})(?!\w))", "\u00a0", text)


def minus(text: str) -> str:
    """Return the text with a typographic minus."""
    return text.replace("-", "−")


def actuation_unit(name: str) -> Unit:
    """Return the display unit of an actuation such as ``pressure_pa``, numbered ones included."""
    return display_unit("N" if name.endswith("_n") else "Pa")


TRAVEL = "e"  # the axis of `records.law.EXTENSION`, which this package may not import


class Jointed(Protocol):
    """A law, or data, of a joint."""

    @property
    def joint(self) -> str:
        """Kind of the joint: "revolute", "spherical", "prismatic" or "extensible"."""
        ...


def slides(law: Jointed, axis: str = "") -> bool:
    """Return whether a joint, or the named axis of one that turns and travels, is a translation."""
    return law.joint == "prismatic" or axis == TRAVEL


def deformation_unit(law: Jointed, axis: str = "") -> Unit:
    """Return the display unit of a joint coordinate; for a joint that turns and travels, of the named axis."""
    return display_unit("m" if slides(law, axis) else "rad")


def effort_unit(law: Jointed, axis: str = "") -> Unit:
    """Return the display unit of a joint's effort; for a joint that turns and travels, of the named axis."""
    return display_unit("N" if slides(law, axis) else "N*m")


def stress_unit(largest_pa: float) -> Unit:
    """Return the display unit of stresses up to this one: that of pressures, or MPa."""
    return Unit("MPa", 1e-6) if largest_pa >= 1e6 else display_unit("Pa")
