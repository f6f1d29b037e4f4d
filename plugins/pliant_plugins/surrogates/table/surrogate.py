"""The table surrogate: penalised least squares, smoothed as far as states left out ask for.

    min Σ (τ(p_m, u_m) − τ_m)² + slopes + Σ_c λ_c |D_c c|²

over the coefficients c of a bicubic spline, with D_c third (second) differences along pressure and angle (P-splines:
Eilers, Marx, Stat. Sci. 11, 1996; in two dimensions Eilers, Currie, Durbán, Comput. Stat. Data Anal. 50, 2006). All
is scaled to a box of [0, 1]² and an effort's range of 1."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from pliant.errors import UserError
from pliant.interfaces.surrogate import FittedLaw
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.fem import FemDataset
from pliant.records.law import Domain, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.config import TableConfig
from pliant_plugins.surrogates.continued import ContinuedLaw, share_actuation
from pliant_plugins.surrogates.polynomial import scoring
from pliant_plugins.surrogates.polynomial.axes import AxesLaw, AxesSurrogate
from pliant_plugins.surrogates.polynomial.law import largest_slope
from pliant_plugins.surrogates.polynomial.states import split
from pliant_plugins.surrogates.polynomial.system import joint_of, levels_of
from pliant_plugins.surrogates.records import affordable, arrays_of, law_record, require_kind, shared_fields
from pliant_plugins.surrogates.table import spline
from pliant_plugins.surrogates.table.spline import ACTING, GAINS, HEADER, axes_effort, block

KIND = "table"
SHARED = partial(share_actuation, header=HEADER, acting=ACTING, gains=GAINS)


@dataclass(frozen=True, eq=False)
class TableLaw(ContinuedLaw):
    """τ(p, u) = Σ c_ij B_i(x) B_j(v), uniform cubic B-splines of x, v ∈ [0, 1] over the box of `domain`.

    Where c falls along j everywhere, ∂τ/∂u < 0 everywhere.

    Attributes:
        coefficients: (I + 3, J + 3) of I × J cells, N·m.
        domain: the box of the data.
        error: the band around τ.
    """

    coefficients: Array
    domain: Domain
    actuation_name: str = "pressure_pa"
    axes: tuple[str, ...] = ("y",)
    joint: JointKind = "revolute"
    error: ErrorBar | None = None
    _areas_table: Array = field(init=False, repr=False)
    _reach: Array = field(init=False, repr=False)
    _reference_gain: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_areas_table", spline.antiderivative(self.coefficients))
        self._continue()

    def scalar(self) -> ScalarLaw:
        """The same law for compiled engines; the continuation's reaches are held parameters there."""
        box = np.concatenate([self.domain.actuation[None], self.domain.deformation])
        parameters = block(self.coefficients, box, self._reach, self._reference_gain)
        return ScalarLaw(axes_effort, parameters, SHARED)

    def record(self) -> LawRecord:
        """Coefficients, box and error bar; `TableSurrogate.load` makes the same law of them."""
        return law_record(KIND, self, {"coefficients": self.coefficients})

    @staticmethod
    def of_record(record: LawRecord) -> TableLaw:
        """The law of a record; both evaluate to the same bits."""
        return TableLaw(**arrays_of(record, "coefficients"), **shared_fields(record))

    def _inside(self, p: Array, u: Array) -> Array:
        (x, by_p), (v, by_u) = self._scaled(p, u)
        rows, columns = (size - 3 for size in self.coefficients.shape)
        (i, s), (j, t) = spline.place(x, rows), spline.place(v, columns)
        four = np.arange(spline.ORDER)
        near = self.coefficients[(i[:, None] + four)[:, :, None], (j[:, None] + four)[:, None, :]]
        in_x = np.stack([spline.weights(s), spline.slope_weights(s) * (rows * by_p)], axis=1)
        in_v = np.stack([spline.weights(t), spline.slope_weights(t) * (columns * by_u)], axis=1)
        both = np.einsum("nam,nmk,nbk->nab", in_x, near, in_v)
        return np.stack([both[:, 0, 0], both[:, 1, 0], both[:, 0, 1], both[:, 1, 1]], axis=1)

    def _areas(self, p: Array, u: Array) -> Array:
        (x, by_p), (v, by_u) = self._scaled(p, u)
        rows, columns = (size - 3 for size in self.coefficients.shape)
        (i, s), (j, t) = spline.place(x, rows), spline.place(v, columns)
        near = self._areas_table[
            (i[:, None] + np.arange(4))[:, :, None], (j[:, None] + np.arange(5))[:, None, :]
        ]
        in_x = np.stack([spline.weights(s), spline.slope_weights(s) * (rows * by_p)], axis=1)
        return np.einsum("nam,nmk,nk->an", in_x, near, spline.area_weights(t) / by_u)

    def _scaled(self, p: Array, u: Array) -> tuple[tuple[Array, float], tuple[Array, float]]:
        """x, v ∈ [0, 1] and their slopes by p and u."""
        (p_low, p_high), (u_low, u_high) = self.domain.actuation, self.domain.deformation[0]
        by_p, by_u = 1 / (p_high - p_low), 1 / (u_high - u_low)
        return ((p - p_low) / (p_high - p_low), float(by_p)), ((u - u_low) / (u_high - u_low), float(by_u))


