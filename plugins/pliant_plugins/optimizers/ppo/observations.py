"""What the policy sees: the features of a condition."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.optimizer import Context
from pliant_plugins.optimizers.ppo.actions import Numbers

LIMIT = 10.0  # features are of order one and clipped here


def observations_of(contexts: Sequence[Context]) -> Numbers:
    """(c, k) one row per context: its features, up to ±10.

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


def context_of(number: int, contexts: int, seed: int) -> int:
    """The context in which a candidate is tried: every `contexts` candidates try each once, in a drawn order."""
    if contexts <= 1:
        return 0
    round_, place = divmod(number, contexts)
    return int(np.random.default_rng((seed, round_)).permutation(contexts)[place])
