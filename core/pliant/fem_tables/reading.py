"""Reader of tables of states from elsewhere (COMSOL, Abaqus, a test rig) and the FEM stage, with lines of mistakes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError, closest
from pliant.fem_tables.columns import (
    ACTUATIONS,
    ALL,
    LABELS,
    PRISMATIC,
    REVOLUTE,
    WORDS,
    StateColumns,
    StateHeader,
    check_actuation,
    check_agreement,
    check_slopes,
    is_data,
    slope_input_number,
    table_notes,
)
from pliant.records.actuation import actuation_kind, driving, joined
from pliant.records.design import Array, Design
from pliant.records.fem import COUPLING, FemDataset, ModuleData
from pliant.records.law import EXTENSIBLE_AXES, EXTENSION, JointKind
from pliant.units import BEYOND
from pliant_tables.cells import NOTHING, is_number
from pliant_tables.opening import open_sheet

FAMILY = "table"
DESIGN = "design"  # column with the design's number in a sweep's table
FULL_TURN = 2 * math.pi
ASKED = " Names must be confirmed: no header states whether an angle is that of half a module, or the sign of a moment."
NEEDED = "pressure_pa (or tendon_force_n),angle_rad,moment_n_m"
Value = float | int | str | bool


def read_table(path: Path, axis: str | None = None) -> FemDataset:
    """Read states of one axis under one actuation from a CSV with a header, in SI.

    Needs `pressure_pa`, `tendon_force_n` or another known input, `angle_rad` (the joint angle of a module) and
    `moment_n_m` (the external moment that opposes the actuation), or `extension_m` and `force_n` of a prismatic joint.
    May have
    `dmoment_dp`, `dmoment_du` (`dforce_dp`, `dforce_du`), `energy_j` (blank = missing = NaN), `branch` (else free
    where the moment is 0), `status` (else ok), `role` (else fit) and `axis` (else y, or x of a prismatic joint).
    Any other column with one number throughout is a design parameter; the rest is ignored. Lines that
    start with `#`, `%` or `**` are comments. A YAML of the same stem may rename columns and give units and signs
    (docs/bring_your_own_data.md).

    Args:
        path: the file.
        axis: which axis to take if the table has several; ignored for a table of one axis.

    Raises `UserError` with the file and the line, and for several actuations (`read_module_table` reads those).
    """
    table = _opened(path)
    if len(table.inputs) > 1:
        raise UserError(
            f"{table.path}: the module is driven by {joined(table.inputs)}, and the law of one axis by itself takes "
            "one actuation: give the table as 'data' of the whole law."
        )
    found, table = _select_axis(table, axis)
    names, actuation = table.names, table.inputs[0]
    values: dict[str, Any] = {
        field: table.numbers(name, name in (actuation, *names[:2]))
        for name, field in {actuation: "actuation", **names.numbers}.items()
    }
    if "status" not in table.cells:  # Pliant's own tables are not checked for plausibility
        _check_plausible(table, [values["actuation"]], [values[names.numbers[name]] for name in names])
    every = [name for name in table.cells if name and not is_data(name)]
    design = {name: value for name, value in table.constants(every).items() if not isinstance(value, str)}
    return FemDataset(
        design=Design(FAMILY, design),
        axis=found,
        actuation_name=actuation,
        joint="prismatic" if names is PRISMATIC else "revolute",
        **values,
        **table.labels(),
    )


def read_module_table(path: Path) -> ModuleData:
    """Return the states of one design exactly as `write_table` wrote them: all rows, those of axis "all" too.

    Every column of a known input (`pressure_1_pa`, `pressure_2_pa`) is an actuation, in the columns' order; slopes by
    several are numbered in that order, `dmoment_dp_1`. A table of one axis may come from elsewhere (`read_table` has
    its columns); missing columns are NaN, 0 iterations. The main axis is the one of the first state with branch "free".
    Shapes, failures and the sampling are not in a table.

    Raises `UserError` with the file and the line.
    """
    return _module(_opened(path))


def read_designs_table(path: Path) -> list[ModuleData]:
    """Return the designs of a sweep's table, in its order; columns that are not data are their parameters.

    Rows are grouped by the column `design`, or without it, by the values of all columns that are not data. A cell of a
    parameter may be blank: then that design does not have it.

    Raises `UserError` with the file and the line.
    """
    return [one for _, one in read_labelled_designs(path)]


def read_labelled_designs(path: Path) -> list[tuple[str, ModuleData]]:
    """Return the designs of a sweep's table, each labelled by its number in the column `design`, or by its line."""
    table = _opened(path)
    numbered = DESIGN in table.cells
    telling = [table.cells[name] for name in ([DESIGN] if numbered else table.parameters)]
    groups: dict[tuple[str, ...], list[int]] = {}
    for row in range(len(table.lines)):
        groups.setdefault(tuple(cells[row] for cells in telling), []).append(row)
    if not numbered and 1 < len(table.lines) == len(groups):
        raise UserError(
            f"{path}: every row is a separate design; a column '{DESIGN}' with one number per design says which "
            "rows belong together"
        )
    if numbered and ("",) in groups:
        raise UserError(f"{path}, line {table.lines[groups['',][0]]}, column {DESIGN}: it is blank")
    return [
        (
            f"design {key[0]}" if numbered else f"the design of line {table.lines[rows[0]]}",
            _module(table.rows(rows)),
        )
        for key, rows in groups.items()
    ]


