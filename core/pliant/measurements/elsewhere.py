"""External columns of a measurement: from the file's name, the notes on its runs and another logger."""

from __future__ import annotations

import re
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pliant.config.measurements import JoinedFile, MeasurementNotes
from pliant.errors import UserError, closest
from pliant.measurements.columns import EXAMPLES, MEASUREMENT, match, with_clock
from pliant.measurements.gathering import Gatherer
from pliant.measurements.interleaved import Line, longest_line, values_between
from pliant.measurements.notes import effective_notes
from pliant.measurements.wrapping import stated_unwrapper
from pliant.records.design import Array
from pliant.records.history import History
from pliant_tables.cells import Cells
from pliant_tables.opening import open_sheet
from pliant_tables.schema import FileColumn
from pliant_tables.units import parse_si_value

NUMBER = r"[-+]?\d+(?:[.,]\d+)?"
FIELD = re.compile(r"\{([A-Za-z]\w*)\}")
SWITCH = "valve_open"  # holds its state from row to row
MOST_ROWS = 20_000_000  # of a joined file
AT_ITS_ENDS = 1e-9  # of its span by which a time may exceed it: clocks are written with few digits


@dataclass(frozen=True)
class Elsewhere:
    """Columns from outside the file: constants of the file's name, and curves over the clock.

    Attributes:
        texts: run and specimen, if the name contains them.
        columns: of numbers, SI.
        constants: value of each of the first columns.
        stated: values of the next columns by run, SI; NaN where the notes state none for a run.
        specimens: by run, where the notes state one.
        joined: source of the other columns.
        remarks: sentences on both.
    """

    texts: dict[str, str] = field(default_factory=dict)
    columns: tuple[FileColumn, ...] = ()
    constants: tuple[float, ...] = ()
    stated: tuple[Mapping[str, float], ...] = ()
    specimens: Mapping[str, str] = field(default_factory=dict)
    joined: Joined | None = None
    remarks: tuple[str, ...] = ()

    def values(self, times: Array | None, runs: Cells) -> list[Array]:
        """Return (n,) of each column at the times of some rows, SI; NaN outside the span of the joined file."""
        constants = [np.full(len(runs), value) for value in self.constants]
        names = [run.strip() for run in runs]
        constants += [np.array([values.get(name, np.nan) for name in names]) for values in self.stated]
        return constants + (
            self.joined.at(times, runs) if self.joined is not None and times is not None else []
        )


@dataclass(frozen=True)
class Joined:
    """Inputs and conditions of another logger: per run, the times on this file's clock and (n,) each column.

    Attributes:
        columns: of the other file, by Pliant's name.
        hold: each value holds until the next row, and the last one to the end.
    """

    name: str
    runs: dict[str, tuple[Array, tuple[Array, ...]]]
    columns: Mapping[str, FileColumn]
    hold: bool = False

    def at(self, times: Array, runs: Cells) -> list[Array]:
        """Return (n,) of each column at some times."""
        found = np.full((len(self.columns), len(times)), np.nan)
        names = np.array(runs, object)
        for run in dict.fromkeys(runs):
            clock, columns = self._of(run)
            if clock is None:
                continue
            rows = names == run
            reach = AT_ITS_ENDS * max(float(np.ptp(clock)), 1.0)
            inside = (times >= clock[0] - reach) & ((times <= clock[-1] + reach) | self.hold)
            within = np.clip(times, clock[0], clock[-1])
            for k, (name, values) in enumerate(zip(self.columns, columns, strict=True)):
                own = values_between(within, clock, values, self.hold or name == SWITCH)
                found[k] = np.where(rows & inside, own, found[k])
        return list(found)

    def long_lines(self, histories: Sequence[History]) -> dict[str, Line]:
        """Return the longest straight line of each input over the rows of this file."""
        found: dict[str, Line] = {}
        for history in histories:
            clock, columns = self._of(history.run)
            if clock is None or history.time_s is None:
                continue
            for name, values in zip(self.columns, columns, strict=True):
                line = longest_line(history.time_s, clock, values) if name in history.actuation else None
                if line is not None and line.rows > (found[name].rows if name in found else 0):
                    found[name] = line
        return found

    def _of(self, run: str) -> tuple[Array | None, tuple[Array, ...]]:
        alone = next(iter(self.runs)) if len(self.runs) == 1 else None
        return self.runs.get(alone if alone is not None else run.strip(), (None, ()))


