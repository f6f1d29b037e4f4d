"""Columns of a measurement file: known names, their units and roles, and their match with a header."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from pliant.config.measurements import PER_RUN, UNKNOWN, MeasurementNotes
from pliant.errors import UserError
from pliant.units import split_unit
from pliant_tables.names import bare, meanings
from pliant_tables.preamble import rates
from pliant_tables.schema import FRAMES, FileColumn, Known, Schema, check_named, noted, stamped
from pliant_tables.sheet import NumberedSheet, Sheet
from pliant_tables.side_by_side import group_numbered_names
from pliant_tables.split_clock import SplitClockSheet, with_joined_clock
from pliant_tables.units import parse_si_value, stem

# The measurement CSV of docs/measurement_files.md.
KNOWN = (
    Known(r"run", "", "", "text"),
    Known(r"specimen", "", "", "text"),
    Known(r"time", "_s", "s", "time"),
    Known(r"pressure(_[1-9]\d*)?", "_pa", "Pa", "input"),
    Known(r"tendon_force(_[1-9]\d*)?", "_n", "N", "input"),
    Known(r"held_angle", "_rad", "rad", "input"),  # imposed by the test rig, which reads the reaction
    Known(r"held_elongation", "_strain", "dimensionless", "input"),
    Known(r"blocked_moment", "_n_m", "N*m", "output"),
    Known(r"blocked_force", "_n", "N", "output"),
    Known(r"tendon_travel(_[1-9]\d*)?", "_m", "m", "output"),  # an input if the chain says so
    Known(r"moment", "_n_m", "N*m", "condition"),
    Known(r"tip_force_[xyz]", "_n", "N", "condition"),
    Known(r"payload", "_kg", "kg", "condition"),
    Known(r"valve_open", "", "", "condition"),  # 1: connected to the supply, 0: closed off
    Known(r"temperature", "_c", "degC", "condition"),
    Known(r"base_(roll|pitch|yaw)", "_rad", "rad", "condition"),
    Known(r"cycle", "", "", "cycle"),
    Known(r"angle(_[yz])?", "_rad", "rad", "output"),
    Known(r"joint_[1-9]\d*_angle(_[yz])?", "_rad", "rad", "output"),
    Known(r"curvature(_[yz])?", "_1_per_m", "m^-1", "output"),
    Known(r"tip_[xyz]", "_m", "m", "output"),
    Known(r"marker_[1-9]\d*_[xyz]", "_m", "m", "output"),
    Known(r"elongation", "_strain", "dimensionless", "output"),
    Known(r"extension", "_m", "m", "output"),
    Known(r"successes", "", "", "count"),
    Known(r"trials", "", "", "count"),
)
# Names to suggest from: one of each family.
EXAMPLES = (
    *("run", "specimen", "time_s", "pressure_pa", "pressure_1_pa", "tendon_force_n", "tendon_travel_m"),
    *(
        "moment_n_m",
        "tip_force_x_n",
        "tip_force_y_n",
        "tip_force_z_n",
        "payload_kg",
        "temperature_c",
        "valve_open",
    ),
    *("base_roll_rad", "base_pitch_rad", "base_yaw_rad", "cycle", "angle_rad", "joint_1_angle_rad"),
    *("tip_x_m", "tip_y_m", "tip_z_m", "marker_1_x_m", "marker_1_y_m", "marker_1_z_m"),
    *(
        "held_elongation_strain",
        "blocked_moment_n_m",
        "blocked_force_n",
    ),  # held_angle is too near to bend_angle
    *("elongation_strain", "extension_m", "curvature_1_per_m", "curvature_y_1_per_m", "joint_1_angle_y_rad"),
    *("successes", "trials", "sigma_angle_rad"),
)
MEASUREMENT = Schema(KNOWN, "run,time_s,pressure_pa,angle_rad")


def column_si_unit(name: str) -> str:
    """Return the SI unit of a column or output: "rad" for `angle_rad`, "" for texts and counts.

    Other names than those of docs/measurement_files.md are channels of a user's own model, with the unit at their end.
    """
    known = MEASUREMENT.find(name.removeprefix("sigma_"))
    return split_unit(name)[1] if known is None else known.unit


def outputs_among(names: Iterable[str]) -> list[str]:
    """Return the names that are readings."""
    known = ((name, MEASUREMENT.find(name)) for name in names)
    return [name for name, column in known if column is not None and column.role == "output"]


def match(
    sheet: Sheet,
    notes: MeasurementNotes,
    notes_name: str,
    inputs: frozenset[str] = frozenset(),
    elsewhere: set[tuple[str, str]] | None = None,
) -> dict[str, FileColumn]:
    """Return the known columns of a sheet by name, with the rates and zeros of the notes.

    `elsewhere` collects the keys and columns of notes that this file does not have; without it they are an error.
    """

    def check(key: str, keys: Iterable[str], columns: Iterable[str]) -> None:
        known = set(columns)
        if elsewhere is None:
            check_named(path, notes_name, key, keys, known, notes)
        else:
            elsewhere.update((key, name) for name in keys if name not in known)

    path, written = sheet.path, sheet.header
    named = [*written, *map(stem, written)]
    check("rename", notes.rename, named)
    check("units", notes.units, [*named, *notes.rename.values()])
    found = MEASUREMENT.matched(path, written, notes, inputs, stamped(sheet))
    if (
        "time_s" not in found
        and (clock := _labview_clock(sheet) or _joined_clock(sheet) or _frame_clock(sheet, notes, notes_name))
        is not None
    ):
        found["time_s"] = clock
    check("zero", notes.zero, [*named, *found])
    check("wrap", notes.wrap, [*named, *found])
    return {name: with_zero(column, notes, notes_name) for name, column in found.items()}


def with_zero(column: FileColumn, notes: MeasurementNotes, notes_name: str) -> FileColumn:
    """Return a column whose numbers have the zero of the notes subtracted, if they state one."""
    names = (column.written, stem(column.written), column.name)
    zero = noted(notes.zero, *names)
    if zero is None or zero in (UNKNOWN, PER_RUN):
        return column
    where = notes.at(notes_name, "zero", next(name for name in names if name in notes.zero))
    value = parse_si_value(zero, column.unit, f"{where}: 'zero' of '{column.written}'")
    return replace(column, shift=column.shift - value, zero=value)


def _labview_clock(sheet: Sheet) -> FileColumn | None:
    """Return the column X_Value of a LabVIEW measurement file: the time in seconds unless its header says otherwise."""
    labview = any(line.startswith("LabVIEW Measurement") for line in sheet.preamble)
    other = any(line.startswith("X_Dimension") and "Time" not in line for line in sheet.preamble)
    if labview and not other and "X_Value" in sheet.header:
        return FileColumn("X_Value", "time_s", "time", "s", in_unit="s")
    return None


def _joined_clock(sheet: Sheet) -> FileColumn | None:
    """Return the clock that was written in two columns, in seconds."""
    if isinstance(sheet, SplitClockSheet):
        return FileColumn(sheet.name, "time_s", "time", "s", in_unit="s")
    return None


def with_clock(sheet: Sheet, notes: MeasurementNotes) -> Sheet:
    """Return the sheet with a clock of two columns joined, or its rows numbered as frames.

    A file with a clock of its own keeps it, and both columns are none.
    """
    named = {meant for name in sheet.header for meant in meanings(bare(name))}
    joined = sheet if "time" in named or notes.rate is not None else with_joined_clock(sheet)
    return joined if isinstance(joined, SplitClockSheet) else _with_frames(sheet, notes)


def _with_frames(sheet: Sheet, notes: MeasurementNotes) -> Sheet:
    """Return the sheet with its rows numbered as frames if it has no clock and the rate of its rows is known.

    The rate is `rate` in the notes; positions of Qualisys without frames state theirs.
    """
    qualisys = any(line.startswith("MARKER_NAMES") for line in sheet.preamble)
    if notes.rate is None and not qualisys:
        return sheet
    named = {
        meant
        for name in sheet.header
        for meant in meanings(bare(noted(notes.rename, name, stem(name)) or name))
    }
    own = {noted(notes.rename, name, stem(name)) or name for name in sheet.header}
    clocked = (
        named & {"frame", "time"} or any(name.startswith("time") for name in own) or _labview_clock(sheet)
    )
    return sheet if clocked else NumberedSheet.around(sheet, "frame")


def _frame_clock(sheet: Sheet, notes: MeasurementNotes, notes_name: str) -> FileColumn | None:
    """Return the clock from a column of frame numbers, at the rate of the notes or of a line above the header."""
    written = next(
        (n for n in sheet.header if "frame" in meanings(noted(notes.rename, n, stem(n)) or n)), None
    )
    if written is None:
        return None
    stated = rates(sheet.preamble, sheet.separator)
    if notes.rate is None and len(stated) != 1:
        several = (
            f"; the lines above the header say {' and '.join(f'{r:g}' for r in sorted(stated))} Hz"
            if stated
            else ""
        )
        raise UserError(
            f"{sheet.path}: column '{written}' contains frame numbers, and their rate is not stated{several}. Write "
            f"'rate: 25 Hz', or what it was, into {notes_name}."
        )
    rate = notes.rate if notes.rate is not None else stated.pop()
    return FileColumn(written, "time_s", "time", "s", 1.0 / rate, in_unit=FRAMES)


def single_column_remarks(columns: Iterable[FileColumn], unknown: Iterable[str]) -> list[str]:
    """Return a sentence for each column read as the only one of its kind although others differ only by a number.

    Args:
        columns: those that are read.
        unknown: those that are not.
    """
    rows, said = group_numbered_names(unknown), []
    for column in columns:
        mine = next(iter(group_numbered_names([column.written])), "")
        others = list(rows.get(mine, ()))
        if others and column.role in ("input", "output") and not re.search(r"\d", column.name):
            what = split_unit(column.name)[0].replace("_", " ")
            names = (
                f"{', '.join(others[:4])}{', …' * (len(others) > 4)} {'is' if len(others) == 1 else 'are'}"
            )
            numbered = "pressure_1_pa, …" if column.role == "input" else "joint_1_angle_rad, …"
            said.append(
                f"{column.written} is read as the only {what}, and {names} not: a robot of several has all of them, "
                f"renamed to {numbered}."
            )
    return said
