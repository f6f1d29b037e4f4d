"""Units in the names of columns: ``pressure_kpa``, ``angle [deg]``, and units in the notes of a column."""

from __future__ import annotations

import re

from pliant_tables.errors import UserError
from pliant_tables.quantities import UnitError, parse_quantity

# Common endings and their units: `pressure_kpa`, `angle_deg`, `time_ms`.
ENDINGS = {
    **{name.lower(): name for name in ("Pa", "hPa", "kPa", "MPa", "bar", "mbar", "psi", "atm")},
    **{name: name for name in ("m", "mm", "cm", "um", "deg", "rad", "mrad", "kg", "g", "mg")},
    **{"s": "s", "ms": "ms", "us": "us", "ns": "ns", "min": "min", "h": "h", "sec": "s"},
    **{"degree": "deg", "degrees": "deg", "grad": "grad", "in": "inch", "n": "N", "mn": "mN", "kn": "kN"},
    **{"gf": "gf", "kgf": "kgf", "nm": "N*m", "n_m": "N*m", "nmm": "N*mm", "n_mm": "N*mm", "mnm": "mN*m"},
    **{"mn_m": "mN*m", "ncm": "N*cm", "n_cm": "N*cm", "c": "degC", "k": "K", "f": "degF"},
    **{"1_per_m": "m^-1", "1_per_mm": "mm^-1", "per_m": "m^-1", "per_mm": "mm^-1"},
    **{"torr": "torr", "mmhg": "mmHg", "cmh2o": "cmH2O", "inhg": "inHg", "kgf_cm2": "kgf/cm^2"},
    **{"degc": "degC", "degf": "degF", "percent": "percent", "pct": "percent", "strain": "dimensionless"},
}
# Common spellings that `pint` would read as something else or not at all.
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
        "psig": "psi",
        "PSIG": "psi",
        "barg": "bar",
        "mbarg": "mbar",
        "kPag": "kPa",
    },  # gauges, as pressures are here
    **{
        "Sek": "s",
        "Sekunden": "s",
        "seconds": "s",
        "msec": "ms",
        "µs": "us",
        "μs": "us",
        "Min": "min",
    },
    **{"µm": "um", "μm": "um", "gr": "g", "fps": "Hz"},
    **{f"{force}/cm{two}": "kgf/cm^2" for force in ("kgf", "kg", "kp") for two in ("2", "²", "^2")},
    **{f"{force}/{length}2": f"{force}/{length}^2" for force in ("N", "kN") for length in ("mm", "cm", "m")},
    **{"Torr": "torr", "TORR": "torr", "mmhg": "mmHg", "mmH2O": "mmH2O"},
}
# Units written out by instruments, in any capitals.
WORDS = {
    **{
        "seconds": "s",
        "sec": "s",
        "second": "s",
        "milliseconds": "ms",
        "millisec": "ms",
        "millis": "ms",
        "minutes": "min",
        "degrees": "deg",
        "radians": "rad",
    },
    **{
        "millimeters": "mm",
        "millimetres": "mm",
        "meters": "m",
        "metres": "m",
        "inches": "inch",
        "inch": "inch",
    },
    **{"newtons": "N", "newton": "N", "kilopascals": "kPa", "pascals": "Pa", "grams": "g", "kilograms": "kg"},
    **{"lbf": "lbf", "mm/mm": "dimensionless", "in/in": "dimensionless", "ksi": "ksi", "kgf": "kgf"},
}
_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\D.*)?")
_BRACKET = re.compile(r"(.+?)\s*[(\[]\s*([^()\[\]]+?)\s*[)\]]$")
_AROUND = re.compile(r"^(?:in|unit:?|units:?|einheit:?)\s+(?=\S)|\s+(?:since|from|seit)\s.*$", re.IGNORECASE)
_BEHIND = re.compile(r"(.+?)(?:\s*/\s*|\s+in\s+)(\S+)$")  # DIN 1313: "p / kPa"; and "Druck in kPa"


def _split(written: str) -> tuple[str, str | None]:
    match = _BRACKET.match(written)
    if match is None and (match := _BEHIND.match(written)) is not None and not is_unit(match[2]):
        match = None
    return (match[1], _AROUND.sub("", match[2])) if match else (written, None)


def is_unit(text: str) -> bool:
    """Return whether a text is a unit that occurs in tables, in one of its common spellings."""
    return text in SPELLINGS or text in ENDINGS.values() or text == "Hz" or text.lower() in WORDS


def stem(written: str) -> str:
    """Return a name without its trailing unit: in brackets, or after a stroke."""
    return _split(written)[0]


def unit_in(written: str) -> str | None:
    """Return the trailing unit of a name: in brackets, or after a stroke."""
    return _split(written)[1]


def last_word(written: str) -> str | None:
    """Return the unit in the last word of a name: ``Actual PSI`` → psi; a single letter is not a unit."""
    word = written.rpartition(" ")[2] if " " in written.strip() else ""
    return (SPELLINGS.get(word) or ENDINGS.get(word.lower())) if len(word) > 1 else None


def unit_at_the_end(written: str) -> str | None:
    """Return the unit that a name ends in, the longest ending that is one: ``angle_deg`` → deg."""
    if word := last_word(written):
        return word
    ends = [end for end in ENDINGS if written.lower().endswith("_" + end)]
    if written.endswith("_Grad"):
        return "deg"
    return ENDINGS[max(ends, key=len)] if ends else None


def fits(written: str, unit: str) -> bool:
    """Return whether a unit in a common spelling has the same dimension as an SI unit."""
    try:
        _in_unit(1, written, unit)
    except UnitError:
        return False
    return True


def conversion(written: str, unit: str, where: str) -> tuple[float, float]:
    """Return scale and shift from a written unit to an SI unit; raise `UserError` that begins with `where`."""
    try:
        one, shift = (_in_unit(number, written, unit) for number in (1, 0))
    except UnitError as error:
        text = str(error).replace(f"'1 {written}'", f"the unit '{written}'")
        raise UserError(f"{where}: {text}.") from None
    return one - shift, shift


def parse_si_value(written: str | float, unit: str, where: str) -> float:
    """Return a written quantity in an SI unit; a bare number is SI.

    Raises `UserError` that begins with `where`.
    """
    if isinstance(written, str) and (match := _NUMBER.fullmatch(written.strip())) and match[2]:
        scale, shift = conversion(match[2], unit, where)
        return scale * float(match[1]) + shift
    try:
        return float(written)
    except ValueError:
        raise UserError(f"{where}: '{written}' is not a quantity.") from None


def _in_unit(number: float, written: str, unit: str) -> float:
    """Return a number of a written unit in SI; a unit such as "0.01 mm", the travel per motor step, is allowed."""
    if (scaled := _NUMBER.fullmatch(written.strip())) is not None and scaled[2] and written not in SPELLINGS:
        number, written = number * float(scaled[1]), scaled[2]
    if written == "grad":
        raise UnitError("'grad' is a degree in German and a gradian in English; write 'deg' or 'gon'")
    written = SPELLINGS.get(written) or WORDS.get(written.lower(), written)
    return parse_quantity(f"{number} {written.replace('·', '*')}", unit)
