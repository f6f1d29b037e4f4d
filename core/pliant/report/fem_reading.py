"""What tables and pictures read out of a module's FEM data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import actuation_unit, deformation_unit, effort_unit
from pliant.records.fem import FemDataset, ModuleData


def axis_record(data: ModuleData, axis: str) -> Mapping[str, Any]:
    """What the sampler recorded of an axis; empty where it recorded nothing."""
    axes = data.sampling.get("axes")
    found = axes.get(axis, {}) if isinstance(axes, Mapping) else {}
    return found if isinstance(found, Mapping) else {}


def foretold_axes(data: ModuleData) -> list[str]:
    """Axes whose states were chosen one by one."""
    return [name for name in data.explored_axes() if axis_record(data, name).get("tests")]


def solved_rows(data: ModuleData) -> NDArray[np.bool_]:
    """(n,) states that were solved; copies by symmetry took no time."""
    return np.asarray((data.wall_s > 0) | (data.iterations > 0))


def explored_kinds(data: ModuleData) -> list[str]:
    """Axes with states of their own, the main one first, then "coupling" where several axes were held."""
    return [*data.explored_axes(), *(["coupling"] if np.any(data.explored == "coupling") else [])]


def failed_place(entry: Mapping[str, object], data: ModuleData | FemDataset) -> tuple[str, str]:
    """Where a state failed: its actuation, and what was held."""
    value, angle = entry.get("actuation"), entry.get("angle_rad")
    actuation = actuation_unit(data.actuation_name)
    where = actuation.text(float(value)) if isinstance(value, int | float) else "unknown actuation"
    u_unit, effort = deformation_unit(data), effort_unit(data)
    held, load = entry.get("held"), entry.get("effort")
    if isinstance(load, Mapping) and load:
        return where, ", ".join(f"τ {axis} {effort.text(float(v), 3)}" for axis, v in load.items())
    if isinstance(held, Mapping) and held:
        return where, ", ".join(f"{axis} {u_unit.text(float(v), 3)}" for axis, v in held.items())
    return where, u_unit.text(float(angle), 3) if isinstance(angle, int | float) else "free"
