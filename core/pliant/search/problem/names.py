"""What the names in a search's formulas mean: variables, keys of the study, else metrics of the task."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pliant.config.searched import Condition, SearchedVariable
from pliant.config.study import Study
from pliant.config.study_keys import study_key
from pliant.errors import UserError
from pliant.records.search import FoundDesign, VariableRecord
from pliant.registry.discovery import Registry
from pliant.search.expressions import NAMED, Symbol
from pliant.units import UNIT_SUFFIXES, si_unit, strip_unit_suffix


class FormulaNames:
    """Looks names up, and remembers the numbers and texts of the study that formulas name.

    Attributes:
        constants: symbol's name → value of those that were looked up.
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
        """What a name means.

        Raises:
            UserError: a key that the study lacks, that is no number, or that differs between conditions.
        """
        if name in self._variables:
            return _of_variable(self._variables[name])
        if "." not in name:
            return Symbol(name, "metric")
        key = study_key(self._study, self._registry, name)
        if key.path in self._everywhere:
            return _of_variable(self._everywhere[key.path])
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


def _of_variable(one: SearchedVariable) -> Symbol:
    sort, unit = ("number", one.unit) if one.numeric else ("text", None)
    return Symbol(one.name, "variable", sort, one.variable.type != "real", unit)  # type: ignore[arg-type]


def metric_name(name: str, metrics: Mapping[str, Any]) -> str | None:
    """The metric that a name means, with or without its unit; None where there is none."""
    endings = ("", *UNIT_SUFFIXES)
    return next((name + ending for ending in endings if name + ending in metrics), None)


def unit_of_metric(name: str, metrics: Mapping[str, Any]) -> str:
    """The unit of a metric, written with or without its suffix; "" for a pure number or an expression."""
    return si_unit(metric_name(name, metrics) or "")


def unit_of_objective(name: str, variables: Sequence[VariableRecord], metrics: Mapping[str, Any]) -> str:
    """The unit of an objective that is a metric, a variable or a key that one sets; "" for any other expression."""
    own = (one.unit for one in variables if name in (one.name, *one.keys))
    return next(own, None) or unit_of_metric(name, metrics)


def acts(variable: VariableRecord, design: FoundDesign) -> bool:
    """Whether a variable sets its keys in the one condition of a design: in others, another one may."""
    if design.context < 0:
        return True
    value = design.values[variable.name]
    own = {strip_unit_suffix(key): held for key, held in design.settings.items()}
    keys = [strip_unit_suffix(key) for key in variable.keys]
    return all(key in own and (isinstance(value, str) or own[key] == value) for key in keys)
