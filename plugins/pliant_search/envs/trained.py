"""A policy that is trained: inverse statics of the nominal model, and a linear rule for what that misses.

The rule is searched by an optimizer of Pliant's (CMA-ES by default) over episodes in chosen robots: those that the
evidence leaves possible, or the nominal one. It sees what a bench measures, as the controllers of `baselines` do.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pliant.records.design import Array
from pliant_plugins.envs.baselines import Nominal, score
from pliant_plugins.envs.control import MeasuredEnv
from pliant_search.optimizer import Optimizer, Space, Variable

# Features of each input in shares of its range, and the bounds of their gains.
FEATURES: Mapping[str, tuple[float, float]] = {
    "lead": (-2.0, 8.0),  # of the inverse statics over the next two steps
    "curve": (-8.0, 8.0),  # its second difference there
    "error": (-1.0, 3.0),  # of the reading, by the nominal slopes
    "sum": (-0.2, 0.6),  # of the errors
    "change": (-3.0, 3.0),  # of the error in a step, smoothed
    "held": (-0.9, 0.9),  # the last command over its inverse statics
}
SMOOTHED = 0.5
SPREAD = 0.1  # of the gains' ranges, in which the search begins
WORST_SHARE = 0.25  # of the episodes, whose mean error training lowers


class LinearResidual:
    """shares = inverse statics of the next target + gains · features, held to 0…1.

    Args:
        env: for the nominal model.
        gains: (features,) in the order of `FEATURES`, the same for all inputs; zeros are open-loop inverse statics.
        model: the nominal model, where there is one already.
    """

    def __init__(self, env: MeasuredEnv, gains: Array, model: Nominal | None = None) -> None:
        self.gains = np.asarray(gains, float).reshape(len(FEATURES))
        self._model, self._late, self._none = model or Nominal(env), env.late, np.zeros(len(env.inputs))
        self._targets = deque[Array](maxlen=self._late + 1)
        self._sum: Array = self._none
        self._change, self._error, self._last = self._sum, self._sum, self._sum

    def begin(self, info: Mapping[str, Any]) -> None:
        self._rest()

    def act(self, info: Mapping[str, Any]) -> Array:
        self._targets.append(np.asarray(info["target_m"]))
        ahead = info["ahead_m"] if "ahead_m" in info else np.tile(info["target_m"], (3, 1))
        now, first, second, third = (self._model.aim(place) for place in (info["target_m"], *ahead))
        error = now.per_m @ (self._targets[0] - info["measured_tip_m"])
        self._change = self._change + SMOOTHED * (error - self._error - self._change)
        self._error = error
        features = (
            third.shares - first.shares,
            third.shares - 2.0 * second.shares + first.shares,
            error,
            self._sum + error,
            self._change,
            self._last - now.shares,
        )
        wanted = first.shares + self.gains @ np.stack(features)
        shares = np.clip(wanted, 0.0, 1.0)
        self._sum = self._sum + np.where(wanted == shares, error, 0.0)  # no integral at a limit
        self._last = shares
        return np.asarray(2.0 * shares - 1.0)

    def _rest(self) -> None:
        self._sum, self._change, self._error, self._last = (self._none,) * 4
        self._targets.clear()


@dataclass(frozen=True, eq=False)
class Trained:
    """The result of training.

    Attributes:
        policy: with the best gains.
        errors_m: mean error of the worst episodes of each candidate, in order.
    """

    policy: LinearResidual
    errors_m: Array


class Episode(NamedTuple):
    """An environment, a seed of its `reset`, and which of its robots: −1 is the nominal one."""

    env: MeasuredEnv
    seed: int
    world: int


def train(
    policy: LinearResidual,
    episodes: Sequence[Episode],
    *,
    candidates: int,
    optimizer: Optimizer,
    seed: int = 0,
    skip: int = 0,
    **options: Any,
) -> Trained:
    """Search the gains with the least mean error of the worst quarter of the episodes.

    Args:
        policy: where the search begins; its model stays.
        episodes: of environments with the same inputs and control step, several where several models are possible.
        candidates: rules to try at least, each in all episodes.
        optimizer: not yet started.
        seed: of the optimizer.
        skip: steps of each episode whose error does not count.
        options: of every `reset`, such as `path_m`.
    """
    names, first = list(FEATURES), dict(zip(FEATURES, policy.gains.tolist(), strict=True))
    variables = tuple(Variable(name, "real", low, high) for name, (low, high) in FEATURES.items())
    optimizer.start(Space(variables, start=first, spread=SPREAD), seed)
    count = max(1, round(WORST_SHARE * len(episodes)))

    def loss(gains: Array) -> float:
        policy.gains = gains
        found = [
            score(env, policy, range(k, k + 1), skip=skip, world=world, **options)[0]
            for env, k, world in episodes
        ]
        return float(np.sort(found)[-count:].mean())

    best, errors = policy.gains, list[float]()
    while len(errors) < candidates:
        done = []
        for trial in optimizer.ask(optimizer.batch):
            gains = np.array([float(trial.values[name]) for name in names])
            errors.append(loss(gains))
            if errors[-1] == min(errors):
                best = gains
            done.append(trial.scored(errors[-1]))
        optimizer.tell(done)
    policy.gains = best
    return Trained(policy, np.array(errors))
