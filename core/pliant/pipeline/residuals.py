"""Residuals of a joint law on solved states: one entry for each state and axis that the state covers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.fem import COUPLING, TRUSTED, FemDataset, ModuleData
from pliant.records.law import FitReport, JointLaw

INSIDE = 1e-9  # of a box's width: rounding


@dataclass(frozen=True, eq=False)
class Residuals:
    """Predicted minus solved effort, m entries.

    A state that explores one axis covers only that axis; a state that prescribes all axes covers all. Shares are
    of the range of an axis' effort in the trusted states that explore it.

    Attributes:
        axes: names of the k axes.
        state: (m,) row of the data.
        axis: (m,) index in `axes`.
        miss: (m,) N·m, or N.
        share: (m,) |miss| / range.
        check: (m,) whether the state is of role "check".
        together: (m,) whether the state prescribes all axes.
        ranges: (k,) range of each axis' effort.
    """

    axes: tuple[str, ...]
    state: NDArray[np.int64]
    axis: NDArray[np.int64]
    miss: Array
    share: Array
    check: NDArray[np.bool_]
    together: NDArray[np.bool_]
    ranges: Array

    @staticmethod
    def from_prediction(
        data: ModuleData,
        axes: tuple[str, ...],
        predict: Callable[[Array, Array], Array],
        inside: Array,
        every: bool = False,
        ranges: Array | None = None,
    ) -> Residuals:
        """Return the residuals of `predict`, from (n,) and (n, k) to (n, k), at trusted states inside a box (m + k, 2).

        With `every`, each state covers all axes of known effort, including those that follow freely; `ranges` (k,)
        replace those of the data.
        """
        columns = [data.axes.index(axis) for axis in axes]
        u, tau = data.deformation[:, columns], data.tau[:, columns]
        low, high = inside.T
        bounded = np.isfinite(inside).all(axis=1)
        room = INSIDE * np.subtract(high, low, out=np.zeros(len(inside)), where=bounded)
        values, trusted = np.column_stack([data.actuation, u]), np.isin(data.status, TRUSTED)
        if ranges is None:
            known = [tau[trusted & (data.explored == axis), k] for k, axis in enumerate(axes)]
            ranges = np.array([(float(np.ptp(own)) if len(own) else 0.0) or 1.0 for own in known])
        trusted &= np.all((values >= low - room) & (values <= high + room), axis=1)
        state, axis = [], []
        for kind in (*axes, COUPLING):
            rows = np.flatnonzero(trusted & (data.explored == kind))
            for k in range(len(axes)) if every or kind == COUPLING else (axes.index(kind),):
                told = rows[np.isfinite(tau[rows, k])]
                state.append(told)
                axis.append(np.full(len(told), k))
        rows, place = np.concatenate(state), np.concatenate(axis)
        miss = predict(data.actuation, u)[rows, place] - tau[rows, place]
        return Residuals(
            axes,
            rows,
            place,
            miss,
            np.abs(miss) / ranges[place],
            data.role[rows] == "check",
            data.explored[rows] == COUPLING,
            ranges,
        )

    @staticmethod
    def from_law(
        data: ModuleData,
        law: JointLaw,
        every: bool = False,
        ranges: Array | None = None,
        inside: Array | None = None,
    ) -> Residuals:
        """Return the residuals of a law at trusted states inside its domain, or another box."""
        box = law.domain.box if inside is None else inside
        return Residuals.from_prediction(
            data, law.axes, lambda p, u: law.evaluate(p, u).tau, box, every, ranges
        )

    def rows(self, keep: NDArray[np.bool_]) -> Residuals:
        """Return the entries selected by a mask (m,)."""
        names = ("state", "axis", "miss", "share", "check", "together")
        return replace(self, **{name: getattr(self, name)[keep] for name in names})

    @property
    def rms(self) -> float:
        """Return the root mean square of the shares; NaN without entries."""
        return float(np.sqrt(np.mean(self.share**2))) if len(self.share) else float("nan")

    @property
    def worst(self) -> float:
        """Return the largest share; NaN without entries."""
        return float(self.share.max()) if len(self.share) else float("nan")


def fitted_box(data: ModuleData, axes: tuple[str, ...]) -> Array:
    """Return (1 + k, 2) box of the trusted states of role "fit"."""
    rows = np.isin(data.status, TRUSTED) & (data.role == "fit")
    values = np.column_stack([data.actuation, data.deformation[:, [data.axes.index(a) for a in axes]]])[rows]
    return np.stack([values.min(axis=0), values.max(axis=0)], axis=1)


def as_module_data(data: FemDataset) -> ModuleData:
    """Convert the states of one axis to `ModuleData`; quantities that it lacks (travel, cost) are NaN and 0."""
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


def module_from_axes(data: Mapping[str, FemDataset], axes: tuple[str, ...]) -> ModuleData:
    """Return the states of several axes from one table each: other axes at rest, their efforts unknown (NaN)."""
    parts = []
    for axis, one in data.items():
        own, at, k = as_module_data(one), axes.index(axis), len(axes)
        spread: dict[str, Any] = {"deformation": np.zeros((len(one), k))}
        spread |= {name: np.full((len(one), k), np.nan) for name in ("tau", "dtau_dp")}
        for name, values in spread.items():
            values[:, at] = getattr(own, name)[:, 0]
        spread["dtau_du"] = np.full((len(one), k, k), np.nan)
        spread["dtau_du"][:, at, at] = one.dmoment_du
        parts.append(replace(own, axes=axes, joint="spherical", **spread))
    arrays = [name for name, value in vars(parts[0]).items() if isinstance(value, np.ndarray)]
    joined: dict[str, Any] = {name: np.concatenate([vars(part)[name] for part in parts]) for name in arrays}
    return replace(parts[0], main_axis="y" if "y" in data else parts[0].explored[0], **joined)


def as_scored(data: ModuleData, report: FitReport) -> ModuleData:
    """Return the data with role "check" at the states that the report scores, if the table has no check states."""
    if np.any(data.role == "check"):
        return data
    scores = np.zeros(len(data), bool)
    explored = data.explored_axes()
    for axis in explored or data.axes:
        details = report.details.get("axes", {}).get(axis, {} if len(data.axes) > 1 else report.details)
        scored = details.get("residuals")
        if not isinstance(scored, Mapping) or "angle_rad" not in scored:
            continue
        at = (np.column_stack([scored["actuation"], scored["angle_rad"]])).tolist()
        places = set(map(tuple, at))
        own = np.column_stack([data.actuation, data.deformation[:, data.axes.index(axis)]]).tolist()
        hit = np.array([tuple(place) in places for place in own])
        scores |= hit & (data.explored == axis) if explored else hit
    return replace(data, role=np.where(scores, "check", data.role))
