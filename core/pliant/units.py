"""Quantities at the boundary: people write "1.5 mm", Pliant keeps SI numbers with the unit in the name.

A configuration field is declared as ``wall_m: Length`` and may be written ``wall: 1.5 mm``, ``wall: 0.0015``
or ``wall_m: 0.0015`` in a study; bare numbers are SI.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, get_args

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

# Suffixes that name a unit in a field: "module_length_m" may be written "module_length".
UNIT_SUFFIXES = {
    "_kg_m3": "kg/m^3",
    "_m_s2": "m/s^2",
    "_n_m": "N*m",
    "_1_per_m": "m^-1",
    "_m": "m",
    "_pa": "Pa",
    "_kg": "kg",
    "_rad": "rad",
    "_n": "N",
    "_s": "s",
}
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
    "dimensionless": "a pure number",
}

BEYOND = 1e30  # no quantity is larger; its fourth power is still a number
LONGEST_UNIT = 40
POWERS = re.compile(r"(\^|\*\*)\s*[-+]?(\d{3,}|[\d.]+\s*(\^|\*\*))")


# Factors of the commonest units, to the last bit those of `pint`, whose import takes as long as many a command.
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
    "dimensionless": {"%": 1e-2},
}
WITHOUT_DIMENSION = {"rad", "dimensionless"}


class UnitError(ValueError):
    """A text is not a quantity of the wanted dimension."""


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
        r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*((?:[^\W\d_]|[%°])[^()=;,]*)?", stripped
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
    except Exception as error:  # pint raises many kinds for one cause: the unit is not known
        raise UnitError(f"'{text}' has an unknown unit '{name}'; it {wanted}") from error
    try:
        return float(quantity.to(unit).magnitude)
    except Exception as error:
        raise UnitError(f"'{text}' is {_kind_of(quantity, name)}; it {wanted}") from error


def _kind_of(quantity: Any, name: str) -> str:
    for unit, label in NAMES.items():
        if quantity.check(_pint().Quantity(1.0, unit).dimensionality):
            return label
    return f"in {name}"


def split_unit(field: str) -> tuple[str, str]:
    """A field's name as people write it, and its SI unit: ``wall_m`` → wall, m; ``kind`` has none."""
    for suffix, unit in UNIT_SUFFIXES.items():
        if field.endswith(suffix):
            return field.removesuffix(suffix), unit
    return field, ""


def strip_unit_suffix(field: str) -> str:
    """The name that people write: ``wall_m`` → ``wall``, ``kind`` → ``kind``."""
    return split_unit(field)[0]


def si_unit(field: str) -> str:
    """The SI unit that a field's name ends with; "" for a pure number."""
    return split_unit(field)[1]


@dataclass(frozen=True)
class Quantity:
    """Annotation of a pydantic field: a float in `unit`, accepted as a number (SI) or as a text with a unit."""

    unit: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self._parse, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        number = handler(schema)
        text = {"type": "string", "examples": [EXAMPLES.get(self.unit, f"1 {self.unit}")]}
        return {"anyOf": [number, text], "x-unit": self.unit}

    def _parse(self, value: Any) -> Any:
        if isinstance(value, bool):
            raise PydanticCustomError("quantity", "it is true or false, not a number")
        if not isinstance(value, str):
            return value
        try:
            return parse_quantity(value, self.unit)
        except UnitError as error:
            raise PydanticCustomError("quantity", "{sentence}", {"sentence": str(error)}) from None


def quantities_in(*annotations: Any) -> Iterator[Quantity]:
    """The quantities anywhere inside annotations such as `tuple[Length, ...] | None`, and among a field's metadata."""
    for one in annotations:
        if isinstance(one, Quantity):
            yield one
        else:
            yield from quantities_in(*get_args(one))


Length = Annotated[float, Quantity("m")]
Pressure = Annotated[float, Quantity("Pa")]
Mass = Annotated[float, Quantity("kg")]
Angle = Annotated[float, Quantity("rad")]
Force = Annotated[float, Quantity("N")]
Time = Annotated[float, Quantity("s")]
Moment = Annotated[float, Quantity("N*m")]
Density = Annotated[float, Quantity("kg/m^3")]
Acceleration = Annotated[float, Quantity("m/s^2")]
Frequency = Annotated[float, Quantity("Hz")]
Ratio = Annotated[float, Quantity("dimensionless")]
