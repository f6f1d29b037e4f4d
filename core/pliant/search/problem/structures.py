"""The combinations of the variables that have a search for each of their values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant.config.searched import SearchedVariable
from pliant.errors import UserError
from pliant.interfaces.optimizer import Value
from pliant.search.expressions.parser import Expression

MOST = 100_000  # searches
MOST_TRIED = 20_000_000  # combinations on the way


def enumerate_branches(
    variables: Sequence[SearchedVariable], constraints: Sequence[Expression], constants: Mapping[str, Any]
) -> tuple[Mapping[str, Value], ...]:
    """All combinations that pass the constraints which name `each` variables only, the first one varying slowest.

    Variables are combined one after another, and a constraint thins them out as soon as all its names have values.

    Raises:
        UserError: nothing passes, or more than `MOST` do.
    """
    axes = [one for one in variables if one.each]
    if not axes:
        return ({},)
    left = of_structures(variables, constraints)
    columns: dict[str, Any] = {}
    count = 1
    for one in axes:
        choices = list(_values(one))
        if count * len(choices) > MOST_TRIED:
            raise UserError(
                f"'search' combines {count} × {len(choices)} values of its 'each' variables, more than {MOST_TRIED}; "
                "narrow their ranges, or search them jointly without 'each'."
            )
        columns = {name: np.repeat(column, len(choices)) for name, column in columns.items()}
        columns[one.name] = np.tile(np.array(choices, dtype=object), count)
        for constraint in [c for c in left if _names(c) <= set(columns)]:
            left.remove(constraint)
            passed = np.broadcast_to(constraint.amount({**constants, **columns}) == 0, len(columns[one.name]))
            columns = {name: column[passed] for name, column in columns.items()}
            if not passed.any():
                raise UserError(
                    f"no combination of the 'each' variables passes the search's constraint '{constraint.text}'."
                )
        count = len(columns[one.name])
    if count > MOST:
        raise UserError(
            f"'search' has {count} combinations of its 'each' variables, more than {MOST}; add constraints, or search "
            "them jointly without 'each'."
        )
    return tuple(dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))


def of_structures(
    variables: Sequence[SearchedVariable], constraints: Sequence[Expression]
) -> list[Expression]:
    """The constraints that name `each` variables only: they choose the searches, and hold no candidate back."""
    each = {one.name for one in variables if one.each}
    return [c for c in constraints if _names(c) and _names(c) <= each and not c.uses("metric")]


def _names(constraint: Expression) -> set[str]:
    return {symbol.name for symbol in constraint.names if symbol.role == "variable"}


def _values(one: SearchedVariable) -> Sequence[Value]:
    axis = one.variable
    return axis.choices if axis.type == "categorical" else range(int(axis.low), int(axis.high) + 1)
