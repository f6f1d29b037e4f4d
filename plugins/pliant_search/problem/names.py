"""Resolution of the names in a search's formulas: variables, keys of the study, else metrics of the task."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pliant.config.study import Study
from pliant.config.study_keys import study_key
from pliant.errors import UserError
from pliant.registry.discovery import Registry
from pliant.units import UNIT_SUFFIXES, si_unit, strip_unit_suffix
from pliant_search.expressions import NAMED, Symbol
from pliant_search.records import FoundDesign, VariableRecord
from pliant_search.variables import Condition, SearchedVariable


class FormulaNames:
    """Resolver of names that records the numbers and texts of the study that formulas name.

    Attributes:
        constants: symbol's name → value of the study's keys that were resolved.
    """

    def __init__(
        self,
        study: Study,
        registry: Registry,
        variables: Sequence[SearchedVariable],
        conditions: Sequence[Condition],
    ) -> None:
        self._study, self._registry = study, registry
        self._variables = {variable.name: variable for variable in variables}
        taken = next((name for name in self._variables if name in (*NAMED, "and")), None)
        if taken is not None:
            raise UserError(
                f"variable '{taken}' of the search has the name of a function; call it otherwise."
            )
        setters = [(path, variable) for variable in variables for path in variable.keys]
        everywhere = range(len(conditions))
        self._everywhere = {path: v for path, v in setters if len(v.conditions) == len(everywhere)}
        self._sometimes = {path for condition in conditions for path in condition.changes}
        self._sometimes |= {path for path, _ in setters if path not in self._everywhere}
        self.constants: dict[str, Any] = {}

    def symbol(self, name: str) -> Symbol:
        """Return the symbol of a name.

        Raises:
            UserError: a key that the study lacks, that is not a number, or that differs between conditions.
        """
        if name in self._variables:
            return _variable_symbol(self._variables[name])
        if "." not in name:
            return Symbol(name, "metric")
        key = study_key(self._study, self._registry, name)
        if key.path in self._everywhere:
            return _variable_symbol(self._everywhere[key.path])
        if key.path in self._sometimes:
            own = [v.name for v in self._variables.values() if key.path in v.keys]
            hint = f"; name the variables that set it: {', '.join(own)}" if own else ""
            raise UserError(
                f"'{name}' differs from condition to condition, so a formula cannot name it{hint}."
            )
        if key.value is None:
            raise UserError(f"'{name}' is not given in the study, so a formula cannot name it.")
        if isinstance(key.value, bool) or not isinstance(key.value, int | float | str):
            raise UserError(f"'{name}' is neither a number nor a text, so a formula cannot name it.")
        self.constants[key.written] = key.value
        if isinstance(key.value, str):
            return Symbol(key.written, "key", "text")
        return Symbol(key.written, "key", "number", key.sort == "integer", key.unit)


def _variable_symbol(one: SearchedVariable) -> Symbol:
    sort, unit = ("number", one.unit) if one.numeric else ("text", None)
    return Symbol(one.name, "variable", sort, one.variable.type != "real", unit)  # type: ignore[arg-type]


def metric_name(name: str, metrics: Mapping[str, Any]) -> str | None:
    """Return the metric that a name denotes, with or without its unit; None if there is no such metric."""
    endings = ("", *UNIT_SUFFIXES)
    return next((name + ending for ending in endings if name + ending in metrics), None)


def metric_unit(name: str, metrics: Mapping[str, Any]) -> str:
    """Return the unit of a metric, written with or without its suffix; "" for a pure number or an expression."""
    return si_unit(metric_name(name, metrics) or "")


def objective_unit(name: str, variables: Sequence[VariableRecord], metrics: Mapping[str, Any]) -> str:
    """Return the unit of an objective that is a metric, a variable or a key that a variable sets; else ""."""
    own = (one.unit for one in variables if name in (one.name, *one.keys))
    return next(own, None) or metric_unit(name, metrics)


def acts(variable: VariableRecord, design: FoundDesign) -> bool:
    """Return whether a variable sets its keys in the single condition of a design.

    In other conditions another variable may set them."""
    if design.context < 0:
        return True
    value = design.values[variable.name]
    own = {strip_unit_suffix(key): held for key, held in design.settings.items()}
    keys = [strip_unit_suffix(key) for key in variable.keys]
    return all(key in own and (isinstance(value, str) or own[key] == value) for key in keys)
