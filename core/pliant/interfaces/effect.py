"""Effect: one physical effect that a model may lack."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

from pliant.interfaces.base import ComponentConfig
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs, TaskResult

Place = Literal["input", "law", "chain", "output"]


class EffectConfig(ComponentConfig):
    """Base of an effect's config: one field per parameter of the effect."""


@dataclass(frozen=True)
class EffectParameter:
    """A number that calibration may fit.

    `neutral` is the value at which the effect vanishes; `bounds` are hard, `plausible` is the range that
    would not surprise an expert.
    """

    name: str
    unit: str
    neutral: float
    bounds: tuple[float, float]
    plausible: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Model:
    """What effects wrap: a chain, maps of the inputs before it, maps of the result after it."""

    chain: ChainModel
    inputs: tuple[Callable[[Inputs], Inputs], ...] = ()
    outputs: tuple[Callable[[TaskResult], TaskResult], ...] = field(default=())

    def with_(self, **changes: object) -> Model:
        """A copy with some fields replaced."""
        return replace(self, **changes)  # type: ignore[arg-type]


class Effect(ABC):
    """One effect at one of four places: input, joint law, chain, output.

    The simulate stage applies a study's `effects` in their order; an effect never changes a model in place.
    The docstring of a subclass gives the equation and its source.
    """

    place: ClassVar[Place]
    parameters: ClassVar[tuple[EffectParameter, ...]]

    def __init__(self, config: EffectConfig) -> None:
        self.config = config

    @abstractmethod
    def apply(self, model: Model) -> Model:
        """The model with this effect, at the parameter values of the config."""
