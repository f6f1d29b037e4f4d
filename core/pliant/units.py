"""Quantities in user input: people write "1.5 mm", Pliant keeps SI numbers with the unit in the name.

A configuration field is declared as ``wall_m: Length`` and may be written ``wall: 1.5 mm``, ``wall: 0.0015``
or ``wall_m: 0.0015`` in a study; bare numbers are SI.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, get_args

from pydantic import BaseModel, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from pliant_tables.quantities import BEYOND as BEYOND
from pliant_tables.quantities import EXAMPLES as EXAMPLES
from pliant_tables.quantities import NAMES as NAMES
from pliant_tables.quantities import UnitError as UnitError
from pliant_tables.quantities import parse_quantity as parse_quantity

# Suffixes that name a unit in a field: "module_length_m" may be written "module_length". Longer ones come first.
UNIT_SUFFIXES = {
    "_n_m_s": "N*m*s",
    "_m_s": "m/s",
    "_1_per_s": "s^-1",
    "_kelvin": "K",
    "_kg_m3": "kg/m^3",
    "_m_s2": "m/s^2",
    "_n_m": "N*m",
    "_1_per_m": "m^-1",
    "_m2": "m^2",
    "_m": "m",
    "_pa": "Pa",
    "_kg": "kg",
    "_rad": "rad",
    "_n": "N",
    "_s": "s",
}


# `drag_1_s` is per second, and `curvature_per_rad` per radian; `pressure_1_pa` is that of chamber 1.
INVERSE = re.compile(r"_1(?=_s$)|_per(?=_[a-z0-9]+$)")


def split_unit(field: str) -> tuple[str, str]:
    """Return a field's name as people write it, and its SI unit: ``wall_m`` → wall, m; ``kind`` has none.

    A field that is per unit keeps the word before the unit in its name: ``drag_1_s`` → drag_1, s^-1.
    """
    for suffix, unit in UNIT_SUFFIXES.items():
        if field.endswith(suffix):
            inverse = "^-1" if "^" not in unit and INVERSE.search(field) else ""
            return field.removesuffix(suffix), unit + inverse
    return field, ""


def strip_unit_suffix(field: str) -> str:
    """Return the name that people write: ``wall_m`` → ``wall``, ``kind`` → ``kind``."""
    return split_unit(field)[0]


def si_unit(field: str) -> str:
    """Return the SI unit that a field's name ends with; "" for a pure number."""
    return split_unit(field)[1]


def config_field_unit(model: type[BaseModel], field: str) -> str:
    """Return the SI unit of a config's field: that of its type, else of its name; "" for a pure number or unknown.

    A name counts where a study may leave its unit out: the coefficient `k_n` is not in newton.
    """
    info = model.model_fields[field]
    typed = {one.unit for one in quantities_in(info.annotation, *info.metadata)}
    if len(typed) == 1:
        return typed.pop().replace("dimensionless", "")
    stem, unit = split_unit(field)
    return unit if info.validation_alias == stem != field else ""


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
    """Yield the quantities inside annotations such as `tuple[Length, ...] | None`, and in a field's metadata."""
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
Rate = Annotated[float, Quantity("s^-1")]
AngularDamping = Annotated[float, Quantity("N*m*s")]
TemperatureDifference = Annotated[float, Quantity("K")]
Area = Annotated[float, Quantity("m^2")]
Ratio = Annotated[float, Quantity("dimensionless")]
