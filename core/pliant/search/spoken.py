"""SI numbers of a search as people read them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pliant.records.search import FoundDesign, VariableRecord
from pliant.search.problem.names import metric_name
from pliant.units import SPOKEN, UNIT_SUFFIXES, strip_unit_suffix


def quantity(value: Any, unit: str = "", digits: int = 3) -> str:
    """A value with its unit: ``7 mm``, ``0.12 mm``, ``egg``."""
    if value is None or isinstance(value, str | bool):
        return str(value)
    factor, name = SPOKEN.get(unit, (1.0, unit))
    text = f"{factor * float(value):.{digits}g}"
    return text + (name if name == "°" else f" {name}" if name else "")


def unit_of(name: str, metrics: Mapping[str, Any]) -> str:
    """The unit of a metric, written with or without its suffix; "" for a pure number or an expression."""
    full = metric_name(name, metrics) or ""
    return next((unit for suffix, unit in UNIT_SUFFIXES.items() if full.endswith(suffix)), "")


def unit_of_objective(name: str, variables: Sequence[VariableRecord], metrics: Mapping[str, Any]) -> str:
    """The unit of an objective that is a metric, a variable or a key that one sets; "" for any other expression."""
    own = (one.unit for one in variables if name in (one.name, *one.keys))
    return next(own, None) or unit_of(name, metrics)


def settings(values: Mapping[str, Any], units: Mapping[str, str]) -> str:
    """Variables with their values: ``n1 4, side 90°``."""
    return ", ".join(f"{name} {quantity(value, units.get(name, ''), 4)}" for name, value in values.items())


def acts(variable: VariableRecord, design: FoundDesign) -> bool:
    """Whether a variable sets its keys in the one condition of a design: in others, another one may."""
    if design.context < 0:
        return True
    value = design.values[variable.name]
    own = {strip_unit_suffix(key): held for key, held in design.settings.items()}
    keys = [strip_unit_suffix(key) for key in variable.keys]
    return all(key in own and (isinstance(value, str) or own[key] == value) for key in keys)
