"""Data of one axis as data of a module, and which states of a table a report scores."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import FitReport


def module_of(data: FemDataset) -> ModuleData:
    """The same states as `ModuleData`; what one axis does not know (travel, cost) is NaN and 0."""
    n = len(data)
    return ModuleData(
        design=data.design,
        joint="prismatic" if data.joint == "prismatic" else "revolute",
        axes=(data.axis,),
        main_axis=data.axis,
        actuation_name=data.actuation_name,
        actuation=data.actuation,
        deformation=data.angle_rad[:, None],
        tau=data.moment_n_m[:, None],
        dtau_dp=data.dmoment_dp[:, None],
        dtau_du=data.dmoment_du[:, None, None],
        energy_j=data.energy_j,
        travel=np.full(n, np.nan),
        iterations=np.zeros(n, np.int64),
        wall_s=np.zeros(n),
        explored=np.full(n, data.axis),
        branch=data.branch,
        status=data.status,
        role=data.role,
        failed=data.failed,
        shapes=data.shapes,
    )


def module_of_axes(data: Mapping[str, FemDataset], axes: tuple[str, ...]) -> ModuleData:
    """States of several axes, each known by a table of its own: the other axes at rest, their efforts unknown (NaN)."""
    parts = []
    for axis, one in data.items():
        own, n, k = module_of(one), len(one), len(axes)
        at = axes.index(axis)
        u, tau, by_p = np.zeros((n, k)), np.full((n, k), np.nan), np.full((n, k), np.nan)
        by_u = np.full((n, k, k), np.nan)
        u[:, at], tau[:, at], by_p[:, at] = one.angle_rad, one.moment_n_m, one.dmoment_dp
        by_u[:, at, at] = one.dmoment_du
        found: dict[str, Any] = {
            "deformation": u,
            "tau": tau,
            "dtau_dp": by_p,
            "dtau_du": by_u,
            "explored": np.full(n, axis),
        }
        parts.append(replace(own, axes=axes, joint="spherical", **found))
    arrays = [name for name, value in vars(parts[0]).items() if isinstance(value, np.ndarray)]
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in arrays
    }
    return replace(parts[0], main_axis="y" if "y" in data else parts[0].explored[0], **joined)


def as_scored(data: ModuleData, report: FitReport) -> ModuleData:
    """The data with role "check" at the states that the report scores, where a table itself has no check states."""
    if np.any(data.role == "check"):
        return data
    scores = np.zeros(len(data), bool)
    for axis in data.explored_axes():
        details = report.details.get("axes", {}).get(axis) if len(data.axes) > 1 else report.details
        scored = (details or {}).get("residuals")
        if not isinstance(scored, Mapping) or "angle_rad" not in scored:
            continue
        places = set(zip(scored["actuation"], scored["angle_rad"], strict=True))
        u = data.deformation[:, data.axes.index(axis)]
        hit = np.array([(p, v) in places for p, v in zip(data.actuation.tolist(), u.tolist(), strict=True)])
        scores |= hit & (data.explored == axis)
    return replace(data, role=np.where(scores, "check", data.role))
