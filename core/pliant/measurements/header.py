"""The header of a measurement file: the columns that are read, those that are missing, and the lines that fix it."""

from __future__ import annotations

import re
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from pliant.config.measurements import MeasurementNotes
from pliant.errors import UserError, closest
from pliant.measurements.columns import EXAMPLES, match, single_column_remarks
from pliant.measurements.plausible import as_key
from pliant.measurements.proposing import (
    DRIVES,
    READ,
    TRAVEL,
    block_to_paste,
    closest_column,
    runs_named,
)
from pliant.records.remark import detail
from pliant.registry.data_kind import data_kinds
from pliant.registry.shipped import REMEDY
from pliant_tables.cells import looks_numeric
from pliant_tables.names import bare, meanings
from pliant_tables.proposals import lines_to_write
from pliant_tables.schema import FRAMES, FileColumn, noted
from pliant_tables.sheet import Sheet
from pliant_tables.side_by_side import check_side_by_side
from pliant_tables.split_clock import SplitClockSheet
from pliant_tables.testers import tester_columns
from pliant_tables.units import stem

HELD = ("held_angle_rad", "held_elongation_strain")  # prescribed: then no supply is needed
TWIST = re.compile(r"curvature[ _]x\b.*|curvature[ _]x_.*", re.IGNORECASE)
VALUE, MOST_KINDS = (
    re.compile(r"_?(value|reading|wert|messwert|data)", re.IGNORECASE),
    50,
)  # of a table in long form
ANOTHER = "another.csv"  # placeholder for a file that has not been named


@dataclass(frozen=True)
class Header:
    """The columns of the file that are read.

    Attributes:
        columns: the numbers among them.
        places: index in the file of each column, by its written name.
        texts: index in the file of `run` and `specimen`, if it has them.
        remarks: what was ignored or converted, in sentences.
        given: numbers from outside the file, after `columns`: of its name, or of another logger.
        may_be: columns that are not read and may name runs or specimens, by their names: Pliant's name of each.
    """

    columns: tuple[FileColumn, ...]
    places: dict[str, int]
    texts: dict[str, int]
    remarks: tuple[str, ...]
    given: tuple[FileColumn, ...] = ()
    may_be: Mapping[str, str] = field(default_factory=dict)

    def names(self, *roles: str) -> list[str]:
        """Return Pliant's names of the columns in some roles."""
        return [column.name for column in self.every if column.role in roles]

    @property
    def every(self) -> tuple[FileColumn, ...]:
        """Return all columns of numbers."""
        return (*self.columns, *self.given)


