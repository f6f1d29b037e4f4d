"""Candidates and outcomes as Optuna's trials, and trials as JSON values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.trial import FrozenTrial, TrialState, create_trial

from pliant.interfaces.optimizer import Space, Value, Variable

VIOLATION = "violation"  # name of the one constraint that a trial has
CANDIDATE = "candidate"  # user attribute: the candidate's number


def distributions(space: Space) -> dict[str, BaseDistribution]:
    """Variable → its range or choices."""
    return {v.name: _distribution(v) for v in space.variables}


def plain_values(space: Space, params: Mapping[str, Any]) -> dict[str, Value]:
    """Variable → plain value within its bounds, in the space's order."""
    return {v.name: _value(v, params[v.name]) for v in space.variables}


def as_json(trial: FrozenTrial) -> dict[str, Any]:
    """What a sampler reads of a trial; dates are left out."""
    return {
        "state": trial.state.name,
        "params": dict(trial.params),
        "values": list(trial.values) if trial.values is not None else None,
        "system": dict(trial.system_attrs),
    }


def from_json(values: Mapping[str, Any], ranges: Mapping[str, BaseDistribution]) -> FrozenTrial:
    """The trial that `as_json` wrote."""
    return create_trial(
        state=TrialState[values["state"]],
        params=dict(values["params"]),
        distributions={name: ranges[name] for name in values["params"]},
        values=values["values"],
        system_attrs=dict(values["system"]),
    )


def shown(
    number: int,
    params: Mapping[str, Value],
    ranges: Mapping[str, BaseDistribution],
    objectives: Sequence[float] | None,
    violation: float,
) -> FrozenTrial:
    """A trial as people see it: complete; failed where there are no objectives; pruned where it was refused."""
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


def _distribution(variable: Variable) -> BaseDistribution:
    if variable.type == "categorical":
        return CategoricalDistribution(variable.choices)
    if variable.type == "integer":
        return IntDistribution(int(variable.low), int(variable.high))
    return FloatDistribution(float(variable.low), float(variable.high))


def _value(variable: Variable, value: Any) -> Value:
    if variable.type == "categorical":
        return variable.choices[variable.choices.index(value)]
    if variable.type == "integer":
        return int(value)
    return float(min(max(float(value), variable.low), variable.high))
