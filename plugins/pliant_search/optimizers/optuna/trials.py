"""Candidates as Optuna's trials, and the trials that a sampler learns from, in memory."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import optuna
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.exceptions import ExperimentalWarning
from optuna.storages import InMemoryStorage
from optuna.trial import FrozenTrial, TrialState, create_trial

from pliant_search.optimizer import Space, Trial, Value
from pliant_search.optimizers.cmaes.fitness import ScoredTrial, fitness

VIOLATION = "violation"  # name of the one constraint that a trial has
CANDIDATE = "candidate"  # user attribute: the candidate's number
# Violation of a failed candidate for the sampler: refused, but less than any that breaks a constraint.
FAILED_VIOLATION = 1e-9
LARGEST = 1e300


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress Optuna's progress messages inside the block, whatever the user has set outside."""
    verbosity = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(max(verbosity, optuna.logging.WARNING))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExperimentalWarning)
            yield
    finally:
        optuna.logging.set_verbosity(verbosity)


def distributions(space: Space) -> dict[str, BaseDistribution]:
    """Return variable → its range or choices."""
    found: dict[str, BaseDistribution] = {}
    for v in space.variables:
        if v.type == "categorical":
            found[v.name] = CategoricalDistribution(v.choices)
        elif v.type == "integer":
            found[v.name] = IntDistribution(int(v.low), int(v.high))
        else:
            found[v.name] = FloatDistribution(float(v.low), float(v.high))
    return found


def plain_values(space: Space, params: Mapping[str, Any]) -> dict[str, Value]:
    """Return variable → plain value within its bounds, in the space's order."""
    found: dict[str, Value] = {}
    for v in space.variables:
        value = params[v.name]
        if v.type == "categorical":
            found[v.name] = v.choices[v.choices.index(value)]
        else:
            found[v.name] = (
                int(value) if v.type == "integer" else float(min(max(float(value), v.low), v.high))
            )
    return found


def shown(
    number: int,
    params: Mapping[str, Value],
    ranges: Mapping[str, BaseDistribution],
    objectives: Sequence[float] | None,
    violation: float,
) -> FrozenTrial:
    """Return a trial for viewing: complete; failed without objectives; pruned if it was refused."""
    state = TrialState.COMPLETE
    if objectives is None:
        state = TrialState.PRUNED if violation > 0 else TrialState.FAIL
    return create_trial(
        state=state,
        params=dict(params),
        distributions=dict(ranges),
        values=objectives,
        user_attrs={CANDIDATE: number, VIOLATION: violation, "failed": state is TrialState.FAIL},
        constraints={VIOLATION: violation},
    )


class TrialMemory:
    """A study of Optuna without a storage; trial k is candidate k.

    A sampler ignores trials that Optuna calls failed and would propose similar ones again. A failed or refused
    candidate is therefore stored as a complete trial that breaks a constraint; its objectives, which samplers other
    than gp do not read then, are the worst known ones. A sampler without constraints gets objectives worse than these,
    increasing with the violation.

    Args:
        space: what is searched.
        constraints: whether the sampler uses them.
    """

    def __init__(self, space: Space, constraints: bool = True) -> None:
        self._space, self._ranges = space, distributions(space)
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
        """Return number and values of a new candidate."""
        with quiet():
            self._study.sampler = sampler
            trial = self._study.ask(self._ranges)
            return trial.number, plain_values(self._space, trial.params)

    def tell(self, trial: Trial) -> tuple[tuple[float, ...] | None, float]:
        """Record objectives, None if it failed or was refused, and violation of a candidate."""
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
            standing = fitness([ScoredTrial(None, violation)], self._worst[0] if self._worst else None)
        self._finish(trial.number, standing, violation or FAILED_VIOLATION)
        return None, violation

    def values(self, number: int) -> dict[str, Value]:
        """Return a candidate's values by variable."""
        return plain_values(self._space, self._trials()[number].params)

    def is_open(self, number: int) -> bool:
        """Return whether a candidate was handed out and has no result."""
        known = self._trials()
        return 0 <= number < len(known) and known[number].state is TrialState.RUNNING

    def state(self) -> dict[str, Any]:
        """Return the state for `restore`, as JSON values."""
        return {
            "trials": [  # the fields that a sampler reads; dates are left out
                {
                    "state": trial.state.name,
                    "params": dict(trial.params),
                    "values": list(trial.values) if trial.values is not None else None,
                    "system": dict(trial.system_attrs),
                }
                for trial in self._trials()
            ],
            "study": self._storage.get_study_system_attrs(self._study_id),
            "worst": self._worst,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Fill an empty memory."""
        for values in state["trials"]:
            template = create_trial(
                state=TrialState[values["state"]],
                params=dict(values["params"]),
                distributions={name: self._ranges[name] for name in values["params"]},
                values=values["values"],
                system_attrs=dict(values["system"]),
            )
            self._storage.create_new_trial(self._study_id, template)
        for key, value in state["study"].items():
            self._storage.set_study_system_attr(self._study_id, key, value)
        self._worst = state["worst"]

    @property
    def _study_id(self) -> int:
        return self._storage.get_study_id_from_name(self._study.study_name)

    def _trials(self) -> list[FrozenTrial]:
        return self._storage.get_all_trials(self._study_id, deepcopy=False)

    def _finish(self, number: int, values: Sequence[float], violation: float) -> None:
        if self._constraints:
            constraint = create_trial(state=TrialState.PRUNED, constraints={VIOLATION: violation})
            trial_id = self._storage.get_trial_id_from_study_id_trial_number(self._study_id, number)
            for key, value in constraint.system_attrs.items():
                self._storage.set_trial_system_attr(trial_id, key, value)
        with quiet():
            self._study.tell(number, list(values))