def holds_whole_states(path: Path) -> bool:
    """Return whether a table has u and the effort of all axes of a spherical joint, or several actuations."""
    table = _opened(path)
    return len(table.axes) > 1 or len(table.inputs) > 1


@dataclass(frozen=True, eq=False)
class StateTable:
    """The cells of each column as texts in SI, as the notes define them, and the line of each row."""

    path: Path
    header: StateHeader
    cells: dict[str, list[str]]
    lines: list[int]

    @property
    def names(self) -> StateColumns:
        """Return the columns of the joint that the header has."""
        return PRISMATIC if any(name in self.cells for name in PRISMATIC[:2]) else REVOLUTE

    @property
    def inputs(self) -> list[str]:
        """Return the columns that drive the module, in their order."""
        return driving(self.cells)

    @property
    def axes(self) -> list[str]:
        """Return the axes with separate columns."""
        own = zip(EXTENSIBLE_AXES, self.names.all_axes_columns(EXTENSIBLE_AXES), strict=False)
        return [axis for axis, column in own if column in self.cells]

    @property
    def parameters(self) -> list[str]:
        """Return the columns of the design."""
        return [name for name in self.cells if name and name != DESIGN and not is_data(name)]

    def rows(self, keep: Sequence[int]) -> StateTable:
        cells = {name: [column[row] for row in keep] for name, column in self.cells.items()}
        return replace(self, cells=cells, lines=[self.lines[row] for row in keep])

    def numbers(self, name: str, needed: bool = False) -> Array:
        """Return (n,) finite numbers of a column; NaN where absent, or blank and not needed."""
        if name not in self.cells:
            return np.full(len(self.lines), np.nan)
        cells = zip(self.lines, self.cells[name], strict=True)
        return np.array([self._number(line, name, text, needed) for line, text in cells])

    def _number(self, line: int, name: str, text: str, needed: bool) -> float:
        where = f"{self.path}, line {line}, column {name}"
        if not needed and text.lower() in ("", "nan"):
            return math.nan
        if not text:
            raise UserError(f"{where}: it is blank; every state needs this number")
        if not is_number(text):
            raise UserError(f"{where}: '{text}' is not a number (write plain SI numbers)")
        value = float(text)
        if not math.isfinite(value):
            raise UserError(f"{where}: '{text}' is not a finite number")
        if abs(value) > BEYOND:
            raise UserError(f"{where}: {text} is beyond ±{BEYOND:g}, and no quantity is that large")
        if 0.0 < abs(value) < NOTHING:  # its square underflows
            return 0.0
        if name == "angle_rad" and abs(value) > FULL_TURN:
            raise UserError(
                f"{where}: {text} rad is more than a full turn; is the column in degrees? Then write "
                f"'units: {{angle_rad: deg}}' into {self.path.with_suffix('.yaml').name} beside it"
            )
        return value

    def words(self, name: str, defaults: Sequence[str]) -> NDArray[np.str_]:
        """Return (n,) a column of words from a short list; blank takes the default of its row."""
        cells = self.cells.get(name, defaults)
        words = [word or default for word, default in zip(cells, defaults, strict=True)]
        for line, word in zip(self.lines, words, strict=True):
            if word not in WORDS[name]:
                raise UserError(
                    f"{self.path}, line {line}, column {name}: '{word}' is not one of {', '.join(WORDS[name])}"
                    f"{closest(word, WORDS[name])}"
                )
        return np.array(words)

    def explored(self) -> NDArray[np.str_]:
        """Return (n,) the axis of each state."""
        return self.words("axis", ["x" if self.names is PRISMATIC else "y"] * len(self.lines))

    def labels(self) -> dict[str, Any]:
        """Return (n,) branch, status and role of each state; without a branch a state of no effort is free."""
        efforts = map(_parsed, self.cells[self.names.effort])
        ok = ["ok"] * len(self.lines)
        status = [text or "ok" for text in self.cells.get("status", ok)]
        branch = self.words("branch", ["free" if value == 0 else "constrained" for value in efforts])
        found = (branch, np.array(status), self.words("role", ["fit"] * len(self.lines)))
        return dict(zip(LABELS, found, strict=True))

    def constants(self, names: Sequence[str]) -> dict[str, Value]:
        """Return columns with one value throughout that is not blank, as numbers or else texts."""
        found: dict[str, Value] = {}
        for name in names:
            text, *others = set(self.cells[name])
            if text and not others:
                value = _parsed(text)
                if value is None or not math.isfinite(value):
                    found[name] = text
                else:
                    found[name] = int(text) if text.lstrip("+-").isdecimal() else value
        return found


