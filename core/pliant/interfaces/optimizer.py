"""Optimizer: proposes designs and learns from their scores."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

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
class Candidate:
    """A proposal: `number` identifies it in `tell`, `values` holds one value per variable."""

    number: int
    values: Mapping[str, Value]


@dataclass(frozen=True)
class Outcome:
    """What became of a candidate. `objective` is minimised; NaN says that the evaluation failed."""

    number: int
    objective: float


class Optimizer(ABC):
    """Ask and tell. The optimize stage asks for a batch, evaluates it in any order, tells the outcomes.

    Same seed, same variables and same outcomes give the same proposals. `state` and `restore` carry a search
    over an interruption.
    """

    def __init__(self, config: OptimizerConfig) -> None:
        self.config = config

    @abstractmethod
    def start(self, variables: Sequence[Variable], seed: int) -> None:
        """Begin a search."""

    @abstractmethod
    def ask(self, count: int) -> Sequence[Candidate]:
        """Up to `count` new candidates, every value within its variable's bounds."""

    @abstractmethod
    def tell(self, outcomes: Sequence[Outcome]) -> None:
        """Learn from outcomes; NaN objectives are survived."""

    @abstractmethod
    def state(self) -> Mapping[str, Any]:
        """The search as JSON values."""

    @abstractmethod
    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue a search exactly where `state` was taken; replaces `start`."""
