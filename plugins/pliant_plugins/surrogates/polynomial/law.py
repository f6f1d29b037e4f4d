"""The polynomial joint law of one axis, and the stated law of the published form."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from pliant.mechanics.law_draws import error_tables
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.continued import ContinuedLaw, share_actuation
from pliant_plugins.surrogates.polynomial.kernel import ACTING, GAINS, HEADER, axes_effort, block, effort
from pliant_plugins.surrogates.records import float_arrays, law_record, shared_fields

if TYPE_CHECKING:
    from pliant_plugins.surrogates.config import StatedDomain, StudyCoefficients

KIND = "polynomial"
SEVERAL = "several actuations"  # form in the records of `SeveralLaw`
ARRAYS = ("coefficients", "actuation_map", "deformation_map")
UNITY = np.array([0.0, 1.0])
SHARED = partial(share_actuation, header=HEADER, acting=ACTING, gains=GAINS)


@dataclass(frozen=True, eq=False)
class PolynomialLaw(ContinuedLaw):
    """τ(p, u) = Σ c_ij x^i v^j + c_odd u|u|, with x = (p − p₀)/p₁ and v = (u − u₀)/u₁.

    Outside the box of `domain` it is continued as every `ContinuedLaw`.

    Attributes:
        coefficients: (I + 1, J + 1) c_ij, N·m.
        actuation_map: (2,) p₀, p₁.
        deformation_map: (2,) u₀, u₁.
        domain: the box of the data.
        odd: c_odd, N·m/rad².
        error: how far off the law is; stated laws have none.
    """

    coefficients: Array
    actuation_map: Array
    deformation_map: Array
    domain: Domain
    odd: float = 0.0
    actuation_name: str = "pressure_pa"
    axes: tuple[str, ...] = ("y",)
    joint: JointKind = "revolute"
    error: ErrorBar | None = None
    _table: Array = field(init=False, repr=False)
    _reach: Array = field(init=False, repr=False)
    _reference_gain: Array = field(init=False, repr=False)
    _packed: tuple[Array, NDArray[np.int64], Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_table", self._derivative_table())
        self._continue()
        object.__setattr__(self, "_packed", self._pack())

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return τ (n, 1), ∂τ/∂p (n, 1) and ∂τ/∂u (n, 1, 1) for actuation (n,) and deformation (n, 1)."""
        p = np.ascontiguousarray(actuation, float)
        u = np.ascontiguousarray(np.asarray(deformation, float)[:, 0])
        out = np.empty((3, len(u)))
        effort(p, u, *self._packed, out)
        return Effort(out[0][:, None], out[1][:, None], out[2][:, None, None])

    def scalar(self) -> ScalarLaw:
        """Return the law as a scalar function for compiled engines; the continuation's reaches are fixed parameters."""
        box = np.concatenate([self.domain.actuation[None], self.domain.deformation])
        maps = (self.actuation_map, self.deformation_map)
        parameters = block(self.coefficients, maps, box, self._reach, self._reference_gain, self.odd)
        return ScalarLaw(axes_effort, parameters, SHARED)

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """Return laws with drawn errors (`mechanics.law_draws`) as further coefficients; empty without an error bar."""
        if self.error is None:
            return ()
        limits = np.vstack([self.domain.actuation, self.domain.deformation])
        maps = np.vstack([self.actuation_map, self.deformation_map])
        drawn = []
        for tables in error_tables(self, count, seed):
            added = monomials(tables[0], limits, maps)
            total = np.zeros(np.maximum(self.coefficients.shape, added.shape))
            for one in (self.coefficients, added):
                total[tuple(map(slice, one.shape))] += one
            drawn.append(replace(self, coefficients=total))
        return tuple(drawn)

    def record(self) -> LawRecord:
        """Return coefficients, scales and domain; `Polynomial.load` makes the same law of them."""
        return law_record(KIND, self, {name: getattr(self, name) for name in ARRAYS}, odd=self.odd)

    @staticmethod
    def from_record(record: LawRecord) -> PolynomialLaw:
        """Return the law of a record, identical bit for bit."""
        odd = float(record.values["odd"])
        return PolynomialLaw(**float_arrays(record, *ARRAYS), **shared_fields(record), odd=odd)

    def _pack(self) -> tuple[Array, NDArray[np.int64], Array]:
        """Return coefficients, their number in each row and all other numbers, as arguments of `batch.effort`."""
        table = np.ascontiguousarray(self.coefficients, float)
        widths = np.array([np.max(np.flatnonzero(row), initial=-1) + 1 for row in table])
        maps = [self.actuation_map, self.deformation_map, self.domain.actuation, self.domain.deformation[0]]
        return table, widths, np.concatenate([*maps, self._reach, self._reference_gain, [self.odd]])

    def _derivative_table(self) -> Array:
        """Return (I + 1, 4 (J + 3)): τ, ∂p τ, ∂u τ, ∂p∂u τ as polynomials in x over the columns v^j, u|u|, |u|."""
        c = self.coefficients
        plain = np.pad(c, ((0, 0), (0, 2)))
        plain[0, -2] = self.odd
        in_u = np.zeros_like(plain)
        in_u[:, : c.shape[1] - 1] = c[:, 1:] * np.arange(1, c.shape[1]) / self.deformation_map[1]
        in_u[0, -1] = 2 * self.odd
        return np.concatenate([plain, self._in_x(plain), in_u, self._in_x(in_u)], axis=1)

    def _in_x(self, table: Array) -> Array:
        slope = np.zeros_like(table)
        slope[:-1] = table[1:] * np.arange(1, len(table))[:, None] / self.actuation_map[1]
        return slope

    def _inside(self, p: Array, u: Array) -> Array:
        """Return (n, 4) τ, ∂p τ, ∂u τ, ∂p∂u τ of the bare polynomial."""
        x = (p - self.actuation_map[0]) / self.actuation_map[1]
        v = (u - self.deformation_map[0]) / self.deformation_map[1]
        columns = np.empty((len(u), self.coefficients.shape[1] + 2))
        columns[:, :-2] = np.vander(v, self.coefficients.shape[1], increasing=True)
        columns[:, -1] = np.abs(u)
        columns[:, -2] = u * columns[:, -1]
        rows = np.vander(x, len(self.coefficients), increasing=True) @ self._table
        return np.einsum("nkj,nj->nk", rows.reshape(len(u), 4, -1), columns)

    def _half_width(self) -> float:
        return float(self.actuation_map[1])

    def _areas(self, p: Array, u: Array) -> Array:
        """Return (2, n) ∫ τ du and ∫ ∂p τ du from the angle u₀ of the map."""
        width = self.coefficients.shape[1]
        v = (u - self.deformation_map[0]) / self.deformation_map[1]
        columns = np.empty((len(u), width + 1))
        powers = np.vander(v, width + 1, increasing=True)[:, 1:]
        columns[:, :-1] = powers * (self.deformation_map[1] / np.arange(1, width + 1))
        columns[:, -1] = u**2 * np.abs(u) / 3
        x = np.vander(
            (p - self.actuation_map[0]) / self.actuation_map[1], len(self.coefficients), increasing=True
        )
        blocks = self._table.reshape(len(self.coefficients), 4, width + 2)[:, :2, :-1]
        return np.einsum("ni,ikj,nj->kn", x, blocks, columns)