def _opened(path: Path) -> StateTable:
    """Return the whole table; its header is checked first."""
    path = Path(path)
    with open_sheet(path, NEEDED, *table_notes(path)) as sheet:
        header = StateHeader(path, sheet.header)
        if problem := _problem(path, header):
            raise UserError(f"{path}, line {sheet.header_line}: {problem}")
        lines, columns = sheet.table()
    cells = {
        name: column
        if header.factors[name] == 1.0
        else [_in_si(text, header.factors[name]) for text in column]
        for name, column in zip(header.names, columns, strict=True)
    }
    table = StateTable(path, header, cells, lines)
    for name, (low, high) in header.notes.between.items():
        # a cell that is not a number is kept, for the message
        values = [low if value is None else value for value in map(_parsed, table.cells[name])]
        table = table.rows([row for row, value in enumerate(values) if low <= value <= high])
        if not table.lines:
            raise UserError(f"{header.file}: 'between' leaves no row of {path.name}")
    return table


def _in_si(text: str, factor: float) -> str:
    """Return a cell in SI; a cell that is not a number is unchanged, for the message."""
    value = _parsed(text)
    return text if value is None else repr(factor * value)


def _parsed(text: str) -> float | None:
    """Return the number in a cell, or None."""
    return float(text) if is_number(text) else None


def _problem(path: Path, header: StateHeader) -> str:
    """Return the problem with the header, or an empty text."""
    columns = header.names
    if repeated := sorted({name for name in columns if columns.count(name) > 1}):
        both = [w for w, name in zip(header.written, columns, strict=True) if name == repeated[0]]
        return f"columns {' and '.join(map(repr, both))} both mean {repeated[0]}; keep one"
    given = header.inputs
    if problem := _slope_problem(columns, given):
        return problem
    unknown = [name for name in columns if not is_data(name)]
    names = PRISMATIC if any(name in columns for name in PRISMATIC[:2]) else REVOLUTE
    missing = [name for name in names[:2] if name not in columns]
    if given and not missing:
        return ""
    lines = header.lines_to_write(path, [*(() if given else header.asked_inputs()), *missing])
    asked = ASKED if lines else ""
    hints = [
        closest(name, unknown).replace("did you mean", "the file has").replace("?", ".")
        for name in (missing[:1] if given else ACTUATIONS)
    ]
    if not given:
        return f"column 'pressure_pa' or 'tendon_force_n' is missing{max(hints, key=len)}{asked}{lines}"
    if "angle_rad" in missing and any("half" in name and "angle" in name for name in unknown):
        return f"column 'angle_rad' is missing: it is the joint angle of a module, twice the half-module angle{lines}"
    return f"column '{missing[0]}' is missing{hints[0]}{asked}{lines}"


def _slope_problem(columns: Sequence[str], given: Sequence[str]) -> str:
    """Return the problem with inputs and with the numbers of their slopes, or an empty text."""
    for kind in {actuation_kind(name) for name in given}:
        numbered = [name for name in given if kind.matches(name) and name != kind.name]
        if numbered and kind.name in given:
            return f"the table has {kind.name} and {numbered[0]}: number all inputs of a kind, or the only one not"
    for name in columns:
        place = slope_input_number(name)
        if given and place == 0 and len(given) > 1:
            return f"column '{name}' does not say by which of {joined(given)}: number them in this order, {name}_1, …"
        if place and given and (place > len(given) or len(given) == 1):
            fit = f"leave out '_{place}'" if len(given) == 1 else f"numbers run from 1 to {len(given)}"
            return f"column '{name}' is a slope by input {place}, and the inputs are {joined(given)}: {fit}"
    return ""


