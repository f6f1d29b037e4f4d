"""Penalised least squares of a tensor-product spline, with smoothing chosen by cross-validation.

    min Σ (τ(p_m, u_m) − τ_m)² + slopes + Σ_c λ_c |D_c c|²

over the coefficients c of a cubic spline of all actuations and u, with D_c third (second) differences along each of
them (P-splines: Eilers, Marx, Stat. Sci. 11, 1996; in two dimensions Eilers, Currie, Durbán, Comput. Stat. Data Anal.
50, 2006). λ is one number for all actuations and one for u. All is scaled to a box of [0, 1]^(m + 1) and an effort's
range of 1."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.fem import FemDataset, ModuleData
from pliant_plugins.surrogates.polynomial.system import coordinate_levels
from pliant_plugins.surrogates.records import affordable
from pliant_plugins.surrogates.table import spline

# Of slopes by coordinates in [0, 1]: they are steeper than the values and would rule the fit.
SLOPE_WEIGHT = 0.1
# Fewest and most cells along an actuation and along u, by the number of actuations.
CELLS = {1: ((3, 12), (6, 16)), 2: ((2, 4), (3, 6)), 3: ((1, 2), (2, 3))}
FOLDS, SEED = 8, 0
SMOOTHING = tuple(10.0**k for k in range(-10, 3, 2))
FINER = (0.01, 0.1, 1.0, 10.0, 100.0)
RIDGE = 1e-12
# Falling everywhere may cost this factor and share of the range; snap-through that is in the data costs more.
FLATTEST = 0.02  # share of the mean slope that a law that must fall keeps everywhere
PUSH, PUSHES = 1e3, 60

Mask = NDArray[np.bool_]
Smoothing = tuple[int, float, float]  # order of differences, λ along pressure, λ along angle


@dataclass(frozen=True, eq=False)
class TableStates:
    """n states of one axis: at (n, m + 1) actuations and u, tau (n,), slopes (n, m + 1) by each; unknown ones NaN."""

    at: Array
    tau: Array
    slopes: Array

    @staticmethod
    def from_data(data: FemDataset | ModuleData) -> TableStates:
        """Collect the states of a data set of one axis, or of a module of one axis."""
        if isinstance(data, FemDataset):
            at, tau = np.column_stack([data.actuation, data.angle_rad]), data.moment_n_m
            return TableStates(at, tau, np.column_stack([data.dmoment_dp, data.dmoment_du]))
        at = np.column_stack([data.actuation, data.deformation])
        slopes = np.column_stack([data.dtau_dp[:, 0], data.dtau_du[:, 0]])
        return TableStates(at, data.tau[:, 0], slopes)


@dataclass(frozen=True, eq=False)
class FittedSpline:
    """Coefficients in the effort's unit, misses (n,) of states left out one by one, and how they were chosen.

    `tried` has the error of states left out, a share of the range, by the smoothing.
    """

    coefficients: Array
    misses: Array
    smoothing: Smoothing
    tried: dict[Smoothing, float]
    forced_to_fall: bool


def fit_spline(states: TableStates, box: Array, names: str) -> FittedSpline:
    """Fit the spline of the states over box (m + 1, 2); one that falls along u if that costs little.

    Raises:
        UserError: the states determine no law; `names` are their coordinates in words.
    """
    system = SplineSystem(states, box)
    tried: dict[Smoothing, float] = {}

    def error(smoothing: Smoothing) -> float:
        if smoothing not in tried:
            tried[smoothing] = system.left_out(smoothing)
        return tried[smoothing]

    best = min(((o, k, k) for o, k in product(system.orders, SMOOTHING)), key=error)
    for _ in range(2):
        best = min(((best[0], best[1] * f, best[2]) for f in FINER), key=error)
        best = min(((best[0], best[1], best[2] * f) for f in FINER), key=error)
    if not np.isfinite(error(best)):
        raise UserError(
            f"the {len(states.tau)} states lie on one line of {names} and determine no "
            "law: add states at other angles under the same actuation"
        )
    free = found = system.solve(best)
    if system.rises(free):
        fallen, rmse = system.falling(best), system.fitted_rmse
        if rmse(fallen) <= affordable(max(error(best), rmse(free))):
            found = fallen
    misses = (system.single_misses(best) + (system.value_rows @ (found - free))) * system.range
    return FittedSpline(found.reshape(system.shape) * system.range, misses, best, tried, found is not free)


class SplineSystem:
    """Normal equations of the states, fold by fold.

    Args:
        states: places, efforts and slopes.
        box: (m + 1, 2) of the actuations and u.
    """

    def __init__(self, states: TableStates, box: Array) -> None:
        spans = [np.ptp(side) for side in box]
        places = [(c - low) / span for c, low, span in zip(states.at.T, box[:, 0], spans, strict=True)]
        self.range = float(np.ptp(states.tau))
        levels = [coordinate_levels(c) for c in places]
        n, m = len(states.tau), len(places) - 1
        cells_p, cells_u = CELLS[m]
        cells = [int(np.clip(level.max(), *cells_p)) for level in levels[:m]]
        cells.append(int(np.clip(min(levels[m].max(), 2 * round(np.sqrt(n))), *cells_u)))
        self.shape = tuple(one + 3 for one in cells)
        self.orders = (2, 3) if min(level.max() for level in levels) >= 3 else (2,)
        if min(cells) < 3:  # of one cell or two there are few third differences
            self.orders = (2,)

        def matrix(known: NDArray[np.int64], along: int | None = None) -> Array:
            factors = zip(places, cells, strict=True)
            each = [spline.rows(c[known], count, d == along) for d, (c, count) in enumerate(factors)]
            return reduce(_products, each)

        self.value_rows = matrix(np.arange(n))
        self.values = states.tau / self.range
        rows, right = [self.value_rows], [self.values]
        state = [np.arange(n)]
        for k, given in enumerate(states.slopes.T):
            known = np.flatnonzero(np.isfinite(given))
            rows.append(SLOPE_WEIGHT * matrix(known, k))
            right.append(SLOPE_WEIGHT * given[known] * spans[k] / self.range)
            state.append(known)
        self.matrix, self.right, self.state = (
            np.concatenate(rows),
            np.concatenate(right),
            np.concatenate(state),
        )
        self.normal, self.moment = self.matrix.T @ self.matrix, self.matrix.T @ self.right
        self.folds = list(_folds(levels))
        self._parts = []
        for fold in self.folds:
            chosen = fold[self.state]
            part = self.matrix[chosen]
            self._parts.append((part.T @ part, part.T @ self.right[chosen]))

    def penalty(self, smoothing: Smoothing) -> Array:
        """Return (k, k) Σ λ_p |D_p c|² + λ_u |D_u c|² with a small ridge that makes it definite."""
        order, in_p, in_u = smoothing
        whole = np.zeros((int(np.prod(self.shape)),) * 2)
        for d, size in enumerate(self.shape):
            before, after = int(np.prod(self.shape[:d])), int(np.prod(self.shape[d + 1 :]))
            factor = in_u if d == len(self.shape) - 1 else in_p
            whole += factor * np.kron(np.kron(np.eye(before), _roughness(size, order)), np.eye(after))
        whole[np.diag_indices_from(whole)] += RIDGE
        return whole

    def left_out(self, smoothing: Smoothing) -> float:
        """Return the RMS error of left-out folds; infinite if the rest determines no law."""
        penalty, squares, count = self.penalty(smoothing), 0.0, 0
        for fold, (normal, moment) in zip(self.folds, self._parts, strict=True):
            try:
                solution = cho_solve(cho_factor(self.normal - normal + penalty), self.moment - moment)
            except LinAlgError:
                return np.inf
            squares += float(np.sum((self.value_rows[fold] @ solution - self.values[fold]) ** 2))
            count += int(fold.sum())
        return float(np.sqrt(squares / count))

    def solve(self, smoothing: Smoothing) -> Array:
        """Solve for the (k,) coefficients of all states."""
        return cho_solve(cho_factor(self.normal + self.penalty(smoothing)), self.moment)

    def single_misses(self, smoothing: Smoothing) -> Array:
        """Return (n,) predicted − given value of each state, fitted without its value and slopes, in closed form.

        With the hat matrix H of its rows b: r_b / (1 − H_bb) (Sherman–Morrison–Woodbury).
        """
        inverse = cho_factor(self.normal + self.penalty(smoothing))
        spread = cho_solve(inverse, self.matrix.T)
        residual = self.matrix @ cho_solve(inverse, self.moment) - self.right
        n = len(self.values)
        own: list[list[int]] = [[] for _ in range(n)]
        for row, state in enumerate(self.state):
            own[state].append(row)
        misses = np.empty(n)
        for index, rows in enumerate(own):
            hat = self.matrix[rows] @ spread[:, rows]
            misses[index] = np.linalg.solve(np.eye(len(rows)) - hat, residual[rows])[0]
        return misses

    def rises(self, solution: Array) -> bool:
        """Return whether coefficients rise along u somewhere, so that the law may."""
        return bool(np.any(np.diff(solution.reshape(self.shape), axis=-1) >= 0))

    def falling(self, smoothing: Smoothing) -> Array:
        """Return coefficients that fall along u, by a penalty on rising pairs (Eilers, Stat. Model. 5, 2005)."""
        steps = np.kron(np.eye(int(np.prod(self.shape[:-1]))), np.diff(np.eye(self.shape[-1]), axis=0))
        base = self.normal + self.penalty(smoothing)
        solution = self.solve(smoothing)
        least = FLATTEST * abs(float(np.median(steps @ solution)))
        active = np.zeros(len(steps), bool)
        for _ in range(PUSHES):
            rising = steps @ solution > -least
            if not np.any(rising & ~active):
                break
            active |= rising
            pushed = steps[active]
            right = self.moment - PUSH * least * pushed.sum(axis=0)
            solution = cho_solve(cho_factor(base + PUSH * pushed.T @ pushed), right)
        return solution

    def fitted_rmse(self, solution: Array) -> float:
        """Return RMS residual of the fitted values."""
        return float(np.sqrt(np.mean((self.value_rows @ solution - self.values) ** 2)))


def _products(first: Array, second: Array) -> Array:
    """Return (n, a b) products of the rows of (n, a) and (n, b)."""
    return (first[:, :, None] * second[:, None, :]).reshape(len(first), first.shape[1] * second.shape[1])


def _roughness(size: int, order: int) -> Array:
    steps = np.diff(np.eye(size), order, axis=0)
    return steps.T @ steps


def _folds(levels: list[NDArray[np.int64]]) -> Iterator[Mask]:
    """Yield states left out together: whole inner levels, if there are any, and a seeded eighth each."""
    random = np.random.default_rng(SEED)
    n = len(levels[0])
    for level in levels:
        count = int(level.max()) + 1
        if count <= n / 3:
            inner = random.permutation(np.arange(1, count - 1))
            for k in range(min(FOLDS, len(inner))):
                yield np.isin(level, inner[k::FOLDS])
    order = random.permutation(n)
    for k in range(min(FOLDS, n)):
        chosen = np.zeros(n, bool)
        chosen[order[k::FOLDS]] = True
        yield chosen