def read_header(
    sheet: Sheet,
    notes: MeasurementNotes,
    notes_name: str,
    actuation: Sequence[str] | None,
    given: Sequence[FileColumn] = (),
    elsewhere: set[tuple[str, str]] | None = None,
) -> Header:
    """Match the header with the known columns.

    Args:
        sheet: the open file.
        notes: renames and units.
        notes_name: where a user would write notes, for messages.
        actuation: names of the chain's inputs; all inputs of the file where None.
        given: columns from outside the file.
        elsewhere: collects the notes on columns that the file does not have: others may have them.

    Raises `UserError` where an input is missing, nothing is measured, or two columns mean the same.
    """
    path, written = sheet.path, sheet.header
    found = match(sheet, notes, notes_name, frozenset(actuation or ()), elsewhere)
    _check_twist(path, [name for name in written if not _renamed(notes, name)], notes_name)
    if actuation is None:
        found, driven = _driven_by_travel(found, given)
    else:
        driven = []
    read = {column.written for column in found.values()}
    unknown = [name for name in written if name and name not in read]
    clock = found["time_s"].written if "time_s" in found else ""
    if unknown and not (clock and _renamed(notes, clock)):
        check_side_by_side(sheet.path, clock, unknown)
    if "time_s" not in found:
        _check_clock(sheet, unknown, notes, notes_name, {column.role for column in found.values()})
    runs_known = "run" in {*found, *(c.name for c in given)}
    may_be = {} if runs_known or not unknown else runs_named(sheet, unknown)
    remarks = list(driven)
    if unknown:
        remarks += single_column_remarks(found.values(), unknown)
        remarks += _unknown_remarks(unknown, notes, notes_name, may_be, set(found))
    if "" in written:
        remarks.append(detail("A column without a name is ignored."))
    numeric = [column for column in found.values() if column.role != "text"]
    _check_needed(sheet, [*numeric, *given], unknown, notes_name, actuation)
    outputs = [column.name for column in numeric if column.role == "output"]
    used = []
    for column in numeric:
        idle = actuation is not None and column.name not in actuation and column.name not in HELD
        if column.role == "input" and idle:
            remarks.append(detail(f"Input '{column.name}' does not drive the chain and is ignored."))
        elif column.role == "count":
            remarks.append(
                f"Column '{column.name}' counts trials, which no chain predicts: ignored; counts belong in a "
                "separate file."
            )
        elif column.role == "sigma" and column.name.removeprefix("sigma_") not in outputs:
            remarks.append(
                detail(f"Column '{column.name}' has no output of its own in the file and is ignored.")
            )
        else:
            used.append(column)
    if "run" not in found and all(column.name != "run" for column in given):
        remarks.append("The file has no column 'run': all rows are one run, called as the file.")
    if "time_s" not in found:
        remarks.append(
            "The file has no column 'time_s': every row is a state that was reached slowly. Effects of rate and time "
            "cannot be judged."
        )
    split = isinstance(sheet, SplitClockSheet)
    remarks += [detail(text) for column in found.values() if (text := _converted(column, notes, split))]
    places = {name: i for i, name in enumerate(written)}
    texts: dict[str, int] = {
        name: places[found[name].written] for name in ("run", "specimen") if name in found
    }
    numbers = tuple(column for column in given if column.role != "text")
    return Header(tuple(used), places, texts, tuple(remarks), numbers, may_be)


class HalfError(UserError):
    """An error of a file of one logger only; `lacks` is what another one may have recorded."""

    def __init__(self, text: str, lacks: Literal["inputs", "readings"] = "inputs") -> None:
        super().__init__(text)
        self.lacks = lacks


def _driven_by_travel(
    found: dict[str, FileColumn], given: Sequence[FileColumn]
) -> tuple[dict[str, FileColumn], list[str]]:
    """Take tendons' travels as the inputs of a file that has no other input and other readings, with a remark."""
    columns = [*found.values(), *given]
    travels = [name for name in found if name.startswith(TRAVEL)]
    others = any(c.role == "output" and not c.name.startswith(TRAVEL) for c in columns)
    if not travels or not others or any(column.role == "input" for column in columns):
        return found, []
    roles = {name: replace(found[name], role="input") for name in travels}
    return {**found, **roles}, [
        f"{', '.join(travels)}: taken as what drives the chain, for the file has no other input; its law then has "
        "'actuation_name: tendon_travel_m'."
    ]


def _check_twist(path: Path, written: Sequence[str], notes_name: str) -> None:
    """Raise `UserError` for a curvature about x, which in Pliant's frame is a twist: axes have to be stated."""
    for name in written:
        if TWIST.fullmatch(name):
            other = re.sub(r"(?i)(curvature[ _])x", r"\1y", name)
            rename = {name: "curvature_y_1_per_m"} | (
                {other: "curvature_z_1_per_m"} if other in written else {}
            )
            raise UserError(
                f"{path}: '{name}' is a curvature about x, and here x runs along the chain; curvature_y_1_per_m and "
                "curvature_z_1_per_m are the bends about the module's y and z over the chain's length, and "
                "'frame: {turn: unknown}' turns the pair where the sensor's axes are not the module's."
                f"{lines_to_write(path, notes_name, rename, {})}"
            )


