"""Writer of the FEM stage's states as CSV, which `reading` reads back exactly."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import ContractError
from pliant.fem_tables.columns import ALL, EFFORTS, LABELS, is_data, joint_columns
from pliant.records.actuation import actuation_kind
from pliant.records.design import Design
from pliant.records.fem import FemDataset, ModuleData
from pliant.store.store import write_atomically

MATERIAL = "material."  # prefix of the columns of the rubber


def write_table(
    dataset: FemDataset | ModuleData, path: Path, material: Mapping[str, Any] | None = None
) -> None:
    """Write the `fem` CSV (docs/command_line.md); numbers are exact (shortest repr), NaN is blank.

    Each row is a state with u, τ and slopes of the axis that it explores, which `read_table` reads back. A `ModuleData`
    adds the travel of the actuation, the solver's effort and, for several axes, u, τ and slopes of all of them; a state
    with several prescribed has "all" for its axis and the numbers of the main one. With several actuations there is a
    column for each, and slopes by them are numbered, `dmoment_dp_1`. Numeric parameters of the design come last,
    followed by constants of the material (`material_parameters`). The file is written atomically.
    """
    if isinstance(dataset, FemDataset):
        columns = _axis_columns(dataset)
    else:
        columns = (
            _module_columns(dataset) if len(dataset.actuations) == 1 else _several_input_columns(dataset)
        )
    rubber = {name: value for name, value in (material or {}).items() if isinstance(value, str | float | int)}
    design = {**_parameters(dataset.design), **{name: str(value) for name, value in rubber.items()}}
    cells = [[_text(value) for value in column] for column in columns.values()]
    cells += [[value] * len(dataset) for value in design.values()]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([[*columns, *design], *zip(*cells, strict=True)])
    write_atomically(Path(path), text.getvalue())


def _axis_columns(data: FemDataset) -> dict[str, Any]:
    """Return column → values of one axis."""
    return {
        data.actuation_name: data.actuation,
        "axis": [data.axis] * len(data),
        **{name: getattr(data, field) for name, field in joint_columns(data.joint).numbers.items()},
        **{name: getattr(data, name) for name in LABELS},
    }


def _module_columns(data: ModuleData) -> dict[str, Any]:
    """Return column → values of a module, one row per state: those of the explored axis, or of the main one."""
    names, main, k = joint_columns(data.joint), data.axes.index(data.main_axis), len(data.axes)
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
    travel = {actuation_kind(data.actuation_name).travel_name(data.actuation_name): data.travel}
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
        columns |= zip(names.all_axes_columns(data.axes), np.concatenate(parts, axis=1).T, strict=True)
    return columns


def _several_input_columns(data: ModuleData) -> dict[str, Any]:
    """Return column → values of a module with several actuations: of the main axis, then of all if there are more."""
    names, main, k = joint_columns(data.joint), data.axes.index(data.main_axis), len(data.axes)
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
        **dict(zip(names.main_axis_columns(m), own, strict=True)),
        "energy_j": data.energy_j,
        **{name: getattr(data, name) for name in LABELS},
        **{
            actuation_kind(name).travel_name(name): one
            for name, one in zip(data.actuations, data.travel.T, strict=True)
        },
        **{name: getattr(data, name) for name in EFFORTS},
    }
    if k > 1:
        parts = (data.deformation, data.tau, data.dtau_dp.reshape(n, -1), data.dtau_du.reshape(n, k * k))
        columns |= zip(names.all_axes_columns(data.axes, m), np.concatenate(parts, axis=1).T, strict=True)
    return columns


def _parameters(design: Design) -> dict[str, str]:
    """Return the design's numbers as texts, and the texts on its rubber."""
    numbers = {
        name: value if isinstance(value, str) else _text(value)
        for name, value in design.parameters.items()
        if (isinstance(value, int | float | np.integer) and not isinstance(value, bool))
        or (isinstance(value, str) and name.startswith(MATERIAL))
    }
    if clash := sorted(filter(is_data, numbers)):
        raise ContractError(f"family '{design.family}': parameter '{clash[0]}' has the name of a data column")
    return numbers


def _text(value: Any) -> str:
    if isinstance(value, str | int | np.integer):
        return str(value)
    return "" if math.isnan(value) else repr(float(value))
