"""Tables that `write_table` and `write_sweep_table` wrote, read back as whole states of one module or of many."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.records.design import Array, Design
from pliant.records.fem import COUPLING, ModuleData
from pliant.records.law import JointKind
from pliant.tabular.fem_checks import Row
from pliant.tabular.fem_columns import ACTUATIONS, ALL, PRISMATIC, TRAVELS, Names, is_data
from pliant.tabular.fem_reading import FAMILY, axis_words, names_in, number, parsed, table_rows, words

DESIGN = "design"  # column with the design's number in a sweep's table
Value = float | int | str | bool


def read_module_table(path: Path) -> ModuleData:
    """The states of one design as `write_table` wrote them, to the bit: all rows, those of axis "all" too.

    A table of one axis may come from elsewhere (`read_table` has its columns); what it lacks is NaN, 0 iterations.
    The main axis is the one of the first state with branch "free". Shapes, failures and the sampling are not in a
    table.

    Raises `UserError` with the file and the line.
    """
    path = Path(path)
    header, rows = table_rows(path)
    return _module(path, header, rows, _constants(_parameter_names(header), rows))


def read_designs_table(path: Path) -> list[ModuleData]:
    """The designs of a sweep's table, in its order; columns that are not data are their parameters.

    Rows belong together by the column `design`, or, where there is none, by the values of all columns that are not
    data. A cell of a parameter may be blank: then that design does not have it.

    Raises `UserError` with the file and the line.
    """
    return [one for _, one in read_labelled_designs(path)]


def read_labelled_designs(path: Path) -> list[tuple[str, ModuleData]]:
    """As `read_designs_table`, each with what messages call it: its number in the column `design`, or its line."""
    path = Path(path)
    header, rows = table_rows(path)
    names = _parameter_names(header)
    telling = [DESIGN] if DESIGN in header else names
    keys = [tuple(row[name] for name in telling) for _, row in rows]
    groups: dict[tuple[str, ...], list[Row]] = {}
    for key, row in zip(keys, rows, strict=True):
        groups.setdefault(key, []).append(row)
    if DESIGN not in header and len(rows) > 1 and len(groups) == len(rows):
        raise UserError(
            f"{path}: every row is a design of its own; a column '{DESIGN}' with one number per design says which "
            "rows belong together"
        )
    if ("",) in groups and DESIGN in header:
        raise UserError(f"{path}, line {groups['',][0][0]}, column {DESIGN}: it is blank")
    return [
        (
            f"design {key[0]}" if DESIGN in header else f"the design of line {group[0][0]}",
            _module(path, header, group, _constants(names, group)),
        )
        for key, group in groups.items()
    ]


def has_several_axes(path: Path) -> bool:
    """Whether a table has u and the effort of all axes of a spherical joint."""
    header, _ = table_rows(Path(path))
    return len(_axes_in(header)) > 1


def _axes_in(header: Sequence[str]) -> tuple[str, ...]:
    """Axes with columns of their own."""
    names = names_in(list(header))
    return tuple(axis for axis in ("x", "y", "z") if names.of_axes(axis)[0] in header)


def _parameter_names(header: Sequence[str]) -> list[str]:
    return [name for name in header if name and name != DESIGN and not is_data(name)]


def _constants(names: Sequence[str], rows: Sequence[Row]) -> dict[str, Value]:
    """Columns with one value throughout that is not blank: numbers, else texts."""
    parameters: dict[str, Value] = {}
    for name in names:
        texts = {row[name] for _, row in rows}
        if len(texts) != 1 or not (text := texts.pop()):
            continue
        value = parsed(text)
        if value is None or not math.isfinite(value):
            parameters[name] = text
        else:
            parameters[name] = int(text) if text.lstrip("+-").isdecimal() else value
    return parameters


def _module(path: Path, header: list[str], rows: list[Row], parameters: dict[str, Value]) -> ModuleData:
    names = names_in(header)
    actuation = next(name for name in ACTUATIONS if name in header)
    explored = axis_words(path, rows, "x" if names is PRISMATIC else "y")
    axes = _axes_in(header)
    branch = words(path, rows, "branch", lambda i: _branch(rows[i][1][names.effort]))
    if not axes:
        axes = _only_axis(path, rows, explored, names)
    main = _main(explored, branch, axes)
    columns = _of_one(names) if len(axes) == 1 else names.of_axes(axes)
    table = _numbers(path, header, rows, columns, set(columns[: 2 * len(axes)]), names)
    n, k = len(rows), len(axes)
    u, tau, by_p, by_u = np.split(table, [k, 2 * k, 3 * k], axis=1)
    more = ["energy_j", TRAVELS[actuation], "iterations", "wall_s"]
    energy, travel, iterations, wall = _numbers(path, header, rows, more, set(), names).T
    joint: JointKind = "spherical" if k > 1 else "prismatic" if names is PRISMATIC else "revolute"
    return ModuleData(
        design=Design(FAMILY, parameters),
        joint=joint,
        axes=axes,
        main_axis=main,
        actuation_name=actuation,
        actuation=_numbers(path, header, rows, [actuation], {actuation}, names)[:, 0],
        deformation=u,
        tau=tau,
        dtau_dp=by_p,
        dtau_du=by_u.reshape(n, k, k),
        energy_j=energy,
        travel=travel,
        iterations=np.nan_to_num(iterations).astype(np.int64),
        wall_s=wall,
        explored=np.where(explored == ALL, COUPLING, explored),
        branch=branch,
        status=np.array([row.get("status") or "ok" for _, row in rows]),
        role=words(path, rows, "role", lambda i: "fit"),
    )


def _branch(effort: str) -> str:
    return "free" if parsed(effort) == 0 else "constrained"


def _of_one(names: Names) -> list[str]:
    """Columns of the only axis in the order of `Names.of_axes`."""
    return [names.deformation, names.effort, names.by_actuation, names.by_deformation]


def _only_axis(path: Path, rows: list[Row], explored: NDArray[np.str_], names: Names) -> tuple[str, ...]:
    """The axis of a table without columns of all axes."""
    found = tuple(dict.fromkeys(map(str, explored)))
    if len(found) > 1 or ALL in found:
        line = rows[int(np.flatnonzero(explored != found[0])[0])][0] if len(found) > 1 else rows[0][0]
        needed = ", ".join(names.of_axes("xyz")[:6])
        raise UserError(
            f"{path}, line {line}, column axis: a table of several axes needs u and the effort of all of them "
            f"({needed}) to be read as whole states"
        )
    return found


def _main(explored: NDArray[np.str_], branch: NDArray[np.str_], axes: tuple[str, ...]) -> str:
    """The axis that actuation drives: all are free on its free branch, so only it has one."""
    free = [str(axis) for axis in explored[branch == "free"] if axis in axes]
    return free[0] if free else "y" if "y" in axes else axes[0]


def _numbers(
    path: Path, header: list[str], rows: list[Row], columns: Sequence[str], needed: set[str], names: Names
) -> Array:
    """(n, c) of some columns; what is absent, or blank and not needed, is NaN."""
    table = np.full((len(rows), len(columns)), np.nan)
    for c, name in enumerate(columns):
        if name in header:
            optional = name not in needed
            table[:, c] = [number(path, line, name, row[name], optional) for line, row in rows]
    return table
