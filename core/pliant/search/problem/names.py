"""What the names in a search's formulas mean: variables, keys of the study, else metrics of the task."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeGuard

import numpy as np

from pliant.config.searched import Condition, SearchedVariable
from pliant.config.study import Study
from pliant.config.study_keys import KeyPath, StudyKey, study_key
from pliant.errors import UserError, closest
from pliant.records.search import FoundDesign, VariableRecord
from pliant.registry.discovery import Registry
from pliant.search.expressions.formula import NAMED, Symbol
from pliant.search.expressions.parser import Expression
from pliant.units import UNIT_SUFFIXES, si_unit, strip_unit_suffix

RESERVED = (*NAMED, "and")


class Names:
    """Looks names up, and remembers the numbers of the study that formulas name."""

    def __init__(
        self,
        study: Study,
        registry: Registry,
        variables: Sequence[SearchedVariable],
        conditions: Sequence[Condition],
    ) -> None:
        self._study, self._registry = study, registry
        self._variables = {variable.name: variable for variable in variables}
        taken = next((name for name in self._variables if name in RESERVED), None)
        if taken is not None:
            raise UserError(
                f"variable '{taken}' of the search has the name of a function; call it otherwise."
            )
        self._everywhere: dict[KeyPath, SearchedVariable] = {}
        self._sometimes: dict[KeyPath, str] = {
            path: "condition to condition" for c in conditions for path in c.changes
        }
        for variable in variables:
            for path in variable.keys:
                if len(variable.conditions) == len(conditions):
                    self._everywhere[path] = variable
                else:
                    self._sometimes[path] = "condition to condition"
        self._constants: dict[str, Any] = {}

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
        return self._constant(name, key)

    def _constant(self, name: str, key: StudyKey) -> Symbol:
        if key.value is None:
            raise UserError(f"'{name}' is not given in the study, so a formula cannot name it.")
        if isinstance(key.value, bool) or not isinstance(key.value, int | float | str):
            raise UserError(f"'{name}' is neither a number nor a text, so a formula cannot name it.")
        self._constants[key.written] = key.value
        if isinstance(key.value, str):
            return Symbol(key.written, "key", "text")
        return Symbol(key.written, "key", "number", key.sort == "integer", key.unit)

    def resolved(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Symbol's name → value, of variables and of the study's own numbers."""
        return {**self._constants, **values}


def _of_variable(one: SearchedVariable) -> Symbol:
    exact = one.variable.type != "real"
    return Symbol(
        one.name, "variable", "number" if one.numeric else "text", exact, one.unit if one.numeric else None
    )


def with_metrics(
    known: Mapping[str, Any], metrics: Mapping[str, Any], expressions: Sequence[Expression]
) -> dict[str, Any]:
    """The values of `known` and those of the metrics that the expressions name; `rmse` means `rmse_m` too.

    What a task did not measure in this run, or not as a number, is NaN; see `require_metrics`.

    Args:
        known: variables and keys.
        metrics: of a task.
        expressions: in which metrics are named.
    """
    found = dict(known)
    for name, _ in _named(expressions):
        value = metrics.get(metric_name(name, metrics) or "")
        found[name] = float(value) if _is_number(value) else math.nan
    return found


def require_metrics(
    metrics: Mapping[str, Any], expressions: Sequence[Expression], variables: Sequence[str]
) -> None:
    """See that expressions name numbers that a task gives; None is one that it did not measure this time.

    Args:
        metrics: of a task.
        expressions: in which metrics are named.
        variables: names that a mistyped one may have meant.

    Raises:
        UserError: a name that is no metric, or a metric that is no number.
    """
    for name, text in _named(expressions):
        full = metric_name(name, metrics)
        numbers = [strip_unit_suffix(key) for key, value in metrics.items() if _is_number(value)]
        there = f" Numbers that the task gives: {', '.join(numbers) or 'none'}."
        if full is None:
            raise UserError(
                f"the search's '{text}' names '{name}', which is no variable, no key of the study and no metric of "
                f"its task{closest(name, [*numbers, *variables])}{there}"
            )
        if metrics[full] is not None and not _is_number(metrics[full]):
            raise UserError(
                f"the search's '{text}' names '{name}', which the task gives, but not as a number.{there}"
            )


def _named(expressions: Sequence[Expression]) -> Iterator[tuple[str, str]]:
    """Names of metrics with the text that names them."""
    for expression in expressions:
        yield from ((one.name, expression.text) for one in expression.names if one.role == "metric")


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


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float | np.number | np.bool_)