def _check_plausible(table: StateTable, p: Sequence[Array], of_one: Sequence[Array]) -> None:
    """Raise `UserError` where states of one axis are implausible or contradict each other.

    Args:
        p: values (n,) of each input.
        of_one: values of the columns `StateColumns.main_axis_columns`.
    """
    path, lines, inputs = table.path, table.lines, table.inputs
    u_name, effort_name, *slopes = table.names.main_axis_columns(len(inputs))
    for name, values in zip(inputs, p, strict=True):
        check_actuation(path, name, values, table.header.stated, table.header.file)
    effort, places = (effort_name, of_one[1]), [*p, of_one[0]]
    check_agreement(path, lines, list(zip([*inputs, u_name], places, strict=True)), effort)
    for along in (len(inputs), *range(len(inputs))):
        slope = (slopes[-1], of_one[-1]) if along == len(inputs) else (slopes[along], of_one[2 + along])
        fixed = np.column_stack([one for d, one in enumerate(places) if d != along])
        check_slopes(path, lines, places[along], fixed, effort, slope)


def _select_axis(table: StateTable, wanted: str | None) -> tuple[str, StateTable]:
    """Return the axis that is read and its rows."""
    axes = table.explored()
    found = list(dict.fromkeys(map(str, axes[axes != ALL])))
    if not found:
        raise UserError(f"{table.path}: no state explores one axis alone; all have '{ALL}' in column axis.")
    if len(found) > 1 and wanted is None:
        other = int(np.flatnonzero((axes != found[0]) & (axes != ALL))[0])
        raise UserError(
            f"{table.path}, line {table.lines[other]}, column axis: it is '{found[1]}' after '{found[0]}'; "
            "one table holds one axis here; give a spherical joint this table for each of 'axes: {x: …, y: …, z: …}'"
        )
    if len(found) > 1 and wanted not in found:
        raise UserError(f"{table.path}: no state explores axis {wanted}, only {', '.join(found)}.")
    axis = found[0] if len(found) == 1 or wanted is None else wanted
    return axis, table.rows(np.flatnonzero(axes == axis).tolist())


def _module(table: StateTable) -> ModuleData:
    names, explored, labels = table.names, table.explored(), table.labels()
    axes = tuple(table.axes)
    if not axes:  # a table of one axis, or one that cannot be read
        axes = tuple(dict.fromkeys(map(str, explored)))
        if len(axes) > 1 or ALL in axes:
            line = table.lines[int(np.flatnonzero(explored != axes[0])[0]) if len(axes) > 1 else 0]
            needed = ", ".join(names.all_axes_columns("xyz")[:6])
            raise UserError(
                f"{table.path}, line {line}, column axis: a table of several axes needs u and the effort of all of "
                f"them ({needed}) to be read as whole states"
            )
    joint: JointKind = "prismatic" if names is PRISMATIC else "revolute"
    if len(axes) > 1:
        joint = "extensible" if EXTENSION in axes else "spherical"
    if joint == "extensible" and axes != EXTENSIBLE_AXES:
        lacking = [one for one in names.all_axes_columns(EXTENSIBLE_AXES)[:4] if one not in table.cells]
        raise UserError(
            f"{table.path}: a joint that extends has all of the axes {', '.join(EXTENSIBLE_AXES)}, and the column "
            f"{lacking[0]} is missing; a module that only extends has extension_m and force_n"
        )
    # all axes are free on the free branch of the actuated one, so only that one has such states
    free = [str(axis) for axis in explored[labels["branch"] == "free"] if axis in axes]
    n, k, m = len(table.lines), len(axes), len(table.inputs)
    columns = names.main_axis_columns(m) if k == 1 else names.all_axes_columns(axes, m)
    numbers = np.column_stack([table.numbers(name, name in columns[: 2 * k]) for name in columns])
    u, tau, by_p, by_u = np.split(numbers, [k, 2 * k, (2 + m) * k], axis=1)
    actuation = [table.numbers(name, needed=True) for name in table.inputs]
    travel = [table.numbers(actuation_kind(name).travel_name(name)) for name in table.inputs]
    if m > 1 and k == 1 and "status" not in table.cells:
        _check_plausible(table, actuation, list(numbers.T))
    return ModuleData(
        design=Design(FAMILY, table.constants(table.parameters)),
        joint=joint,
        axes=axes,
        main_axis=free[0] if free else "y" if "y" in axes else axes[0],
        actuation_name=joined(table.inputs),
        actuation=actuation[0] if m == 1 else np.column_stack(actuation),
        deformation=u,
        tau=tau,
        dtau_dp=by_p if m == 1 else by_p.reshape(n, k, m),
        dtau_du=by_u.reshape(n, k, k),
        energy_j=table.numbers("energy_j"),
        travel=travel[0] if m == 1 else np.column_stack(travel),
        iterations=np.nan_to_num(table.numbers("iterations")).astype(np.int64),
        wall_s=table.numbers("wall_s"),
        explored=np.where(explored == ALL, COUPLING, explored),
        **labels,
    )
