"""``gymnasium.make("pliant/Design-v0", study="gripper.yaml")``"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np

from pliant.api import open_study
from pliant.errors import UserError, closest
from pliant_plugins.envs.base import stored
from pliant_ppo.episode import Numbers, context_observations, decode_action, episode_spaces
from pliant_search.evaluate.evaluator import Evaluates, evaluator_from_study
from pliant_search.optimizer import Value
from pliant_search.problem.search_problem import SearchProblem


class DesignEnv(gymnasium.Env[Numbers, Numbers]):
    """A study's `search` with episodes of one step: the condition is observed, the action is a design, the reward its
    score.

    Action: one number in [−1, 1] per variable, in the order of `space.variables`: a real goes from low to high, an
    integer the same rounded, choices have equal bins.

    Observation: the features of the condition; where conditions have none, 1 in the condition's own column; the
    constant 1 where the search has no conditions. Each reset draws the condition; option `condition`: its name.

    Reward: minus the first objective if it is minimised, the objective if it is maximised; with the measure of
        `search.robust` if there is one. A design that breaks a constraint, or whose simulation fails, gets
        `failed_reward`.

    `info`: `condition`, `values` (SI), `status` (ok, refused, failed, not_a_number), `metrics`, `cause` (why not ok),
    `violation`, and `is_success` where the search says `until`.

    Args:
        study: path of a study with a `search` block.
        branch: which combination of the `each` variables is searched; the first by default.
        failed_reward: what a design without a score gets.
        opened: makes problem and evaluator from the path; by default `pliant_search`'s own. Each environment makes its
            own, so that environments can run in separate processes.

    Raises:
        UserError: the study or its `search` is wrong, or there is no such branch.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - gymnasium's
    option_names: ClassVar[tuple[str, ...]] = ("condition",)

    def __init__(
        self,
        study: str | Path,
        *,
        branch: int = 0,
        failed_reward: float = -1.0,
        opened: Callable[[str | Path], tuple[SearchProblem, Evaluates]] | None = None,
    ) -> None:
        if not np.isfinite(failed_reward):
            raise UserError(f"failed_reward is {failed_reward}; it needs a finite number.")
        self.problem, self.evaluator = (opened or open_problem)(study)
        branches = self.problem.branches()
        if not 0 <= branch < len(branches):
            raise UserError(f"branch is {branch}; this search has {len(branches)}, counted from 0.")
        self.branch = dict(branches[branch])
        self.space = self.problem.space(contextual=True)
        self.conditions = tuple(context.name for context in self.space.contexts)
        self.failed_reward = float(failed_reward)
        self._seen = context_observations(self.space.contexts)
        self._condition = 0
        self.observation_space, self.action_space = episode_spaces(
            self._seen.shape[1], len(self.space.variables)
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Draw a condition, or take the one that `options` names."""
        super().reset(seed=seed)
        options = options or {}
        for name in options:
            if name not in self.option_names:
                raise UserError(f"unknown option '{name}'; this environment takes {self.option_names[0]}.")
        self._condition = int(self.np_random.integers(len(self.conditions)))
        wanted = options.get("condition")
        if wanted is not None:
            if wanted not in self.conditions:
                raise UserError(f"unknown condition '{wanted}'{closest(str(wanted), self.conditions)}")
            self._condition = self.conditions.index(wanted)
        return self._observed(), {"condition": self._name}

    def step(self, action: Numbers) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        """Try a design in the condition of this episode, which ends with it."""
        values = {**self.branch, **decode_action(action, self.space.variables)}
        reward, info = self._scored(values)
        return self._observed(), reward, True, False, {"condition": self._name, "values": values, **info}

    def _scored(self, values: Mapping[str, Value]) -> tuple[float, dict[str, Any]]:
        found = self.evaluator.evaluate(values, self._condition)
        info = {
            "status": found.state,
            "metrics": dict(found.metrics),
            "cause": found.cause,
            "violation": float(found.violation),
        }
        good = found.state == "ok" and found.violation <= 0
        if self.problem.until is not None:
            info["is_success"] = bool(good and self.problem.reached(values, found.metrics))
        return (-float(found.objectives[0]) if good else self.failed_reward), info

    def _observed(self) -> Numbers:
        return self._seen[self._condition].copy()

    @property
    def _name(self) -> str:
        return self.conditions[self._condition]


def open_problem(study: str | Path) -> tuple[SearchProblem, Evaluates]:
    """Open the search of a study file and its evaluator; stored stages are reused.

    Raises:
        UserError: the study is wrong, or has no `search`.
    """
    opened = open_study(study, store=stored())
    evaluator = evaluator_from_study(opened.context, opened.study)
    return evaluator.problem, evaluator
