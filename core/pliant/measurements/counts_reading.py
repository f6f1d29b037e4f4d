"""Read a file of counts: successes of trials under conditions, which are keys of the study's task."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from pliant.config.measurements import MeasurementsConfig
from pliant.config.problems import sentences
from pliant.config.task_keys import changed_task
from pliant.errors import UserError, closest
from pliant.formatting import number, quantity
from pliant.interfaces.task import TaskConfig
from pliant.measurements.counts_layout import COUNTS, TEXTS, ConditionOf, Layout, layout_of, readings_among
from pliant.measurements.reading import notes_of
from pliant.records.counts import CountCondition, Counts, CountSet
from pliant.tabular.text import MISSING, Cells, Sheet, open_sheet
from pliant.units import UNIT_SUFFIXES

EXAMPLE = "run,object,pressure_pa,extra_weights,successes,trials"
MOST_ROWS = 10_000
MOST_TRIALS = 1_000_000_000


def holds_counts(path: Path, task: TaskConfig | None, settings: MeasurementsConfig | None = None) -> bool:
    """Whether a file is one of counts: it has successes or trials, and no readings that the study could be asked for.

    Beside readings, counts are for a study whose task counts trials (then `read_counts` refuses the mixture); a
    chain's readings are compared and its counts are ignored.
    """
    notes, _ = notes_of(path, settings)
    with open_sheet(path, EXAMPLE) as sheet:
        names = [notes.rename.get(name, name).lower() for name in sheet.header]
    has = any(name in COUNTS for name in names)
    return has and (not readings_among(names) or (task is not None and counts_trials(task)))


def counts_trials(task: TaskConfig) -> bool:
    """Whether a task can be done several times with other random numbers, and counts how often it succeeds."""
    return {"trials", "seed"} <= set(type(task).model_fields)


def read_counts(path: Path | str, task: TaskConfig, settings: MeasurementsConfig | None = None) -> Counts:
    """Read a counts CSV (docs/measurement_files.md) and the YAML notes of the same stem.

    Args:
        path: the CSV: columns successes, trials, and one for each condition that was set.
        task: the study's task; every condition is validated by it.
        settings: the study's `measurements` block; its entries come before those of the notes.

    Raises:
        UserError: no such columns, a column that names no key of the task, or rows that cannot be, with their lines.
    """
    path = Path(path)
    notes, notes_name = notes_of(path, settings)
    with open_sheet(path, EXAMPLE) as sheet:
        layout = layout_of(path, sheet.header, notes, notes_name, type(task))
        rows = _rows(sheet, layout, task)
    sheet.problems.raise_if_any()
    if not rows:
        raise UserError(f"{path}: the file has a header and no rows.")
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return Counts(_conditions(rows, layout), path.name, digest, tuple(layout.remarks))


@dataclass(frozen=True)
class _Row:
    values: tuple[Any, ...]  # of the conditions, in the layout's order
    written: tuple[str, ...]
    one: CountSet


def _rows(sheet: Sheet, layout: Layout, task: TaskConfig) -> list[_Row]:
    rows: list[_Row] = []
    known: dict[tuple[str, ...], tuple[Any, ...] | None] = {}
    for block in sheet.blocks():
        columns = [block.columns[layout.places[c.column]] for c in layout.conditions]
        cells = [block.columns[layout.places[name]] for name in COUNTS]
        counts = [block.numbers(layout.places[name], name) for name in COUNTS]
        names = _names(block.columns, layout, len(block.lines))
        for k, line in enumerate(block.lines.tolist()):
            blank = [n for n, c in zip(COUNTS, cells, strict=True) if c[k].strip().lower() in MISSING]
            for name in blank:
                sheet.problems.add(line, f"column {name} is blank; a row needs both counts")
            one = _set(names[k], float(counts[0][k]), float(counts[1][k]), line, sheet)
            texts = tuple(column[k].strip() for column in columns)
            if texts not in known:
                known[texts] = _values(texts, layout, task, line, sheet)
            values = known[texts]
            if one is not None and values is not None:
                rows.append(_Row(values, texts, one))
        if len(rows) > MOST_ROWS:
            raise UserError(
                f"{sheet.path}: more than {MOST_ROWS} rows of counts; add up the trials of each set."
            )
    return rows


def _names(columns: Sequence[Cells], layout: Layout, count: int) -> list[str]:
    """What names each row: its run, specimen and cycle."""
    texts = [columns[layout.places[name]] for name in TEXTS if name in layout.places]
    return [" ".join(filter(None, (column[k].strip() for column in texts))) for k in range(count)]


def _set(name: str, successes: float, trials: float, line: int, sheet: Sheet) -> CountSet | None:
    """The row's count; None where it cannot be. What is no number was told before, the rest is told here."""
    if not np.isfinite([successes, trials]).all():
        return None
    problem = ""
    for label, value in zip(COUNTS, (successes, trials), strict=True):
        if value != int(value):
            problem = problem or f"column {label} is {value:g}; a count is a whole number"
        elif value < 0:
            problem = problem or f"column {label} is {value:g}; a count is not negative"
    if not problem and trials == 0:
        problem = "column trials is 0; a row without trials says nothing, leave it out"
    if not problem and trials > MOST_TRIALS:
        problem = f"column trials is {trials:g}; that is more than anybody counts"
    if not problem and successes > trials:
        problem = f"{successes:g} successes are more than {trials:g} trials; are the columns exchanged?"
    if problem:
        sheet.problems.add(line, problem)
        return None
    return CountSet(name, int(successes), int(trials), line)


