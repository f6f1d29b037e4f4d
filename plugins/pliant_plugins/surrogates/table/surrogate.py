"""The table surrogate: laws interpolated from scattered states by splines (see `fitting`).

One axis under several actuations has a tensor-product spline of all of them and u:

    τ(a, u) = T(ã, u) + Σ_j (a_j − ã_j) G_j,   T = Σ c_{i…j} Π_d B_i(x_d) B_j(v),   ã = â + L tanh(δ/L)

with B uniform cubic B-splines over the box, δ the distance of an actuation outside it and â the nearest point in it.
Outside the box each B continues along its tangent, so T is multilinear there and τ is C¹. The actuations' influence on
the stiffness saturates at L (`REACHES`, chosen so that at least half of the least stiffness of the box remains), and
the effort of the gain G_j at the border at rest grows without bound and does not change the stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import product
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.surrogate import FittedLaw
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.config import TableConfig
from pliant_plugins.surrogates.continued import ContinuedLaw, share_actuation
from pliant_plugins.surrogates.polynomial import scoring
from pliant_plugins.surrogates.polynomial.axes import AxesLaw, AxesSurrogate
from pliant_plugins.surrogates.polynomial.law import largest_slope
from pliant_plugins.surrogates.polynomial.several_fit import largest_slope as largest_slope_of_several
from pliant_plugins.surrogates.polynomial.states import split
from pliant_plugins.surrogates.polynomial.system import one_axis_joint
from pliant_plugins.surrogates.records import float_arrays, law_record, require_kind, shared_fields
from pliant_plugins.surrogates.table import spline
from pliant_plugins.surrogates.table.fitting import CELLS, SEED, FittedSpline, TableStates, fit_spline
from pliant_plugins.surrogates.table.spline import (
    ACTING,
    GAINS,
    HEADER,
    axes_effort,
    block,
    several_table_effort,
)

FORM = "several actuations"
KIND = "table"
# L in half-widths of the box, halved until the law is stable as far outside as that.
REACHES = (0.5, 0.25, 0.125, 1 / 16, 1 / 32, 1 / 64)
SHARE_LEFT = 0.5
LEVELS = 9  # of u, of the grid that is looked at; three of each actuation


@dataclass(frozen=True, eq=False)
class SeveralTableLaw(JointLaw):
    """See the module. With m actuations:

    Attributes:
        coefficients: (I_1 + 3, …, I_m + 3, J + 3) of I_1 × … × J cells, N·m.
        domain: the box of the data.
        error: the band around τ.
    """

    coefficients: Array
    domain: Domain
    actuation_name: str
    axes: tuple[str, ...] = ("y",)
    joint: JointKind = "revolute"
    error: ErrorBar | None = None

    @cached_property
    def reach(self) -> Array:
        """(m,) L, Pa or N."""
        half = np.ptp(self.domain.actuation, axis=1) / 2
        inner = self._steepest(0.0 * half)
        for share in REACHES[:-1]:
            if self._steepest(share * half) <= SHARE_LEFT * inner < 0:
                return np.asarray(share * half)
        return np.asarray(REACHES[-1] * half)

    @cached_property
    def gain(self) -> Array:
        """(m, 2) G_j below and above, the other actuations and u at rest."""
        rest = np.clip(np.zeros(len(self.domain.box)), *self.domain.box.T)
        found = np.empty((len(self.actuations), 2))
        for j, side in product(range(len(found)), (0, 1)):
            at = rest.copy()
            at[j] = self.domain.actuation[j, side]
            found[j, side] = self._spline(at[None, :-1], at[-1:])[1][0, j]
        return found

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return τ (n, 1), ∂τ/∂a (n, 1, m) and ∂τ/∂u (n, 1, 1) at a (n, m) and u (n, 1)."""
        bent, rate, outer = self._bent(np.asarray(actuation, float))
        tau, gain, slope = self._spline(bent, np.asarray(deformation, float)[:, 0])
        tau = tau + np.sum((actuation - bent) * outer, axis=1)
        gain = rate * gain + (1 - rate) * outer
        return Effort(tau[:, None], gain[:, None, :], slope[:, None, None])

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Return Π(a, u) − Π(a, 0) in J, shape (n,), in closed form, continuation included."""
        a, u = np.asarray(actuation, float), np.asarray(deformation, float)[:, 0]
        bent, _, outer = self._bent(a)
        table, _ = self._rows(bent)
        pushed = np.sum((a - bent) * outer, axis=1) * u
        return self._area(table, np.zeros_like(u)) - self._area(table, u) - pushed

    def scalar(self) -> ScalarLaw:
        """Return the compiled form: see `several_table_effort`."""
        header = [len(self.actuations), *self.coefficients.shape]
        parts = [self.domain.box, self.reach, self.gain, self.coefficients]
        return ScalarLaw(several_table_effort, np.concatenate([header, *map(np.ravel, parts)]).astype(float))

    def record(self) -> LawRecord:
        """Return coefficients, box and error bar; `from_record` makes the same law of them."""
        return law_record(KIND, self, {"coefficients": self.coefficients}, form=FORM)

    @staticmethod
    def from_record(record: LawRecord) -> SeveralTableLaw:
        """Return the law of a record, identical bit for bit."""
        return SeveralTableLaw(**float_arrays(record, "coefficients"), **shared_fields(record))

    def _steepest(self, reach: Array) -> float:
        """Return the largest ∂τ/∂u at distances up to `reach` (m,) outside, on a grid."""
        low, high = self.domain.actuation.T
        levels = np.linspace(low - reach, high + reach, 3).T
        first, last = (float(side) for side in self.domain.deformation[0])
        grid = np.meshgrid(*levels, np.linspace(first, last, LEVELS), indexing="ij")
        at = np.stack([axis.ravel() for axis in grid], axis=1)
        return float(self._spline(at[:, :-1], at[:, -1])[2].max())

    def _bent(self, actuation: Array) -> tuple[Array, Array, Array]:
        """Return ã, its derivative by a, and G of the side that was left, (n, m) each."""
        low, high = self.domain.actuation.T
        inside = np.clip(actuation, low, high)
        excess = actuation - inside
        bent = np.tanh(excess / self.reach)
        outer = np.where(excess > 0, self.gain[:, 1], self.gain[:, 0])
        return inside + self.reach * bent, 1 - bent * bent, outer

    def _spline(self, a: Array, u: Array) -> tuple[Array, Array, Array]:
        """Return T (n,), ∂T/∂a (n, m) and ∂T/∂u (n,) at places a (n, m), u (n,), along tangents outside the box."""
        table, by_a = self._rows(a)
        value, slope = _weights(u, self.domain.deformation[0], self.coefficients.shape[-1])
        tau, steep = np.sum(table * value, axis=1), np.sum(table * slope, axis=1)
        return tau, np.einsum("nmj,nj->nm", by_a, value), steep

    def _rows(self, a: Array) -> tuple[Array, Array]:
        """Return (n, J + 3) coefficients of the spline of u at actuations a (n, m), and (n, m, J + 3) slopes by a."""
        n, m = a.shape
        each = [_weights(a[:, d], self.domain.actuation[d], self.coefficients.shape[d]) for d in range(m)]
        found = []
        for along in (None, *range(m)):
            table = np.broadcast_to(self.coefficients, (n, *self.coefficients.shape))
            for d in range(m):
                table = np.einsum("ni...,ni->n...", table, each[d][1 if d == along else 0])
            found.append(table)
        return found[0], np.stack(found[1:], axis=1)

    def _area(self, table: Array, u: Array) -> Array:
        """Return (n,) ∫ T du from a fixed angle, the same for one row of `table` (n, J + 3), to u."""
        low, high = self.domain.deformation[0]
        cells = table.shape[1] - 3
        inside = np.clip(u, low, high)
        cell, t = spline.place((inside - low) / (high - low), cells)
        quartic = spline.antiderivative(table)
        near = np.take_along_axis(quartic, cell[:, None] + np.arange(5), axis=1)
        area = np.sum(near * spline.area_weights(t), axis=1) * (high - low)
        value, slope = _weights(inside, self.domain.deformation[0], table.shape[1])
        beyond = u - inside
        return np.asarray(
            area + beyond * np.sum(table * value, axis=1) + beyond**2 / 2 * np.sum(table * slope, axis=1)
        )


def _weights(values: Array, limits: Array, size: int) -> tuple[Array, Array]:
    """Return (n, size) weights of one coordinate's coefficients and their slopes; on tangents outside the limits."""
    low, high = limits
    inside = np.clip(values, low, high)
    cells = size - 3
    x = (inside - low) / (high - low)
    slope = spline.rows(x, cells, slopes=True) / (high - low)
    return spline.rows(x, cells) + (values - inside)[:, None] * slope, slope


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
        """Return the law as a scalar function for compiled engines; the continuation's reaches are fixed parameters."""
        box = np.concatenate([self.domain.actuation[None], self.domain.deformation])
        parameters = block(self.coefficients, box, self._reach, self._reference_gain)
        return ScalarLaw(axes_effort, parameters, SHARED)

    def record(self) -> LawRecord:
        """Return coefficients, box and error bar; `TableSurrogate.load` makes the same law of them."""
        return law_record(KIND, self, {"coefficients": self.coefficients})

    @staticmethod
    def from_record(record: LawRecord) -> TableLaw:
        """Return the law of a record, identical bit for bit."""
        return TableLaw(**float_arrays(record, "coefficients"), **shared_fields(record))

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
        """Return x, v ∈ [0, 1] and their slopes by p and u."""
        (p_low, p_high), (u_low, u_high) = self.domain.actuation, self.domain.deformation[0]
        by_p, by_u = 1 / (p_high - p_low), 1 / (u_high - u_low)
        return ((p - p_low) / (p_high - p_low), float(by_p)), ((u - u_low) / (u_high - u_low), float(by_u))