def _check_clock(
    sheet: Sheet, unknown: Sequence[str], notes: MeasurementNotes, notes_name: str, roles: Container[str]
) -> None:
    """Raise `UserError` for a column named as a clock that cannot be read as one: without it the model differs."""
    for name in unknown:
        if "time" in meanings(bare(name)) and not _renamed(notes, name):
            inputs, outputs = () if "input" in roles else DRIVES, () if "output" in roles else READ
            first = sheet.first(sheet.header.index(name))
            if first and not looks_numeric(first, replace(sheet.marks, comma=True)):
                raise UserError(
                    f"{sheet.path}: column '{name}' is called as a clock, and '{first[:30]}' is neither a number nor a "
                    "time; write numbers with the unit in the name, such as time_s, or times as 10:00:00.125."
                )
            raise UserError(
                f"{sheet.path}: column '{name}' is called as a clock and does not say its unit; without it the rows "
                f"would be states reached slowly.{block_to_paste(sheet, notes_name, unknown, inputs, outputs)}"
            )


def _converted(column: FileColumn, notes: MeasurementNotes, split: bool) -> str:
    """Return a sentence on the conversion of a column's numbers; empty if they are unchanged.

    `split`: the clock is written in two columns.
    """
    about = f"Column '{column.written}'"
    if column.role == "time" and split:
        return f"{about} is in two, seconds and nanoseconds: time_s is their sum."
    if column.in_unit == FRAMES:
        return f"{about} holds numbers of pictures: time_s = value / {1 / column.scale:g} Hz."
    if column.stamped:
        return f"{about} holds dates or times of day: time_s counts from the first."
    zero = f" Its zero, {column.zero:g} {column.unit}, was subtracted." if column.zero else ""
    shift = column.shift + column.zero
    if (column.scale, shift) != (1.0, 0.0):
        added = f" + {shift:g}" if shift else ""
        return f"{about} was converted: {column.name} = {column.scale:.6g} × value{added}.{zero}"
    if column.written != column.name and not _renamed(notes, column.written):
        return f"{about} is read as {column.name}.{zero}"
    return f"{about}:{zero}" if zero else ""


def _renamed(notes: MeasurementNotes, name: str) -> bool:
    """Return whether the notes rename a column, named with or without its unit."""
    return noted(notes.rename, name, stem(name)) is not None


def _unknown_remarks(
    unknown: Sequence[str], notes: MeasurementNotes, notes_name: str, may_be: Container[str], taken: set[str]
) -> list[str]:
    """Return remarks on unknown columns; a name that is already read or proposed is not proposed again."""
    remarks: list[str] = []
    plain = []
    for name in unknown:
        if (meant := noted(notes.rename, name, stem(name))) is not None:
            key = name if name in notes.rename else stem(name)
            raise UserError(
                f"{notes.at(notes_name, 'rename', key)}: 'rename' gives '{key}' the name '{meant}', which is not a "
                f"column of a measurement{closest(meant, EXAMPLES)}"
            )
        meant = closest_column(name) if name not in may_be else ""
        if meant and not {meant, re.sub(r"_\d+", "", meant)} & taken:
            taken.add(meant)
            remarks.append(
                f"Column '{name}' is not known and is ignored; did you mean {meant}? Then write "
                f"'rename: {{{name}: {meant}}}' in {notes_name}."
            )
        else:
            plain.append(f"'{name}'")
    if plain:
        more = f" and {len(plain) - 20} more" if len(plain) > 20 else ""
        who = f"Column {plain[0]} is" if len(plain) == 1 else f"Columns {', '.join(plain[:20])}{more} are"
        remarks.append(detail(f"{who} not known and ignored."))
    return remarks


