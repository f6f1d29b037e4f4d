"""Variables as coordinates of a normal distribution.

A real variable is one coordinate 0…1. A whole number is one coordinate in its own steps, which pycma rounds and keeps
from freezing (its `integer_variables`). A choice of two is a whole number 0 or 1, which imposes no order. A choice of
more is one coordinate 0…1 per choice and the largest wins: an index would put choices in an order that they do not
have. Their standard deviation has a lower limit, so that a choice can still change late.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.interfaces.optimizer import Value, Variable
from pliant.records.design import Array

LEAST_CHOICE_STD = 0.1
CHOSEN, NOT_CHOSEN = 0.75, 0.25  # where a guess puts the coordinates of a choice


@dataclass(frozen=True)
class Axis:
    """A variable and the coordinates that encode it; `size` 0 where there is nothing to choose."""

    variable: Variable
    first: int
    size: int

    @property
    def whole(self) -> bool:
        """Whether its coordinate is rounded."""
        v = self.variable
        return self.size == 1 and (v.type == "integer" or v.type == "categorical")

    @property
    def steps(self) -> float:
        """The coordinate's highest value; its lowest is 0."""
        v = self.variable
        return v.high - v.low if v.type == "integer" else 1.0


@dataclass(frozen=True, eq=False)
class Encoding:
    """All axes; n coordinates, at least two since pycma does not search a single one: one without meaning is added.

    Attributes:
        axes: the variables.
        high: (n,) upper bound of each coordinate; the lower bound is 0.
        whole: coordinates that are rounded.
        least_std: (n,) lower limit of the standard deviation; 0 for none.
    """

    axes: tuple[Axis, ...]
    high: Array
    whole: tuple[int, ...]
    least_std: Array

    @classmethod
    def of(cls, variables: Sequence[Variable]) -> Encoding:
        """The encoding of a space's variables."""
        axes: list[Axis] = []
        n = 0
        for variable in variables:
            axes.append(Axis(variable, n, _size(variable)))
            n += axes[-1].size
        high, least = np.ones(max(n, 2)), np.zeros(max(n, 2))
        for axis in axes:
            high[axis.first : axis.first + axis.size] = axis.steps
            if axis.size > 1:
                least[axis.first : axis.first + axis.size] = LEAST_CHOICE_STD
        whole = tuple(axis.first for axis in axes if axis.whole)
        return cls(tuple(axes), high, whole, least)

    def encoded(self, guess: Mapping[str, Value]) -> Array:
        """(n,) coordinates of a guess; variables that it leaves out stand in the middle."""
        x: Array = 0.5 * self.high
        for axis in self.axes:
            v = axis.variable
            if v.name not in guess or axis.size == 0:
                continue
            value = guess[v.name]
            if v.type != "categorical":
                share = (float(value) - v.low) / (v.high - v.low)
                x[axis.first] = min(max(share, 0.0), 1.0) * axis.steps
            elif value in v.choices:
                index = v.choices.index(value)
                if axis.size == 1:
                    x[axis.first] = index
                else:
                    x[axis.first : axis.first + axis.size] = NOT_CHOSEN
                    x[axis.first + index] = CHOSEN
        return x

    def rounded(self, x: Array) -> Array:
        """(n,) coordinates of the very values that x stands for."""
        rounded = x.copy()
        rounded[list(self.whole)] = np.round(x[list(self.whole)])
        return rounded

    def decoded(self, x: Array) -> dict[str, Value]:
        """Variable → value, within its bounds."""
        return {axis.variable.name: _value(axis, x) for axis in self.axes}


def _size(variable: Variable) -> int:
    if variable.type != "categorical":
        return int(variable.high > variable.low)
    return {1: 0, 2: 1}.get(len(variable.choices), len(variable.choices))


def _value(axis: Axis, x: Array) -> Value:
    v = axis.variable
    if v.type == "categorical":
        if axis.size == 0:
            return v.choices[0]
        part = x[axis.first : axis.first + axis.size]
        return v.choices[int(np.argmax(part)) if axis.size > 1 else round(min(max(part[0], 0.0), 1.0))]
    coordinate = float(x[axis.first]) if axis.size else 0.0
    if v.type == "integer":
        return int(min(max(v.low + round(coordinate), v.low), v.high))
    return float(min(max(v.low + coordinate * (v.high - v.low), v.low), v.high))
