"""Counts: numbers of successes under set conditions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class CountSet:
    """One row of a counts file: `successes` of `trials` of one series; `line` in the file, 0 in memory."""

    name: str
    successes: int
    trials: int
    line: int = 0


@dataclass(frozen=True)
class CountCondition:
    """A condition with its trials and successes.

    Attributes:
        changes: study key (``task.pressure_pa``) → set value, in the order of the file's columns.
        words: the condition as text, "cylinder, 13 kPa, 2 extra weights".
        sets: the rows of this condition, in the file's order; several rows are repetitions.
    """

    changes: Mapping[str, Any]
    words: str
    sets: tuple[CountSet, ...]

    @property
    def successes(self) -> int:
        """Successful trials of all sets."""
        return sum(one.successes for one in self.sets)

    @property
    def trials(self) -> int:
        """Trials of all sets."""
        return sum(one.trials for one in self.sets)


@dataclass(frozen=True)
class Counts:
    """A counts file.

    Attributes:
        conditions: in the file's order.
        source: the file's name, for messages.
        sha256: of its content; "" for data in memory.
        remarks: changes and observations of the reader, in sentences.
    """

    conditions: tuple[CountCondition, ...]
    source: str = ""
    sha256: str = ""
    remarks: tuple[str, ...] = ()

    @property
    def trials(self) -> int:
        """Trials of all conditions."""
        return sum(condition.trials for condition in self.conditions)
