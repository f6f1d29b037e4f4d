"""Optimizer: proposes designs and learns from their scores."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

from pliant.interfaces.base import ComponentConfig

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


@dataclass(frozen=True)
class Candidate:
    """A proposal: `number` identifies it in `tell`, `values` holds one value per variable.

    `context` is the index of the condition that it is meant for, 0 where there are none.
    """

    number: int
    values: Mapping[str, Value]
    context: int = 0


@dataclass(frozen=True)
class Outcome:
    """What became of a candidate.

    Attributes:
        number: of the candidate.
        objective: is minimised; NaN says that the evaluation failed, or that there was none.
        further: the objectives after the first, where the space has several.
        violation: how far the candidate breaks constraints, 0 where it breaks none. One that breaks a constraint of
            variables was not evaluated and its objective is NaN; one that breaks a constraint on metrics was evaluated
            and has both.
    """

    number: int
    objective: float
    further: tuple[float, ...] = ()
    violation: float = 0.0


class Optimizer(ABC):
    """Ask and tell. The search asks for a batch, evaluates it in any order, tells the outcomes.

    Same seed, same space and same outcomes give the same proposals. `state` and `restore` carry a search
    over an interruption.
    """

    capabilities: ClassVar[OptimizerCapabilities] = OptimizerCapabilities()

    def __init__(self, config: OptimizerConfig) -> None:
        self.config = config

    @property
    def batch(self) -> int:
        """How many candidates a started search should be asked for at a time: a generation."""
        return 8

    @abstractmethod
    def start(self, space: Space, seed: int) -> None:
        """Begin a search."""

    @abstractmethod
    def ask(self, count: int) -> Sequence[Candidate]:
        """One to `count` new candidates, every value within its variable's bounds."""

    @abstractmethod
    def tell(self, outcomes: Sequence[Outcome]) -> None:
        """Learn from outcomes; NaN objectives are survived."""

    @abstractmethod
    def state(self) -> Mapping[str, Any]:
        """The search as JSON values."""

    @abstractmethod
    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue a search exactly where `state` was taken; replaces `start`."""

    def recommend(self) -> Sequence[Candidate]:
        """What has been learned, one candidate per context: the mean of a policy. Empty: the best that was tried."""
        return ()

    def export(self, folder: Path) -> Sequence[Path]:
        """Write what other programs can use (a policy, a database of trials, logs); the files that were written."""
        return ()
