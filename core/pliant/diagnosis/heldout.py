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


def heldout_residual(fit: Fit, groups: NDArray[np.intp]) -> Array:
    """(N,) residual of each reading with the readings of its group left out; `groups` (N,) numbers them."""
    if fit.slopes.shape[1] == 0:
        return fit.residual
    low, high = fit.candidate.limits()
    left = fit.residual.copy()
    for group in np.unique(groups):
        mine = groups == group
        slopes, residual = fit.slopes[~mine], fit.residual[~mine]
        normal = slopes.T @ slopes + PRIOR_WEIGHT * np.eye(len(fit.x))
        move = np.linalg.solve(normal, slopes.T @ residual - PRIOR_WEIGHT * fit.x)
        left[mine] -= fit.slopes[mine] @ (np.clip(fit.x + move, low, high) - fit.x)
    return left


def by_group(values: Array, groups: NDArray[np.intp]) -> Array:
    """Sums of values (N,) over each group."""
    return np.asarray(np.bincount(groups, weights=values), float)


def condition_of_runs(n_runs: int, repeats: Sequence[Sequence[int]]) -> NDArray[np.intp]:
    """(runs,) number of the condition of each run: repeats share one."""
    condition = np.arange(n_runs)
    for group in repeats:
        condition[list(group)] = min(group)
    return condition.astype(np.intp)
