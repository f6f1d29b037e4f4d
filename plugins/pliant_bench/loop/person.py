"""The operator of a bench, who sets conditions and confirms the first run."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping

from pliant.formatting import output_unit


class Person(ABC):
    """Somebody who can be asked."""

    @abstractmethod
    def set_conditions(self, changes: Mapping[str, float], new_specimen: bool) -> None:
        """Ask for these conditions, and return when they are set."""

    @abstractmethod
    def confirm(self, question: str) -> bool:
        """Return the answer to a question."""


class Nobody(Person):
    """A simulated bench, which sets its own conditions, or an unattended one."""

    def set_conditions(self, changes: Mapping[str, float], new_specimen: bool) -> None:
        """Do nothing."""

    def confirm(self, question: str) -> bool:
        """Return true: the study says `unattended: true`, or nothing can move."""
        return True


def words(name: str, value: float) -> str:
    """Return a condition in words, in its display unit."""
    unit = output_unit(name)
    return f"{unit.label} = {unit.text(value)}"
