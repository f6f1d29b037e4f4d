"""Solved states as rows of a `ModuleData`: one for each, and copies that symmetry gives for nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pliant.pipeline.sampling import FULL, Sampled, Sampling
from pliant.records.design import Array
from pliant.records.fem import COUPLING, FemState

NUMBERS = ("actuation", "energy_j", "travel", "wall_s")
VECTORS = ("deformation", "tau", "dtau_dp", "dtau_du")


@dataclass(frozen=True)
class _Row:
    """A state with all axes and the axis whose law it explores."""

    state: FemState
    role: str
    explored: str


def module_rows(sampling: Sampling, axes: Sequence[str], main_axis: str) -> dict[str, Any]:
    """The columns of `ModuleData`.

    Of a module with several axes, a state of the piece that moves about the main one alone has zero in the other
    places of u, τ and ∂τ/∂p, by symmetry, and NaN in the slopes that it does not know. A free state of the
    full piece is a row of each lateral axis. A state of an axis about which the module is symmetric has a copy
    at −u. Copies took no iterations and no time.
    """
    rows = list(_rows(sampling, axes, main_axis))
    columns: dict[str, Any] = {name: _column(rows, name) for name in (*NUMBERS, *VECTORS)}
    return {
        **columns,
        "iterations": np.array([row.state.iterations for row in rows], dtype=np.int64),
        "explored": np.array([row.explored for row in rows]),
        "branch": np.array([row.state.branch for row in rows]),
        "status": np.array([row.state.status for row in rows]),
        "role": np.array([row.role for row in rows]),
    }


def _column(rows: Sequence[_Row], name: str) -> Array:
    return np.array([getattr(row.state, name) for row in rows], dtype=float)


def _rows(sampling: Sampling, axes: Sequence[str], main_axis: str) -> Iterator[_Row]:
    lateral = [axis for axis in axes if axis != main_axis]
    for one in sampling.solved:
        if one.target.piece != FULL:
            yield _Row(_embedded(one, axes, main_axis), one.target.role, main_axis)
            continue
        if one.target.branch == "free":
            for number, axis in enumerate(lateral):
                yield _Row(one.state if number == 0 else _copy(one.state), one.target.role, axis)
            continue
        explored = one.target.explored or COUPLING
        yield _Row(one.state, one.target.role, explored)
        if explored in sampling.mirrored and one.target.role == "fit":
            yield _Row(_mirrored(one.state, axes.index(main_axis)), one.target.role, explored)


def _embedded(one: Sampled, axes: Sequence[str], main_axis: str) -> FemState:
    """A state of the main axis alone among all axes."""
    k, m = len(axes), axes.index(main_axis)
    if k == 1:
        return one.state
    vectors = {name: np.zeros(k) for name in ("deformation", "tau", "dtau_dp")}
    slopes = np.full((k, k), np.nan)
    for name, vector in vectors.items():
        vector[m] = getattr(one.state, name)[one.state.main]
    slopes[m, m] = one.state.dmoment_du
    return replace(one.state, **vectors, dtau_du=slopes, main=m)  # type: ignore[arg-type]


def _mirrored(state: FemState, main: int) -> FemState:
    """The state on the other side of the mirror plane: all lateral angles change their sign."""
    sign = -np.ones(len(state.deformation))
    sign[main] = 1.0
    return replace(
        _copy(state),
        deformation=sign * state.deformation,
        tau=sign * state.tau,
        dtau_dp=sign * state.dtau_dp,
        dtau_du=np.outer(sign, sign) * state.dtau_du,
    )


def _copy(state: FemState) -> FemState:
    return replace(state, iterations=0, wall_s=0.0)
