"""Designs as actions: one number in [−1, 1] per variable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pliant.interfaces.optimizer import Value, Variable

Numbers = NDArray[np.float32]


def values_of(action: NDArray[np.floating], variables: Sequence[Variable]) -> dict[str, Value]:
    """The design of an action (n,); numbers beyond ±1 count as ±1.

    A real goes from low at −1 to high at +1; an integer is the same rounded, so that its two ends have half a bin
    each, which the numbers beyond ±1 fill up. Choices have equal bins of [−1, 1], in their order.
    """
    shares = 0.5 * (np.clip(np.asarray(action, float).ravel(), -1.0, 1.0) + 1.0)
    return {v.name: _value(v, float(share)) for v, share in zip(variables, shares, strict=True)}


def action_of(values: Mapping[str, Value], variables: Sequence[Variable]) -> Numbers:
    """(n,) the action of a design; 0, the middle, for variables without a value."""
    return np.array([_number(v, values.get(v.name)) for v in variables], np.float32)


def _value(variable: Variable, share: float) -> Value:
    if variable.type == "categorical":
        return variable.choices[min(int(share * len(variable.choices)), len(variable.choices) - 1)]
    value = variable.low + share * (variable.high - variable.low)
    if variable.type == "integer":
        value = float(np.floor(value + 0.5))  # halves up: numpy rounds them to the even number
    value = min(max(value, variable.low), variable.high)
    return int(value) if variable.type == "integer" else value


def _number(variable: Variable, value: Value | None) -> float:
    if variable.type == "categorical":
        if value not in variable.choices:
            return 0.0
        return 2.0 * (variable.choices.index(value) + 0.5) / len(variable.choices) - 1.0
    width = variable.high - variable.low
    if value is None or isinstance(value, str) or width <= 0:
        return 0.0
    return float(np.clip(2.0 * (value - variable.low) / width - 1.0, -1.0, 1.0))
