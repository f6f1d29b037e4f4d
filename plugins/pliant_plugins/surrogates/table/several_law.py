"""The table law of one axis under several actuations: a tensor-product spline of all of them and u.

    τ(a, u) = T(ã, u) + Σ_j (a_j − ã_j) G_j,   T = Σ c_{i…j} Π_d B_i(x_d) B_j(v),   ã = â + L tanh(δ/L)

with B uniform cubic B-splines over the box, δ how far an actuation lies outside it and â the nearest place in it.
Outside the box each B goes on along its tangent, so T is multilinear there and τ is C¹. The actuations' influence on
the stiffness saturates at L (`REACHES`, chosen so that at least half of the least stiffness of the box is left), and
G_j, the gain at the border at rest, pushes on without end and without changing the stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.records import arrays_of, law_record, shared_fields
from pliant_plugins.surrogates.table import spline
from pliant_plugins.surrogates.table.spline import several_table_effort

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
        """τ (n, 1), ∂τ/∂a (n, 1, m) and ∂τ/∂u (n, 1, 1) at a (n, m) and u (n, 1)."""
        bent, rate, outer = self._bent(np.asarray(actuation, float))
        tau, gain, slope = self._spline(bent, np.asarray(deformation, float)[:, 0])
        tau = tau + np.sum((actuation - bent) * outer, axis=1)
        gain = rate * gain + (1 - rate) * outer
        return Effort(tau[:, None], gain[:, None, :], slope[:, None, None])

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Π(a, u) − Π(a, 0) in J, shape (n,), in closed form, continuation included."""
        a, u = np.asarray(actuation, float), np.asarray(deformation, float)[:, 0]
        bent, _, outer = self._bent(a)
        table, _ = self._rows(bent)
        pushed = np.sum((a - bent) * outer, axis=1) * u
        return self._area(table, np.zeros_like(u)) - self._area(table, u) - pushed

    def scalar(self) -> ScalarLaw:
        """The compiled form: see `several_table_effort`."""
        header = [len(self.actuations), *self.coefficients.shape]
        parts = [self.domain.box, self.reach, self.gain, self.coefficients]
        return ScalarLaw(several_table_effort, np.concatenate([header, *map(np.ravel, parts)]).astype(float))

    def record(self) -> LawRecord:
        """Coefficients, box and error bar; `of_record` makes the same law of them."""
        return law_record(KIND, self, {"coefficients": self.coefficients}, form=FORM)

    @staticmethod
    def of_record(record: LawRecord) -> SeveralTableLaw:
        """The law of a record; both evaluate to the same bits."""
        return SeveralTableLaw(**arrays_of(record, "coefficients"), **shared_fields(record))

    def _steepest(self, reach: Array) -> float:
        """The largest ∂τ/∂u as far outside as `reach` (m,), on a grid."""
        low, high = self.domain.actuation.T
        levels = np.linspace(low - reach, high + reach, 3).T
        first, last = (float(side) for side in self.domain.deformation[0])
        grid = np.meshgrid(*levels, np.linspace(first, last, LEVELS), indexing="ij")
        at = np.stack([axis.ravel() for axis in grid], axis=1)
        return float(self._spline(at[:, :-1], at[:, -1])[2].max())

    def _bent(self, actuation: Array) -> tuple[Array, Array, Array]:
        """ã, how fast it follows a, and G of the side that was left, (n, m) each."""
        low, high = self.domain.actuation.T
        inside = np.clip(actuation, low, high)
        excess = actuation - inside
        bent = np.tanh(excess / self.reach)
        outer = np.where(excess > 0, self.gain[:, 1], self.gain[:, 0])
        return inside + self.reach * bent, 1 - bent * bent, outer

    def _spline(self, a: Array, u: Array) -> tuple[Array, Array, Array]:
        """T (n,), ∂T/∂a (n, m) and ∂T/∂u (n,) at places a (n, m), u (n,), along tangents outside the box."""
        table, by_a = self._rows(a)
        value, slope = _weights(u, self.domain.deformation[0], self.coefficients.shape[-1])
        tau, steep = np.sum(table * value, axis=1), np.sum(table * slope, axis=1)
        return tau, np.einsum("nmj,nj->nm", by_a, value), steep

    def _rows(self, a: Array) -> tuple[Array, Array]:
        """(n, J + 3) coefficients of the spline of u at actuations a (n, m), and (n, m, J + 3) their slopes by a."""
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
        """(n,) ∫ T du from some angle, the same for one row of `table` (n, J + 3), to u."""
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
    """(n, size) weights of all coefficients of one coordinate and their slopes; on tangents outside the limits."""
    low, high = limits
    inside = np.clip(values, low, high)
    cells = size - 3
    x = (inside - low) / (high - low)
    slope = spline.rows(x, cells, slopes=True) / (high - low)
    return spline.rows(x, cells) + (values - inside)[:, None] * slope, slope