# Of slopes by coordinates in [0, 1]: they are steeper than the values and would rule the fit.
SLOPE_WEIGHT = 0.1
CELLS_P, CELLS_U = (3, 12), (6, 16)
FOLDS, SEED = 8, 0
SMOOTHING = tuple(10.0**k for k in range(-10, 3, 2))
FINER = (0.01, 0.1, 1.0, 10.0, 100.0)
RIDGE = 1e-12
# Falling everywhere may cost this factor and share of the range; snap-through that is in the data costs more.
FLATTEST = 0.02  # of the mean slope: what a law that must fall keeps everywhere
PUSH, PUSHES = 1e3, 60

Mask = NDArray[np.bool_]
Smoothing = tuple[int, float, float]  # order of differences, λ along pressure, λ along angle


class _System:
    """Normal equations of the states, fold by fold."""

    def __init__(self, data: FemDataset, domain: Domain) -> None:
        spans = np.ptp(domain.actuation), np.ptp(domain.deformation[0])
        x = (data.actuation - domain.actuation[0]) / spans[0]
        v = (data.angle_rad - domain.deformation[0, 0]) / spans[1]
        self.range = float(np.ptp(data.moment_n_m))
        levels = [levels_of(c) for c in (x, v)]
        cells = (
            int(np.clip(levels[0].max(), *CELLS_P)),
            int(np.clip(min(levels[1].max(), 2 * round(np.sqrt(len(x)))), *CELLS_U)),
        )
        self.shape = (cells[0] + 3, cells[1] + 3)
        self.orders = (2, 3) if min(level.max() for level in levels) >= 3 else (2,)
        self.value_rows = _products(spline.rows(x, cells[0]), spline.rows(v, cells[1]))
        self.values = data.moment_n_m / self.range
        rows, right = [self.value_rows], [self.values]
        state = [np.arange(len(x))]
        for k, given in enumerate((data.dmoment_dp, data.dmoment_du)):
            known = np.flatnonzero(np.isfinite(given))
            pair = [
                spline.rows(c[known], n, k == i) for i, (c, n) in enumerate(zip((x, v), cells, strict=True))
            ]
            rows.append(SLOPE_WEIGHT * _products(*pair))
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
        """(k, k) λ_p |D_p c|² + λ_u |D_u c|² with a grain that makes it definite."""
        order, in_p, in_u = smoothing
        rows, columns = self.shape
        whole = np.asarray(in_p * np.kron(_roughness(rows, order), np.eye(columns)), np.float64)
        whole += in_u * np.kron(np.eye(rows), _roughness(columns, order))
        whole[np.diag_indices_from(whole)] += RIDGE
        return whole

    def left_out(self, smoothing: Smoothing) -> float:
        """RMS error of states left out, whole folds at a time; infinite where the rest determines no law."""
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
        """(k,) coefficients of all states."""
        return cho_solve(cho_factor(self.normal + self.penalty(smoothing)), self.moment)

    def single_misses(self, smoothing: Smoothing) -> Array:
        """(n,) predicted − given value of each state, fitted without its value and slopes, in closed form.

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
        """Whether coefficients rise along u somewhere, so that the law may."""
        return bool(np.any(np.diff(solution.reshape(self.shape), axis=1) >= 0))

    def falling(self, smoothing: Smoothing) -> Array:
        """Coefficients that fall along u everywhere (Eilers, Stat. Model. 5, 2005): rising pairs are pushed down."""
        rows, columns = self.shape
        steps = np.kron(np.eye(rows), np.diff(np.eye(columns), axis=0))
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

    def rmse_of_fitted(self, solution: Array) -> float:
        """RMS residual of the fitted values."""
        return float(np.sqrt(np.mean((self.value_rows @ solution - self.values) ** 2)))


def _products(first: Array, second: Array) -> Array:
    """(n, a b) products of the rows of (n, a) and (n, b)."""
    return (first[:, :, None] * second[:, None, :]).reshape(len(first), first.shape[1] * second.shape[1])


def _roughness(size: int, order: int) -> Array:
    steps = np.diff(np.eye(size), order, axis=0)
    return steps.T @ steps


def _folds(levels: list[NDArray[np.int64]]) -> Iterator[Mask]:
    """States left out together: whole inner levels where the data stand on levels, and a seeded eighth each."""
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


# States of a long recording whose misses make the band.
MOST_PLACES = 1500


class TableSurrogate(AxesSurrogate):
    """Bicubic laws interpolated from scattered states, smoothed as far as states left out ask for.

    `FitReport.details` holds what was tried, the residuals and the errors of the study's form on the same states.
    """

    config: TableConfig

    def of_axes(self) -> dict[str, TableSurrogate]:
        """The surrogates of the axes of a spherical joint, where the config has them."""
        each = {} if self.config.axes is None else self.config.axes.each()
        return {axis: TableSurrogate(TableConfig(data=one.data)) for axis, one in each.items()}

    def fit(self, data: FemDataset) -> FittedLaw:
        """Fit the states of role "fit" and score the law on those of role "check" (see `polynomial.states`).

        Deterministic. Raises `UserError`, in one sentence, for too few states, non-finite numbers, contradictions, and
        where the states determine no law.
        """
        states = split(data, "a table law")
        fit, system = states.fit, _System(states.fit, states.domain)
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
                f"the {len(fit)} states lie on one line of {fit.actuation_name} and angle_rad and determine no "
                "law: add states at other angles under the same actuation"
            )
        free = found = system.solve(best)
        if system.rises(free):
            fallen, rmse = system.falling(best), system.rmse_of_fitted
            if rmse(fallen) <= affordable(max(error(best), rmse(free))):
                found = fallen
        misses = (system.single_misses(best) + (system.value_rows @ (found - free))) * system.range
        box = np.concatenate([states.domain.actuation[None], states.domain.deformation])
        told = np.sort(np.random.default_rng(SEED).permutation(len(fit))[:MOST_PLACES])
        angles = fit.angle_rad[told, None]
        bar = ErrorBar.of(box, fit.actuation[told], angles, misses[told, None], inner_scores=True)
        table, named = found.reshape(system.shape) * system.range, (data.actuation_name, (data.axis,))
        law = TableLaw(table, states.domain, *named, joint_of(data), bar)
        slope, names = largest_slope(law), ("order", "actuation", "deformation", "rmse_of_range")
        details = {
            "form": "table",
            "cells": [size - 3 for size in law.coefficients.shape],
            "smoothing": dict(zip(names, best, strict=False)),
            "left_out_rmse_of_range": error(best),
            "forced_to_fall": found is not free,
            "tried": [dict(zip(names, (*s, e), strict=True)) for s, e in tried.items()],
            "largest_slope": slope,
            "stable": slope < 0,
        }
        return FittedLaw(law, scoring.report(law, states, details))

    def load(self, record: LawRecord) -> JointLaw:
        """The law of a record that `TableLaw.record` or `AxesLaw.record` wrote."""
        require_kind(record, KIND)
        if record.values["joint"] == "spherical":
            return AxesLaw.of_record(record, TableLaw.of_record)
        return TableLaw.of_record(record)