def external_columns(
    path: Path, notes: MeasurementNotes, notes_name: str, actuation: Sequence[str] | None, own: Container[str]
) -> Elsewhere:
    """Return the columns of the notes' `name_pattern`, `runs` and `join`; the file's own columns take precedence.

    Args:
        path: the file that is read.
        notes: on it.
        notes_name: where they are written, for messages.
        actuation: names of the chain's inputs.
        own: Pliant's names of the file's own columns.

    Raises `UserError` for a name that the pattern does not fit, or a file that cannot be joined.
    """
    texts: dict[str, str] = {}
    constants: dict[FileColumn, float] = {}
    remarks: list[str] = []
    if notes.name_pattern is not None:
        fields = _fields(notes.name_pattern, notes.at(notes_name, "name_pattern"), actuation)
        found = _in_name(path.stem, notes.name_pattern, fields)
        if found is None and "run" not in own:
            where = notes.at(notes_name, "name_pattern")
            raise UserError(f"{path}: its name does not fit 'name_pattern: {notes.name_pattern}' in {where}.")
        if found is None:
            remarks.append("The file's name does not fit 'name_pattern': its own columns are taken.")
        for written, text in (found or {}).items():
            column = fields[written]
            if column.name in own:
                remarks.append(
                    f"{column.name} is a column of the file, so that it is not read from the file's name."
                )
            elif column.role == "text":
                texts[column.name] = text
            else:
                made = FileColumn(
                    "the file's name", column.name, column.role, column.unit, in_unit=column.in_unit
                )
                constants[made] = column.scale * float(text.replace(",", ".")) + column.shift
        said = [f"{name} '{text}'" for name, text in texts.items()]
        said += [f"{column.name} {value:g}" for column, value in constants.items()]
        remarks += [f"The file's name says {', '.join(said)}."] if said else []
    told = {*texts, *(column.name for column in constants)}
    stated, specimens = _read_run_values(path, notes, notes_name, actuation, (own, told))
    joined, columns = None, [*constants, *stated]
    if notes.join is not None and actuation and all(name in own for name in actuation):
        remarks.append(f"The file has all inputs itself: {notes.join.file} is not joined.")
    elif notes.join is not None:
        if "time_s" not in own:
            raise UserError(f"{path}: 'join' needs a column time_s, to know when each row was recorded.")
        joined, more, remark = _joined(path, notes.join, actuation, own)
        columns += more
        remarks.append(remark)
    given = tuple(stated.values())
    values = tuple(constants.values())
    return Elsewhere(texts, tuple(columns), values, given, specimens, joined, tuple(remarks))


def _read_run_values(
    path: Path,
    notes: MeasurementNotes,
    notes_name: str,
    actuation: Sequence[str] | None,
    known: Sequence[Container[str]],
) -> tuple[dict[FileColumn, dict[str, float]], dict[str, str]]:
    """Return the values in the notes' `runs`: by column and run, SI, and specimens by run.

    Columns in `known` take precedence. Raises `UserError` for an unknown column, or a quantity of the wrong kind.
    """
    found: dict[str, tuple[FileColumn, dict[str, float]]] = {}
    specimens: dict[str, str] = {}
    for run, values in notes.runs.items():
        for written, value in values.items():
            where = f"{notes.at(notes_name, 'runs', run, written)}: 'runs' of '{run}'"
            column = _column(written, value, actuation)
            if column is None or column.role not in ("text", "input", "condition"):
                raise UserError(
                    f"{where} has '{written}', which is no input, load or condition{closest(written, EXAMPLES)}"
                )
            if any(column.name in names for names in known):
                continue
            if column.role == "text":
                if column.name != "specimen":
                    raise UserError(f"{where} has '{written}'; of texts it may say the specimen.")
                specimens[run] = f"{value:g}" if isinstance(value, float) else str(value)
                continue
            number = (
                column.scale * value + column.shift
                if isinstance(value, int | float)
                else parse_si_value(value, column.unit, f"{where}, {written}")
            )
            found.setdefault(column.name, (column, {}))[1][run] = number
    return {
        replace(column, written="the notes on its run", scale=1.0, shift=0.0): values
        for column, values in found.values()
    }, specimens


