"""Optimizer: proposes designs and learns from their scores."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Final, Literal, Self

from pliant.interfaces.base import ComponentConfig, Configured

Value = float | int | str


class OptimizerConfig(ComponentConfig):
    """Base of an optimizer's config."""


@dataclass(frozen=True)
class Variable:
    """One axis of a search: `real` and `integer` have low and high, `categorical` has choices."""

    name: str
    type: Literal["real", "integer", "categorical"]
    low: float = 0.0
    high: float = 1.0
    choices: tuple[Value, ...] = ()


@dataclass(frozen=True)
class Context:
    """A condition that an optimizer with contexts answers with a design of its own: features (k,) of order one."""

    name: str
    features: tuple[float, ...] = ()


@dataclass(frozen=True)
class Space:
    """What is searched.

    Attributes:
        variables: the axes.
        objectives: how many numbers a candidate is scored by, all minimised; more than one only for optimizers
            that can.
        contexts: conditions, each candidate being tried in one of them; empty unless the optimizer knows contexts.
        start: a value for each variable, where the search may begin; empty where nobody knows better.
        spread: how far from `start` the best is thought to lie, as a share of each variable's range; None: anywhere.
    """

    variables: tuple[Variable, ...]
    objectives: int = 1
    contexts: tuple[Context, ...] = ()
    start: Mapping[str, Value] = field(default_factory=dict)
    spread: float | None = None

    def as_json(self) -> dict[str, Any]:
        """The space as dicts, lists, numbers and texts, for the state of an optimizer."""
        return {
            "variables": [{**asdict(v), "choices": list(v.choices)} for v in self.variables],
            "objectives": self.objectives,
            "contexts": [{"name": c.name, "features": list(c.features)} for c in self.contexts],
            "start": dict(self.start),
            "spread": self.spread,
        }

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """The space that `as_json` gave."""
        return cls(
            variables=tuple(Variable(**{**v, "choices": tuple(v["choices"])}) for v in values["variables"]),
            objectives=int(values["objectives"]),
            contexts=tuple(Context(c["name"], tuple(c["features"])) for c in values["contexts"]),
            start=dict(values["start"]),
            spread=values["spread"],
        )


@dataclass(frozen=True)
class OptimizerCapabilities:
    """What an optimizer can do; the search asks before it starts.

    Attributes:
        several_objectives: a front of best compromises instead of one best candidate.
        contexts: it learns from candidates tried in different conditions which design suits which.
    """

    several_objectives: bool = False
    contexts: bool = False


PROPOSED: Final = "proposed"
OK: Final = "ok"
REFUSED: Final = "refused"
FAILED: Final = "failed"
NOT_A_NUMBER: Final = "not_a_number"
State = Literal["proposed", "ok", "refused", "failed", "not_a_number"]


@dataclass(frozen=True)
class Trial:
    """One candidate of a search, from its proposal to its result.

    Attributes:
        number: identifies it to its optimizer, from 0; −1: a recommendation, or nobody's proposal.
        values: one per variable; beyond the optimizer those of the `each` variables too.
        context: index of the one condition that it is for; −1: all of them.
        state: `proposed`, then `ok`; `refused` breaks a constraint of variables or is no possible design, and was not
            simulated; `failed` ended in an error or did not settle; `not_a_number` has an objective that is none.
        objectives: as they are minimised, over conditions and scenarios; empty or NaN unless the state is `ok`.
        violation: sum of the amounts by which constraints are broken, those on metrics too; 0 where none is.
        cause: why the state is not `ok`; which constraints on metrics are broken where it is.
        metrics: numbers that the task measured, SI; mean over the conditions, without scenarios.
        conditions: condition → its metrics.
        scenarios: first objective in each scenario of a robust search.
        simulations: runs of the task.
        wall_s: time of the evaluation.
        first: objectives as the search saw them, of one that was evaluated again (`search.confirm`).
    """

    number: int
    values: Mapping[str, Value]
    context: int = -1
    state: State = PROPOSED
    objectives: tuple[float, ...] = ()
    violation: float = 0.0
    cause: str = ""
    metrics: Mapping[str, float] = field(default_factory=dict)
    conditions: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    scenarios: tuple[float, ...] = ()
    simulations: int = 0
    wall_s: float = 0.0
    first: tuple[float, ...] = ()

    @property
    def objective(self) -> float:
        """The first objective, minimised; NaN where there is none."""
        return self.objectives[0] if self.objectives else math.nan

    @property
    def simulated(self) -> bool:
        """Whether it counts as an evaluation."""
        return self.state not in (PROPOSED, REFUSED)

    @property
    def feasible(self) -> bool:
        """Whether it may be the best."""
        return self.state == OK and self.violation <= 0.0 and all(map(math.isfinite, self.objectives))

    def scored(self, *objectives: float, violation: float = 0.0) -> Trial:
        """The trial evaluated to these objectives; failed where one is not finite, refused where it broke a rule."""
        bad: State = REFUSED if violation > 0.0 else FAILED
        state: State = OK if all(map(math.isfinite, objectives)) else bad
        return replace(self, state=state, objectives=objectives, violation=violation)

    def failed(self, cause: str) -> Trial:
        """The trial, which could not be evaluated."""
        return replace(self, state=FAILED, cause=cause)

    def refused(self, broken: Mapping[str, float]) -> Trial:
        """The trial, which breaks constraints of variables (text → amount)."""
        return replace(self, state=REFUSED, violation=float(sum(broken.values())), cause="; ".join(broken))

    def told(self, objectives: int) -> Trial:
        """What an optimizer is told: as many objectives, NaN unless it was evaluated; a refused one has a violation."""
        scores = self.objectives if self.state == OK else (math.nan,) * objectives
        rule = self.state == REFUSED and not self.violation > 0.0
        return replace(self, objectives=scores, violation=1.0 if rule else self.violation)


class Optimizer(Configured[OptimizerConfig]):
    """Ask and tell. The search asks for a batch, evaluates it in any order, tells the same trials with their results.

    Same seed, same space and same results give the same proposals. `state` and `restore` carry a search
    over an interruption.
    """

    capabilities: ClassVar[OptimizerCapabilities] = OptimizerCapabilities()

    @property
    def batch(self) -> int:
        """How many candidates a started search should be asked for at a time: a generation."""
        return 8

    @abstractmethod
    def start(self, space: Space, seed: int) -> None:
        """Begin a search of this space; the same seed gives the same trials."""

    @abstractmethod
    def ask(self, count: int) -> Sequence[Trial]:
        """One to `count` new trials, every value within its variable's bounds."""

    @abstractmethod
    def tell(self, trials: Sequence[Trial]) -> None:
        """Learn from evaluated trials; NaN objectives (failed, refused) and violations above 0 are survived.

        A trial that breaks a constraint of variables was not evaluated and its objectives are NaN; one that breaks a
        constraint on metrics was evaluated and has both objectives and a violation.
        """

    @abstractmethod
    def state(self) -> Mapping[str, Any]:
        """The search as JSON values."""

    @abstractmethod
    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue a search exactly where `state` was taken; replaces `start`."""

    def recommend(self) -> Sequence[Trial]:
        """What has been learned, one trial per context: the mean of a policy. Empty: the best that was tried."""
        return ()

    def export(self, folder: Path) -> Sequence[Path]:
        """Write what other programs can use (a policy, a database of trials, logs); the files that were written."""
        return ()
