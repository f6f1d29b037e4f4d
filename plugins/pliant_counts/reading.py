"""Reader of count files: successes of trials under conditions, which are keys of the study's task."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from pliant.config.measurements import MeasurementNotes, MeasurementsConfig
from pliant.config.problems import sentences
from pliant.errors import UserError, closest
from pliant.formatting import number, quantity
from pliant.interfaces.task import TaskConfig
from pliant.measurements.columns import MEASUREMENT, outputs_among
from pliant.measurements.notes import file_digest, notes_on
from pliant.units import UNIT_SUFFIXES
from pliant_counts.recognition import COUNTS, called
from pliant_counts.records import CountCondition, Counts, CountSet
from pliant_counts.task_keys import TaskKey, changed_task, find_key, known_keys, need_key
from pliant_tables.cells import MISSING, Problems
from pliant_tables.columns import is_frame
from pliant_tables.opening import FRAME, open_sheet
from pliant_tables.schema import check_named, noted
from pliant_tables.sheet import Sheet
from pliant_tables.units import ENDINGS, SPELLINGS, stem, unit_in

EXAMPLE = "run,object,pressure_pa,extra_weights,successes,trials"
TEXTS = ("run", "specimen", "cycle")  # identify the set of a row
SLIP = 0.75  # likeness of a column's name to a key from which it is taken for a misspelling
MOST_ROWS = 10_000
MOST_TRIALS = 1_000_000_000


def read_counts(source: Path | Any, task: TaskConfig, settings: MeasurementsConfig | None = None) -> Counts:
    """Read a counts CSV (docs/measurement_files.md) and the YAML notes of the same stem.

    Args:
        source: the file, or a pandas frame: columns successes, trials, and one for each condition that was set.
        task: the study's task; every condition is validated by it.
        settings: the study's `measurements` block; its entries come before those of the notes.

    Raises:
        UserError: no such columns, a column that names no key of the task, or impossible rows, with their lines.
    """
    path = Path(FRAME if is_frame(source) else source)
    notes, notes_name = notes_on(source, settings)
    with open_sheet(source, EXAMPLE, notes, notes_name) as sheet:
        layout = _layout(path, sheet.header, notes, notes_name, type(task))
        rows = _rows(sheet, layout, task)
    sheet.problems.raise_if_any()
    if not rows:
        raise UserError(f"{path}: the file has a header and no rows.")
    digest = "" if is_frame(source) else file_digest(path)
    return Counts(_conditions(rows, layout), path.name, digest, tuple(layout.remarks))


@dataclass(frozen=True)
class TaskKeyColumn:
    """A column that sets a key, with the conversion of its texts. `unit` is that of the texts, or ""."""

    column: str
    key: TaskKey
    unit: str
    values: Mapping[str, Any]

    def value(self, text: str) -> Any:
        """Return the task's value of a text."""
        if self.values:
            return self.values[text]
        if self.unit:
            return f"{text} {self.unit}"
        for kind in (int, float):
            try:
                return kind(text)
            except ValueError:
                continue
        return text

    def words(self, text: str) -> str:
        """Return a condition for display: ``cylinder``, ``13 kPa``, ``2 extra weights``."""
        if self.unit:
            return f"{text} {self.unit}"
        try:
            value = float(text)
        except ValueError:
            return text
        if self.key.si in UNIT_SUFFIXES.values():
            return quantity(value, self.key.si, 6)
        return f"{number(value, 6)} {self.key.path[-1].replace('_', ' ')}"


@dataclass
class Layout:
    """The role of each column, by its index in the file."""

    places: dict[str, int] = field(default_factory=dict)
    conditions: list[TaskKeyColumn] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _CountRow:
    values: tuple[Any, ...]  # of the conditions, in the layout's order
    written: tuple[str, ...]
    one: CountSet


def _layout(
    path: Path, header: Sequence[str], notes: MeasurementNotes, notes_name: str, task: type[TaskConfig]
) -> Layout:
    """Match the header with the counts and the keys of the task."""
    names = [called(name, notes) for name in header]
    every = [*header, *map(stem, header)]
    check_named(path, notes_name, "rename", notes.rename, every, notes)
    check_named(path, notes_name, "units", notes.units, [*every, *names], notes)
    check_named(path, notes_name, "conditions", notes.conditions, [*every, *names], notes)
    if readings := outputs_among(name.lower() for name in names):
        raise UserError(
            f"{path}: the file has counts (successes, trials) and readings ({', '.join(readings)}). A row is one or "
            "the other: put them into two files and compare each."
        )
    layout, ignored = Layout(), []
    taken: dict[tuple[str, ...], str] = {}
    for place, (written, name) in enumerate(zip(header, names, strict=True)):
        plain = name.lower()
        special = plain in (*COUNTS, *TEXTS)
        layout.places[plain if special else written] = place
        if not name or special:
            continue
        condition = _condition(path, written, name, notes, notes_name, task)
        if condition is None:
            ignored.append(f"'{written}'")
            continue
        if condition.key.path in taken:
            raise UserError(
                f"{path}: columns '{taken[condition.key.path]}' and '{written}' both set {condition.key.dotted}; "
                "keep one."
            )
        taken[condition.key.path] = written
        layout.conditions.append(condition)
    for name, other in (COUNTS, COUNTS[::-1]):
        if name not in layout.places:
            hint = closest(name, [n.lower() for n in header])
            raise UserError(
                f"{path}: a file of counts has the columns 'successes' and 'trials', and '{name}' is not there"
                f"{hint} Without '{name}' the meaning of '{other}' is unknown."
            )
    if ignored:
        layout.remarks.append(
            f"Columns that are no key of the task are ignored: {', '.join(ignored)}. Rows that differ in nothing else "
            "are taken as repeats; 'conditions' in the notes says which key a column sets."
        )
    if not layout.conditions:
        layout.remarks.append(
            "No column sets a condition: all rows are repeats of the study's task as it is."
        )
    return layout


