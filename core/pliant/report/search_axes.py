"""Variables and objectives of a search as people write them: labels, shown units, places on an axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.formatting import Unit, number
from pliant.records.design import Array
from pliant.units import strip_unit_suffix


@dataclass(frozen=True, eq=False)
class Axis:
    """A variable in its shown unit.

    Attributes:
        name: in the study.
        label: short, without unit.
        unit: that it is shown in.
        type: real, integer or categorical.
        low, high: ends of the range in that unit; first and last index of choices.
        choices: texts; empty for a range.
        values: (n,) of every candidate, choices by their index; NaN where it has none.
        raw: the choices as the record has them.
        each: whether a search was made for each of its values.
    """

    name: str
    label: str
    unit: Unit
    type: str
    low: float
    high: float
    choices: tuple[str, ...]
    values: Array
    raw: tuple[Any, ...] = ()
    each: bool = False

    @property
    def title(self) -> str:
        """Label and unit: ``radius (mm)``."""
        return f"{self.label} ({self.unit.symbol})" if self.unit.symbol and not self.choices else self.label

    def place(self, value: Any) -> float:
        """Where a value of a `FoundDesign` stands: in the shown unit, or the index of a choice; NaN if nowhere."""
        if value is None:
            return float("nan")
        if self.choices:
            return float(next((k for k, choice in enumerate(self.raw) if _same(choice, value)), np.nan))
        return float(value) * self.unit.factor

    def text(self, value: Any) -> str:
        """A value of a `FoundDesign` with its unit."""
        if value is None:
            return "–"
        if isinstance(value, bool | str):
            return number(value) if isinstance(value, bool) else value
        if self.type == "integer" and not self.choices:
            value = round(value)
        return self.unit.text(value)

    def tick(self, shown: float) -> str:
        """A value on the axis, without unit."""
        if self.choices:
            return self.choices[min(max(round(shown), 0), len(self.choices) - 1)]
        return number(round(shown) if self.type == "integer" and not self.unit.symbol else shown, 4)

    def share(self, shown: Array | float) -> Array:
        """Values as shares of the range, 0…1."""
        width = self.high - self.low
        return (
            (np.asarray(shown, float) - self.low) / width if width > 0 else 0.5 + 0 * np.asarray(shown, float)
        )


@dataclass(frozen=True)
class Objective:
    """An objective: its text in the study, its unit where it is a metric with one, and its direction."""

    name: str
    label: str
    unit: Unit
    maximised: bool
    column: int = 0

    @property
    def title(self) -> str:
        """Label and unit."""
        return f"{self.label} ({self.unit.symbol})" if self.unit.symbol else self.label

    @property
    def best_word(self) -> str:
        """Whether low or high is better."""
        return "higher is better" if self.maximised else "lower is better"

    def stated(self, minimised: Array | float) -> Array:
        """As the study states it, in the shown unit, from values as they are minimised (SI)."""
        return np.asarray(minimised, float) * self.unit.factor * (-1.0 if self.maximised else 1.0)

    def text(self, value: float, digits: int = 4) -> str:
        """A value as stated (SI) with its unit."""
        return self.unit.text(float(value), digits)


def choice_text(choice: Any, unit: Unit) -> str:
    """A choice as people read it."""
    if isinstance(choice, int | float) and not isinstance(choice, bool):
        return unit.text(choice)
    return number(choice) if isinstance(choice, bool) else str(choice)


def short_labels(names: Sequence[str]) -> list[str]:
    """Last parts of dotted names as words; as many parts as tell them apart."""
    words = [[strip_unit_suffix(part) for part in name.split(".")] for name in names]
    found = []
    for parts in words:
        for count in range(1, len(parts) + 1):
            if sum(other[-count:] == parts[-count:] for other in words) == 1:
                break
        found.append(" ".join(parts[-count:]).replace("_", " "))
    return found


def _same(choice: Any, value: Any) -> bool:
    if isinstance(choice, int | float) and isinstance(value, int | float):
        return bool(np.isclose(choice, value, rtol=1e-9, atol=1e-12))
    return bool(choice == value)
