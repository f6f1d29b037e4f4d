"""Limits of the inputs: given by the user, or the domain of the laws' data."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pliant.errors import UserError, closest
from pliant.records.chain import ChainModel
from pliant.records.design import Array


def input_range(chain: ChainModel, name: str) -> tuple[float, float]:
    """Return low and high of an input within the domains of all laws that it drives."""
    limits = []
    for joint in chain.joints:
        law = chain.laws[joint.law]
        first, last = getattr(joint, "drives", None) or (0, len(chain.actuators))
        rows = np.atleast_2d(law.domain.actuation)
        for place, actuator in enumerate(chain.actuators[first:last]):
            if actuator.input == name:
                limits.append(rows[min(place, len(rows) - 1)])
    low, high = np.array(limits).T
    return float(low.max()), float(high.min())


def input_bounds(chain: ChainModel, given: Mapping[str, tuple[float, float]] | None = None) -> Array:
    """Return (k, 2) low and high of each input of the chain.

    Raises:
        UserError: an unknown input, limits in the wrong order, or no limits where the law has none either.
    """
    given = dict(given or {})
    for name in given:
        if name not in chain.inputs:
            raise UserError(
                f"'bounds' names {name}{closest(name, chain.inputs)} The inputs are {', '.join(chain.inputs)}."
            )
    rows = []
    for name in chain.inputs:
        low, high = given.get(name) or input_range(chain, name)
        if not (np.isfinite([low, high]).all() and low < high):
            raise UserError(
                f"the input {name} needs finite bounds, low below high, and has {low:g} to {high:g}: the chain's law "
                f"states none. Give them, for example bounds: {{{name}: [0, 15000]}}."
            )
        rows.append((low, high))
    return np.array(rows, float)
