"""Errors on runs that a fit has not seen, by leaving them out one after another.

The fit is not repeated: without the readings G the knobs x move by

    dx = (A + λ)⁻¹ (b − λ x),      A = Σ_{i ∉ G} J_iᵀ J_i,      b = Σ_{i ∉ G} J_iᵀ r_i

within their bounds, and leave r_G − J_G dx, exact for a linear model (Cook & Weisberg 1982, section 2.2.2). The weak
prior λ = `PRIOR_WEIGHT` decides only where the other readings say nothing about a knob: it then returns to x = 0,
the neutral strength or the typical shape, as a fit without G would have left it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.fitting import PRIOR_WEIGHT, Fit
from pliant.records.design import Array

# A group that holds more than all but this share of what is known of some parameter cannot be predicted without it.
LEAST_LEFT = 0.02


def heldout_residual(fit: Fit, groups: NDArray[np.intp], plain: Array | None = None) -> Array:
    """(N,) residual of each reading with the readings of its group left out.

    Args:
        fit: at its optimum.
        groups: (N,) number of each reading's group.
        plain: (N,) residual of the model as it is: what stands for groups without which a parameter would not be
            known at all, as for the only warm runs when softening with temperature is fitted.

    Of a fit without an equilibrium at any start, NaN.
    """
    if fit.slopes.shape[1] == 0:
        return fit.residual
    if not (np.isfinite(fit.residual).all() and np.isfinite(fit.slopes).all()):
        return np.full_like(fit.residual, np.nan)
    low, high = fit.candidate.limits()
    prior = PRIOR_WEIGHT * np.eye(len(fit.x))
    whole = fit.slopes.T @ fit.slopes
    left = fit.residual.copy()
    for group in np.unique(groups):
        mine = groups == group
        slopes, residual = fit.slopes[~mine], fit.residual[~mine]
        normal = slopes.T @ slopes
        if plain is not None and _share_left(normal, whole + prior) < LEAST_LEFT:
            left[mine] = plain[mine]
            continue
        move = np.linalg.solve(normal + prior, slopes.T @ residual - PRIOR_WEIGHT * fit.x)
        left[mine] -= fit.slopes[mine] @ (np.clip(fit.x + move, low, high) - fit.x)
    return left


def _share_left(rest: Array, whole: Array) -> float:
    """Least share of the information that stays, over all directions of the parameters."""
    return float(np.linalg.eigvals(np.linalg.solve(whole, rest)).real.min())


def condition_of_runs(n_runs: int, repeats: Sequence[Sequence[int]]) -> NDArray[np.intp]:
    """(runs,) number of the condition of each run: repeats share one."""
    condition = np.arange(n_runs)
    for group in repeats:
        condition[list(group)] = min(group)
    return condition.astype(np.intp)
