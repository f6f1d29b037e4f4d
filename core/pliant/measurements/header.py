"""The header of a measurement: which column is what, after renames and units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pliant.config.measurements import MeasurementNotes
from pliant.errors import UserError, closest
from pliant.measurements.columns import EXAMPLES, MEASUREMENT
from pliant.tabular.notes import check_named, noted
from pliant.tabular.schema import Column
from pliant.tabular.units import stem

ALIASES = {"moment_nm": "moment_n_m"}


@dataclass(frozen=True)
class Header:
    """Columns of the file that are read.

    Attributes:
        columns: the numbers among them.
        places: index in the file of each column, by its written name.
        run, specimen: index of these texts, None where the file has no such column.
        remarks: what was ignored or converted, in sentences.
    """

    columns: tuple[Column, ...]
    places: dict[str, int]
    run: int | None
    specimen: int | None
    remarks: tuple[str, ...]

    def place(self, column: Column) -> int:
        return self.places[column.written]

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
    renamed_too = [*written, *(notes.rename.get(name, name) for name in written), *map(stem, written)]
    check_named(path, notes_name, "rename", notes.rename, [*written, *map(stem, written)])
    check_named(path, notes_name, "units", notes.units, renamed_too)
    inputs = frozenset(actuation or ())
    found: dict[str, Column] = {}
    unknown: list[str] = []
    for name in filter(None, written):
        renamed = noted(notes.rename, name, stem(name)) or name
        unit = noted(notes.units, name, stem(name), renamed)
        column = MEASUREMENT.column_of(name, ALIASES.get(renamed, renamed), unit, inputs)
        if column is None:
            unknown.append(name)
        elif column.name in found:
            raise UserError(
                f"{path}: columns '{found[column.name].written}' and '{name}' both mean {column.name}; keep one."
            )
        else:
            found[column.name] = column
    remarks = _unknown_remarks(unknown, notes, notes_name)
    if "" in written:
        remarks.append("A column without a name is ignored.")
    numeric = [column for column in found.values() if column.role != "text"]
    numeric, more = _used(path, numeric, unknown, notes_name, actuation)
    if "run" not in found:
        more.append(f"The file has no column 'run': all rows are one run, '{path.stem}'.")
    if "time_s" not in found:
        more.append(
            "The file has no column 'time_s': every row is a state that was reached slowly. Effects of rate and time "
            "cannot be judged."
        )
    places = {name: i for i, name in enumerate(written)}
    texts = {name: places[found[name].written] if name in found else None for name in ("run", "specimen")}
    return Header(
        tuple(numeric),
        places,
        texts["run"],
        texts["specimen"],
        (*remarks, *more, *_conversions(found, notes)),
    )


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
            plain.append(name)
            continue
        meant = meant.split("'")[1]
        remarks.append(
            f"Column '{name}' is not known and is ignored; did you mean {meant}? Then write "
            f"'rename: {{{name}: {meant}}}' in {notes_name}."
        )
    if plain:
        names = ", ".join(f"'{name}'" for name in plain[:20])
        more = f" and {len(plain) - 20} more" if len(plain) > 20 else ""
        who = f"Column {names} is" if len(plain) == 1 else f"Columns {names}{more} are"
        remarks.append(f"{who} not known and ignored.")
    return remarks


def _used(
    path: Path,
    columns: list[Column],
    unknown: Sequence[str],
    notes_name: str,
    actuation: Sequence[str] | None,
) -> tuple[list[Column], list[str]]:
    """Columns that are read, and remarks on known ones that are not. Raises where something needed is missing."""
    roles = {column.role for column in columns}
    if "count" in roles and "output" not in roles:
        raise UserError(
            f"{path}: the file holds counts (successes, trials) and no readings such as angle_rad or tip_x_m, which "
            "are needed here; `pliant compare` and `pliant diagnose` take counts as their only file."
        )
    have = [column.name for column in columns if column.role == "input"]
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
            f"{_of_the_file(unknown, notes_name)}"
        )
    outputs = [column.name for column in columns if column.role == "output"]
    if not outputs:
        raise UserError(
            f"{path}: nothing is measured; a measurement has angle_rad, joint_1_angle_rad…, tip_x_m…, marker_1_x_m… "
            f"or elongation_strain{_of_the_file(unknown, notes_name)}"
        )
    return _without_unused(columns, outputs, actuation)


def _of_the_file(unknown: Sequence[str], notes_name: str) -> str:
    if not unknown:
        return "."
    return f". Columns that are not known: {', '.join(unknown[:20])}; 'rename' in {notes_name} says what they are."


def _without_unused(
    columns: list[Column], outputs: list[str], actuation: Sequence[str] | None
) -> tuple[list[Column], list[str]]:
    used, remarks = [], []
    for column in columns:
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
    return used, remarks


def _conversions(found: dict[str, Column], notes: MeasurementNotes) -> list[str]:
    remarks = []
    for column in found.values():
        if (column.scale, column.shift) != (1.0, 0.0):
            shift = f" + {column.shift:g}" if column.shift else ""
            remarks.append(
                f"Column '{column.written}' was converted: {column.name} = {column.scale:.6g} × value{shift}."
            )
        elif column.written != column.name and column.written not in notes.rename:
            remarks.append(f"Column '{column.written}' is read as {column.name}.")
    return remarks
