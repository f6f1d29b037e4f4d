"""The trials that a sampler learns from, in memory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import optuna
from optuna.storages import InMemoryStorage
from optuna.trial import TrialState

from pliant.interfaces.optimizer import Space, Trial, Value
from pliant_plugins.optimizers.cmaes.fitness import Result, fitness
from pliant_plugins.optimizers.optuna import trials
from pliant_plugins.optimizers.optuna.quiet import quiet

# What a failed candidate counts as to the sampler: refused, but less so than any that breaks a constraint.
FAILED_VIOLATION = 1e-9
LARGEST = 1e300


class Memory:
    """A study of Optuna without a storage; trial k is candidate k.

    A sampler ignores trials that Optuna calls failed, and would propose their like again. So a failed or refused
    candidate is told as a complete trial that breaks a constraint; its objectives, which samplers other than gp do not
    read then, are the worst that are known. A sampler that knows no constraints gets objectives behind these, by the
    violation.

    Args:
        space: what is searched.
        constraints: whether the sampler knows them.
    """

    def __init__(self, space: Space, constraints: bool = True) -> None:
        self._space, self._ranges = space, trials.distributions(space)
        self._constraints = constraints
        self._storage = InMemoryStorage()
        with quiet():
            self._study = optuna.create_study(
                storage=self._storage, directions=["minimize"] * space.objectives
            )
        self._worst: list[float] | None = None

    def guess(self, values: Mapping[str, Value]) -> None:
        """Let the first candidate have these values."""
        kept = {
            v.name: v.choices[v.choices.index(values[v.name])]
            if v.type == "categorical"
            else min(max(values[v.name], v.low), v.high)
            for v in self._space.variables
            if v.name in values and (v.type != "categorical" or values[v.name] in v.choices)
        }
        with quiet():
            self._study.enqueue_trial(kept)

    def ask(self, sampler: optuna.samplers.BaseSampler) -> tuple[int, dict[str, Value]]:
        """Number and values of a new candidate."""
        with quiet():
            self._study.sampler = sampler
            trial = self._study.ask(self._ranges)
            return trial.number, trials.plain_values(self._space, trial.params)

    def tell(self, trial: Trial) -> tuple[tuple[float, ...] | None, float]:
        """Its objectives, None where it failed or was refused, and its violation."""
        values = tuple(map(float, trial.objectives))
        violation = float(trial.violation)
        violation = 0.0 if violation <= 0 else min(violation, LARGEST) if violation == violation else LARGEST
        good = violation == 0 and all(map(math.isfinite, values)) and len(values) == self._space.objectives
        if good:
            self._worst = [max(pair) for pair in zip(self._worst or values, values, strict=True)]
            self._finish(trial.number, values, 0.0)
            return values, 0.0
        if self._constraints:
            standing = self._worst or [0.0] * self._space.objectives
        else:
            standing = fitness([Result(None, violation)], self._worst[0] if self._worst else None)
        self._finish(trial.number, standing, violation or FAILED_VIOLATION)
        return None, violation

    def values(self, number: int) -> dict[str, Value]:
        """Of a candidate."""
        return trials.plain_values(self._space, self._trials()[number].params)

    def is_open(self, number: int) -> bool:
        """Whether a candidate was asked for and not told."""
        known = self._trials()
        return 0 <= number < len(known) and known[number].state is TrialState.RUNNING

    def state(self) -> dict[str, Any]:
        """As JSON values."""
        return {
            "trials": [trials.as_json(trial) for trial in self._trials()],
            "study": self._storage.get_study_system_attrs(self._study_id),
            "worst": self._worst,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Fill an empty memory."""
        for values in state["trials"]:
            self._storage.create_new_trial(self._study_id, trials.from_json(values, self._ranges))
        for key, value in state["study"].items():
            self._storage.set_study_system_attr(self._study_id, key, value)
        self._worst = state["worst"]

    @property
    def _study_id(self) -> int:
        return self._storage.get_study_id_from_name(self._study.study_name)

    def _trials(self) -> list[optuna.trial.FrozenTrial]:
        return self._storage.get_all_trials(self._study_id, deepcopy=False)

    def _finish(self, number: int, values: Sequence[float], violation: float) -> None:
        if self._constraints:
            constraint = optuna.trial.create_trial(
                state=TrialState.PRUNED, constraints={trials.VIOLATION: violation}
            )
            trial_id = self._storage.get_trial_id_from_study_id_trial_number(self._study_id, number)
            for key, value in constraint.system_attrs.items():
                self._storage.set_trial_system_attr(trial_id, key, value)
        with quiet():
            self._study.tell(number, list(values))