def _check_needed(
    sheet: Sheet,
    columns: Sequence[FileColumn],
    unknown: Sequence[str],
    notes_name: str,
    actuation: Sequence[str] | None,
) -> None:
    path, roles = sheet.path, {column.role for column in columns}
    have = [column.name for column in columns if column.role == "input"]
    wanted = [name for name in actuation or () if name not in have and not set(have) & set(HELD)]
    inputs = wanted or (() if have else DRIVES)
    outputs = () if "output" in roles else READ
    if not inputs and not outputs:
        return
    loads, extensions = ([], []) if have else tester_columns(sheet.header)
    if loads and extensions and not set(loads) & {c.written for c in columns}:
        raise UserError(
            f"{path}: '{loads[0]}' and '{extensions[0]}' are what a tensile tester exports, and nothing drives a "
            "chain; a test of the rubber is read by `pliant calibrate`. For a module in a tester say by 'rename' which "
            "columns are tendon_force_n, held_elongation_strain or blocked_force_n."
        )
    if "count" in roles and "output" not in roles:
        takers = "`pliant compare` and `pliant diagnose` take counts as their only file."
        if "counts" not in data_kinds():
            takers = f"counts belong to the package pliant_counts, {REMEDY}."
        raise UserError(
            f"{path}: the file holds counts (successes, trials) and no readings such as angle_rad or tip_x_m, which "
            f"are needed here; {takers}"
        )
    if long := _long_form(sheet, unknown):
        raise UserError(f"{path}: {long}")
    listed = ", ".join(unknown[:20])
    above = sheet.header_line > 1
    elsewhere = f", 'header: …' that another line than {sheet.header_line} names them" if above else ""
    of_the_file = (
        f". Columns that are not known: {listed}; 'rename' in {notes_name} says what they are{elsewhere}."
        if unknown
        else "."
    )
    paste = block_to_paste(sheet, notes_name, unknown, inputs, outputs)
    for name in wanted[:1]:
        others = [*have, *unknown]
        listing = f"it has {', '.join(others)}" if others else "it has no input at all"
        raise UserError(
            f"{path}: the chain is driven by '{name}', and the file has no such column; {listing}. "
            f"Name the column so, or write 'rename: {{its name: {name}}}' in {notes_name}.{paste}"
        )
    has = f" It has {', '.join(column.written for column in columns)}" if columns and not unknown else ""
    if inputs:
        line = f"join: {{file: {ANOTHER}, shift: 0 s}}"
        run = as_key(path.stem)
        join = (
            f"; if another logger recorded the input, write '{line}' into {notes_name}; if nothing drove it (a free "
            f"swing), 'runs: {{{run}: {{pressure_pa: 0}}}}' and 'let_go: {run}'."
        )
        raise HalfError(
            f"{path}: no column drives the chain; a measurement needs pressure_pa, pressure_1_pa…, tendon_force_n or "
            f"tendon_travel_m"
            f"{of_the_file}{has + join if has else ''}{paste}",
            "inputs",
        )
    if outputs:
        join = (
            f"; where it holds the inputs of another file, name that one ({ANOTHER}) and write 'join: {path.name}' "
            "into its notes."
        )
        raise HalfError(
            f"{path}: nothing is measured; a measurement has angle_rad, joint_1_angle_rad…, tip_x_m…, marker_1_x_m… "
            f"or elongation_strain{of_the_file}{has + join if has else ''}{paste}",
            "readings",
        )


def _long_form(sheet: Sheet, unknown: Sequence[str]) -> str:
    """Return a sentence on a table in long form, whose rows name their quantity; empty for other tables."""
    values = [name for name in unknown if VALUE.fullmatch(bare(name))]
    for name in unknown if values else ():
        cells = [row[sheet.header.index(name)].strip() for row in sheet.sample]
        kinds = list(dict.fromkeys(filter(None, cells)))
        if 2 <= len(kinds) <= MOST_KINDS and not any(looks_numeric(kind, sheet.marks) for kind in kinds):
            return (
                f"column '{name}' says what the '{values[0]}' of each row is ({', '.join(kinds[:3])}"
                f"{', …' if len(kinds) > 3 else ''}); write one column for each, named so, as pivot tables do: cells "
                "without a reading may be blank."
            )
    return ""
