"""Newton's method on a potential, globalised so that it ends in a minimum and not in a saddle.

Where the stiffness is positive definite the step is Newton's; elsewhere its eigenvalues are replaced by their
absolute values (Dauphin et al. 2014), so every step descends. A backtracking line search on the potential
takes over when the full step does not halve the residual.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pliant.mechanics.statics import Balance, ChainStatics, Loads, unstable_mode
from pliant.records.design import Array

SUFFICIENT_DECREASE = 1e-4
MAX_HALVINGS = 30
# An equilibrium that is a saddle is left along its most negative mode by this share of the longest step.
PUSH = 0.2


class NewtonOptions(NamedTuple):
    """tolerance on the largest residual, iterations allowed, longest move of a coordinate in one step."""

    tolerance: float
    max_iterations: int
    max_step: float


@dataclass(frozen=True, eq=False)
class Solution:
    """Where the iteration ended: q (n, a), its largest residual, and what that point is.

    `markers` (n + 2, 3) and `inside`, no law outside its domain, are there where they cost nothing.
    """

    q: Array
    residual: float
    converged: bool
    stable: bool
    iterations: int
    markers: Array | None = None
    inside: bool = False


# The stable equilibrium of one chain under any loads, reached from coordinates q (n, a).
Solver = Callable[[Array, Loads], Solution]


def minimise(statics: ChainStatics, loads: Loads, q: Array, options: NewtonOptions) -> Solution:
    """Descend from q (n, a) to a stable equilibrium; `converged` is False if none is reached."""
    balance = statics.balance(q, loads)
    for iteration in range(options.max_iterations):
        size = _size(balance)
        if not np.isfinite(size):
            return Solution(q, size, False, False, iteration)
        positive = _is_positive(balance.stiffness)
        if size <= options.tolerance:
            mode = None if positive else unstable_mode(balance.stiffness)
            if mode is None:
                return Solution(q, size, True, True, iteration)
            q = _leave_saddle(statics, loads, q, mode.reshape(q.shape), PUSH * options.max_step)
            balance = statics.balance(q, loads)
            continue
        step = _step(balance, positive).reshape(q.shape)
        longest = float(np.abs(step).max())
        if longest > options.max_step:
            step *= options.max_step / longest
        moved = _search(statics, loads, q, balance, step, positive)
        if moved is None:
            return Solution(q, size, False, positive, iteration + 1)
        q, balance = moved
    size = _size(balance)
    stable = unstable_mode(balance.stiffness) is None
    return Solution(q, size, size <= options.tolerance and stable, stable, options.max_iterations)


def _size(balance: Balance) -> float:
    return float(np.abs(balance.residual).max())


def _is_positive(stiffness: Array) -> bool:
    try:
        np.linalg.cholesky(0.5 * (stiffness + stiffness.T))
    except np.linalg.LinAlgError:
        return False
    return True


def _step(balance: Balance, positive: bool) -> Array:
    right = balance.residual.ravel()
    if positive:
        # The stiffness as it is, not its symmetric part: laws fitted without an energy stay quadratic.
        return np.asarray(np.linalg.solve(balance.stiffness, right), float)
    values, modes = np.linalg.eigh(0.5 * (balance.stiffness + balance.stiffness.T))
    floor = 1e-8 * float(np.abs(values).max()) + np.finfo(float).tiny
    return np.asarray(modes @ ((modes.T @ right) / np.maximum(np.abs(values), floor)), float)


def _search(
    statics: ChainStatics, loads: Loads, q: Array, balance: Balance, step: Array, positive: bool
) -> tuple[Array, Balance] | None:
    """The accepted point and its balance, or None when no step along the direction helps."""
    trial = statics.balance(q + step, loads)
    norm = np.linalg.norm(balance.residual)
    if positive and np.linalg.norm(trial.residual) <= 0.5 * norm:
        return q + step, trial
    slope = float(np.sum(balance.residual * step))
    start = statics.potential(q, loads)
    rounding = 1e-14 * max(abs(start), 1e-12)
    share = 1.0
    for _ in range(MAX_HALVINGS):
        drop = start - statics.potential(q + share * step, loads)
        if drop >= SUFFICIENT_DECREASE * share * slope - rounding:
            return q + share * step, trial if share == 1.0 else statics.balance(q + share * step, loads)
        share *= 0.5
    if np.linalg.norm(trial.residual) < norm:
        return q + step, trial
    return None


def _leave_saddle(statics: ChainStatics, loads: Loads, q: Array, mode: Array, length: float) -> Array:
    """q moved along an unstable mode by `length`, to the side on which the potential is lower."""
    push = mode * (length / np.abs(mode).max())
    up, down = q + push, q - push
    return up if statics.potential(up, loads) <= statics.potential(down, loads) else down
