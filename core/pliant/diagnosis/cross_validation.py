"""Errors on runs that a fit has not seen, by leaving them out one after another.

The fit is not repeated: without the readings G the parameters x move by

    dx = (A + λ)⁻¹ (b − λ x),      A = Σ_{i ∉ G} J_iᵀ J_i,      b = Σ_{i ∉ G} J_iᵀ r_i

within their bounds, and leave r_G − J_G dx, exact for a linear model (Cook & Weisberg 1982, section 2.2.2). The weak
prior λ = `PRIOR_WEIGHT` decides only where the other readings say nothing about a parameter: it then returns to x = 0,
the neutral strength or the typical shape, as a fit without G would have left it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.fitting import PRIOR_WEIGHT, EffectFit
from pliant.measurements.floors import Floor
from pliant.records.design import Array
from pliant.records.measurement import Measurement

# A group that holds more than all but this share of what is known of some parameter cannot be predicted without it.
LEAST_LEFT = 0.02


def heldout_residual(fit: EffectFit, groups: NDArray[np.intp], plain: Array | None = None) -> Array:
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


Residuals = Sequence[Mapping[str, Array]]
# An output without any floor is weighed by this share of its range.
SHARE_OF_RANGE = 0.02


@dataclass(frozen=True)
class Score:
    """Root mean square errors.

    Attributes:
        rmse: by output, SI; outputs without a reading in these runs are left out.
        over_floor: over all outputs, each in units of its floor; NaN where a floor is not known.
        n: readings.
    """

    rmse: Mapping[str, float]
    over_floor: float
    n: int


def score(residuals: Residuals, floors: Mapping[str, Floor], runs: Collection[int] | None = None) -> Score:
    """The error of these runs, of all by default; readings that are missing do not count."""
    chosen = range(len(residuals)) if runs is None else sorted(runs)
    series = {
        name: np.concatenate([residuals[k][name] for k in chosen] or [np.zeros(0)]) for name in residuals[0]
    }
    there = {name: values[np.isfinite(values)] for name, values in series.items()}
    there = {name: values for name, values in there.items() if len(values)}
    n = sum(len(values) for values in there.values())
    total = sum(float(np.sum((values / floors[name].value) ** 2)) for name, values in there.items())
    return Score(
        rmse={name: float(np.sqrt(np.mean(values**2))) for name, values in there.items()},
        over_floor=float(np.sqrt(total / n)) if n else np.nan,
        n=n,
    )


def scales_of(
    measurement: Measurement, floors: Mapping[str, Floor], outputs: Sequence[str]
) -> dict[str, float]:
    """The unit of each output's residuals: its floor, or a share of its range where nothing tells one.

    Outputs without a reading are left out.
    """
    scales = {}
    for name in outputs:
        series: Array = np.concatenate([run.outputs[name] for run in measurement.runs])
        there = series[np.isfinite(series)]
        if not len(there):
            continue
        span, value = float(np.ptp(there)), floors[name].value
        smallest = 1e-6 * max(span, float(np.abs(there).max()))
        scales[name] = value if np.isfinite(value) and value > smallest else (SHARE_OF_RANGE * span or 1.0)
    return scales
