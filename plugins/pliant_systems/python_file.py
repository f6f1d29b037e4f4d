"""Reading of a user's Python file: its channels, its tables of numbers, its function.

Every fault of the file is one sentence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from pliant.errors import UserError, closest
from pliant.interfaces.model import Channel
from pliant.registry.files import load_module, shown
from pliant.units import split_unit

PARAMETER, STATE = "parameter", "state"
TABLES = {PARAMETER: "PARAMETERS", STATE: "MISSING"}
LIBRARIES = ("jax", "torch")
# Columns of every recording, which no channel may be.
RESERVED = ("time_s", "run", "specimen")
ENTRY = "write (value, lowest plausible, highest plausible), with a unit and words behind if you like"


@dataclass(frozen=True)
class StatedNumber:
    """A number of the file: its value, its plausible range, its unit and its meaning."""

    value: float
    low: float
    high: float
    unit: str = "1"
    words: str = ""


@dataclass(frozen=True, eq=False)
class PythonFile:
    """The contents of a model's file.

    Attributes:
        where: the file, for messages.
        inputs, outputs: channels in the file's order.
        tables: kind of place → the numbers of its table by name.
        simulate: the user's function.
        library: library that the file states for derivatives; "" without one.
    """

    where: str
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    tables: Mapping[str, Mapping[str, StatedNumber]]
    simulate: Callable[..., Any]
    library: str = ""


def read_python_file(file: Path) -> PythonFile:
    """Execute the file and return its contents; raise `UserError` for a file that fails, or an entry that is wrong."""
    module, where = load_module(file), shown(file)
    for name in ("INPUTS", "OUTPUTS", "simulate"):
        if not hasattr(module, name):
            raise UserError(
                f"{where}: the model has no {name}; it needs INPUTS, OUTPUTS and simulate(time_s, inputs, "
                "parameters)."
            )
    if not callable(module.simulate):
        raise UserError(
            f"{where}: simulate is {module.simulate!r}, no function; write 'def simulate(time_s, inputs, "
            "parameters)'."
        )
    inputs = _channels(where, "INPUTS", module.INPUTS, "input")
    outputs = _channels(where, "OUTPUTS", module.OUTPUTS, "output")
    both = sorted({one.name for one in inputs} & {one.name for one in outputs})
    if both:
        raise UserError(f"{where}: '{both[0]}' is in INPUTS and in OUTPUTS; give one of them another name.")
    library = getattr(module, "DERIVATIVES", "")
    if library not in ("", *LIBRARIES):
        raise UserError(f"{where}: DERIVATIVES is {library!r}; write 'jax' or 'torch', or leave it out.")
    return PythonFile(where, inputs, outputs, _tables(where, module), module.simulate, library)


def _channels(where: str, name: str, stated: Any, what: str) -> tuple[Channel, ...]:
    """Return the channels of INPUTS or OUTPUTS: names, or a dict of names with their ranges."""
    if isinstance(stated, str) or not isinstance(stated, Mapping | list | tuple) or not stated:
        raise UserError(
            f"{where}: {name} is {stated!r}; write a tuple of names, such as ('voltage',), or a dict of names with "
            "their ranges (lowest, highest)."
        )
    ranges = stated if isinstance(stated, Mapping) else {}
    found: list[Channel] = []
    for one in stated:
        if not isinstance(one, str) or not one or one in RESERVED:
            raise UserError(
                f"{where}: {name} has {one!r}, which cannot be a channel's name; write a text other than "
                f"{', '.join(RESERVED)}."
            )
        if one in [channel.name for channel in found]:
            raise UserError(f"{where}: {name} has '{one}' twice; leave one out.")
        low, high = _range(where, name, one, ranges.get(one))
        found.append(Channel(one, split_unit(one)[1], f"{what} '{one}'", low, high))
    return tuple(found)


def _range(where: str, table: str, name: str, stated: Any) -> tuple[float | None, float | None]:
    """Return the range of a channel; None at an open end."""
    if stated is None:
        return None, None
    try:
        low, high = (None if end is None else float(end) for end in stated)
    except (TypeError, ValueError):
        low = high = math.nan
    if not (-math.inf if low is None else low) < (math.inf if high is None else high):
        raise UserError(
            f"{where}: {table}['{name}'] is {stated!r}; write (lowest, highest), None at an open end."
        )
    return low, high


def _tables(where: str, module: ModuleType) -> dict[str, dict[str, StatedNumber]]:
    """Return PARAMETERS and MISSING by kind of place."""
    found: dict[str, dict[str, StatedNumber]] = {}
    for place, table in TABLES.items():
        stated = getattr(module, table, {})
        if not isinstance(stated, Mapping):
            raise UserError(f"{where}: {table} is {stated!r}; write a dict of names, each with {ENTRY[6:]}.")
        found[place] = {name: _number(where, table, name, entry) for name, entry in stated.items()}
    twice = [name for name in found[PARAMETER] if name in found[STATE]]
    if twice:
        raise UserError(
            f"{where}: '{twice[0]}' is in PARAMETERS and in MISSING; give one of them another name."
        )
    return found


def _number(where: str, table: str, name: object, entry: Any) -> StatedNumber:
    """Return an entry ``(value, low, high, unit, words)``, of which the last two may be left out."""
    wrong = UserError(f"{where}: {table}['{name}'] is {entry!r}; {ENTRY}.")
    if not (isinstance(name, str) and name and isinstance(entry, tuple | list) and 3 <= len(entry) <= 5):
        raise wrong
    numbers, texts = entry[:3], entry[3:]
    if not all(isinstance(one, str) for one in texts):
        raise wrong
    try:
        value, low, high = map(float, numbers)
    except (TypeError, ValueError):
        raise wrong from None
    if not (all(map(math.isfinite, (value, low, high))) and low < high):
        raise wrong
    return StatedNumber(value, low, high, (texts[0] if texts else "") or "1", texts[1] if texts[1:] else "")


def stated_number(file: PythonFile, place: str, name: str) -> StatedNumber:
    """Return a number by the kind of its place and its name; raise `UserError` for a name that the file lacks."""
    table = file.tables[place]
    if name not in table:
        known = ", ".join(table) or "no entry"
        raise UserError(
            f"{file.where}: {TABLES[place]} has no '{name}'{closest(name, tuple(table))} It has {known}."
        )
    return table[name]
