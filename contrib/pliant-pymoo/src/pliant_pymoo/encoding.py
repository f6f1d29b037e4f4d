"""Variables as coordinates 0…1 of an evolutionary search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pliant.records.design import Array
from pliant_search.optimizer import Value, Variable

CHOSEN, NOT_CHOSEN = 0.75, 0.25  # where a guess puts the coordinates of a choice


def size(variables: Sequence[Variable]) -> int:
    """Return the number of coordinates: one for a number, one for each choice."""
    return sum(_width(variable) for variable in variables)


def decoded(variables: Sequence[Variable], x: Array) -> dict[str, Value]:
    """Return variable → value for coordinates x (n,). Integers have equal shares of 0…1; the largest choice wins."""
    values: dict[str, Value] = {}
    first = 0
    for v in variables:
        part = np.clip(x[first : first + _width(v)], 0.0, 1.0)
        first += _width(v)
        if v.type == "categorical":
            values[v.name] = v.choices[int(np.argmax(part))]
        elif v.type == "integer":
            steps = round(v.high - v.low) + 1
            values[v.name] = int(v.low) + min(int(part[0] * steps), steps - 1)
        else:
            values[v.name] = float(min(max(v.low + part[0] * (v.high - v.low), v.low), v.high))
    return values


def encoded(variables: Sequence[Variable], guess: Mapping[str, Value], x: Array) -> Array:
    """Return coordinates (n,) that decode to the guess; omitted variables stay as in x."""
    told = np.array(x, float)
    first = 0
    for v in variables:
        width = _width(v)
        value = guess.get(v.name)
        if v.type == "categorical" and value in v.choices:
            told[first : first + width] = NOT_CHOSEN
            told[first + v.choices.index(value)] = CHOSEN
        elif v.type == "integer" and value is not None:
            told[first] = (float(value) - v.low + 0.5) / (v.high - v.low + 1)
        elif v.type == "real" and value is not None and v.high > v.low:
            told[first] = (float(value) - v.low) / (v.high - v.low)
        first += width
    return np.clip(told, 0.0, 1.0)


def _width(variable: Variable) -> int:
    return len(variable.choices) if variable.type == "categorical" else 1
