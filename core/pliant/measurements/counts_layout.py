"""The header of a file of counts: which column is a count, which sets a key of the study's task, and how."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pliant.config.measurements import MeasurementNotes
from pliant.config.task_keys import TaskKey, find_key, known_keys, need_key
from pliant.errors import UserError, closest
from pliant.interfaces.task import TaskConfig
from pliant.measurements.columns import MEASUREMENT
from pliant.tabular.notes import check_named
from pliant.tabular.units import ENDINGS

COUNTS = ("successes", "trials")
TEXTS = ("run", "specimen", "cycle")  # say which set a row is
SLIP = 0.75  # likeness of a column's name to a key from which on it is taken for a slip of the pen


@dataclass(frozen=True)
class ConditionOf:
    """A column that sets a key: how its texts become values. `unit` is what the texts are written in, or ""."""

    column: str
    key: TaskKey
    unit: str
    values: Mapping[str, Any]


@dataclass
class Layout:
    """Which column is what, by its place in the file."""

    places: dict[str, int] = field(default_factory=dict)
    conditions: list[ConditionOf] = field(default_factory=list)
    ignored: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def readings_among(names: Sequence[str]) -> list[str]:
    known = {name: MEASUREMENT.find(name) for name in names}
    return [name for name, column in known.items() if column is not None and column.role == "output"]


def layout_of(
    path: Path, header: Sequence[str], notes: MeasurementNotes, notes_name: str, task: type[TaskConfig]
) -> Layout:
    """Match the header with what counts need and what the task knows."""
    renamed = [*header, *(notes.rename.get(name, name) for name in header)]
    check_named(path, notes_name, "rename", notes.rename, header)
    check_named(path, notes_name, "units", notes.units, renamed)
    check_named(path, notes_name, "conditions", notes.conditions, renamed)
    if readings := readings_among([notes.rename.get(name, name).lower() for name in header]):
        raise UserError(
            f"{path}: the file has counts (successes, trials) and readings ({', '.join(readings)}). A row is one or "
            "the other: put them into two files and compare each."
        )
    layout = Layout()
    taken: dict[tuple[str, ...], str] = {}
    for place, written in enumerate(header):
        name = notes.rename.get(written, written)
        plain = name.lower()
        layout.places[plain if plain in (*COUNTS, *TEXTS) else written] = place
        if not name or plain in COUNTS or plain in TEXTS:
            continue
        condition = _condition(path, written, name, notes, notes_name, task)
        if condition is None:
            layout.ignored.append(written)
            continue
        if condition.key.path in taken:
            raise UserError(
                f"{path}: columns '{taken[condition.key.path]}' and '{written}' both set {condition.key.dotted}; "
                "keep one."
            )
        taken[condition.key.path] = written
        layout.conditions.append(condition)
    _check_layout(path, layout, header)
    return layout


def _condition(
    path: Path,
    written: str,
    name: str,
    notes: MeasurementNotes,
    notes_name: str,
    task: type[TaskConfig],
) -> ConditionOf | None:
    """What a column sets; None for one that is ignored. A dotted name or a near miss of a key is a slip of the pen."""
    unit = notes.units.get(written, notes.units.get(name, ""))
    stated = notes.conditions.get(written, notes.conditions.get(name))
    if stated is not None:
        key = need_key(task, stated.key, ENDINGS, f"{notes_name}: 'conditions' gives '{written}' the key")
        return ConditionOf(written, key, unit or key.unit, stated.values)
    found = find_key(task, name, ENDINGS)
    if found is not None:
        return ConditionOf(written, found, unit or found.unit, {})
    known = [key.removeprefix("task.") for key in known_keys(task)]
    slip = difflib.get_close_matches(name.lower(), known, n=1, cutoff=SLIP)
    if MEASUREMENT.find(name.lower()) is None and ("." in name or slip):
        need_key(task, name, ENDINGS, f"{path}: there is a column")
    return None


def _check_layout(path: Path, layout: Layout, header: Sequence[str]) -> None:
    """Refuse a file without counts; say what is ignored."""
    for name in COUNTS:
        if name not in layout.places:
            other = "trials" if name == "successes" else "successes"
            hint = closest(name, [n.lower() for n in header])
            raise UserError(
                f"{path}: a file of counts has the columns 'successes' and 'trials', and '{name}' is not there"
                f"{hint} Without '{name}' nobody can tell what '{other}' means."
            )
    if layout.ignored:
        names = ", ".join(f"'{name}'" for name in layout.ignored)
        layout.remarks.append(
            f"Columns that are no key of the task are ignored: {names}. Rows that differ in nothing else are taken as "
            "repeats; 'conditions' in the notes says which key a column sets."
        )
    if not layout.conditions:
        layout.remarks.append(
            "No column sets a condition: all rows are repeats of the study's task as it is."
        )
