"""The law of a joint under several actuations: one polynomial energy Π(a, u) of all of them and all axes.

    Π = Σ_t c_t Π_j g(x_j)^{i_tj} Π_k h(v_k)^{l_tk},   x = (a − a₀)/a₁,  v = (u − u₀)/u₁,  both in [−1, 1] on the box

τ = −∂Π/∂u, so that ∂τ_i/∂u_j = ∂τ_j/∂u_i, and −∂Π/∂a is the travel on which each actuation works. Outside the box each
power is continued by its Taylor polynomial at the border, of first order in x and of second order in v: Π stays one
energy whose effort and slopes are continuous.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pliant.mechanics.law_draws import error_polynomials
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.polynomial.kernel import several_effort, several_shared
from pliant_plugins.surrogates.polynomial.law import KIND, SEVERAL
from pliant_plugins.surrogates.records import float_arrays, law_record, shared_fields

Exponents = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class SeveralLaw(JointLaw):
    """See the module. With m actuations and k axes:

    Attributes:
        exponents: (t, m + k) of each term.
        coefficients: (t,) in J.
        maps: (m + k, 2) centre and half-width of each actuation and each deformation: those of the domain.
        domain: the box of the data.
        error: its error bar.
    """

    exponents: Exponents
    coefficients: Array
    maps: Array
    domain: Domain
    actuation_name: str
    axes: tuple[str, ...] = ("y",)
    joint: JointKind = "revolute"
    error: ErrorBar | None = None

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return τ (n, k), ∂τ/∂a (n, k, m) and the symmetric ∂τ/∂u (n, k, k) at a (n, m) and u (n, k)."""
        tables, m = self._tables(actuation, deformation), len(self.actuations)
        k, c = len(self.axes), self.coefficients
        n = len(tables[0][0])
        tau, by_a, by_u = np.empty((n, k)), np.empty((n, k, m)), np.empty((n, k, k))
        for i in range(k):
            tau[:, i] = -product(tables, {m + i: 1}) @ c
            for j in range(m):
                by_a[:, i, j] = -product(tables, {m + i: 1, j: 1}) @ c
            for j in range(i, k):
                orders = {m + i: 2} if i == j else {m + i: 1, m + j: 1}
                by_u[:, i, j] = by_u[:, j, i] = -product(tables, orders) @ c
        return Effort(tau, by_a, by_u)

    def travel(self, actuation: Array, deformation: Array) -> Array:
        """Return −∂Π/∂a (n, m), the conjugate of each actuation relative to the undeformed module; m³ for pressures.

        A law fitted to states without energies knows it up to a function of the actuations alone.
        """
        tables = self._tables(actuation, deformation)
        return -np.stack(
            [product(tables, {j: 1}) @ self.coefficients for j in range(len(self.actuations))], axis=1
        )

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Return Π(a, u) − Π(a, 0) in J, shape (n,)."""
        there, rest = (
            product(self._tables(actuation, u), {}) @ self.coefficients
            for u in (deformation, np.zeros_like(np.asarray(deformation, float)))
        )
        return np.asarray(there - rest)

    def _tables(self, actuation: Array, deformation: Array) -> list[tuple[Array, Array, Array]]:
        """Return, for each coordinate, the powers of all terms and their first two derivatives, (n, t) each."""
        at = np.column_stack([np.asarray(actuation, float), np.asarray(deformation, float)])
        m = len(self.actuations)
        return [powers(at[:, d], self.maps[d], self.exponents[:, d], bent=d >= m) for d in range(at.shape[1])]

    def scalar(self) -> ScalarLaw:
        """Return the compiled form: see `several_effort`."""
        return ScalarLaw(several_effort, self._packed, several_shared)

    @cached_property
    def _packed(self) -> Array:
        """Numbers of m, k, monomials and degrees; maps; exponents; the table of coefficients (see the kernel)."""
        m, k = len(self.actuations), len(self.axes)
        moving = self.exponents[:, m:].any(axis=1)  # others have no effort
        terms, c = self.exponents[moving], self.coefficients[moving]
        of_a, place_a = np.unique(terms[:, :m], axis=0, return_inverse=True)
        of_u, place_u = np.unique(terms[:, m:], axis=0, return_inverse=True)
        # Rows end early where monomials of low degree come first.
        order = np.lexsort((*of_a.T, of_a.sum(axis=1)))
        rank = np.argsort(order)
        table = np.zeros((len(of_u), len(of_a)))
        np.add.at(table, (place_u.ravel(), rank[place_a.ravel()]), c)
        known = table != 0
        lengths = np.where(known.any(axis=1), table.shape[1] - np.argmax(known[:, ::-1], axis=1), 0)
        highest = (int(of_a.max(initial=0)), int(of_u.max(initial=0)))
        header = [m, k, len(of_a), len(of_u), *highest]
        rows = np.column_stack([lengths, of_u, table])
        return np.concatenate([header, self.maps.ravel(), of_a[order].ravel(), rows.ravel()]).astype(float)

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """Return laws whose energy is reduced by the work of drawn errors (`mechanics.law_draws`), if any."""
        if self.error is None:
            return ()
        m, k = len(self.actuations), len(self.axes)
        exponents, errors = error_polynomials(self, count, seed)
        powers_of_u = exponents[:, m] + 1
        terms = np.zeros((k, len(exponents), m + k), np.int64)
        terms[:, :, :m] = exponents[:, :m]
        terms[np.arange(k), :, m + np.arange(k)] = powers_of_u
        work = -errors * self.maps[m:, 1, None] / powers_of_u
        every = np.concatenate([self.exponents, *terms])
        return tuple(
            replace(self, exponents=every, coefficients=np.concatenate([self.coefficients, one.ravel()]))
            for one in work
        )

    def record(self) -> LawRecord:
        """Return terms, coefficients, scales, domain and error bar."""
        arrays = {
            "exponents": self.exponents.astype(float),
            "coefficients": self.coefficients,
            "maps": self.maps,
        }
        return law_record(KIND, self, arrays, form=SEVERAL)

    @staticmethod
    def from_record(record: LawRecord) -> SeveralLaw:
        """Return the law of a record."""
        read = float_arrays(record, "coefficients", "maps")
        exponents = np.asarray(record.arrays["exponents"], np.int64)
        return SeveralLaw(exponents, **read, **shared_fields(record))


def powers(values: Array, scale: Array, exponents: Exponents, bent: bool) -> tuple[Array, Array, Array]:
    """Return (n, t) powers of one coordinate and their first two derivatives, continued outside [−1, 1].

    `bent`: by the Taylor polynomial of second order, else of first.
    """
    centre, half = scale
    x = (np.asarray(values, float) - centre) / half
    inside = np.clip(x, -1.0, 1.0)
    beyond = (x - inside)[:, None]
    table = np.vander(inside, int(exponents.max(initial=0)) + 1, increasing=True)
    zero = table[:, exponents]
    one = exponents * table[:, np.maximum(exponents - 1, 0)]
    two = exponents * (exponents - 1) * table[:, np.maximum(exponents - 2, 0)]
    if not bent:
        return zero + beyond * one, one / half, np.where(beyond == 0.0, two, 0.0) / half**2
    return zero + beyond * (one + 0.5 * beyond * two), (one + beyond * two) / half, two / half**2


def product(tables: list[tuple[Array, Array, Array]], orders: dict[int, int]) -> Array:
    """Return (n, t) derivatives of all terms, `orders` times by each coordinate."""
    found = tables[0][orders.get(0, 0)]
    for d, table in enumerate(tables[1:], start=1):
        found = found * table[orders.get(d, 0)]
    return found


def lower_terms(exponents: Exponents) -> Exponents:
    """Return (t', d) all terms that divide some of (t, d), the constant left out, for another origin."""
    every = {low for one in exponents for low in np.ndindex(*(one + 1))} - {(0,) * exponents.shape[1]}
    return np.array(sorted(every, key=lambda one: (sum(one), one)), np.int64)


def shifted(coefficients: Array, exponents: Exponents, lower: Exponents, maps: Array) -> Array:
    """Return (t',) coefficients of `lower_terms` in y of a polynomial in x = centre + half · y, no constant.

    Args:
        coefficients: (t,) of the terms `exponents` (t, d) in x.
        maps: (d, 2) centre and half of each coordinate.
    """
    found = np.ones((len(lower), len(exponents)))
    for d, (centre, half) in enumerate(maps):
        top = int(exponents[:, d].max())
        table = np.zeros((top + 1, top + 1))
        for e in range(top + 1):
            table[: e + 1, e] = [math.comb(e, i) * half**i * centre ** (e - i) for i in range(e + 1)]
        found *= table[np.ix_(lower[:, d], exponents[:, d])]
    moved: Array = found @ coefficients
    return moved
