"""The header of a measurement file: which of its columns are read, what is lacking, and the lines that mend it."""

from __future__ import annotations

import difflib
import re
from collections.abc import Container, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from pliant.config.measurements import MeasurementNotes
from pliant.errors import UserError, closest
from pliant.measurements.columns import EXAMPLES, MEASUREMENT, match, unit_of
from pliant.measurements.plausible import as_key
from pliant.records.remark import detail
from pliant.tabular.names import bare, is_counter, lines_to_write, meanings, motor_of_steps, proposed
from pliant.tabular.schema import FRAMES, FileColumn
from pliant.tabular.sheet import Sheet
from pliant.tabular.units import stem, unit_at_the_end

# What a file may lack: one that drives, one that is read; the first is proposed where nothing else speaks for any.
DRIVES = ("pressure_pa", "tendon_force_n", "tendon_travel_m")
HELD = ("held_angle_rad", "held_elongation_strain")  # imposed: then no supply is needed
READ = ("angle_rad", "elongation_strain", "extension_m", "tip_x_m", "tip_y_m", "tip_z_m")
TRAVEL = "tendon_travel"
TWIST = re.compile(r"curvature[ _]x\b.*|curvature[ _]x_.*", re.IGNORECASE)
STEP = "1 mm  # <- what one step pulls in: the file does not say"
ANOTHER = "another.csv"  # stands for a file that has not been named


@dataclass(frozen=True)
class Header:
    """Columns of the file that are read.

    Attributes:
        columns: the numbers among them.
        places: index in the file of each column, by its written name.
        texts: index in the file of `run` and `specimen`, where it has them.
        remarks: what was ignored or converted, in sentences.
        given: numbers that do not stand in the file, after `columns`: of its name, or of another logger.
    """

    columns: tuple[FileColumn, ...]
    places: dict[str, int]
    texts: dict[str, int]
    remarks: tuple[str, ...]
    given: tuple[FileColumn, ...] = ()

    def names(self, *roles: str) -> list[str]:
        """Pliant's names of the columns in some roles."""
        return [column.name for column in self.every if column.role in roles]

    @property
    def every(self) -> tuple[FileColumn, ...]:
        """All columns of numbers."""
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
        given: columns that do not stand in the file.
        elsewhere: takes what the notes say of columns that the file does not have: others may.

    Raises `UserError` where an input is missing, nothing is measured, or two columns mean the same.
    """
    path, written = sheet.path, sheet.header
    found = match(sheet, notes, notes_name, frozenset(actuation or ()), elsewhere)
    _check_twist(path, [name for name in written if name not in notes.rename], notes_name)
    if actuation is None:
        found, driven = _driven_by_travel(found, given)
    else:
        driven = []
    read = {column.written for column in found.values()}
    unknown = [name for name in written if name and name not in read]
    if "time_s" not in found:
        _check_clock(path, unknown, notes, notes_name, {column.role for column in found.values()})
    remarks = [*driven, *_unknown_remarks(unknown, notes, notes_name)]
    if "" in written:
        remarks.append(detail("A column without a name is ignored."))
    numeric = [column for column in found.values() if column.role != "text"]
    _check_needed(path, [*numeric, *given], unknown, notes_name, actuation)
    outputs = [column.name for column in numeric if column.role == "output"]
    used = []
    for column in numeric:
        idle = actuation is not None and column.name not in actuation and column.name not in HELD
        if column.role == "input" and idle:
            remarks.append(detail(f"Input '{column.name}' does not drive the chain and is ignored."))
        elif column.role == "count":
            remarks.append(
                f"Column '{column.name}' counts trials, which no chain predicts: ignored; counts go in a file of "
                "their own."
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
    remarks += [detail(text) for column in found.values() if (text := _converted(column, notes))]
    places = {name: i for i, name in enumerate(written)}
    texts: dict[str, int] = {
        name: places[found[name].written] for name in ("run", "specimen") if name in found
    }
    numbers = tuple(column for column in given if column.role != "text")
    return Header(tuple(used), places, texts, tuple(remarks), numbers)


class HalfError(UserError):
    """A file of one logger only; `lacks` is what another one may have recorded."""

    def __init__(self, text: str, lacks: Literal["inputs", "readings"] = "inputs") -> None:
        super().__init__(text)
        self.lacks = lacks


def _driven_by_travel(
    found: dict[str, FileColumn], given: Sequence[FileColumn]
) -> tuple[dict[str, FileColumn], list[str]]:
    """Take tendons' travels as the inputs of a file that has no other input and other readings; say so."""
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
    """Raise `UserError` for a curvature about x, which in Pliant's frame is a twist: axes have to be said."""
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
    path: Path, unknown: Sequence[str], notes: MeasurementNotes, notes_name: str, roles: Container[str]
) -> None:
    """Raise `UserError` where a column is called as a clock and cannot be read as one: its absence would mean much."""
    for name in unknown:
        if "time" in meanings(bare(name)) and name not in notes.rename:
            inputs, outputs = () if "input" in roles else DRIVES, () if "output" in roles else READ
            raise UserError(
                f"{path}: column '{name}' is called as a clock and does not say its unit; without it the rows would "
                f"be states reached slowly.{_lines(path, notes_name, unknown, inputs, outputs)}"
            )


