"""Errors on runs that a fit has not seen, by leaving them out one after another.

The fit is not repeated: at the optimum the parameters without the readings G move by
(Σ_{i ∉ G} J_iᵀ J_i)⁻¹ J_Gᵀ r_G against the descent, so that the residual left out is
r_G + J_G (JᵀJ − J_Gᵀ J_G)⁻¹ J_Gᵀ r_G, exact for a linear model (Cook & Weisberg 1982, section 2.2.2).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.fitting import Fit
from pliant.records.design import Array

RIDGE = 1e-9


def heldout_residual(fit: Fit, groups: NDArray[np.intp]) -> Array:
    """(N,) residual of each reading with the readings of its group left out; `groups` (N,) numbers them."""
    if fit.slopes.shape[1] == 0:
        return fit.residual
    whole = fit.slopes.T @ fit.slopes
    ridge = RIDGE * np.trace(whole) * np.eye(len(whole)) + 1e-12 * np.eye(len(whole))
    left = fit.residual.copy()
    for group in np.unique(groups):
        mine = groups == group
        slopes, residual = fit.slopes[mine], fit.residual[mine]
        rest = whole - slopes.T @ slopes + ridge
        left[mine] = residual + slopes @ np.linalg.solve(rest, slopes.T @ residual)
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
