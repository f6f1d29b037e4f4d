"""Variables that set one key in different conditions, as one axis of a search that answers conditions.

The merged variable is a share 0…1 of each one's own range, so that one policy serves an egg whose inset runs from 0 to
16 mm and a cylinder whose inset runs from −4 to 4 mm. Choices are merged where they are the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pliant.config.searched import SearchedVariable
from pliant.config.study_keys import KeyPath
from pliant.interfaces.optimizer import Value, Variable
from pliant.records.search import VariableRecord


@dataclass(frozen=True)
class SharedVariable:
    """One axis for several variables of the same keys.

    Attributes:
        variable: the axis, named like the key: real 0…1, or the choices that all have.
        of: the variables that it stands for.
    """

    variable: Variable
    of: tuple[SearchedVariable, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variables."""
        return tuple(one.name for one in self.of)

    @property
    def middle(self) -> Value:
        """Where a search begins that knows nothing better."""
        return self.variable.choices[0] if self.variable.choices else 0.5

    def value_in(self, full: Mapping[str, Value], condition: int) -> Value:
        """The value that the key gets in a condition, from one per variable; NaN where none of them sets it."""
        return next((full[one.name] for one in self.of if condition in one.conditions), math.nan)

    def record(self) -> VariableRecord:
        """Of the key's value, over the ranges of all: what people are shown instead of shares."""
        first, ranges = self.of[0], [one.variable for one in self.of]
        low, high = min(float(r.low) for r in ranges), max(float(r.high) for r in ranges)
        axis = first.variable
        return VariableRecord(
            self.variable.name, first.written, axis.type, low, high, axis.choices, first.unit
        )


def shared_variables(variables: Sequence[SearchedVariable]) -> tuple[SharedVariable, ...]:
    """The groups of two and more variables, none of them `each`, that set the same keys and can be one."""
    groups: dict[tuple[KeyPath, ...], list[SearchedVariable]] = {}
    for one in variables:
        if not one.each:
            groups.setdefault(one.keys, []).append(one)
    return tuple(
        SharedVariable(_axis(group), tuple(group))
        for group in groups.values()
        if len(group) > 1 and len({_fits(one) for one in group}) == 1
    )


def expanded(values: Mapping[str, Value], shared: Sequence[SharedVariable]) -> dict[str, Value]:
    """One value per variable: each merged axis gives every variable that it stands for its share of its range."""
    found = dict(values)
    for group in shared:
        if group.variable.name in found and not set(group.names) <= set(found):
            share = found.pop(group.variable.name)
            found.update({one.name: _at(one.variable, share) for one in group.of})
    return found


def _fits(one: SearchedVariable) -> tuple[Value, ...]:
    """What must be equal for two variables to be one: choices, or being a range."""
    return one.variable.choices


def _axis(group: Sequence[SearchedVariable]) -> Variable:
    name = group[0].written[0]
    if group[0].variable.type == "categorical":
        return Variable(name, "categorical", choices=group[0].variable.choices)
    return Variable(name, "real", 0.0, 1.0)


def _at(axis: Variable, share: Value) -> Value:
    if axis.type == "categorical" or isinstance(share, str):
        return share
    value = axis.low + float(share) * (axis.high - axis.low)
    if axis.type == "real":
        return min(max(value, axis.low), axis.high)
    count = int(axis.high - axis.low) + 1  # equal shares for all whole numbers
    return int(axis.low) + min(int(float(share) * count), count - 1)
