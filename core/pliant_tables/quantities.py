"""Written quantities such as "1.5 mm": numbers with a unit, converted to SI."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

EXAMPLES = {
    "m": "1.5 mm",
    "Pa": "15 kPa",
    "kg": "13 g",
    "rad": "30 deg",
    "N": "0.2 N",
    "s": "2 s",
    "N*m": "5 mN*m",
    "kg/m^3": "1150 kg/m^3",
    "m/s^2": "9.81 m/s^2",
    "Hz": "25 Hz",
    "m^-1": "2.5 m^-1",
    "s^-1": "4 1/s",
    "N*m*s": "2 mN*m*s",
    "K": "10 K",
    "m^2": "12 mm^2",
    "dimensionless": "0.49",
}
NAMES = {
    "m": "a length",
    "Pa": "a pressure or modulus",
    "kg": "a mass",
    "rad": "an angle",
    "N": "a force",
    "s": "a time",
    "N*m": "a moment",
    "kg/m^3": "a density",
    "m/s^2": "an acceleration",
    "Hz": "a rate",
    "m^-1": "a curvature",
    "s^-1": "a rate in time",
    "N*m*s": "a damping",
    "K": "a temperature difference",
    "m^2": "an area",
    "dimensionless": "a pure number",
}

BEYOND = 1e30  # larger quantities do not occur; its fourth power is still finite
LONGEST_UNIT = 40
POWERS = re.compile(r"(\^|\*\*)\s*[-+]?(\d{3,}|[\d.]+\s*(\^|\*\*))")


# Factors of the most common units, bitwise equal to `pint`'s, whose import takes as long as many a command.
COMMON = {
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "mbar": 1e2, "bar": 1e5},
    "kg": {"kg": 1.0, "g": 1e-3},
    "rad": {"rad": 1.0, "deg": 0.017453292519943295},
    "N": {"N": 1.0, "mN": 1e-3},
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "N*m": {"N*m": 1.0, "mN*m": 1e-3},
    "kg/m^3": {"kg/m^3": 1.0},
    "m/s^2": {"m/s^2": 1.0},
    "Hz": {"Hz": 1.0},
    "m^-1": {"m^-1": 1.0},
    "m^2": {"m^2": 1.0, "mm^2": 1e-6, "cm^2": 1e-4},
    "dimensionless": {"%": 1e-2},
}
WITHOUT_DIMENSION = {"rad", "dimensionless"}


class UnitError(ValueError):
    """Error of a text that is not a quantity of the wanted dimension."""


@cache
def _pint() -> Any:
    import pint  # imported on first use: most commands never parse a unit

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


def parse_quantity(text: str, unit: str) -> float:
    """Convert a written quantity such as ``"1.5 mm"`` to a float in `unit` (a key of `EXAMPLES`).

    Raises `UnitError` with a sentence when the text is no quantity or has another dimension.
    """
    wanted = f"needs {NAMES.get(unit, unit)} such as '{EXAMPLES.get(unit, '1 ' + unit)}'"
    stripped = text.strip()
    # pint evaluates expressions; only "number unit" is a quantity here.
    match = re.fullmatch(
        r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*((?:(?<=\s)1\s*/\s*)?(?:[^\W\d_]|[%°])[^()=;,]*)?",
        stripped,
    )
    if match is None:
        if re.match(r"[-+]?\d+,\d", stripped):
            raise UnitError(f"'{text}' has a comma; write the decimals with a point, as in '1.5'")
        raise UnitError(f"'{text}' is not a quantity; it {wanted}")
    number, name = float(match[1]), (match[2] or "").strip()
    if abs(number) > BEYOND:
        raise UnitError(f"'{match[1]}' is beyond ±{BEYOND:g}, and no quantity is that large")
    if not name:
        return number
    if len(name) > LONGEST_UNIT or POWERS.search(name):  # pint would compute m**10**10
        raise UnitError(f"'{text}' has an unknown unit '{name}'; it {wanted}")
    if name in COMMON.get(unit, {}):
        return number * COMMON[unit][name]
    other = next((of for of, names in COMMON.items() if name in names), None)
    if other is not None and unit in COMMON and not {unit, other} <= WITHOUT_DIMENSION:
        raise UnitError(f"'{text}' is {NAMES[other]}; it {wanted}")
    registry = _pint()
    try:
        quantity = registry.Quantity(number, registry.parse_units(name.replace("%", "percent")))
    except Exception as error:  # pint raises many exception types for one cause: an unknown unit
        raise UnitError(f"'{text}' has an unknown unit '{name}'; it {wanted}") from error
    try:
        return float(quantity.to(unit).magnitude)
    except Exception as error:
        raise UnitError(f"'{text}' is {_describe_unit(quantity, name)}; it {wanted}") from error


def _describe_unit(quantity: Any, name: str) -> str:
    for unit, label in NAMES.items():
        if quantity.check(_pint().Quantity(1.0, unit).dimensionality):
            return label
    return f"in {name}"