def study_law(
    coefficients: StudyCoefficients,
    odd: bool,
    domain: Domain,
    actuation_name: str = "pressure_pa",
    axis: str = "y",
    joint: JointKind = "revolute",
) -> PolynomialLaw:
    """Return the law of the study's coefficients in SI; `odd` uses u|u| instead of u².

    τ(p, u) = k_n p + (m_a p + b_a) u − (m_e u²/2 + b_e u); `study` fits the coefficients.
    """
    k = coefficients
    table = np.zeros((2, 2 if odd else 3))
    table[1, 0] = k.k_n
    table[1, 1] = k.m_a
    table[0, 1] = k.b_a - k.b_e
    if not odd:
        table[0, 2] = -k.m_e / 2
    return PolynomialLaw(
        table, UNITY, UNITY, domain, -k.m_e / 2 if odd else 0.0, actuation_name, (axis,), joint
    )


def stated_domain(domain: StatedDomain | None) -> Domain:
    """Return the record of a stated domain; unstated sides are unbounded."""
    everywhere = Domain.unbounded(1)
    if domain is None:
        return everywhere
    deformation = domain.deformation or domain.extension_m
    return Domain(
        everywhere.actuation if domain.actuation is None else np.array(domain.actuation, float),
        everywhere.deformation if deformation is None else np.array([deformation], float),
    )


def largest_slope(law: JointLaw) -> float:
    """Return largest ∂τ/∂u of a one-axis law on a 61 × 61 grid of its (finite) domain, N·m/rad."""
    (low_p, high_p), (low_u, high_u) = law.domain.actuation, law.domain.deformation[0]
    p, u = np.meshgrid(np.linspace(low_p, high_p, 61), np.linspace(low_u, high_u, 61))
    return float(law.evaluate(p.ravel(), u.reshape(-1, 1)).dtau_du.max())


def monomials(table: Array, limits: Array, maps: Array) -> Array:
    """Return (I, J) monomial coefficients, scaled by `maps` (2, 2), of a Chebyshev table in coordinates of `limits`."""
    out = table
    for axis, ((low, high), (centre, scale)) in enumerate(zip(limits, maps, strict=True)):
        size = table.shape[axis]
        # Columns: monomials of the map's coordinate as Chebyshev series of the box's, t = (x·scale + centre − m)/h.
        nodes = chebyshev.chebpts1(size)
        x = ((low + high) / 2 + nodes * (high - low) / 2 - centre) / scale
        change = np.linalg.solve(np.vander(x, size, increasing=True), chebyshev.chebvander(nodes, size - 1))
        out = np.moveaxis(np.tensordot(change, out, axes=(1, axis)), 0, axis)
    return out
