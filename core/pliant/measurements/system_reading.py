"""Reader of measurements of a user's own model: columns are the channels of the model."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pliant.config.measurements import MeasurementNotes, MeasurementsConfig
from pliant.errors import UserError, closest
from pliant.execution.progress import Progress
from pliant.formatting import number
from pliant.interfaces.model import Channel
from pliant.measurements.files import Sources, as_notes, expand_sources, together
from pliant.measurements.notes import file_digest, notes_on
from pliant.measurements.reading import without_excluded
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement
from pliant.records.remark import Rank, Remark, detail
from pliant.units import parse_quantity, split_unit
from pliant_tables.columns import is_frame
from pliant_tables.opening import FRAME, open_sheet
from pliant_tables.schema import FileColumn, Known, Schema, stamped
from pliant_tables.units import stem

# Columns of any measurement, besides the model's channels.
GENERAL = (
    Known(r"run", "", "", "text"),
    Known(r"specimen", "", "", "text"),
    Known(r"time", "_s", "s", "time"),
)
FEWEST = 3  # samples of a run
MOST_ANGLE = 13.0  # two turns: larger angles are likely degrees
# An input may leave its range by this share of it: rounding in the file.
ROUNDING = 1e-6


def read_system_measurement(
    files: Sources,
    notes: MeasurementNotes | None,
    inputs: Sequence[Channel],
    outputs: Sequence[Channel],
    progress: Progress | None = None,
) -> Measurement:
    """Read tables whose columns are the channels of a model, as one measurement in their order.

    A column has the name of its channel, with or without the unit, or is renamed to it (`rename` in the notes). Columns
    `time_s`, which every file needs, and `run`, `specimen` are as in docs/measurement_files.md.

    Raises:
        UserError: a file that cannot be read, an input or the time that is missing, no output, an input beyond its
            range.
    """
    stated = as_notes(notes)
    sources = expand_sources(files)
    for source in sources:
        if not is_frame(source) and not source.exists():
            raise UserError(f"{source}: the table cannot be read (no such file).")
    schema = _schema(inputs, outputs)
    return together([_read(source, stated, schema, inputs, outputs) for source in sources])


def _schema(inputs: Sequence[Channel], outputs: Sequence[Channel]) -> Schema:
    """Return the columns of a model."""
    known = list(GENERAL)
    for channels, role in ((inputs, "input"), (outputs, "output")):
        for channel in channels:
            name, suffix = channel.name, ""
            plain, unit = split_unit(channel.name)
            if unit:
                name, suffix = plain, channel.name.removeprefix(plain)
            known.append(Known(re.escape(name.lower()), suffix, channel.unit, role))  # type: ignore[arg-type]
    example = ",".join(["run", "time_s", *(channel.name for channel in (*inputs, *outputs))])
    return Schema(tuple(known), example)


def _read(
    source: object,
    stated: MeasurementNotes,
    schema: Schema,
    inputs: Sequence[Channel],
    outputs: Sequence[Channel],
) -> Measurement:
    in_memory = is_frame(source)
    path = Path(FRAME if in_memory else str(source))
    notes, notes_name = notes_on(source, stated)
    with open_sheet(source if in_memory else path, schema.example, notes, notes_name) as sheet:
        found = schema.matched(path, sheet.header, notes, frozenset(), stamped(sheet))
        found = {_channel_name(name, inputs, outputs): column for name, column in found.items()}
        _check_columns(path, notes_name, found, sheet.header, inputs, outputs)
        places = {column.written: sheet.header.index(column.written) for column in found.values()}
        numeric = {name: column for name, column in found.items() if column.role != "text"}
        pieces: dict[str, list[Array]] = {name: [] for name in numeric}
        names: list[str] = []
        bodies: list[str] = []
        lines: list[Array] = []
        for block in sheet.blocks():
            count = len(block.lines)
            for name, column in numeric.items():
                pieces[name].append(column.values(block, places[column.written]))
            for key, texts, default in (("run", names, path.stem), ("specimen", bodies, "")):
                named = found.get(key)
                texts += [default] * count if named is None else block.texts(places[named.written])
            lines.append(np.asarray(block.lines))
        sheet.problems.raise_if_any()
    table = {name: np.concatenate(some) for name, some in pieces.items() if some}
    if not table or not len(table["time_s"]):
        raise UserError(f"{path}: the file has no row.")
    wanted = [c.name for c in outputs if c.name in table]
    if isinstance(stated, MeasurementsConfig) and stated.outputs:
        wanted = [_wanted(path, name, wanted) for name in stated.outputs]
    sigma = _sigmas(notes, notes_name, wanted)
    order = dict.fromkeys(names)
    runs = []
    for run in order:
        rows = np.flatnonzero([name == run for name in names])
        runs.append(
            _run(path, run, bodies[int(rows[0])], table, rows, inputs, wanted, sigma, np.concatenate(lines))
        )
    said: list[str] = []
    placed = [(span, notes.at(notes_name, "exclude", k)) for k, span in enumerate(notes.exclude)]
    runs = without_excluded(runs, placed, said)
    if not runs:
        raise UserError(f"{path}: no run is left.")
    read = {column.written for column in found.values()}
    unread = [name for name in sheet.header if name and name not in read]
    if unread:
        absent = [c.name for c in (*inputs, *outputs) if c.name not in table]
        others = f" Channels without a column: {', '.join(absent)}." if absent else ""
        said.append(
            detail(f"Columns {', '.join(unread)} are no channels of the model and are ignored.{others}")
        )
        said += _misspelt(unread, absent, notes_name)
    said += _large_angles(table, found, notes_name)
    return Measurement(
        tuple(runs),
        tuple(wanted),
        path.name,
        tuple(said),
        sha256="" if in_memory else file_digest(path),
        written={name: c.unit_as_written for name, c in numeric.items() if c.unit},
        headed={name: c.written for name, c in numeric.items()},
    )


def _misspelt(unread: Sequence[str], absent: Sequence[str], notes_name: str) -> list[str]:
    """Return a sentence for each ignored column that resembles a channel without a column."""
    near = (
        (name, get_close_matches(name.lower(), [one.lower() for one in absent], 1, 0.8)) for name in unread
    )
    return [
        Remark(
            f"Column '{name}' is ignored; if it is '{found[0]}', write 'rename: {{{name}: {found[0]}}}' in "
            f"{notes_name}.",
            Rank.UNIT,
        )
        for name, found in near
        if found
    ]


def _large_angles(
    table: Mapping[str, Array], columns: Mapping[str, FileColumn], notes_name: str
) -> list[str]:
    """Return a sentence for each column of angles in rad that looks like degrees."""
    return [
        Remark(
            f"'{column.written}' reaches {number(top)} rad; if it is in degrees, write "
            f"'units: {{{column.written}: deg}}' in {notes_name}.",
            Rank.UNIT,
        )
        for name, column in columns.items()
        if name in table
        and column.unit == "rad"
        and (top := float(np.nanmax(np.abs(table[name])))) > MOST_ANGLE
    ]


def _channel_name(name: str, inputs: Sequence[Channel], outputs: Sequence[Channel]) -> str:
    """Return the channel's own spelling of a column's name."""
    return next((c.name for c in (*inputs, *outputs) if c.name.lower() == name), name)


def _check_columns(
    path: Path,
    notes_name: str,
    found: dict[str, FileColumn],
    header: Sequence[str],
    inputs: Sequence[Channel],
    outputs: Sequence[Channel],
) -> None:
    """Raise `UserError` if the time, an input, or every output is missing."""
    others = [name for name in header if name and name not in {c.written for c in found.values()}]
    rename = f"write 'rename: {{its name: %s}}' in {notes_name}"
    for name, what in [("time_s", "the clock"), *((c.name, c.label or "an input") for c in inputs)]:
        with_unit = next((one for one in others if one != name and split_unit(one)[0] == name), "")
        if name not in found and with_unit:
            raise UserError(
                f"{path}: '{name}', {what} of the model, has no known unit, and '{with_unit}' has one. If its numbers "
                f"are what the model takes, write 'rename: {{{with_unit}: {name}}}' in {notes_name}."
            )
        if name not in found:
            raise UserError(
                f"{path}: no column is '{name}', {what} of the model{closest(name, others)} The file has "
                f"{', '.join(header)}; name the column so, or {rename % name}."
            )
    if not any(c.name in found for c in outputs):
        raise UserError(
            f"{path}: no column is an output of the model, which has {', '.join(c.name for c in outputs)}; the file "
            f"has {', '.join(header)}. Name one so, or {rename % outputs[0].name}."
        )


def _wanted(path: Path, name: str, have: Sequence[str]) -> str:
    for one in have:
        if name in (one, stem(one), split_unit(one)[0]):
            return one
    raise UserError(
        f"{path}: the study asks for output '{name}', which the file does not have{closest(name, have)}"
    )


def _sigmas(notes: MeasurementNotes, notes_name: str, outputs: Sequence[str]) -> dict[str, float]:
    """Return the stated standard deviations by output, SI."""
    found = {}
    for key, value in notes.sigma.items():
        name = next((one for one in outputs if key in (one, split_unit(one)[0])), None)
        if name is None:
            raise UserError(
                f"{notes.at(notes_name, 'sigma', key)}: 'sigma' names '{key}', which is no output of the file"
                f"{closest(key, outputs)}"
            )
        unit = split_unit(name)[1]
        found[name] = value if isinstance(value, float | int) else parse_quantity(value, unit)
    return found


def _run(
    path: Path,
    name: str,
    specimen: str,
    table: dict[str, Array],
    rows: NDArray[np.intp],
    inputs: Sequence[Channel],
    outputs: Sequence[str],
    sigma: dict[str, float],
    lines: Array,
) -> MeasuredRun:
    """Return one run; raise `UserError` for a clock that does not increase or an input beyond its range."""
    clock, at = table["time_s"][rows], lines[rows]
    if len(rows) < FEWEST:
        raise UserError(f"{path}: run '{name}' has {len(rows)} rows; {FEWEST} are the fewest.")
    wrong = np.flatnonzero(~np.isfinite(clock) | np.append(False, ~(np.diff(clock) > 0.0)))
    if len(wrong):
        k = int(wrong[0])
        raise UserError(f"{path}, line {at[k]:g}: the time of run '{name}' does not increase; sort its rows.")
    for channel in inputs:
        values = table[channel.name][rows]
        if (bad := np.flatnonzero(~np.isfinite(values))).size:
            raise UserError(f"{path}, line {at[int(bad[0])]:g}: input '{channel.name}' has no value there.")
        _check_range(path, channel, values, at)
    history = History.from_arrays(
        {c.name: table[c.name][rows] for c in inputs}, clock - clock[0], run=name, specimen=specimen
    )
    n = len(rows)
    return MeasuredRun(
        history,
        {one: table[one][rows] for one in outputs},
        {one: np.full(n, value) for one, value in sigma.items()},
        np.ones(n),
        at,
    )


def _check_range(path: Path, channel: Channel, values: Array, lines: Array) -> None:
    low = -np.inf if channel.low is None else channel.low
    high = np.inf if channel.high is None else channel.high
    slack = ROUNDING * max([abs(end) for end in (low, high) if np.isfinite(end)], default=0.0)
    beyond = np.flatnonzero((values < low - slack) | (values > high + slack))
    if len(beyond):
        k = int(beyond[0])
        ends = " to ".join(number(end) for end in (low, high) if np.isfinite(end))
        raise UserError(
            f"{path}, line {lines[k]:g}: '{channel.name}' is {number(float(values[k]))}, and "
            f"{channel.label or 'the input'} of the model allows {ends}; correct the unit, or the range in the "
            "model."
        )


def largest_magnitudes(measurement: Measurement) -> dict[str, float]:
    """Return the largest magnitude of each input and output over all runs, SI; 1 for those that are always zero."""
    largest: dict[str, float] = {}
    for run in measurement.runs:
        for name, values in {**run.history.actuation, **run.outputs}.items():
            top = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
            largest[name] = max(largest.get(name, 0.0), top)
    return {name: top or 1.0 for name, top in largest.items()}
