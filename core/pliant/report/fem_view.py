"""Quantities of a module's FEM data for sentences, tables and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import actuation_unit, deformation_unit, effort_unit, fixed, plural
from pliant.pipeline.answer_checks import answer_doubts
from pliant.records.actuation import split_actuation_names as actuations_of
from pliant.records.fem import PASSED, SELF_CONTACT, TOUCHING, TRUSTED, FemDataset, ModuleData
from pliant.report.document import Warned

LISTED = 12  # entries that a warning lists


@dataclass(frozen=True, eq=False)
class DesignStates:
    """The FEM data of a design, under its name; `backend` is the kind of the code that solved it."""

    name: str
    data: ModuleData
    backend: str = ""


def axis_record(data: ModuleData, axis: str) -> Mapping[str, Any]:
    """Return the sampler's record of an axis; empty without one."""
    axes = data.sampling.get("axes")
    found = axes.get(axis, {}) if isinstance(axes, Mapping) else {}
    return found if isinstance(found, Mapping) else {}


def foretold_axes(data: ModuleData) -> list[str]:
    """Return the axes whose states were chosen one by one."""
    return [name for name in data.explored_axes() if axis_record(data, name).get("tests")]


def solved_rows(data: ModuleData) -> NDArray[np.bool_]:
    """Return (n,) states that were solved; copies by symmetry took no time."""
    return np.asarray((data.wall_s > 0) | (data.iterations > 0))


def explored_kinds(data: ModuleData) -> list[str]:
    """Return the explored axes, the main one first, then "coupling" if several axes were prescribed together."""
    return [*data.explored_axes(), *(["coupling"] if np.any(data.explored == "coupling") else [])]


def failed_place(entry: Mapping[str, object], data: ModuleData | FemDataset) -> tuple[str, str]:
    """Return where a state failed: its actuation, and its prescribed coordinates."""
    value, angle = entry.get("actuation"), entry.get("angle_rad")
    actuation = actuation_unit(actuations_of(data.actuation_name)[0])
    where = actuation.text(float(value)) if isinstance(value, int | float) else "unknown actuation"
    if isinstance(value, list | tuple):
        where = ", ".join(actuation.text(float(one)) for one in value)
    u_unit, effort = deformation_unit(data), effort_unit(data)
    held, load = entry.get("held"), entry.get("effort")
    if isinstance(load, Mapping) and load:
        return where, ", ".join(f"τ {axis} {effort.text(float(v), 3)}" for axis, v in load.items())
    if isinstance(held, Mapping) and held:
        return where, ", ".join(f"{axis} {u_unit.text(float(v), 3)}" for axis, v in held.items())
    return where, u_unit.text(float(angle), 3) if isinstance(angle, int | float) else "free"


def free_reach(data: ModuleData) -> str:
    """Return the range of the free branch, e.g. ``bends 23.1° at 15 kPa``; empty without one."""
    if len(data.actuations) > 1:
        turned = np.abs(data.deformation[data.branch == "free"]).max()
        return f"bends {deformation_unit(data).text(float(turned), 3)} at most under these inputs alone"
    main = data.axis(data.main_axis)
    free = main.branch == "free"
    if not free.any():
        return ""
    last = int(np.argmax(np.where(free, main.actuation, -np.inf)))
    unit, given = deformation_unit(data), actuation_unit(data.actuation_name)
    verb = "extends by" if data.joint == "prismatic" else "bends"
    u = fixed(float(main.angle_rad[last]) * unit.factor, 2)
    return f"{verb} {unit.attached(u)} at {given.text(float(main.actuation[last]))}"


def data_warnings(data: FemDataset | ModuleData, prefix: str = "") -> list[Warned]:
    """Return the limits of a data set: self-contact, untrusted states, states that failed."""
    found = []
    if contact := int(np.sum(data.status == SELF_CONTACT)):
        tendon = data.actuation_name == "tendon_force_n"
        touching = "links that would meet" if tendon else "touching walls"
        found.append(
            f"{contact} of {len(data)} states have {touching}, and this solver has no contact: the law's domain ends "
            "where they meet, and beyond it these states are too soft."
        )
    if passed := int(np.sum(data.status == PASSED)):
        found.append(
            f"In {passed} of {len(data)} states walls pass through each other, as 'fem.self_contact: pass' "
            "lets them: a real module is stiffer there."
        )
    if met := int(np.sum(data.status == TOUCHING)):
        found.append(
            f"In {met} of {len(data)} states walls touch and hold each other, without friction: the law bends "
            "where they meet, which 'surrogate: {kind: table}' follows better than a polynomial."
        )
    other = ~np.isin(data.status, (*TRUSTED, SELF_CONTACT))
    if other.any():
        names = ", ".join(sorted(set(data.status[other].tolist())))
        found.append(f"{int(other.sum())} states are not trusted ({names}).")
    if isinstance(data, ModuleData) and isinstance(figures := data.sampling.get("checks"), Mapping):
        found += answer_doubts(figures)
    warned = [Warned(prefix + text) for text in found]
    if count := len(data.failed):
        items = tuple(
            f"{', '.join(failed_place(entry, data))}: {entry.get('cause', 'no cause recorded')}"
            for entry in data.failed[:LISTED]
        )
        warned.append(Warned(f"{prefix}{plural(count, 'state')} failed{truncation_note(count)}.", items))
    return warned


def truncation_note(count: int) -> str:
    """Return the end of a sentence with a truncated list."""
    return f" (the first {LISTED} are listed)" if count > LISTED else ""
