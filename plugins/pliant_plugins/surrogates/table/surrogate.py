"""The table surrogate: laws interpolated from scattered states by splines (see `fitting`)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.surrogate import FittedLaw
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.fem import FemDataset, ModuleData
from pliant.records.law import Domain, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.config import TableConfig
from pliant_plugins.surrogates.continued import ContinuedLaw, share_actuation
from pliant_plugins.surrogates.polynomial import scoring
from pliant_plugins.surrogates.polynomial.axes import AxesLaw, AxesSurrogate
from pliant_plugins.surrogates.polynomial.law import largest_slope
from pliant_plugins.surrogates.polynomial.several_fit import largest_slope as largest_slope_of_several
from pliant_plugins.surrogates.polynomial.states import split
from pliant_plugins.surrogates.polynomial.system import joint_of
from pliant_plugins.surrogates.records import arrays_of, law_record, require_kind, shared_fields
from pliant_plugins.surrogates.table import spline
from pliant_plugins.surrogates.table.fitting import CELLS, SEED, Fitted, States, fit_spline
from pliant_plugins.surrogates.table.several_law import FORM as SEVERAL
from pliant_plugins.surrogates.table.several_law import SeveralTableLaw
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


# States of a long recording whose misses make the band.
MOST_PLACES = 1500
MOST_INPUTS = max(CELLS)


class TableSurrogate(AxesSurrogate):
    """Cubic laws interpolated from scattered states, smoothed as far as states left out ask for.

    `FitReport.details` holds what was tried, the residuals and the errors of the study's form on the same states.
    """

    config: TableConfig
    several_actuations = True

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
        fit = states.fit
        found = fit_spline(States.of(fit), states.domain.box, f"{fit.actuation_name} and angle_rad")
        told = np.sort(np.random.default_rng(SEED).permutation(len(fit))[:MOST_PLACES])
        angles = fit.angle_rad[told, None]
        box, misses = states.domain.box, found.misses[told, None]
        bar = ErrorBar.of(box, fit.actuation[told], angles, misses, inner_scores=True)
        named = (data.actuation_name, (data.axis,))
        law = TableLaw(found.coefficients, states.domain, *named, joint_of(data), bar)
        return FittedLaw(law, scoring.report(law, states, _details(found, largest_slope(law))))

    def fit_module(self, data: ModuleData) -> FittedLaw:
        """Whole states: each axis by itself under one actuation; of several the one axis that the module has.

        Raises:
            UserError: as `fit` does; several axes, or more than `MOST_INPUTS`, of several actuations.
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
        found = fit_spline(States.of(fit), states.domain.box, f"{fit.actuation_name} and u")
        bar = ErrorBar.of(states.domain.box, fit.actuation, fit.deformation, found.misses[:, None])
        named = (data.actuation_name, data.axes, data.joint)
        law = SeveralTableLaw(found.coefficients, states.domain, *named, bar)
        slope = largest_slope_of_several(law)
        return FittedLaw(law, scoring.report_axes(law, states, _details(found, slope), slope))

    def load(self, record: LawRecord) -> JointLaw:
        """The law of a record that `TableLaw.record` or `AxesLaw.record` wrote."""
        require_kind(record, KIND)
        if record.values.get("form") == SEVERAL:
            return SeveralTableLaw.of_record(record)
        if record.values["joint"] == "spherical":
            return AxesLaw.of_record(record, TableLaw.of_record)
        return TableLaw.of_record(record)


def _details(found: Fitted, slope: float) -> dict[str, Any]:
    """What a report tells of the choice; `slope` is the largest ∂τ/∂u in the box."""
    names = ("order", "actuation", "deformation", "rmse_of_range")
    return {
        "form": "table",
        "cells": [size - 3 for size in found.coefficients.shape],
        "smoothing": dict(zip(names, found.smoothing, strict=False)),
        "left_out_rmse_of_range": found.tried[found.smoothing],
        "forced_to_fall": found.forced_to_fall,
        "tried": [dict(zip(names, (*s, e), strict=True)) for s, e in found.tried.items()],
        "largest_slope": slope,
        "stable": slope < 0,
    }
