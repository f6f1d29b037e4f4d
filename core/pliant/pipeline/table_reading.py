"""Tables from elsewhere (COMSOL, Abaqus, a test bench) and from the FEM stage, read with the line of each mistake."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import UserError, closest
from pliant.pipeline.table_columns import ACTUATIONS, ALL, PRISMATIC, REVOLUTE, WORDS, Names, is_data
from pliant.records.design import Design
from pliant.records.fem import FemDataset

FAMILY = "table"
FULL_TURN = 2 * math.pi

Row = tuple[int, dict[str, str]]


def read_table(path: Path, axis: str | None = None) -> FemDataset:
    """Read states from a CSV with a header, in SI.

    Needs `pressure_pa` or `tendon_force_n`, `angle_rad` (the joint angle of a module) and `moment_n_m` (the
    external moment that opposes the actuation), or `extension_m` and `force_n` of a prismatic joint. May have
    `dmoment_dp`, `dmoment_du` (`dforce_dp`, `dforce_du`), `energy_j` (blank = missing = NaN), `branch` (else free
    where the moment is 0), `status` (else ok), `role` (else fit) and `axis` (else y, or x of a prismatic joint).
    Any other column that holds one number throughout is a design parameter; the rest is ignored. Lines that
    start with `#` are comments.

    Args:
        path: the file.
        axis: which axis to take where the table has several; a table of one axis is read whatever it says.

    Raises `UserError` with the file and the line.
    """
    path = Path(path)
    header, rows = _rows(path)
    names = _names(header)
    default = "x" if names is PRISMATIC else "y"
    found, rows = _of_axis(path, rows, axis, default)
    actuation = next(name for name in ACTUATIONS if name in header)
    numbers = {
        name: np.array([_number(path, line, name, row[name], names) for line, row in rows])
        for name in (actuation, *names.numbers)
        if name in header
    }
    missing = np.full(len(rows), np.nan)
    fields = {field: numbers.get(name, missing) for name, field in names.numbers.items()}
    effort = fields["moment_n_m"]
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
        branch=_words(path, rows, "branch", lambda index: "free" if effort[index] == 0 else "constrained"),
        status=np.array([row.get("status") or "ok" for _, row in rows]),
        role=_words(path, rows, "role", lambda index: "fit"),
        joint="prismatic" if names is PRISMATIC else "revolute",
    )


def table_axes(path: Path) -> tuple[str, ...]:
    """The axes of a table in the order in which they appear, that of the first state first."""
    header, rows = _rows(Path(path))
    default = "x" if _names(header) is PRISMATIC else "y"
    return tuple(dict.fromkeys(str(word) for word in _axes(Path(path), rows, default) if word != ALL))


def _names(header: list[str]) -> Names:
    return PRISMATIC if any(name in header for name in PRISMATIC.required) else REVOLUTE


@dataclass
class _Lines:
    """The lines of a file that are neither blank nor comments; `number` is that of the last one given."""

    text: str
    number: int = 0

    def __iter__(self) -> Iterator[str]:
        for number, line in enumerate(self.text.splitlines(keepends=True), start=1):
            if line.strip() and not line.lstrip().startswith("#"):
                self.number = number
                yield line


def _rows(path: Path) -> tuple[list[str], list[Row]]:
    """Names of the header, which is checked first, and each row with its line."""
    try:
        lines = _Lines(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: it is not a UTF-8 text file; export the table as CSV") from error
    except OSError as error:
        raise UserError(f"{path}: the table cannot be read ({error.strerror})") from error
    reader = csv.reader(lines, skipinitialspace=True)
    header: list[str] = []
    rows: list[Row] = []
    try:
        for cells in reader:
            stripped = [cell.strip() for cell in cells]
            if not header:
                header = stripped
                _check_header(path, lines.number, header)
            elif len(cells) != len(header):
                raise UserError(
                    f"{path}, line {lines.number}: {len(cells)} cells, but the header has {len(header)}"
                )
            elif any(stripped):
                rows.append((lines.number, dict(zip(header, stripped, strict=True))))
    except csv.Error as error:
        raise UserError(f"{path}, line {lines.number}: it cannot be read as CSV ({error})") from error
    if not header:
        raise UserError(f"{path}: the table is empty; it needs a header with {_needs()}")
    if not rows:
        raise UserError(f"{path}: the table has a header and no rows")
    return header, rows


def _needs() -> str:
    return "pressure_pa (or tendon_force_n), angle_rad and moment_n_m"


def _check_header(path: Path, line: int, header: list[str]) -> None:
    if problem := _problem(header):
        raise UserError(f"{path}, line {line}: {problem}")


def _problem(header: list[str]) -> str:
    """What is wrong with the header, or an empty text."""
    if len(header) == 1 and any(mark in header[0] for mark in ";\t"):
        return "columns need ',' between them and numbers '.' for the decimals; export the table that way"
    if repeated := sorted({name for name in header if header.count(name) > 1}):
        return f"column '{repeated[0]}' appears {header.count(repeated[0])} times"
    given = [name for name in ACTUATIONS if name in header]
    if len(given) > 1:
        return "the table has pressure_pa and tendon_force_n; one law has one actuation"
    unknown = [name for name in header if not is_data(name)]
    if not given:
        hints = sorted((_of_the_file(name, unknown) for name in ACTUATIONS), key=len)
        return f"column 'pressure_pa' or 'tendon_force_n' is missing{hints[-1]}"
    names = _names(header)
    if names is REVOLUTE and "angle_rad" not in header and any("half" in n and "angle" in n for n in unknown):
        return "column 'angle_rad' is missing: it is the joint angle of a module, twice the half-module angle"
    for name in names.required:
        if name not in header:
            return f"column '{name}' is missing{_of_the_file(name, unknown)}"
    return ""


def _of_the_file(name: str, columns: list[str]) -> str:
    """The end of a sentence: the column that may have been meant."""
    return closest(name, columns).replace("did you mean", "the file has").replace("?", ".")


def _number(path: Path, line: int, name: str, text: str, names: Names) -> float:
    """A finite number, or NaN for a blank in an optional column."""
    where = f"{path}, line {line}, column {name}"
    if name in names.optional and text.lower() in ("", "nan"):
        return math.nan
    if not text:
        raise UserError(f"{where}: it is blank; every state needs this number")
    value = _parsed(text)
    if value is None:
        raise UserError(f"{where}: '{text}' is not a number (write plain SI numbers)")
    if not math.isfinite(value):
        raise UserError(f"{where}: '{text}' is not a finite number")
    if name == "angle_rad" and abs(value) > FULL_TURN:
        raise UserError(f"{where}: {text} rad is more than a full turn; is the column in degrees?")
    return value


def _words(path: Path, rows: list[Row], name: str, default: Callable[[int], str]) -> Any:
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


def _axes(path: Path, rows: list[Row], default: str) -> Any:
    return _words(path, rows, "axis", lambda index: default)


def _of_axis(path: Path, rows: list[Row], wanted: str | None, default: str) -> tuple[str, list[Row]]:
    """The axis that is read and its rows."""
    axes = _axes(path, rows, default)
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
        value = _parsed(text)
        if value is not None and math.isfinite(value):
            parameters[name] = int(text) if text.lstrip("+-").isdecimal() else value
    return parameters


def _parsed(text: str) -> float | None:
    try:
        return None if "_" in text else float(text)  # Python would read 1_5 as 15
    except ValueError:
        return None