# States of a long recording whose misses make the band.
MOST_PLACES = 1500
MOST_INPUTS = max(CELLS)


class TableSurrogate(AxesSurrogate):
    """Cubic laws interpolated from scattered states, with smoothing chosen by cross-validation.

    `FitReport.details` contains the smoothings tried, the residuals and the errors of the published form on the same
    states.
    """

    config: TableConfig
    several_actuations = True
    gets_untrusted = True  # `states.split` judges them

    def axis_surrogates(self) -> dict[str, TableSurrogate]:
        """Return the surrogates of the axes of a spherical joint, if the config has them."""
        each = {} if self.config.axes is None else self.config.axes.each()
        return {axis: TableSurrogate(TableConfig(data=one.data)) for axis, one in each.items()}

    def fit(self, data: FemDataset) -> FittedLaw:
        """Fit the states of role "fit" and score the law on those of role "check" (see `polynomial.states`).

        Deterministic. Raises `UserError`, in one sentence, for too few states, non-finite numbers, contradictions, and
        where the states determine no law.
        """
        states = split(data, "a table law")
        fit = states.fit
        found = fit_spline(
            TableStates.from_data(fit), states.domain.box, f"{fit.actuation_name} and angle_rad"
        )
        told = np.sort(np.random.default_rng(SEED).permutation(len(fit))[:MOST_PLACES])
        angles = fit.angle_rad[told, None]
        box, misses = states.domain.box, found.misses[told, None]
        bar = ErrorBar.from_residuals(box, fit.actuation[told], angles, misses, inner_scores=True)
        named = (data.actuation_name, (data.axis,))
        law = TableLaw(found.coefficients, states.domain, *named, one_axis_joint(data), bar)
        return FittedLaw(law, scoring.report(law, states, _details(found, largest_slope(law))))

    def fit_module(self, data: ModuleData) -> FittedLaw:
        """Fit states: each axis separately under one actuation; under several, the only axis of the module.

        Raises:
            UserError: as for `fit`; under several actuations, more than one axis or more than `MOST_INPUTS` actuations.
        """
        m = len(data.actuations)
        if m == 1:
            return super().fit_module(data)
        if len(data.axes) > 1 or m > MOST_INPUTS:
            raise UserError(
                f"surrogate 'table' interpolates one axis under up to {MOST_INPUTS} actuations, and this module has "
                f"{', '.join(data.axes)} under {data.actuation_name}: use surrogate.kind 'polynomial' or 'neural'."
            )
        states = split(data, f"a table law of {m} actuations")
        fit = states.fit
        found = fit_spline(TableStates.from_data(fit), states.domain.box, f"{fit.actuation_name} and u")
        bar = ErrorBar.from_residuals(
            states.domain.box, fit.actuation, fit.deformation, found.misses[:, None]
        )
        named = (data.actuation_name, data.axes, data.joint)
        law = SeveralTableLaw(found.coefficients, states.domain, *named, bar)
        slope = largest_slope_of_several(law)
        return FittedLaw(law, scoring.report_axes(law, states, _details(found, slope), slope))

    def load(self, record: LawRecord) -> JointLaw:
        """Return the law of a record that `TableLaw.record` or `AxesLaw.record` wrote."""
        require_kind(record, KIND)
        if record.values.get("form") == FORM:
            return SeveralTableLaw.from_record(record)
        if record.values["joint"] == "spherical":
            return AxesLaw.from_record(record, TableLaw.from_record)
        return TableLaw.from_record(record)


def _details(spline: FittedSpline, slope: float) -> dict[str, Any]:
    """Return the report's entries on the choice; `slope` is the largest ∂τ/∂u in the box."""
    names = ("order", "actuation", "deformation", "rmse_of_range")
    return {
        "form": "table",
        "cells": [size - 3 for size in spline.coefficients.shape],
        "smoothing": dict(zip(names, spline.smoothing, strict=False)),
        "left_out_rmse_of_range": spline.tried[spline.smoothing],
        "forced_to_fall": spline.forced_to_fall,
        "tried": [dict(zip(names, (*s, e), strict=True)) for s, e in spline.tried.items()],
        "largest_slope": slope,
        "stable": slope < 0,
    }
