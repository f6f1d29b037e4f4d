"""What became of one candidate, as plain values: what a worker answers, a journal keeps and an optimizer is told."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from pliant.errors import PliantError, interrupted
from pliant.interfaces.optimizer import Candidate, Outcome, Value

if TYPE_CHECKING:  # workers import the evaluator's parts when they need one
    from pliant.search.evaluation import Evaluation

OK, REFUSED, FAILED, NOT_A_NUMBER = "ok", "refused", "failed", "not_a_number"
NAN = math.nan


class Evaluates(Protocol):
    """What the loop asks of an evaluator."""

    def evaluate(self, values: Mapping[str, Value], context: int = -1) -> Evaluation:
        """What becomes of one candidate."""
        ...


@dataclass(frozen=True)
class Told:
    """One candidate and what it came to.

    Attributes:
        number: of the candidate in its branch.
        context: index of the one condition in which it was tried; −1: in all.
        values: of the space's variables and of the branch.
        status: one of `pliant.records.search.STATUSES`.
        objectives: as they are minimised; NaN unless the status is ok.
        violation: how far it breaks constraints, of metrics too; 0 where it breaks none.
        cause: why it was refused or failed.
        metrics: mean over the conditions.
        conditions: condition → metrics.
        scenarios: objective in each scenario of a robust search.
        simulations: runs of the task.
        wall_s: time of the evaluation.
        first: objectives as the search saw them, of a candidate that was tried again; see `confirming`.
    """

    number: int
    context: int
    values: Mapping[str, Value]
    status: str
    objectives: tuple[float, ...]
    violation: float = 0.0
    cause: str = ""
    metrics: Mapping[str, float] = field(default_factory=dict)
    conditions: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    scenarios: tuple[float, ...] = ()
    simulations: int = 0
    wall_s: float = 0.0
    first: tuple[float, ...] = ()

    @classmethod
    def refused(
        cls, candidate: Candidate, context: int, values: Mapping[str, Value], broken: Mapping[str, float]
    ) -> Told:
        """A candidate that breaks constraints of variables."""
        return cls(
            candidate.number,
            context,
            values,
            REFUSED,
            (),
            violation=float(sum(broken.values())),
            cause="; ".join(broken),
        )

    @property
    def simulated(self) -> bool:
        """Whether it counts as an evaluation."""
        return self.status != REFUSED

    @property
    def feasible(self) -> bool:
        """Whether it may be the best."""
        return self.status == OK and self.violation <= 0.0 and all(map(math.isfinite, self.objectives))

    def outcome(self, objectives: int) -> Outcome:
        """What the optimizer is told; a refused design that states no amount breaks its rule by 1."""
        scores = self.objectives if self.status == OK else (NAN,) * objectives
        violation = self.violation
        if self.status == REFUSED and not violation > 0.0:
            violation = 1.0
        return Outcome(self.number, scores[0], tuple(scores[1:]), violation)

    def as_list(self) -> list[Any]:
        """JSON values in the order of the fields."""
        return [
            self.number,
            self.context,
            dict(self.values),
            self.status,
            list(self.objectives),
            self.violation,
            self.cause,
            dict(self.metrics),
            {name: dict(metrics) for name, metrics in self.conditions.items()},
            list(self.scenarios),
            self.simulations,
            self.wall_s,
        ]

    @classmethod
    def of_list(cls, plain: Sequence[Any]) -> Told:
        """The reverse of `as_list`."""
        row = list(plain)
        row[4], row[9] = tuple(row[4]), tuple(row[9])
        return cls(*row)


@dataclass(frozen=True)
class Task:
    """One candidate to evaluate: number in its branch, all its values, its condition or −1."""

    number: int
    values: Mapping[str, Value]
    context: int = -1

    def failed(self, cause: str) -> Told:
        """It cannot be evaluated."""
        return Told(self.number, self.context, self.values, FAILED, (), cause=cause)


def evaluated(evaluator: Evaluates, task: Task) -> Told:
    """Evaluate one candidate; only what every candidate would meet (`PliantError`) is raised."""
    try:
        found = evaluator.evaluate(task.values, task.context)
    except PliantError:
        raise
    except Exception as error:  # a plugin may fail in any way
        if interrupted(error):
            raise KeyboardInterrupt from None
        text = " ".join(str(error).split())
        return task.failed(f"{type(error).__name__}: {text}" if text else type(error).__name__)
    return Told(
        task.number,
        task.context,
        task.values,
        found.status,
        tuple(float(one) for one in found.objectives) if found.status == OK else (),
        float(found.violation),
        str(found.cause),
        _numbers(found.metrics),
        {str(name): _numbers(metrics) for name, metrics in found.conditions.items()},
        tuple(float(one) for one in found.scenarios),
        int(found.simulations),
        float(found.wall_s),
    )


def _numbers(metrics: Mapping[str, Any]) -> dict[str, float]:
    return {str(name): float(value) for name, value in metrics.items()}