def _converted(column: FileColumn, notes: MeasurementNotes) -> str:
    """What was done to a column's numbers, in a sentence; empty where it is read as it stands."""
    about = f"Column '{column.written}'"
    if column.in_unit == FRAMES:
        return f"{about} numbers pictures: time_s = value / {1 / column.scale:g} Hz."
    if column.stamped:
        return f"{about} holds dates or times of day: time_s counts from the first."
    zero = f" Its zero, {column.zero:g} {column.unit}, was subtracted." if column.zero else ""
    shift = column.shift + column.zero
    if (column.scale, shift) != (1.0, 0.0):
        added = f" + {shift:g}" if shift else ""
        return f"{about} was converted: {column.name} = {column.scale:.6g} × value{added}.{zero}"
    if column.written != column.name and column.written not in notes.rename:
        return f"{about} is read as {column.name}.{zero}"
    return f"{about}:{zero}" if zero else ""


def _closest(name: str) -> str:
    """The known column that a name resembles, or an empty text: ``angel_deg`` → angle_deg."""
    near = closest(name.lower(), EXAMPLES)
    stems = [example.rpartition("_")[0] or example for example in EXAMPLES]
    of_stem = difflib.get_close_matches(bare(name).lower(), stems, n=1, cutoff=0.7)
    ending = name[len(bare(name)) :]
    if (
        of_stem
        and unit_at_the_end(name)
        and MEASUREMENT.column_of(of_stem[0] + ending, of_stem[0] + ending, None, frozenset())
    ):
        return of_stem[0] + ending
    return "" if near == "." else near.split("'")[1]


def _unknown_remarks(unknown: Sequence[str], notes: MeasurementNotes, notes_name: str) -> list[str]:
    remarks: list[str] = []
    plain = []
    for name in unknown:
        if name in notes.rename:
            raise UserError(
                f"{notes_name}: 'rename' gives '{name}' the name '{notes.rename[name]}', which is not a column of a "
                f"measurement{closest(notes.rename[name], EXAMPLES)}"
            )
        if meant := _closest(name):
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
    path: Path,
    columns: Sequence[FileColumn],
    unknown: Sequence[str],
    notes_name: str,
    actuation: Sequence[str] | None,
) -> None:
    roles = {column.role for column in columns}
    have = [column.name for column in columns if column.role == "input"]
    if "count" in roles and "output" not in roles:
        raise UserError(
            f"{path}: the file holds counts (successes, trials) and no readings such as angle_rad or tip_x_m, which "
            "are needed here; `pliant compare` and `pliant diagnose` take counts as their only file."
        )
    wanted = [name for name in actuation or () if name not in have and not set(have) & set(HELD)]
    inputs = wanted or (() if have else DRIVES)
    outputs = () if "output" in roles else READ
    listed = ", ".join(unknown[:20])
    of_the_file = (
        f". Columns that are not known: {listed}; 'rename' in {notes_name} says what they are."
        if unknown
        else "."
    )
    paste = _lines(path, notes_name, unknown, inputs, outputs)
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


def _lines(
    path: Path, notes_name: str, unknown: Sequence[str], inputs: Sequence[str], outputs: Sequence[str]
) -> str:
    """The block to paste: what names and units speak for, else the first unknown column as what is lacking."""
    columns = ["time_s", *inputs, *outputs]
    rename, units = proposed(unknown, {name: unit_of(name) for name in columns})
    for name, meant in rename.items():
        if near := _closest(name):
            rename[name] = near if bare(name).lower() != stem(name).lower() or near == meant else meant
    units = {name: unit for name, unit in units.items() if rename[name] in columns}
    lacking = [group[0] for group in (inputs, outputs) if group and not set(group) & set(rename.values())]
    if any(name in DRIVES or name.startswith(TRAVEL) for name in inputs):  # steps of motors pull tendons in
        motors = {name: number for name in unknown if (number := motor_of_steps(name)) is not None}
        for name, number in motors.items():
            rename[name] = f"{TRAVEL}_{number}_m" if number else f"{TRAVEL}_m"
            units[name] = STEP
        lacking = [one for one in lacking if not motors or one not in inputs]
    free = [name for name in unknown if name not in rename and not is_counter(name)]
    rename |= dict(zip(free, [name for name in lacking if name not in rename.values()], strict=False))
    return lines_to_write(path, notes_name, rename, units)
