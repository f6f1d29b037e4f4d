"""Tables from elsewhere (COMSOL, Abaqus, a test bench) and from the FEM stage, read with the line of each mistake."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import UserError, closest
from pliant.records.design import Design
from pliant.records.fem import FemDataset
from pliant.tabular.fem_checks import Row, check_agreement, check_pressure, check_slopes, check_tendon
from pliant.tabular.fem_columns import ACTUATIONS, ALL, PRISMATIC, REVOLUTE, WORDS, Names, is_data
from pliant.tabular.fem_notes import Columns, lines_to_write
from pliant.tabular.text import is_number, open_sheet

FAMILY = "table"
FULL_TURN = 2 * math.pi
NEEDED = "pressure_pa (or tendon_force_n),angle_rad,moment_n_m"


def read_table(path: Path, axis: str | None = None) -> FemDataset:
    """Read states from a CSV with a header, in SI.

    Needs `pressure_pa` or `tendon_force_n`, `angle_rad` (the joint angle of a module) and `moment_n_m` (the
    external moment that opposes the actuation), or `extension_m` and `force_n` of a prismatic joint. May have
    `dmoment_dp`, `dmoment_du` (`dforce_dp`, `dforce_du`), `energy_j` (blank = missing = NaN), `branch` (else free
    where the moment is 0), `status` (else ok), `role` (else fit) and `axis` (else y, or x of a prismatic joint).
    Any other column that holds one number throughout is a design parameter; the rest is ignored. Lines that
    start with `#`, `%` or `**` are comments. A YAML of the same stem may rename columns and give units and signs
    (docs/bring_your_own_data.md).

    Args:
        path: the file.
        axis: which axis to take where the table has several; a table of one axis is read whatever it says.

    Raises `UserError` with the file and the line.
    """
    path = Path(path)
    header, rows, columns = _rows_of(path)
    names = names_in(header)
    default = "x" if names is PRISMATIC else "y"
    found, rows = _of_axis(path, rows, axis, default)
    actuation = next(name for name in ACTUATIONS if name in header)
    numbers = {
        name: np.array([number(path, line, name, row[name], name in names.optional) for line, row in rows])
        for name in (actuation, *names.numbers)
        if name in header
    }
    missing = np.full(len(rows), np.nan)
    fields = {field: numbers.get(name, missing) for name, field in names.numbers.items()}
    effort = fields["moment_n_m"]
    if "status" not in header:  # Pliant's own tables are taken as they are
        check_pressure(path, rows, columns.stated, columns.file)
        check_tendon(path, rows, columns.stated, columns.file)
        check_agreement(path, rows, actuation, *names.required)
        check_slopes(path, rows, names.deformation, actuation, names.effort, names.by_deformation)
        check_slopes(path, rows, actuation, names.deformation, names.effort, names.by_actuation)
    return FemDataset(
        design=Design(FAMILY, _design(header, rows)),
        axis=found,
        actuation_name=actuation,
        actuation=numbers[actuation],
        angle_rad=fields["angle_rad"],
        moment_n_m=effort,
        dmoment_dp=fields["dmoment_dp"],
        dmoment_du=fields["dmoment_du"],
        energy_j=fields["energy_j"],
        branch=words(path, rows, "branch", lambda index: "free" if effort[index] == 0 else "constrained"),
        status=np.array([row.get("status") or "ok" for _, row in rows]),
        role=words(path, rows, "role", lambda index: "fit"),
        joint="prismatic" if names is PRISMATIC else "revolute",
    )


def table_axes(path: Path) -> tuple[str, ...]:
    """The axes of a table in the order in which they appear, that of the first state first."""
    header, rows = table_rows(Path(path))
    default = "x" if names_in(header) is PRISMATIC else "y"
    return tuple(dict.fromkeys(str(word) for word in axis_words(Path(path), rows, default) if word != ALL))


def names_in(header: list[str]) -> Names:
    """The columns of the joint that the header has."""
    return PRISMATIC if any(name in header for name in PRISMATIC.required) else REVOLUTE


def table_rows(path: Path) -> tuple[list[str], list[Row]]:
    """Names of the header, which is checked first, and each row with its line, in SI as the notes beside it say.

    Raises `UserError` with the file and the line.
    """
    header, rows, _ = _rows_of(path)
    return header, rows


def _rows_of(path: Path) -> tuple[list[str], list[Row], Columns]:
    with open_sheet(path, NEEDED) as sheet:
        columns = Columns(path, sheet.header)
        header = columns.names
        if problem := _problem(path, header, columns):
            raise UserError(f"{path}, line {sheet.header_line}: {problem}")
        rows = [
            (line, {name: columns.converted(name, cell) for name, cell in zip(header, row, strict=True)})
            for line, row in sheet.rows()
        ]
    rows = [(line, row) for line, row in rows if columns.keeps(row)]
    if not rows:
        raise UserError(f"{columns.file}: 'between' leaves no row of {path.name}")
    return header, rows, columns


def _problem(path: Path, header: list[str], columns: Columns) -> str:
    """What is wrong with the header, or an empty text."""
    if repeated := sorted({name for name in header if header.count(name) > 1}):
        both = [w for w, name in zip(columns.written, header, strict=True) if name == repeated[0]]
        return f"columns {' and '.join(map(repr, both))} both mean {repeated[0]}; keep one"
    given = [name for name in ACTUATIONS if name in header]
    if len(given) > 1:
        return "the table has pressure_pa and tendon_force_n; one law has one actuation"
    unknown = [name for name in header if not is_data(name)]
    names = names_in(header)
    if given:
        needed = [name for name in names.required if name not in header]
    else:
        needed = [*ACTUATIONS, *(name for name in names.required if name not in header)]
    lines = lines_to_write(path, columns.written, needed) if needed else ""
    if not given:
        hints = sorted((_of_the_file(name, unknown) for name in ACTUATIONS), key=len)
        return f"column 'pressure_pa' or 'tendon_force_n' is missing{hints[-1]}{lines}"
    if names is REVOLUTE and "angle_rad" not in header and any("half" in n and "angle" in n for n in unknown):
        return f"column 'angle_rad' is missing: it is the joint angle of a module, twice the half-module angle{lines}"
    for name in names.required:
        if name not in header:
            return f"column '{name}' is missing{_of_the_file(name, unknown)}{lines}"
    return ""


def _of_the_file(name: str, columns: list[str]) -> str:
    """The end of a sentence: the column that may have been meant."""
    return closest(name, columns).replace("did you mean", "the file has").replace("?", ".")


def number(path: Path, line: int, name: str, text: str, optional: bool) -> float:
    """A finite number, or NaN for a blank in an optional column."""
    where = f"{path}, line {line}, column {name}"
    if optional and text.lower() in ("", "nan"):
        return math.nan
    if not text:
        raise UserError(f"{where}: it is blank; every state needs this number")
    value = parsed(text)
    if value is None:
        raise UserError(f"{where}: '{text}' is not a number (write plain SI numbers)")
    if not math.isfinite(value):
        raise UserError(f"{where}: '{text}' is not a finite number")
    if name == "angle_rad" and abs(value) > FULL_TURN:
        raise UserError(
            f"{where}: {text} rad is more than a full turn; is the column in degrees? Then write "
            f"'units: {{angle_rad: deg}}' into {path.with_suffix('.yaml').name} beside it"
        )
    return value


def words(path: Path, rows: list[Row], name: str, default: Callable[[int], str]) -> Any:
    """A column of words from a short list; blank takes the default of its row."""
    words = []
    for index, (line, row) in enumerate(rows):
        word = row.get(name) or default(index)
        if word not in WORDS[name]:
            allowed = ", ".join(WORDS[name])
            hint = closest(word, WORDS[name])
            raise UserError(f"{path}, line {line}, column {name}: '{word}' is not one of {allowed}{hint}")
        words.append(word)
    return np.array(words)


def axis_words(path: Path, rows: list[Row], default: str) -> Any:
    """(n,) the axis of each state."""
    return words(path, rows, "axis", lambda index: default)


def _of_axis(path: Path, rows: list[Row], wanted: str | None, default: str) -> tuple[str, list[Row]]:
    """The axis that is read and its rows."""
    axes = axis_words(path, rows, default)
    single = axes[axes != ALL]
    found = list(dict.fromkeys(map(str, single)))
    if not found:
        raise UserError(f"{path}: no state explores one axis alone; all have '{ALL}' in column axis.")
    if len(found) > 1 and wanted is None:
        other = int(np.flatnonzero((axes != found[0]) & (axes != ALL))[0])
        raise UserError(
            f"{path}, line {rows[other][0]}, column axis: it is '{found[1]}' after '{found[0]}'; "
            "one table holds one axis here; give a spherical joint this table for each of 'axes: {x: …, y: …, z: …}'"
        )
    if len(found) > 1 and wanted not in found:
        raise UserError(f"{path}: no state explores axis {wanted}, only {', '.join(found)}.")
    axis = found[0] if len(found) == 1 or wanted is None else wanted
    return axis, [row for row, word in zip(rows, axes, strict=True) if word == axis]


def _design(header: list[str], rows: list[Row]) -> dict[str, float | int | str | bool]:
    """Other columns that hold one number throughout."""
    parameters: dict[str, float | int | str | bool] = {}
    for name in header:
        values = {row[name] for _, row in rows}
        if is_data(name) or not name or len(values) != 1:
            continue
        text = values.pop()
        value = parsed(text)
        if value is not None and math.isfinite(value):
            parameters[name] = int(text) if text.lstrip("+-").isdecimal() else value
    return parameters


def parsed(text: str) -> float | None:
    """The number that a cell holds, or None."""
    return float(text) if is_number(text) else None