def _column(written: str, value: float | str, actuation: Sequence[str] | None) -> FileColumn | None:
    """Return the column that a key of a run's notes means: "payload_g", or "payload" with "200 g"."""
    inputs = frozenset(actuation or ())
    column = MEASUREMENT.resolve_column(written, written, None, inputs)
    if column is None and isinstance(value, str):
        unit = value.strip().lstrip("+-.0123456789eE ")
        column = MEASUREMENT.resolve_column(written, written, unit or None, inputs)
    return column


def _fields(pattern: str, notes_name: str, actuation: Sequence[str] | None) -> dict[str, FileColumn]:
    """Return the column of each name in braces."""
    names = FIELD.findall(pattern)
    if not names or len(set(names)) < len(names):
        raise UserError(
            f"{notes_name}: 'name_pattern' needs names in braces, each once: finger_{{payload_g}}g_{{run}}."
        )
    fields = {}
    for name in names:
        column = MEASUREMENT.resolve_column(name, name, None, frozenset(actuation or ()))
        if column is None:
            raise UserError(
                f"{notes_name}: 'name_pattern' has '{{{name}}}', which is not a column of a measurement"
                f"{closest(name, EXAMPLES)} Use * for a part without a meaning."
            )
        fields[name] = column
    return fields


def _in_name(name: str, pattern: str, fields: Mapping[str, FileColumn]) -> dict[str, str] | None:
    """Return the named parts of a file's name; None where it does not fit the pattern."""
    parts = FIELD.split(pattern)
    texts = [re.escape(text).replace(r"\*", ".*?") for text in parts[::2]]
    said = [f"(?P<{n}>{'.+?' if fields[n].role == 'text' else NUMBER})" for n in parts[1::2]]
    found = re.fullmatch("".join(a + b for a, b in zip(texts, [*said, ""], strict=True)), name)
    return None if found is None else found.groupdict()


def _joined(
    path: Path, join: JoinedFile, actuation: Sequence[str] | None, own: Container[str]
) -> tuple[Joined, list[FileColumn], str]:
    other = path.parent / join.file
    notes, notes_name = effective_notes(other, None)
    with open_sheet(other, MEASUREMENT.example, notes, notes_name) as opened:
        sheet = with_clock(opened, notes)
        found = match(sheet, notes, notes_name, frozenset(actuation or ()))
        clock = found.get("time_s")
        used = [c for c in found.values() if c.role in ("input", "condition") and c.name not in own]
        used = [c for c in used if c.role == "condition" or actuation is None or c.name in actuation]
        if clock is None or not used:
            lacks = "no column time_s" if clock is None else "none"
            raise UserError(
                f"{other}: a file that is joined has time_s, and inputs or conditions that {path.name} lacks; it has "
                f"{lacks} (its columns: {', '.join(filter(None, sheet.header))})."
            )
        in_si = clock if clock.stamped else replace(clock, in_unit="", scale=1.0, shift=0.0)
        gatherer = Gatherer((in_si, *used), sheet.problems, MOST_ROWS)
        unwrapper = stated_unwrapper(notes, notes_name, (clock, *used), si=True)
        places = {name: i for i, name in enumerate(sheet.header)}
        for block in sheet.blocks():
            numbers = [column.values(block, places[column.written]) for column in (clock, *used)]
            alone = (other.stem,) * len(block.lines)
            runs = block.texts(places[found["run"].written]) if "run" in found else alone
            gatherer.add(np.column_stack(unwrapper.unwrap(numbers, runs)), block.lines, runs, None)
        gatherer.finish()
    sheet.problems.raise_if_any()
    tables = {rows.name: np.concatenate(rows.parts) for rows in gatherer.runs if rows.kept}
    runs_of = {name: (t[:, 0] + join.shift_s, tuple(t.T[1:-1])) for name, t in tables.items()}
    if not runs_of:
        raise UserError(f"{other}: {gatherer.no_rows()}")
    columns = [FileColumn(other.name, c.name, c.role, c.unit, in_unit=c.in_unit) for c in used]
    shift = f", its clock shifted by {join.shift_s:g} s" if join.shift_s else ""
    remark = f"{', '.join(c.name for c in columns)} from {other.name}{shift}: " + (
        "each value holds until the next row, and the last one to the end."
        if join.hold
        else "interpolated linearly at this file's times, not extrapolated."
    )
    joined = Joined(other.name, runs_of, {column.name: column for column in used}, bool(join.hold))
    return joined, columns, remark
