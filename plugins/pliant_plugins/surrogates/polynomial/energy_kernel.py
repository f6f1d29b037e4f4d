"""The law of a polynomial energy for many joints at once: points in the box side by side, others one by one."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import njit
from numba.extending import register_jitable

from pliant.records.design import Array
from pliant_plugins.surrogates.polynomial import energy_scalar
from pliant_plugins.surrogates.polynomial.energy_batch import COLUMNS, inside
from pliant_plugins.surrogates.polynomial.energy_scalar import AXES, GAINS, HEADER


def evaluate(actuation: Array, deformation: Array, parameters: Array) -> Array:
    """(n, 13) what `energy_scalar.energy_and_slopes` gives for p (n,) and u (n, k), to rounding."""
    n = len(actuation)
    at = np.zeros((n, 4))
    at[:, 0], at[:, 1 : 1 + deformation.shape[1]] = actuation, deformation
    axes = parameters[AXES:GAINS].reshape(3, 6)
    maps = np.vstack([parameters[2:4], axes[:, :2]])
    low, high = np.vstack([parameters[4:6], axes[:, 2:4]]).T
    columns = int(parameters[1])
    rows = parameters[HEADER:].reshape(-1, 4 + columns)
    table = np.ascontiguousarray(rows[:, 4:])
    powers = np.round(rows[:, 1:4]).astype(np.int64)
    out = np.empty((n, COLUMNS))
    outside = ~np.all((at >= low) & (at <= high), axis=1)  # what is not a number too
    if not outside.any():
        inside(at, maps, powers, table, out)
        return out
    part = np.empty((n - int(outside.sum()), COLUMNS))
    inside(at[~outside], maps, powers, table, part)
    beyond = np.empty((n - len(part), COLUMNS))
    _one_by_one()(at[outside], np.array(parameters), beyond)
    out[~outside], out[outside] = part, beyond
    return out


@cache
def _one_by_one() -> Any:
    """The compiled loop of `energy_scalar`: its cache on disk is of that file, which has all that it calls."""
    for helper in ("_axis", "_bent_power", "_straight_power", "energy_and_slopes"):
        register_jitable(getattr(energy_scalar, helper))
    return njit(cache=True, error_model="numpy")(energy_scalar.one_by_one)
