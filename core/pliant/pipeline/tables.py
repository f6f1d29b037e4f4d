"""Data sets as CSV: data from elsewhere (COMSOL, Abaqus, a test bench) in, the FEM stage's states out."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import ContractError, UserError, closest
from pliant.records.design import Design
from pliant.records.fem import FemDataset, ModuleData
from pliant.store.store import write_atomically

ACTUATIONS = ("pressure_pa", "tendon_force_n")
REQUIRED = ("angle_rad", "moment_n_m")
OPTIONAL = ("dmoment_dp", "dmoment_du", "energy_j")
WORDS = {"axis": ("x", "y", "z"), "branch": ("free", "constrained"), "role": ("fit", "check")}
KNOWN = (*ACTUATIONS, *REQUIRED, *OPTIONAL, *WORDS, "status")
FAMILY = "table"
FULL_TURN = 2 * math.pi

Row = tuple[int, dict[str, str]]


def read_table(path: Path) -> FemDataset:
    """Read states from a CSV with a header, in SI.

    Needs `pressure_pa` or `tendon_force_n`, `angle_rad` (the joint angle of a module) and `moment_n_m` (the
    external moment that opposes the actuation). May have `dmoment_dp`, `dmoment_du`, `energy_j` (blank =
    missing = NaN), `branch` (else free where the moment is 0), `status` (else ok), `role` (else fit) and
    `axis` (else y; one axis per file). Any other column that holds one number throughout is a design
    parameter; the rest is ignored. Lines that start with `#` are comments.

    Raises `UserError` with the file and the line.
    """
    path = Path(path)
    header, rows = _rows(path)
    actuation = next(name for name in ACTUATIONS if name in header)
    columns = {
        name: np.array([_number(path, line, name, row[name]) for line, row in rows])
        for name in (actuation, *REQUIRED, *OPTIONAL)
        if name in header
    }
    missing = np.full(len(rows), np.nan)
    moment = columns["moment_n_m"]
    return FemDataset(
        design=Design(FAMILY, _design(header, rows)),
        axis=_axis(path, rows),
        actuation_name=actuation,
        actuation=columns[actuation],
        angle_rad=columns["angle_rad"],
        moment_n_m=moment,
        dmoment_dp=columns.get("dmoment_dp", missing),
        dmoment_du=columns.get("dmoment_du", missing),
        energy_j=columns.get("energy_j", missing),
        branch=_words(path, rows, "branch", lambda index: "free" if moment[index] == 0 else "constrained"),
        status=np.array([row.get("status") or "ok" for _, row in rows]),
        role=_words(path, rows, "role", lambda index: "fit"),
    )


def write_table(dataset: FemDataset | ModuleData, path: Path) -> None:
    """Write the `fem` CSV (docs/command_line.md); numbers are exact (shortest repr), NaN is blank.

    Numeric parameters of the design follow as columns. The file appears whole or not at all.
    """
    dataset = dataset.axis(dataset.main_axis) if isinstance(dataset, ModuleData) else dataset
    design = {
        name: _text(value)
        for name, value in dataset.design.parameters.items()
        if isinstance(value, int | float | np.integer) and not isinstance(value, bool)
    }
    if clash := sorted(set(design) & set(KNOWN)):
        raise ContractError(
            f"family '{dataset.design.family}': parameter '{clash[0]}' has the name of a data column"
        )
    numbers = ("angle_rad", "moment_n_m", *OPTIONAL)
    labels = ("branch", "status", "role")
    header = [dataset.actuation_name, "axis", *numbers, *labels, *design]
    lines = [
        [
            _text(dataset.actuation[i]),
            dataset.axis,
            *(_text(getattr(dataset, name)[i]) for name in numbers),
            *(str(getattr(dataset, name)[i]) for name in labels),
            *design.values(),
        ]
        for i in range(len(dataset))
    ]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([header, *lines])
    write_atomically(Path(path), text.getvalue())


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
    unknown = [name for name in header if name not in KNOWN]
    if not given:
        hints = sorted((_of_the_file(name, unknown) for name in ACTUATIONS), key=len)
        return f"column 'pressure_pa' or 'tendon_force_n' is missing{hints[-1]}"
    if "angle_rad" not in header and any("half" in name and "angle" in name for name in unknown):
        return "column 'angle_rad' is missing: it is the joint angle of a module, twice the half-module angle"
    for name in REQUIRED:
        if name not in header:
            return f"column '{name}' is missing{_of_the_file(name, unknown)}"
    return ""


def _of_the_file(name: str, columns: list[str]) -> str:
    """The end of a sentence: the column that may have been meant."""
    return closest(name, columns).replace("did you mean", "the file has").replace("?", ".")


def _number(path: Path, line: int, name: str, text: str) -> float:
    """A finite number, or NaN for a blank in an optional column."""
    where = f"{path}, line {line}, column {name}"
    if name in OPTIONAL and text.lower() in ("", "nan"):
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


def _axis(path: Path, rows: list[Row]) -> str:
    axes = _words(path, rows, "axis", lambda index: "y")
    other = np.flatnonzero(axes != axes[0])
    if other.size:
        raise UserError(
            f"{path}, line {rows[other[0]][0]}, column axis: it is '{axes[other[0]]}' after '{axes[0]}'; "
            "one table holds one axis"
        )
    return str(axes[0])


def _design(header: list[str], rows: list[Row]) -> dict[str, float | int | str | bool]:
    """Other columns that hold one number throughout."""
    parameters: dict[str, float | int | str | bool] = {}
    for name in header:
        values = {row[name] for _, row in rows}
        if name in KNOWN or not name or len(values) != 1:
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


def _text(value: float) -> str:
    if isinstance(value, int | np.integer):
        return str(value)
    return "" if math.isnan(value) else repr(float(value))
