"""Read what a bench recorded: CSV and notes in, runs with their inputs and readings out."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pliant.config.measurements import MOST_SAMPLES, MeasurementNotes, MeasurementsConfig
from pliant.errors import UserError
from pliant.execution.progress import Progress, Silent
from pliant.formatting import plural
from pliant.measurements.assembly import assembled
from pliant.measurements.columns import MEASUREMENT
from pliant.measurements.gathering import Gatherer
from pliant.measurements.header import Header, read_header
from pliant.records.measurement import Measurement
from pliant.tabular.notes import notes_beside
from pliant.tabular.text import Sheet, count_lines, lines_text, open_sheet

LARGE_FILE = 20_000_000  # bytes: from here on reading shows its progress


def read_measurement(
    path: Path | str,
    *,
    settings: MeasurementsConfig | None = None,
    actuation: Sequence[str] | None = None,
    expected: Mapping[str, tuple[float, float]] | None = None,
    progress: Progress | None = None,
) -> Measurement:
    """Read a measurement CSV (docs/measurement_files.md) and the YAML notes of the same stem.

    The file streams through in blocks; memory is bounded by `settings.max_samples`, whatever the file's length.

    Args:
        path: the CSV.
        settings: the study's `measurements` block; its entries come before those of the notes.
        actuation: names of the chain's inputs, which the file must have; all inputs of the file by default.
        expected: for some columns the range that the model knows (a law's domain, the chain's length), to
            notice a wrong unit.
        progress: receives rows read, for files above 20 MB.

    Raises:
        UserError: the file cannot be read, a row or column is wrong (all such rows with their lines, 20 of them
            listed), or the chain's inputs or the wanted outputs are not there.
    """
    path = Path(path)
    notes, notes_name = notes_of(path, settings)
    with open_sheet(path, MEASUREMENT.example) as sheet:
        header = read_header(path, sheet.header, notes, notes_name, actuation)
        gatherer = _gathered(
            sheet, header, settings.max_samples if settings else MOST_SAMPLES, progress or Silent()
        )
    sheet.problems.raise_if_any()
    if not any(run.kept for run in gatherer.runs):
        raise UserError(f"{path}: {_no_rows(gatherer)}")
    remarks = [*header.remarks, *_row_remarks(sheet, gatherer)]
    wanted = settings.outputs if settings else ()
    found = assembled(path, gatherer, header, notes, notes_name, wanted, expected or {}, remarks)
    with path.open("rb") as file:
        return replace(found, sha256=hashlib.file_digest(file, "sha256").hexdigest())


def notes_of(path: Path, settings: MeasurementsConfig | None) -> tuple[MeasurementNotes, str]:
    """The notes beside the file with the study's on top, and the name of the file to write notes into."""
    beside, file = notes_beside(path, MeasurementNotes)
    notes = beside or MeasurementNotes()
    if settings is not None:
        notes = MeasurementNotes(
            rename={**notes.rename, **settings.rename},
            units={**notes.units, **settings.units},
            sigma={**notes.sigma, **settings.sigma},
            markers_m=settings.markers_m or notes.markers_m,
            exclude=(*notes.exclude, *settings.exclude),
            conditions={**notes.conditions, **settings.conditions},
        )
    # a study of the same stem takes the name: then the notes belong into its `measurements` block
    name = (
        path.with_suffix(".yaml").name
        if file is None
        else file.name
        if beside is not None
        else f"the 'measurements' block of {file.name}"
    )
    return notes, name


def _gathered(sheet: Sheet, header: Header, most: int, progress: Progress) -> Gatherer:
    gatherer = Gatherer(header.columns, sheet.problems, most)
    large = sheet.path.stat().st_size > LARGE_FILE
    task = progress.begin(f"read {sheet.path.name}, rows", count_lines(sheet.path)) if large else Silent()
    name = sheet.path.stem
    try:
        for block in sheet.blocks():
            table = np.column_stack([block.numbers(header.place(c), c.written) for c in header.columns])
            runs = name if header.run is None else block.columns[header.run]
            specimens = None if header.specimen is None else block.columns[header.specimen]
            gatherer.add(table, block.lines, runs, specimens)
            task.advance(len(block.lines))
    finally:
        task.finish()
    return gatherer


def _no_rows(gatherer: Gatherer) -> str:
    if not gatherer.blanks:
        return "the file has a header and no rows."
    name, blanks = max(gatherer.blanks.items(), key=lambda item: item[1].count)
    return f"no row can be used; {name} is blank in {blanks.count} of them ({lines_text(blanks.lines, blanks.count)})."


def _row_remarks(sheet: Sheet, gatherer: Gatherer) -> list[str]:
    """What was done to rows while reading."""
    remarks = []
    needed = [c.name for c in gatherer.columns if c.role in ("time", "input")]
    for name in needed:
        if blanks := gatherer.blanks.get(name):
            remarks.append(
                f"{name} is blank in {plural(blanks.count, 'row')} ({lines_text(blanks.lines, blanks.count)}): left "
                "out; inputs are taken as straight lines across them."
            )
    if doubles := gatherer.doubles.count:
        remarks.append(
            f"Left out: {plural(doubles, 'row')} equal to the row before in every column "
            f"({lines_text(gatherer.doubles.lines, doubles)})."
        )
    if sheet.blank_rows:
        remarks.append(f"Left out: {plural(sheet.blank_rows, 'row')} of nothing but separators.")
    if gatherer.split_runs:
        run, line = next(iter(gatherer.split_runs.items()))
        remarks.append(
            f"Rows of {len(gatherer.split_runs)} of {len(gatherer.runs)} runs do not stand together (run "
            f"'{gatherer.runs[run].name}' goes on in line {line}); they were put together in the file's order."
        )
    thinned = [run for run in gatherer.runs if run.stride > 1]
    if thinned:
        longest = max(thinned, key=lambda run: run.stride)
        total = sum(run.count for run in gatherer.runs)
        remarks.append(
            f"{total} rows are more than max_samples ({gatherer.most}): of {len(thinned)} of {len(gatherer.runs)} runs "
            f"only a part of the rows is kept (run '{longest.name}': one in {longest.stride} of "
            f"{longest.count}). Nothing was averaged; what is faster than the kept rows is not seen."
        )
    return remarks
