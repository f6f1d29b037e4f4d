"""The numbers that a task measured, by the names that formulas use."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeGuard

import numpy as np

from pliant.errors import UserError, closest
from pliant.records.search import FoundDesign, VariableRecord
from pliant.search.expressions import Expression
from pliant.units import UNIT_SUFFIXES, si_unit, strip_unit_suffix


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
