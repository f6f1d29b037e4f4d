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
    **{"1_per_m": "m^-1", "1_per_mm": "mm^-1", "per_m": "m^-1", "per_mm": "mm^-1"},
    **{"degc": "degC", "degf": "degF", "percent": "percent", "pct": "percent", "strain": "dimensionless"},
}
# As people write units, where `pint` would read something else or nothing.
SPELLINGS = {
    **{"°": "deg", "Grad": "deg", "degree": "deg", "degrees": "deg", "Degrees": "deg", "gon": "gradian"},
    **{"°C": "degC", "C": "degC", "°F": "degF", "%": "percent", "-": "dimensionless", "1": "dimensionless"},
    **{"1/m": "m^-1", "1/mm": "mm^-1", "1/cm": "cm^-1", "m⁻¹": "m^-1"},
    **{"m/m": "dimensionless", "mm/mm": "dimensionless"},
    **{
        "Nm": "N*m",
        "N m": "N*m",
        "Nmm": "N*mm",
        "N mm": "N*mm",
        "mNm": "mN*m",
        "mN m": "mN*m",
        "Ncm": "N*cm",
    },
    **{"Bar": "bar", "mBar": "mbar", "KPa": "kPa", "kpa": "kPa", "PSI": "psi", "Psi": "psi", "Mpa": "MPa"},
    **{
        "Sek": "s",
        "sec": "s",
        "Sekunden": "s",
        "seconds": "s",
        "msec": "ms",
        "µs": "us",
        "μs": "us",
        "Min": "min",
    },
    **{"µm": "um", "μm": "um", "gr": "g", "fps": "Hz"},
}
_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\D.*)?")
_BRACKET = re.compile(r"(.+?)\s*[(\[]\s*([^()\[\]]+?)\s*[)\]]$")
_BEHIND = re.compile(r"(.+?)(?:\s*/\s*|\s+in\s+)(\S+)$")  # DIN 1313: "p / kPa"; and "Druck in kPa"


def _split(written: str) -> tuple[str, str | None]:
    match = _BRACKET.match(written)
    if match is None and (match := _BEHIND.match(written)) is not None and not is_unit(match[2]):
        match = None
    return (match[1], match[2]) if match else (written, None)


def is_unit(text: str) -> bool:
    """Whether a text is a unit that tables have, in one of the spellings of people."""
    return text in SPELLINGS or text in ENDINGS.values() or text == "Hz"


def stem(written: str) -> str:
    """A name without the unit behind it: in brackets, or after a stroke."""
    return _split(written)[0]


def unit_in(written: str) -> str | None:
    """The unit behind a name: in brackets, or after a stroke."""
    return _split(written)[1]


def unit_at_the_end(written: str) -> str | None:
    """The unit that a name ends in, the longest ending that is one: ``angle_deg`` → deg."""
    ends = [end for end in ENDINGS if written.lower().endswith("_" + end)]
    if written.endswith("_Grad"):
        return "deg"
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
        text = str(error).replace(f"'1 {written}'", f"the unit '{written}'")
        raise UserError(f"{where}: {text}.") from None
    return one - shift, shift


def value_of(written: str | float, unit: str, where: str) -> float:
    """A quantity as people write it, in an SI unit; a bare number is SI. Raises `UserError` with `where` in front."""
    if isinstance(written, str) and (match := _NUMBER.fullmatch(written.strip())) and match[2]:
        scale, shift = conversion(match[2], unit, where)
        return scale * float(match[1]) + shift
    try:
        return float(written)
    except ValueError:
        raise UserError(f"{where}: '{written}' is not a quantity.") from None


def _in_unit(number: float, written: str, unit: str) -> float:
    """Return a number of a written unit in SI; "0.01 mm" is a unit too, of which one step of a motor is worth."""
    if (scaled := _NUMBER.fullmatch(written.strip())) is not None and scaled[2] and written not in SPELLINGS:
        number, written = number * float(scaled[1]), scaled[2]
    if written == "grad":
        raise UnitError("'grad' is a degree in German and a gradian in English; write 'deg' or 'gon'")
    written = SPELLINGS.get(written, written)
    return parse_quantity(f"{number} {written.replace('·', '*')}", unit)
