"""The joint law of one axis as a bicubic table: C² inside the box of its data, continued outside."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain, JointKind, LawRecord, ScalarLaw
from pliant_plugins.surrogates.continued import ContinuedLaw
from pliant_plugins.surrogates.records import arrays_of, law_record, shared_fields
from pliant_plugins.surrogates.table import spline
from pliant_plugins.surrogates.table.scalar import axes_effort, block, shared

KIND = "table"


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
        return ScalarLaw(axes_effort, parameters, shared)

    def record(self) -> LawRecord:
        """Coefficients, box and error bar; `Table.load` makes the same law of them."""
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
        areas: Array = np.einsum("nam,nmk,nk->an", in_x, near, spline.area_weights(t) / by_u)
        return areas

    def _scaled(self, p: Array, u: Array) -> tuple[tuple[Array, float], tuple[Array, float]]:
        """x, v ∈ [0, 1] and their slopes by p and u."""
        (p_low, p_high), (u_low, u_high) = self.domain.actuation, self.domain.deformation[0]
        by_p, by_u = 1 / (p_high - p_low), 1 / (u_high - u_low)
        return ((p - p_low) / (p_high - p_low), float(by_p)), ((u - u_low) / (u_high - u_low), float(by_u))
