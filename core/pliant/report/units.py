"""SI numbers as people read them: a display unit for each quantity, and texts of a sensible length."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

from pliant.records.law import JointKind
from pliant.units import SPOKEN, UNIT_SUFFIXES


@dataclass(frozen=True)
class Unit:
    """A display unit: value shown = SI value × factor."""

    name: str
    factor: float = 1.0

    def text(self, value: float, digits: int = 4) -> str:
        """A value with its unit, e.g. ``15 kPa``."""
        return f"{number(value * self.factor, digits)}{'' if self.name == '°' else ' '}{self.name}".strip()


DEGREES = Unit("°", 180 / math.pi)
MILLIMETRES = Unit("mm", 1e3)
ROUNDING = 1e-20  # nothing that people read is this small
SHOWN = {
    **{unit: Unit(name, factor) for unit, (factor, name) in SPOKEN.items()},
    "N": Unit("N"),
    "s": Unit("s"),
    "kg/m^3": Unit("kg/m³"),
    "m/s^2": Unit("m/s²"),
}


def number(value: Any, digits: int = 4) -> str:
    """A number with `digits` significant digits, without trailing zeros; ``–`` where there is none."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return str(value)
    value = float(value)
    if abs(value) < ROUNDING:
        return "0"
    if 1e-4 <= abs(value) < 1e6:
        decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
        text = f"{value:.{decimals}f}"
        return minus(text.rstrip("0").rstrip(".") if decimals else text)
    mantissa, exponent = f"{value:.{min(digits, 2) - 1}e}".split("e")
    return f"{minus(mantissa)}·10{_superscript(int(exponent))}"


def fixed(value: float, decimals: int) -> str:
    """A number with this many decimals."""
    text = f"{value:.{decimals}f}"
    return minus(text.lstrip("-") if float(text) == 0 else text)


def seconds(value: float) -> str:
    """A duration: ``72.2 s``, ``14.0 ms``, ``3 min 20 s``."""
    if value >= 120:
        return f"{int(value // 60)} min {value % 60:.0f} s"
    if value >= 0.1:
        return f"{value:.1f} s"
    return f"{1e3 * value:.1f} ms" if value >= 1e-4 else f"{1e6 * value:.0f} µs"


def small_length(value_m: float) -> str:
    """A distance in mm, µm or nm."""
    for name, factor in (("mm", 1e3), ("µm", 1e6), ("nm", 1e9)):
        if abs(value_m) * factor >= 1:
            return f"{number(value_m * factor, 2)} {name}"
    return "less than 1 nm" if value_m else "0 mm"


def percent(share: float, digits: int = 2) -> str:
    """A share as a percentage; what is below a millionth is said so."""
    if math.isfinite(share) and 0 < abs(share) < 1e-6:
        return "less than 0.0001 %"
    return f"{number(100 * share, digits)} %"


def of_actuation(name: str) -> Unit:
    """Display unit of an actuation such as ``pressure_pa``, numbered ones included."""
    return SHOWN["N"] if name.endswith("_n") else SHOWN["Pa"]


class Jointed(Protocol):
    """A law, or data, of a joint."""

    @property
    def joint(self) -> JointKind:
        """Kind of the joint."""
        ...


def of_deformation(law: Jointed) -> Unit:
    """Display unit of a joint coordinate."""
    return MILLIMETRES if law.joint == "prismatic" else DEGREES


def of_effort(law: Jointed) -> Unit:
    """Display unit of a joint's effort."""
    return SHOWN["N"] if law.joint == "prismatic" else SHOWN["N*m"]


def of_stress(largest_pa: float) -> Unit:
    """Display unit of stresses up to this one: kPa, or MPa."""
    return Unit("MPa", 1e-6) if largest_pa >= 1e6 else SHOWN["Pa"]


def of_field(field: str) -> tuple[str, Unit]:
    """A field's name without its unit, and its display unit: ``wall_m`` → wall, mm."""
    for suffix, unit in UNIT_SUFFIXES.items():
        if field.endswith(suffix):
            return field.removesuffix(suffix), SHOWN[unit]
    return field, Unit("")


def minus(text: str) -> str:
    """The text with a typographic minus."""
    return text.replace("-", "−")


def _superscript(exponent: int) -> str:
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
