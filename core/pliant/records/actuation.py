"""Actuations: the inputs that drive a module, each with a name, a unit, and the travel on which it does work.

A law, a problem or a data set of one actuation has its name, `pressure_pa`; with several actuations it has all names
in one text, `pressure_1_pa, pressure_2_pa`, and its arrays of actuations and of slopes by them have an additional
trailing axis, in that order (docs/conventions.md, "Several actuations").
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, TypeAlias

from pliant.errors import UserError

SEPARATOR = ", "
# Values of one state: a number for one actuation, (m,) for several.
Levels: TypeAlias = Any


@dataclass(frozen=True)
class ActuationKind:
    """A quantity that drives modules; `pressure_pa`, or numbered `pressure_1_pa`, are names of the kind "pressure".

    Attributes:
        quantity: the word before the number.
        suffix: unit at the end of the name ("_pa").
        unit: SI unit ("Pa").
        travel: name of its work conjugate, with unit ("volume_change_m3").
        noun: its name in sentences.
        limit: field of an FEM block that bounds it, with unit; "" if only `actuation_max` does.
    """

    quantity: str
    suffix: str
    unit: str
    travel: str
    noun: str = ""
    limit: str = ""

    @property
    def name(self) -> str:
        """The name without a number."""
        return self.quantity + self.suffix

    def matches(self, name: str) -> bool:
        """Return whether an input of this name is of this kind."""
        return re.fullmatch(rf"{re.escape(self.quantity)}(_\d+)?{re.escape(self.suffix)}", name) is not None

    def matches_travel(self, name: str) -> bool:
        """Return whether a travel of this name, numbered or not, is this kind's."""
        stem, _, unit = self.travel.rpartition("_")
        return re.fullmatch(rf"{re.escape(stem)}(_\d+)?_{re.escape(unit)}", name) is not None

    def travel_name(self, name: str) -> str:
        """Return the travel's name with the number of the input: volume_change_2_m3 of pressure_2_pa."""
        number = name.removeprefix(self.quantity).removesuffix(self.suffix)
        stem, _, unit = self.travel.rpartition("_")
        return f"{stem}{number}_{unit}"


_KINDS = {
    kind.name: kind
    for kind in (
        ActuationKind("pressure", "_pa", "Pa", "volume_change_m3", "pressure", "pressure_max_pa"),
        ActuationKind("tendon_force", "_n", "N", "tendon_travel_m", "tendon force", "tendon_force_max_n"),
        # Its conjugate is the tension: a motor sets the tendon's position, and the law includes its elasticity.
        ActuationKind("tendon_travel", "_m", "m", "tendon_tension_n", "tendon travel"),
    )
}


def register(kind: ActuationKind) -> None:
    """Register a kind for the process; plugins do so by the hook `pliant_actuations`.

    Raises:
        UserError: another kind of that name is registered.
    """
    known = _KINDS.setdefault(kind.name, kind)
    if known != kind:
        raise UserError(
            f"the actuation '{kind.name}' is known with unit {known.unit} and travel {known.travel}, and cannot be "
            f"registered with {kind.unit} and {kind.travel}: name it otherwise."
        )


def kinds() -> tuple[ActuationKind, ...]:
    """Return all kinds, those of Pliant first."""
    return tuple(_KINDS.values())


def actuation_kind(name: str) -> ActuationKind:
    """Return the kind of an input's name, numbered or not.

    Raises:
        UserError: no kind has that name.
    """
    for kind in _KINDS.values():
        if kind.matches(name):
            return kind
    raise UserError(f"'{name}' is no actuation: it should be {expected()}.")


def is_known(name: str) -> bool:
    """Return whether an input's name is of a registered kind."""
    return any(kind.matches(name) for kind in _KINDS.values())


def is_travel(name: str) -> bool:
    """Return whether a name is the travel of a registered kind."""
    return any(kind.matches_travel(name) for kind in _KINDS.values())


def driving(names: Iterable[str]) -> list[str]:
    """Return the inputs among the columns of a table, without travels of other inputs in it.

    With `tendon_force_n` in the table, `tendon_travel_m` is the travel of the tendon; without it, an input.
    """
    known = [name for name in names if is_known(name)]
    worked_on = {actuation_kind(name).travel_name(name) for name in known}
    return [name for name in known if name not in worked_on]


def expected() -> str:
    """Return the allowed names of inputs, for messages."""
    return " or ".join(f"{kind.name}, {kind.quantity}_1{kind.suffix}, …" for kind in _KINDS.values())


def split_actuation_names(actuation_name: str) -> tuple[str, ...]:
    """Return the names in a text such as `pressure_1_pa, pressure_2_pa`, in their order."""
    return tuple(actuation_name.split(SEPARATOR))


def joined(names: Iterable[str]) -> str:
    """Return the text from which `split_actuation_names` reads the names."""
    return SEPARATOR.join(names)
