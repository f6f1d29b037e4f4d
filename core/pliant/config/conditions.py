"""Conditions of counted trials: what a column of a counts file sets, and numbers that are not known well."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, StringConstraints, model_validator

from pliant.interfaces.base import FrozenModel
from pliant.units import Ratio

Name = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]


class ConditionColumn(FrozenModel):
    """What a column of a counts file sets. ``weights: task.extra_weights`` is short for ``{key: …}``."""

    key: Name = Field(description="a key of the study's task, e.g. task.object or task.object.radius")
    values: dict[str, Any] = Field(
        default_factory=dict,
        description="text in the file: value of the key; as written where it is not listed here",
    )


Condition = Annotated[
    ConditionColumn, BeforeValidator(lambda value: {"key": value} if isinstance(value, str) else value)
]


class PlausibleRange(FrozenModel):
    """A number of the task that is not known well, for `pliant diagnose` on counts."""

    key: Name = Field(description="e.g. task.friction")
    low: Ratio | str = Field(description="with its unit; the range holds 90 % of what would surprise nobody")
    high: Ratio | str = Field(description="the other end")
    where: dict[str, Any] = Field(
        default_factory=dict,
        description="only where these conditions were set, e.g. {task.object: cylinder}; everywhere by default",
    )

    @model_validator(mode="after")
    def _both_ways(self) -> PlausibleRange:
        if isinstance(self.low, str) != isinstance(self.high, str):
            raise ValueError("'low' and 'high' need to be both with a unit, or both plain numbers")
        if not isinstance(self.low, str) and not isinstance(self.high, str) and self.low >= self.high:
            raise ValueError("'low' should be below 'high'")
        return self
