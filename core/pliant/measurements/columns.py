"""Columns of a measurement file: which names are known, in which unit, what each is for, and which a file has."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from pliant.config.measurements import MeasurementNotes
from pliant.errors import UserError, closest
from pliant.tabular.schema import FileColumn, Known, Schema, check_named
from pliant.tabular.units import stem

# The measurement CSV of docs/measurement_files.md.
KNOWN = (
    Known(r"run", "", "", "text"),
    Known(r"specimen", "", "", "text"),
    Known(r"time", "_s", "s", "time"),
    Known(r"pressure(_[1-9]\d*)?", "_pa", "Pa", "input"),
    Known(r"tendon_force(_[1-9]\d*)?", "_n", "N", "input"),
    Known(r"tendon_travel", "_m", "m", "output"),  # an input where the chain says so
    Known(r"moment", "_n_m", "N*m", "condition"),
    Known(r"tip_force_[xyz]", "_n", "N", "condition"),
    Known(r"payload", "_kg", "kg", "condition"),
    Known(r"valve_open", "", "", "condition"),  # 1: connected to the supply, 0: closed off
    Known(r"temperature", "_c", "degC", "condition"),
    Known(r"base_(roll|pitch|yaw)", "_rad", "rad", "condition"),
    Known(r"cycle", "", "", "cycle"),
    Known(r"angle", "_rad", "rad", "output"),
    Known(r"joint_[1-9]\d*_angle", "_rad", "rad", "output"),
    Known(r"tip_[xyz]", "_m", "m", "output"),
    Known(r"marker_[1-9]\d*_[xyz]", "_m", "m", "output"),
    Known(r"elongation", "_strain", "dimensionless", "output"),
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
    *("elongation_strain", "successes", "trials", "sigma_angle_rad"),
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


@dataclass(frozen=True)
class Header:
    """Columns of the file that are read.

    Attributes:
        columns: the numbers among them.
        places: index in the file of each column, by its written name.
        texts: index in the file of `run` and `specimen`, where it has them.
        remarks: what was ignored or converted, in sentences.
    """

    columns: tuple[FileColumn, ...]
    places: dict[str, int]
    texts: dict[str, int]
    remarks: tuple[str, ...]

    def names(self, *roles: str) -> list[str]:
        """Pliant's names of the columns in some roles."""
        return [column.name for column in self.columns if column.role in roles]


def read_header(
    path: Path,
    written: Sequence[str],
    notes: MeasurementNotes,
    notes_name: str,
    actuation: Sequence[str] | None,
) -> Header:
    """Match the header with the known columns.

    Args:
        path: the CSV, for messages.
        written: names in the file.
        notes: renames and units.
        notes_name: where a user would write notes, for messages.
        actuation: names of the chain's inputs; all inputs of the file where None.

    Raises `UserError` where an input is missing, nothing is measured, or two columns mean the same.
    """
    named = [*written, *map(stem, written)]
    check_named(path, notes_name, "rename", notes.rename, named)
    check_named(path, notes_name, "units", notes.units, [*named, *notes.rename.values()])
    found = MEASUREMENT.matched(path, written, notes, frozenset(actuation or ()))
    read = {column.written for column in found.values()}
    unknown = [name for name in written if name and name not in read]
    remarks = _unknown_remarks(unknown, notes, notes_name)
    if "" in written:
        remarks.append("A column without a name is ignored.")
    numeric = [column for column in found.values() if column.role != "text"]
    _check_needed(path, numeric, unknown, notes_name, actuation)
    outputs = [column.name for column in numeric if column.role == "output"]
    used = []
    for column in numeric:
        if column.role == "input" and actuation is not None and column.name not in actuation:
            remarks.append(f"Input '{column.name}' does not drive the chain and is ignored.")
        elif column.role == "count":
            remarks.append(
                f"Column '{column.name}' counts trials, which no chain predicts: ignored; counts go in a file of "
                "their own."
            )
        elif column.role == "sigma" and column.name.removeprefix("sigma_") not in outputs:
            remarks.append(f"Column '{column.name}' has no output of its own in the file and is ignored.")
        else:
            used.append(column)
    if "run" not in found:
        remarks.append(f"The file has no column 'run': all rows are one run, '{path.stem}'.")
    if "time_s" not in found:
        remarks.append(
            "The file has no column 'time_s': every row is a state that was reached slowly. Effects of rate and time "
            "cannot be judged."
        )
    for column in found.values():
        if (column.scale, column.shift) != (1.0, 0.0):
            shift = f" + {column.shift:g}" if column.shift else ""
            remarks.append(
                f"Column '{column.written}' was converted: {column.name} = {column.scale:.6g} × value{shift}."
            )
        elif column.written != column.name and column.written not in notes.rename:
            remarks.append(f"Column '{column.written}' is read as {column.name}.")
    places = {name: i for i, name in enumerate(written)}
    texts: dict[str, int] = {
        name: places[found[name].written] for name in ("run", "specimen") if name in found
    }
    return Header(tuple(used), places, texts, tuple(remarks))


def _unknown_remarks(unknown: Sequence[str], notes: MeasurementNotes, notes_name: str) -> list[str]:
    remarks = []
    plain = []
    for name in unknown:
        if name in notes.rename:
            raise UserError(
                f"{notes_name}: 'rename' gives '{name}' the name '{notes.rename[name]}', which is not a column of a "
                f"measurement{closest(notes.rename[name], EXAMPLES)}"
            )
        meant = closest(name.lower(), EXAMPLES)
        if meant == ".":
            plain.append(f"'{name}'")
        else:
            meant = meant.split("'")[1]
            remarks.append(
                f"Column '{name}' is not known and is ignored; did you mean {meant}? Then write "
                f"'rename: {{{name}: {meant}}}' in {notes_name}."
            )
    if plain:
        more = f" and {len(plain) - 20} more" if len(plain) > 20 else ""
        who = f"Column {plain[0]} is" if len(plain) == 1 else f"Columns {', '.join(plain[:20])}{more} are"
        remarks.append(f"{who} not known and ignored.")
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
    of_the_file = "."
    if unknown:
        listed = ", ".join(unknown[:20])
        of_the_file = f". Columns that are not known: {listed}; 'rename' in {notes_name} says what they are."
    if "count" in roles and "output" not in roles:
        raise UserError(
            f"{path}: the file holds counts (successes, trials) and no readings such as angle_rad or tip_x_m, which "
            "are needed here; `pliant compare` and `pliant diagnose` take counts as their only file."
        )
    for name in actuation or ():
        if name not in have:
            others = [*have, *unknown]
            listing = f"it has {', '.join(others)}" if others else "it has no input at all"
            raise UserError(
                f"{path}: the chain is driven by '{name}', and the file has no such column; {listing}. "
                f"Name the column so, or write 'rename: {{its name: {name}}}' in {notes_name}."
            )
    if not have:
        raise UserError(
            f"{path}: no column drives the chain; a measurement needs pressure_pa, pressure_1_pa… or tendon_force_n"
            f"{of_the_file}"
        )
    if "output" not in roles:
        raise UserError(
            f"{path}: nothing is measured; a measurement has angle_rad, joint_1_angle_rad…, tip_x_m…, marker_1_x_m… "
            f"or elongation_strain{of_the_file}"
        )
