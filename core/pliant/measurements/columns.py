"""Columns of a measurement file: which names are known, in which unit, what each is for, and which a file has."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from pliant.config.measurements import PER_RUN, UNKNOWN, MeasurementNotes
from pliant.errors import UserError, closest
from pliant.tabular.names import meanings
from pliant.tabular.schema import FRAMES, FileColumn, Known, Schema, check_named, noted, stamped
from pliant.tabular.sheet import Sheet
from pliant.tabular.units import stem, value_of

# The measurement CSV of docs/measurement_files.md.
KNOWN = (
    Known(r"run", "", "", "text"),
    Known(r"specimen", "", "", "text"),
    Known(r"time", "_s", "s", "time"),
    Known(r"pressure(_[1-9]\d*)?", "_pa", "Pa", "input"),
    Known(r"tendon_force(_[1-9]\d*)?", "_n", "N", "input"),
    Known(r"held_angle", "_rad", "rad", "input"),  # imposed by the bench, which reads what holds it
    Known(r"held_elongation", "_strain", "dimensionless", "input"),
    Known(r"blocked_moment", "_n_m", "N*m", "output"),
    Known(r"blocked_force", "_n", "N", "output"),
    Known(r"tendon_travel(_[1-9]\d*)?", "_m", "m", "output"),  # an input where the chain says so
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


def unit_of(name: str) -> str:
    """SI unit of a column or output: "rad" for `angle_rad`, "" for texts and counts.

    Raises `UserError` for a name that is not in docs/measurement_files.md.
    """
    known = MEASUREMENT.find(name.removeprefix("sigma_"))
    if known is None:
        raise UserError(f"'{name}' is not a column of a measurement{closest(name, EXAMPLES)}")
    return known.unit


def outputs_among(names: Iterable[str]) -> list[str]:
    """Those of the names that are readings."""
    known = ((name, MEASUREMENT.find(name)) for name in names)
    return [name for name, column in known if column is not None and column.role == "output"]


def match(
    sheet: Sheet,
    notes: MeasurementNotes,
    notes_name: str,
    inputs: frozenset[str] = frozenset(),
    elsewhere: set[tuple[str, str]] | None = None,
) -> dict[str, FileColumn]:
    """The columns of a sheet that are known, by name, with what the notes say of rates and zeros.

    `elsewhere` takes the keys and columns of notes that this file does not have, which is an error without it.
    """

    def check(key: str, keys: Iterable[str], columns: Iterable[str]) -> None:
        known = set(columns)
        if elsewhere is None:
            check_named(path, notes_name, key, keys, known)
        else:
            elsewhere.update((key, name) for name in keys if name not in known)

    path, written = sheet.path, sheet.header
    named = [*written, *map(stem, written)]
    check("rename", notes.rename, named)
    check("units", notes.units, [*named, *notes.rename.values()])
    found = MEASUREMENT.matched(path, written, notes, inputs, stamped(sheet))
    if (
        "time_s" not in found
        and (clock := _of_labview(sheet) or _of_frames(sheet, notes, notes_name)) is not None
    ):
        found["time_s"] = clock
    check("zero", notes.zero, [*named, *found])
    return {name: with_zero(column, notes, notes_name) for name, column in found.items()}


def with_zero(column: FileColumn, notes: MeasurementNotes, notes_name: str) -> FileColumn:
    """A column from whose numbers the zero of the notes is subtracted, where they state one."""
    zero = noted(notes.zero, column.written, stem(column.written), column.name)
    if zero is None or zero in (UNKNOWN, PER_RUN):
        return column
    value = value_of(zero, column.unit, f"{notes_name}: 'zero' of '{column.written}'")
    return replace(column, shift=column.shift - value, zero=value)


def _of_labview(sheet: Sheet) -> FileColumn | None:
    """The column X_Value of a LabVIEW measurement file, which is the time in seconds unless its header says else."""
    labview = any(line.startswith("LabVIEW Measurement") for line in sheet.preamble)
    other = any(line.startswith("X_Dimension") and "Time" not in line for line in sheet.preamble)
    if labview and not other and "X_Value" in sheet.header:
        return FileColumn("X_Value", "time_s", "time", "s", in_unit="s")
    return None


FRAME_RATE = re.compile(
    r"\b(?:frame|sampl\w*|recording|picture|video|bild\w*|abtast\w*)[\s_-]*(?:rate|frequen\w*|freq)?\b[^\d\n]*?"
    r"(\d+(?:[.,]\d+)?)[\s,;]*(?:fps|hz|1/s)\b|\bfps\b\W*(\d+(?:[.,]\d+)?)",
    re.IGNORECASE,
)


def _of_frames(sheet: Sheet, notes: MeasurementNotes, notes_name: str) -> FileColumn | None:
    """The clock that a column of numbered pictures is, at the rate of the notes or of a line above the header."""
    written = next((name for name in sheet.header if "frame" in meanings(notes.rename.get(name, name))), None)
    if written is None:
        return None
    rates = {rate for line in sheet.preamble for rate in _rates(line)}
    if notes.rate is None and len(rates) != 1:
        several = (
            f"; the lines above the header say {' and '.join(f'{r:g}' for r in sorted(rates))} Hz"
            if rates
            else ""
        )
        raise UserError(
            f"{sheet.path}: column '{written}' numbers pictures, and nothing says their rate{several}. Write "
            f"'rate: 25 Hz', or what it was, into {notes_name}."
        )
    rate = notes.rate if notes.rate is not None else rates.pop()
    return FileColumn(written, "time_s", "time", "s", 1.0 / rate, in_unit=FRAMES)


def _rates(line: str) -> list[float]:
    return [float((one or other).replace(",", ".")) for one, other in FRAME_RATE.findall(line)]
