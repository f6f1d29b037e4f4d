"""Values of several inputs in the notation of studies: ``{pressure_1_pa: 20 kPa, pressure_2_pa: 0}``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator

from pliant.errors import UserError
from pliant.records.actuation import actuation_kind
from pliant.units import UnitError, parse_quantity


def read_levels(values: Any) -> Any:
    """Convert quantities to numbers in the SI unit of each input's kind; raise `ValueError` with a sentence."""
    if not isinstance(values, Mapping):
        return values
    return {name: _read(name, value) for name, value in values.items()}


def _read(name: Any, value: Any) -> Any:
    try:
        unit = actuation_kind(str(name)).unit
        number = parse_quantity(value, unit) if isinstance(value, str) else value
    except (UserError, UnitError) as error:
        raise ValueError(str(error).rstrip(".")) from error
    if isinstance(number, int | float) and not math.isfinite(number):
        raise ValueError(f"'{name}' is {value!r}; it should be a finite number in {unit}")
    return number


InputLevels = Annotated[dict[str, float], BeforeValidator(read_levels)]