def _values(
    texts: Sequence[str], layout: Layout, task: TaskConfig, line: int, sheet: Sheet
) -> tuple[Any, ...] | None:
    """The values that a row's texts mean, as the task understands them; None where one cannot be, which is told."""
    changes: dict[str, Any] = {}
    for text, condition in zip(texts, layout.conditions, strict=True):
        if text.lower() in MISSING:
            sheet.problems.add(line, f"column {condition.column} is blank; write the value that was set")
            return None
        if condition.values and text not in condition.values:
            listed = ", ".join(condition.values)
            sheet.problems.add(
                line,
                f"column {condition.column} is '{text}', for which 'conditions' gives no value"
                f"{closest(text, condition.values)} It has {listed}",
            )
            return None
        value = condition.values[text] if condition.values else _typed(text, condition.unit)
        changes[condition.key.dotted] = value
    try:
        changed_task(task, changes)
    except ValidationError as error:
        for sentence in sentences(error, type(task), lambda at: "", ("task",)).splitlines():
            sheet.problems.add(line, sentence.rstrip("."))
        return None
    return tuple(changes.values())


def _typed(text: str, unit: str) -> Any:
    if unit:
        return f"{text} {unit}"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _conditions(rows: Sequence[_Row], layout: Layout) -> tuple[CountCondition, ...]:
    """Rows of one condition together, in the order of their first rows."""
    together: dict[str, list[_Row]] = {}
    for row in rows:
        together.setdefault(repr(row.values), []).append(row)
    varying = [
        len({repr(row.values[k]) for row in rows}) > 1 or len(layout.conditions) == 1
        for k in range(len(layout.conditions))
    ]
    found = []
    for group in together.values():
        keys = [condition.key.dotted for condition in layout.conditions]
        told = [
            _said(condition, text)
            for condition, text, varies in zip(layout.conditions, group[0].written, varying, strict=True)
            if varies
        ]
        sets = tuple(
            CountSet(row.one.name or f"set {number}", row.one.successes, row.one.trials, row.one.line)
            for number, row in enumerate(group, start=1)
        )
        changes = dict(zip(keys, group[0].values, strict=True))
        found.append(CountCondition(changes, ", ".join(told) or "the task as it is", sets))
    return tuple(found)


def _said(condition: ConditionOf, text: str) -> str:
    """A condition for people: ``cylinder``, ``13 kPa``, ``2 extra weights``."""
    label = condition.key.path[-1].replace("_", " ")
    if condition.unit:
        return f"{text} {condition.unit}"
    try:
        value = float(text)
    except ValueError:
        return text
    if condition.key.si in UNIT_SUFFIXES.values():
        return quantity(value, condition.key.si, 6)
    return f"{number(value, 6)} {label}"
