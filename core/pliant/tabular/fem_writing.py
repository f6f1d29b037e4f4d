"""The FEM stage's states as CSV, which `fem_reading` reads back to the bit."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import ContractError
from pliant.records.actuation import kind_of
from pliant.records.design import Design
from pliant.records.fem import FemDataset, ModuleData
from pliant.store.store import write_atomically
from pliant.tabular.fem_columns import ALL, EFFORTS, LABELS, is_data, names_of


def write_table(dataset: FemDataset | ModuleData, path: Path) -> None:
    """Write the `fem` CSV (docs/command_line.md); numbers are exact (shortest repr), NaN is blank.

    Each row is a state with u, τ and slopes of the axis that it explores, which `read_table` reads back. Of a
    `ModuleData` there follow the travel of the actuation, the solver's effort and, for several axes, u, τ and
    slopes of all of them; a state that holds several has "all" for its axis and the numbers of the main one.
    Under several actuations there is a column for each, and slopes by them are numbered, `dmoment_dp_1`. Numeric
    parameters of the design come last. The file appears whole or not at all.
    """
    if isinstance(dataset, FemDataset):
        columns = _of_axis(dataset)
    else:
        columns = _of_module(dataset) if len(dataset.actuations) == 1 else _of_several(dataset)
    design = _parameters(dataset.design)
    cells = [[_text(value) for value in column] for column in columns.values()]
    cells += [[value] * len(dataset) for value in design.values()]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([[*columns, *design], *zip(*cells, strict=True)])
    write_atomically(Path(path), text.getvalue())


def _of_axis(data: FemDataset) -> dict[str, Any]:
    """Column → values of one axis."""
    return {
        data.actuation_name: data.actuation,
        "axis": [data.axis] * len(data),
        **{name: getattr(data, field) for name, field in names_of(data.joint).numbers.items()},
        **{name: getattr(data, name) for name in LABELS},
    }


def _of_module(data: ModuleData) -> dict[str, Any]:
    """Column → values of a module, one row per state: those of the axis that it explores, or of the main one."""
    names, main, k = names_of(data.joint), data.axes.index(data.main_axis), len(data.axes)
    own = [
        part.copy()
        for part in (
            data.deformation[:, main],
            data.tau[:, main],
            data.dtau_dp[:, main],
            data.dtau_du[:, main, main],
        )
    ]
    for axis in data.explored_axes():
        law = data.axis(axis)
        for part, field in zip(own, names.numbers.values(), strict=False):
            part[data.explored == axis] = getattr(law, field)
    travel = {kind_of(data.actuation_name).travel_of(data.actuation_name): data.travel}
    columns = {
        data.actuation_name: data.actuation,
        "axis": [axis if axis in data.axes else ALL for axis in map(str, data.explored)],
        **dict(zip(names.numbers, (*own, data.energy_j), strict=True)),
        **{name: getattr(data, name) for name in LABELS},
        **travel,
        **{name: getattr(data, name) for name in EFFORTS},
    }
    if k > 1:
        parts = (data.deformation, data.tau, data.dtau_dp, data.dtau_du.reshape(len(data), k * k))
        columns |= zip(names.of_axes(data.axes), np.concatenate(parts, axis=1).T, strict=True)
    return columns


def _of_several(data: ModuleData) -> dict[str, Any]:
    """Column → values of a module under several actuations: of the main axis, then of all where there are more."""
    names, main, k = names_of(data.joint), data.axes.index(data.main_axis), len(data.axes)
    n, m = len(data), len(data.actuations)
    own = [
        data.deformation[:, main],
        data.tau[:, main],
        *data.dtau_dp[:, main].T,
        data.dtau_du[:, main, main],
    ]
    columns = {
        **dict(zip(data.actuations, data.actuation.T, strict=True)),
        "axis": [axis if axis in data.axes else ALL for axis in map(str, data.explored)],
        **dict(zip(names.of_one(m), own, strict=True)),
        "energy_j": data.energy_j,
        **{name: getattr(data, name) for name in LABELS},
        **{
            kind_of(name).travel_of(name): one
            for name, one in zip(data.actuations, data.travel.T, strict=True)
        },
        **{name: getattr(data, name) for name in EFFORTS},
    }
    if k > 1:
        parts = (data.deformation, data.tau, data.dtau_dp.reshape(n, -1), data.dtau_du.reshape(n, k * k))
        columns |= zip(names.of_axes(data.axes, m), np.concatenate(parts, axis=1).T, strict=True)
    return columns


def _parameters(design: Design) -> dict[str, str]:
    """The design's numbers as texts."""
    numbers = {
        name: _text(value)
        for name, value in design.parameters.items()
        if isinstance(value, int | float | np.integer) and not isinstance(value, bool)
    }
    if clash := sorted(filter(is_data, numbers)):
        raise ContractError(f"family '{design.family}': parameter '{clash[0]}' has the name of a data column")
    return numbers


def _text(value: Any) -> str:
    if isinstance(value, str | int | np.integer):
        return str(value)
    return "" if math.isnan(value) else repr(float(value))
