"""Recognition of a file of counts, before anything else of this package is imported."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from pliant.config.measurements import MeasurementNotes, MeasurementsConfig
from pliant.config.study import Study
from pliant.errors import UserError
from pliant.interfaces.task import TaskConfig
from pliant.measurements.columns import MEASUREMENT, outputs_among
from pliant.measurements.files import Sources, expand_sources
from pliant.measurements.notes import notes_on
from pliant_tables.columns import is_frame
from pliant_tables.opening import open_sheet
from pliant_tables.schema import noted
from pliant_tables.units import stem

COUNTS = ("successes", "trials")


def is_counted(study: Study, data: Sources = None) -> bool:
    """Return whether the study's measurements, or `data` or the first of them, are a file of counts."""
    first = data[0] if isinstance(data, list | tuple) and data else data
    path = counts_file(study, first)
    return path is not None and holds_counts(path, study.task, study.measurements)


def holds_counts(
    source: Path | Any, task: TaskConfig | None, settings: MeasurementsConfig | None = None
) -> bool:
    """Return whether a file contains counts: it has successes or trials, and no readings that the study could use.

    If it also has readings, it counts only for a study whose task counts trials (then `read_counts` refuses the
    mixture); a chain's readings are compared and its counts are ignored.
    """
    notes, notes_name = notes_on(source, settings)
    with open_sheet(source, MEASUREMENT.example, notes, notes_name) as sheet:
        names = [called(name, notes).lower() for name in sheet.header]
    has = any(name in COUNTS for name in names)
    return has and (not outputs_among(names) or (task is not None and counts_trials(task)))


def counts_trials(task: TaskConfig) -> bool:
    """Return whether a task can be repeated with other random numbers, and counts its successes."""
    return {"trials", "seed"} <= set(type(task).model_fields)


def counts_file(study: Study, data: Sources) -> Any:
    """Return the one table that may contain counts; None where there are several, or none."""
    files = data if data is not None else study.measurements.file if study.measurements is not None else ()
    sources = expand_sources(files) if is_frame(files) or files else []
    return sources[0] if len(sources) == 1 else None


def called(written: str, notes: MeasurementNotes) -> str:
    """Return a column's name without its unit; Pliant's name for counts, readings and columns that name a set."""
    renamed = noted(notes.rename, written, stem(written))
    if renamed is not None:
        return renamed
    column = None
    with suppress(UserError):  # a unit of a condition, which is checked with the task
        column = MEASUREMENT.resolve_column(written, written, None, frozenset())
    of_counts = column is not None and column.role in ("count", "text", "cycle", "output")
    return column.name if column is not None and of_counts else stem(written)
