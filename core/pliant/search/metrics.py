"""The numbers that a task measured, by the names that formulas use."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.errors import UserError, closest
from pliant.search.expressions import Expression
from pliant.units import UNIT_SUFFIXES, strip_unit_suffix


def with_metrics(
    known: Mapping[str, Any],
    metrics: Mapping[str, Any],
    expressions: Sequence[Expression],
    variables: Sequence[str],
) -> dict[str, Any]:
    """The values of `known` and those of the metrics that the expressions name; `rmse` means `rmse_m` too.

    Args:
        known: variables and keys.
        metrics: of a task.
        expressions: in which metrics are named.
        variables: names that a mistyped one may have meant.

    Raises:
        UserError: a name that is no metric, or a metric that is no number.
    """
    found = dict(known)
    for expression in expressions:
        for symbol in expression.names:
            if symbol.role == "metric" and symbol.name not in found:
                found[symbol.name] = _number(symbol.name, metrics, expression.text, variables)
    return found


def _number(name: str, metrics: Mapping[str, Any], text: str, variables: Sequence[str]) -> float:
    full = metric_name(name, metrics)
    numbers = [strip_unit_suffix(key) for key, value in metrics.items() if _is_number(value)]
    there = f" Numbers that the task gives: {', '.join(numbers) or 'none'}."
    if full is None:
        raise UserError(
            f"the search's '{text}' names '{name}', which is no variable, no key of the study and no metric of its "
            f"task{closest(name, [*numbers, *variables])}{there}"
        )
    if metrics[full] is None:  # not measured in this run
        return math.nan
    if not _is_number(metrics[full]):
        raise UserError(
            f"the search's '{text}' names '{name}', which the task gives, but not as a number.{there}"
        )
    return float(metrics[full])


def metric_name(name: str, metrics: Mapping[str, Any]) -> str | None:
    """The metric that a name means, with or without its unit; None where there is none."""
    endings = ("", *UNIT_SUFFIXES)
    return next((name + ending for ending in endings if name + ending in metrics), None)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.number | np.bool_)
