"""Units in the names of columns: ``pressure_kpa``, ``angle [deg]``, and what notes say of a column."""

from __future__ import annotations

import re

from pliant.errors import UserError
from pliant.units import UnitError, parse_quantity

# Endings that people write, and what they mean: `pressure_kpa`, `angle_deg`, `time_ms`.
ENDINGS = {
    **{name.lower(): name for name in ("Pa", "hPa", "kPa", "MPa", "bar", "mbar", "psi", "atm")},
    **{name: name for name in ("m", "mm", "cm", "um", "deg", "rad", "mrad", "kg", "g", "mg")},
    **{"s": "s", "ms": "ms", "us": "us", "min": "min", "h": "h", "sec": "s"},
    **{"degree": "deg", "degrees": "deg", "grad": "grad", "in": "inch", "n": "N", "mn": "mN", "kn": "kN"},
    **{"gf": "gf", "kgf": "kgf", "nm": "N*m", "n_m": "N*m", "nmm": "N*mm", "n_mm": "N*mm", "mnm": "mN*m"},
    **{"mn_m": "mN*m", "ncm": "N*cm", "n_cm": "N*cm", "c": "degC", "k": "K", "f": "degF"},
    **{"degc": "degC", "degf": "degF", "percent": "percent", "pct": "percent", "strain": "dimensionless"},
}
_BRACKET = re.compile(r"(.+?)\s*[(\[]\s*([^()\[\]]+?)\s*[)\]]$")


def stem(written: str) -> str:
    """A name without the unit in brackets behind it."""
    match = _BRACKET.match(written)
    return match[1] if match else written


def unit_in(written: str) -> str | None:
    """The unit in brackets behind a name."""
    match = _BRACKET.match(written)
    return match[2] if match else None


def unit_at_the_end(written: str) -> str | None:
    """The unit that a name ends in, the longest ending that is one: ``angle_deg`` → deg."""
    ends = [end for end in ENDINGS if written.lower().endswith("_" + end)]
    return ENDINGS[max(ends, key=len)] if ends else None


def fits(written: str, unit: str) -> bool:
    """Whether a unit as people write it is one of the same kind as an SI unit."""
    try:
        _in_unit(1, written, unit)
    except UnitError:
        return False
    return True


def conversion(written: str, unit: str, where: str) -> tuple[float, float]:
    """Scale and shift from a unit as people write it to an SI unit, or a `UserError` that begins with `where`."""
    try:
        one, shift = (_in_unit(number, written, unit) for number in (1, 0))
    except UnitError as error:
        raise UserError(f"{where}: {error}.") from None
    return one - shift, shift


def _in_unit(number: int, written: str, unit: str) -> float:
    return parse_quantity(f"{number} {written.replace('·', '*')}", unit)
