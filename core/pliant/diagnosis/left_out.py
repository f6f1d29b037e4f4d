"""Cross-validated errors: runs, conditions or blocks are left out of a fit, one after another.

The fit is not repeated: without the readings G the parameters x move by

    dx = (A + λ)⁻¹ (b − λ x),      A = Σ_{i ∉ G} J_iᵀ J_i,      b = Σ_{i ∉ G} J_iᵀ r_i

within their bounds (all at once: Stark & Parker, Comput. Stat. 10, 1995), and leave r_G − J_G dx, exact for a linear
model (Cook & Weisberg 1982, section 2.2.2). The weak prior λ (`FitParameter.pull`) decides only if the other readings
carry no information on a parameter: it then returns to x = 0, the neutral strength or the typical shape, as in a fit
without G.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.readings import ReadingVector
from pliant.records.design import Array
from pliant.records.measurement import MeasuredRun

# A group with more than all but this share of the information on some parameter cannot be predicted without it.
LEAST_LEFT = 0.02
# Directions below this share of the largest information are rounding.
ROUNDING = 1e-14


def heldout_residual(
    fit: EffectFit, groups: NDArray[np.intp], plain: Array | None = None, exact_law: bool = False
) -> Array:
    """Return (N,) residual of each reading with the readings of its group left out.

    Args:
        fit: at its optimum.
        groups: (N,) number of each reading's group.
        plain: (N,) residual of the unchanged model, used for groups without which a parameter would be unknown,
            such as the only warm runs when softening with temperature is fitted.
        exact_law: predict with the unchanged law, although its error was part of the fit.

    NaN for a fit without an equilibrium at any start. The law's own error, if it is part of the hypothesis, is also
    estimated from the other groups only.
    """
    if fit.slopes.shape[1] == 0 and (fit.law is None or exact_law):
        return fit.raw
    if not (np.isfinite(fit.residual).all() and np.isfinite(fit.slopes).all()):
        return np.full_like(fit.residual, np.nan)
    joint = _JointFit.from_fit(fit)
    slopes, pull, low, high = joint.slopes, joint.pull, joint.low, joint.high
    prior = np.diag(pull)
    whole, pulled = slopes.T @ slopes, slopes.T @ fit.residual
    spared = _spared(whole, pull, joint.is_nuisance)
    left = fit.raw.copy() if exact_law else fit.residual.copy()
    order = np.argsort(groups, kind="stable")
    members = np.split(order, np.flatnonzero(np.diff(groups[order])) + 1)
    normals = whole - np.array([slopes[mine].T @ slopes[mine] for mine in members])
    if plain is not None:
        known = np.linalg.solve(whole + prior, normals + spared)
        lost = np.linalg.eigvals(known).real.min(axis=1) < LEAST_LEFT
        for mine in itertools.compress(members, lost):
            left[mine] = plain[mine]
        members, normals = list(itertools.compress(members, ~lost)), normals[~lost]
    rights = np.array([pulled - slopes[mine].T @ fit.residual[mine] - pull * joint.x for mine in members])
    moves = _bounded(normals + prior, rights, low - joint.x, high - joint.x)
    k = fit.slopes.shape[1] if exact_law else slopes.shape[1]
    for mine, move in zip(members, moves, strict=True):
        left[mine] -= slopes[mine, :k] @ move[:k]
    return left


@dataclass(frozen=True, eq=False)
class _JointFit:
    """Parameters of a fit, followed by the coefficients of the law's error: values, slopes, prior and bounds.

    `is_nuisance` marks those with a real prior, to which they return without information: forms and coefficients.
    """

    x: Array
    slopes: Array
    pull: Array
    low: Array
    high: Array
    is_nuisance: NDArray[np.bool_]

    @staticmethod
    def from_fit(fit: EffectFit) -> _JointFit:
        low, high = fit.candidate.limits()
        pull = np.array([parameter.pull for parameter in fit.candidate.parameters])
        forms = np.array([parameter.is_form for parameter in fit.candidate.parameters], bool)
        if fit.law is None:
            return _JointFit(fit.x, fit.slopes, pull, low, high, forms)
        c = fit.law.coefficient
        return _JointFit(
            np.r_[fit.x, c],
            np.column_stack([fit.slopes, fit.law.columns]),
            np.r_[pull, np.full(len(c), fit.law.precision)],
            np.r_[low, np.full(len(c), -np.inf)],
            np.r_[high, np.full(len(c), np.inf)],
            np.r_[forms, np.ones(len(c), bool)],
        )


def _spared(whole: Array, pull: Array, forms: NDArray[np.bool_]) -> Array:
    """Return (k, k) the prior's weights of what may remain unknown.

    These are forms, which are plain if unknown, and directions on which all readings together contain less
    information than the prior, such as a second time constant that ended at zero.
    """
    scale = np.sqrt(pull)
    known, directions = np.linalg.eigh(whole / np.outer(scale, scale))
    idle = directions[:, known < 1.0]
    rest = np.eye(len(pull)) - idle @ idle.T
    spared = idle @ idle.T + (rest * forms) @ rest
    return np.asarray(spared * np.outer(scale, scale), float)


# A single run is left out in blocks: their number, and the number of folds to which they are assigned.
BLOCKS, FOLDS = 24, 6


def assign_blocks(readings: ReadingVector) -> NDArray[np.intp]:
    """Return (N,) fold of each reading: each run and output in `BLOCKS` equal parts, assigned in turn."""
    block = np.empty(len(readings), np.intp)
    for run in range(readings.n_runs):
        for output in range(len(readings.outputs)):
            mine = np.flatnonzero((readings.run == run) & (readings.output == output))
            block[mine] = BLOCKS * np.arange(len(mine)) // max(len(mine), 1) % FOLDS
    return block


def _bounded(normals: Array, rights: Array, low: Array, high: Array) -> Array:
    """Return (G, k) the minimum of ½ mᵀ A m − bᵀ m within bounds, for each A (G, k, k) and b.

    If one parameter is at its bound, the others are optimized given it.
    """
    if not len(rights):
        return rights
    moves = np.asarray(np.linalg.solve(normals, rights[:, :, None])[:, :, 0], float)
    for k in np.flatnonzero(~np.all((moves >= low) & (moves <= high), axis=1)):
        moves[k] = _at_bounds(normals[k], rights[k], np.minimum(low, 0.0), np.maximum(high, 0.0))
    return moves


def _at_bounds(normal: Array, right: Array, low: Array, high: Array) -> Array:
    from scipy.optimize import lsq_linear  # takes a moment to import

    squares, axes = np.linalg.eigh(normal)
    sizes = np.sqrt(np.maximum(squares, ROUNDING * squares[-1]))  # rounding may leave a square below zero
    root, goal, found = sizes[:, None] * axes.T, axes.T @ right / sizes, np.zeros(len(right))
    free = low < high  # fixed parameters have equal bounds
    if free.any():
        found[free] = lsq_linear(root[:, free], goal, (low[free], high[free]), method="bvls").x
    return np.asarray(found, float)


def specimen_indices(runs: Sequence[MeasuredRun]) -> NDArray[np.intp]:
    """Return (runs,) number of the specimen of each run.

    Runs of one specimen share its peculiarities: what predicts a run from others of its specimen need not predict
    another specimen (Roberts et al., Ecography 40, 2017, on blocks in cross-validation).
    """
    names = list(dict.fromkeys(run.history.specimen for run in runs))
    return np.array([names.index(run.history.specimen) for run in runs], np.intp)


def condition_indices(n_runs: int, repeats: Sequence[Sequence[int]]) -> NDArray[np.intp]:
    """Return (runs,) number of the condition of each run: repeats share one."""
    condition = np.arange(n_runs)
    for group in repeats:
        condition[list(group)] = min(group)
    return condition.astype(np.intp)
