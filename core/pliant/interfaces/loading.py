"""Equilibrium under a prescribed effort, from a solver that prescribes angles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import FemState

MOST_STEPS = 12
# Change of u in the last step, as a share of the largest u met.
CLOSE = 1e-9


def loaded_state(
    constrained: Callable[[float, Mapping[str, float], FemState], FemState],
    actuation: float,
    axis: str,
    effort: float,
    start: FemState,
    axes: Sequence[str],
) -> FemState | None:
    """Newton's method on u of `axis`, all others free; None where it does not converge.

    Whatever `constrained` raises passes through. A step after one that made the residual larger is halved.
    """
    k = list(axes).index(axis)
    efforts = np.zeros(len(axes))
    efforts[k] = effort
    u = float(start.deformation[k] + _tangent(start, actuation, efforts)[k])
    state, size, before = start, abs(u), np.inf
    for _ in range(MOST_STEPS):
        state = constrained(actuation, {axis: u}, state)
        residual = effort - float(state.tau[k])
        step = float(_tangent(state, actuation, efforts)[k])
        size = max(size, abs(u), abs(step))
        if abs(step) <= CLOSE * size:
            return state
        if abs(residual) > before:
            step /= 2
        before = abs(residual)
        u += step
    return None


def _tangent(state: FemState, actuation: float, efforts: Array) -> Array:
    """(k,) change of u that the slopes ask for: τ + ∂τ/∂p Δp + ∂τ/∂u Δu = M."""
    missing = efforts - state.tau - state.dtau_dp * (actuation - state.actuation)
    return np.asarray(np.linalg.solve(state.dtau_du, missing))
