"""The spaces of an episode: the same in the optimizer and in `pliant/Design-v0`, so that a policy suits both."""

from __future__ import annotations

import gymnasium
import numpy as np

from pliant_plugins.optimizers.ppo.observations import LIMIT


def episode_spaces(observations: int, actions: int) -> tuple[gymnasium.spaces.Box, gymnasium.spaces.Box]:
    """Box of the features (k,) of a condition, and box of the action (n,), one number per variable."""
    seen = gymnasium.spaces.Box(-LIMIT, LIMIT, (observations,), np.float32)
    return seen, gymnasium.spaces.Box(-1.0, 1.0, (actions,), np.float32)