def _condition(
    path: Path,
    written: str,
    name: str,
    notes: MeasurementNotes,
    notes_name: str,
    task: type[TaskConfig],
) -> TaskKeyColumn | None:
    """Return what a column sets, None if it is ignored; raise `UserError` for a misspelt key."""
    unit = noted(notes.units, written, stem(written), name) or unit_in(written) or ""
    unit = SPELLINGS.get(unit, unit)
    stated = noted(notes.conditions, written, stem(written), name)
    if stated is not None:
        key = need_key(
            task,
            stated.key,
            ENDINGS,
            f"{notes.at(notes_name, 'conditions', written)}: 'conditions' gives '{written}' the key",
        )
        return TaskKeyColumn(written, key, unit or key.unit, stated.values)
    found = find_key(task, name, ENDINGS)
    if found is not None:
        return TaskKeyColumn(written, found, unit or found.unit, {})
    known = [key.removeprefix("task.") for key in known_keys(task)]
    slip = difflib.get_close_matches(name.lower(), known, n=1, cutoff=SLIP)
    if MEASUREMENT.find(name.lower()) is None and ("." in name or slip):
        need_key(task, name, ENDINGS, f"{path}: there is a column")
    return None


def _rows(sheet: Sheet, layout: Layout, task: TaskConfig) -> list[_CountRow]:
    rows: list[_CountRow] = []
    known: dict[tuple[str, ...], tuple[Any, ...] | None] = {}
    for block in sheet.blocks():
        cells = [block.plain_texts(place) for place in range(len(sheet.header))]
        conditions = [cells[layout.places[c.column]] for c in layout.conditions]
        names = [cells[layout.places[name]] for name in TEXTS if name in layout.places]
        counts = {name: block.numbers(layout.places[name], name) for name in COUNTS}
        for k, line in enumerate(block.lines.tolist()):
            for name in COUNTS:
                if cells[layout.places[name]][k].lower() in MISSING:
                    sheet.problems.add(line, f"column {name} is blank; a row needs both counts")
            numbers = {name: float(values[k]) for name, values in counts.items()}
            one = None
            if np.isfinite(list(numbers.values())).all():  # the others were reported
                if problem := _problem(**numbers):
                    sheet.problems.add(line, problem)
                else:
                    name = " ".join(filter(None, (texts[k] for texts in names)))
                    one = CountSet(name, int(numbers["successes"]), int(numbers["trials"]), line)
            written = tuple(texts[k] for texts in conditions)
            if written not in known:
                known[written] = _values(written, layout, task, line, sheet.problems)
            values = known[written]
            if one is not None and values is not None:
                rows.append(_CountRow(values, written, one))
        if len(rows) > MOST_ROWS:
            raise UserError(
                f"{sheet.path}: more than {MOST_ROWS} rows of counts; add up the trials of each set."
            )
    return rows


def _problem(successes: float, trials: float) -> str:
    """Return why these cannot be counts, or an empty text."""
    for label, value in zip(COUNTS, (successes, trials), strict=True):
        if value != int(value):
            return f"column {label} is {value:g}; a count is a whole number"
        if value < 0:
            return f"column {label} is {value:g}; a count is not negative"
    if trials == 0:
        return "column trials is 0; leave a row without trials out"
    if trials > MOST_TRIALS:
        return f"column trials is {trials:g}; that is an implausibly large count"
    if successes > trials:
        return f"{successes:g} successes are more than {trials:g} trials; are the columns exchanged?"
    return ""


def _values(
    texts: Sequence[str], layout: Layout, task: TaskConfig, line: int, problems: Problems
) -> tuple[Any, ...] | None:
    """Return the task's values of a row's texts; None where one is invalid, which is reported."""
    changes: dict[str, Any] = {}
    for text, condition in zip(texts, layout.conditions, strict=True):
        if text.lower() in MISSING:
            problems.add(line, f"column {condition.column} is blank; write the value that was set")
            return None
        if condition.values and text not in condition.values:
            problems.add(
                line,
                f"column {condition.column} is '{text}', for which 'conditions' gives no value"
                f"{closest(text, condition.values)} It has {', '.join(condition.values)}",
            )
            return None
        changes[condition.key.dotted] = condition.value(text)
    try:
        changed_task(task, changes)
    except ValidationError as error:
        for sentence in sentences(error, type(task), lambda at: "", ("task",)).splitlines():
            problems.add(line, sentence.rstrip("."))
        return None
    return tuple(changes.values())


def _conditions(rows: Sequence[_CountRow], layout: Layout) -> tuple[CountCondition, ...]:
    """Return rows grouped by condition, in the order of their first rows; constant columns are not named."""
    together: dict[str, list[_CountRow]] = {}
    for row in rows:
        together.setdefault(repr(row.values), []).append(row)
    varying = [
        k
        for k in range(len(layout.conditions))
        if len({repr(row.values[k]) for row in rows}) > 1 or len(layout.conditions) == 1
    ]
    found = []
    for group in together.values():
        words = ", ".join(layout.conditions[k].words(group[0].written[k]) for k in varying)
        sets = tuple(
            replace(row.one, name=row.one.name or f"set {place}") for place, row in enumerate(group, start=1)
        )
        keys = [condition.key.dotted for condition in layout.conditions]
        changes = dict(zip(keys, group[0].values, strict=True))
        found.append(CountCondition(changes, words or "the task as it is", sets))
    return tuple(found)
