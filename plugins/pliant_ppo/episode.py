"""A search as episodes of one step: designs as actions, the features of a condition as observations.

The same in the optimizer and in `pliant/Design-v0`, so that a policy suits both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant_search.optimizer import Context, Value, Variable

Numbers = NDArray[np.float32]
LIMIT = 10.0  # features are of order one and clipped here


def episode_spaces(observations: int, actions: int) -> tuple[Any, Any]:
    """Return gymnasium's boxes of the features (k,) of a condition and of the action (n,), a number per variable."""
    import gymnasium  # here, since policies are read where it may be missing

    seen = gymnasium.spaces.Box(-LIMIT, LIMIT, (observations,), np.float32)
    return seen, gymnasium.spaces.Box(-1.0, 1.0, (actions,), np.float32)


def decode_action(action: NDArray[np.floating], variables: Sequence[Variable]) -> dict[str, Value]:
    """Return the design of an action (n,); numbers beyond ±1 count as ±1.

    A real goes from low at −1 to high at +1; an integer is the same rounded, so that its two ends have half a bin
    each, which the numbers beyond ±1 fill up. Choices have equal bins of [−1, 1], in their order.
    """
    shares = 0.5 * (np.clip(np.asarray(action, float).ravel(), -1.0, 1.0) + 1.0)
    return {v.name: _value(v, float(share)) for v, share in zip(variables, shares, strict=True)}


def encode_action(values: Mapping[str, Value], variables: Sequence[Variable]) -> Numbers:
    """Return the (n,) action of a design; 0, the middle, for variables without a value."""
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


def context_observations(contexts: Sequence[Context]) -> Numbers:
    """Return (c, k) one row per context: its features, up to ±10.

    Where no context has features, a row says which one it is (1 in its own column); without contexts there is one row
    with the constant 1.

    Raises:
        UserError: contexts have different numbers of features.
    """
    if not any(context.features for context in contexts):
        return np.eye(max(len(contexts), 1), dtype=np.float32)
    lengths = {len(context.features) for context in contexts}
    if len(lengths) > 1:
        raise UserError(
            f"the contexts have {' and '.join(map(str, sorted(lengths)))} features; "
            "a policy needs the same number from each."
        )
    return np.clip([context.features for context in contexts], -LIMIT, LIMIT).astype(np.float32)


def context_index(number: int, contexts: int, seed: int) -> int:
    """Return a candidate's context: every `contexts` candidates try each once, in a drawn order."""
    if contexts <= 1:
        return 0
    round_, place = divmod(number, contexts)
    return int(np.random.default_rng((seed, round_)).permutation(contexts)[place])
