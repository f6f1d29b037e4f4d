"""The law of a joint with one to three coupled axes, derived from a polynomial energy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np

from pliant.mechanics.law_draws import error_tables
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.polynomial.energy import EnergyBasis, unit
from pliant_plugins.surrogates.polynomial.energy_continuation import UPPER, continuation, packed
from pliant_plugins.surrogates.polynomial.energy_kernel import evaluate
from pliant_plugins.surrogates.polynomial.energy_scalar import energy_effort, shared
from pliant_plugins.surrogates.polynomial.law import KIND, monomials
from pliant_plugins.surrogates.records import arrays_of, law_record, shared_fields

# Of the efforts' ranges: smaller changes of τ are no loss.
NEGLIGIBLE = 1e-7


@dataclass(frozen=True, eq=False)
class EnergyLaw(JointLaw):
    """τ = −∂Π/∂u with Π(p, u) = Σ_t c_t φ_t(p, u), so that ∂τ_i/∂u_j = ∂τ_j/∂u_i everywhere.

    Π goes on outside the box of `domain`, so that τ stays C¹ in p and u and a gradient. With the excesses δ and
    φ(δ) = L tanh(δ/L):

    - in p: Π(p̂, u) + φ(δp) Π_p(p̂, u) − (δp − φ(δp)) g·u, g the gain ∂τ/∂p of the border at the u nearest to zero:
      the push grows without end, what p takes from the stiffness saturates.
    - in u: terms of one axis by their second-order Taylor polynomial at the border, so that τ of an axis alone is
      linear there; terms that couple axes see û + φ(δu), so that coupling is bounded; and a bowl
      K L² (a²/2 + a − (1 + a) ln(1 + a)), a = |δu|/L, whose stiffness rises from zero to K.

    With the L of u, the largest of four, and the least K, half of the border's smallest stiffness remains at a few
    places outside: where terms bend most, and where they are as good as constant (see `energy_continuation`).

    Attributes:
        basis: the terms φ_t and their scales.
        coefficients: (m,) c_t in J.
        domain: the box of the data.
        error: its error bar.
    """

    basis: EnergyBasis
    coefficients: Array
    domain: Domain
    axes: tuple[str, ...] = ("y",)
    joint: JointKind = "revolute"
    actuation_name: str = "pressure_pa"
    error: ErrorBar | None = None

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """τ (n, k), ∂τ/∂p (n, k) and the symmetric ∂τ/∂u (n, k, k) for deformation (n, k)."""
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)
        k = len(self.axes)
        found = evaluate(p, u, self._parameters)
        slopes = found[:, 7:][:, UPPER[:k, :k].ravel()].reshape(-1, k, k)
        return Effort(found[:, 1 : 1 + k], found[:, 4 : 4 + k], slopes)

    def pruned(self, ranges: Array) -> EnergyLaw:
        """The law without the terms that together change τ in the box by less than `NEGLIGIBLE` of `ranges` (k,)."""
        box = np.concatenate([self.domain.actuation[None], self.domain.deformation])
        maps = np.vstack([self.basis.actuation_map, self.basis.deformation_map])
        largest = np.abs((box - maps[:, :1]) / maps[:, 1:]).max(axis=1)
        if not np.isfinite(largest).all():
            return self
        powers = self.basis.exponents
        sizes = np.abs(self.coefficients) * np.prod(np.maximum(largest, 1.0) ** powers, axis=1)
        shares = (sizes[:, None] * powers[:, 1:] / (maps[1:, 1] * ranges)).max(axis=1)
        order = np.argsort(shares, kind="stable")
        kept = np.ones(len(order), bool)
        kept[order[np.cumsum(shares[order]) <= NEGLIGIBLE]] = False
        if not kept.any():
            return self
        basis = replace(self.basis, exponents=powers[kept])
        return replace(self, basis=basis, coefficients=self.coefficients[kept])

    def stiffness_in_box(self, actuation: Array, deformation: Array) -> Array:
        """−∂τ/∂u (n, k, k) of the bare polynomial, without the cost of its continuation."""
        u = np.asarray(deformation, float)
        k = u.shape[1]
        matrix = np.empty((len(u), k, k))
        for i, j in combinations_with_replacement(range(k), 2):
            entry = self.basis.derivative(actuation, u, unit(k, 1 + i, 1 + j)) @ self.coefficients
            matrix[:, i, j] = matrix[:, j, i] = entry
        return matrix

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Π(p, u) − Π(p, 0) in J, shape (n,), in closed form, continuation included."""
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)
        full = evaluate(p, u, self._parameters)[:, 0]
        change: Array = full - evaluate(p, np.zeros_like(u), self._parameters)[:, 0]
        return change

    def scalar(self) -> ScalarLaw:
        """The same law for compiled engines."""
        return ScalarLaw(energy_effort, self._parameters, shared)

    @cached_property
    def _parameters(self) -> Array:
        box = np.concatenate([self.domain.actuation[None], self.domain.deformation])
        how = continuation(self.basis, self.coefficients, box)
        return packed(self.basis, self.coefficients, box, how)

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """Laws whose energy has the work of drawn errors (`mechanics.law_draws`) taken away; empty without an error."""
        if self.error is None:
            return ()
        box = np.vstack([self.domain.actuation, self.domain.deformation])
        old = self.basis
        drawn = []
        for tables in error_tables(self, count, seed):
            exponents, coefficients = [old.exponents], [self.coefficients]
            for a, table in enumerate(tables):
                maps = np.vstack([old.actuation_map, old.deformation_map[a]])
                work = monomials(table, box[[0, 1 + a]], maps)
                i, j = (grid.ravel() for grid in np.indices(work.shape))
                powers = np.zeros((work.size, 1 + len(self.axes)), np.int64)
                powers[:, 0], powers[:, 1 + a] = i, j + 1
                exponents.append(powers)
                coefficients.append(-work.ravel() * old.deformation_map[a, 1] / (j + 1))
            basis = replace(old, exponents=np.concatenate(exponents))
            drawn.append(replace(self, basis=basis, coefficients=np.concatenate(coefficients)))
        return tuple(drawn)

    def record(self) -> LawRecord:
        """Terms, coefficients, scales, domain and error bar."""
        basis = self.basis
        arrays = {
            "exponents": basis.exponents.astype(float),
            "coefficients": self.coefficients,
            "actuation_map": basis.actuation_map,
            "deformation_map": basis.deformation_map,
        }
        return law_record(KIND, self, arrays, form="energy")

    @staticmethod
    def of_record(record: LawRecord) -> EnergyLaw:
        """The law of a record; both evaluate to the same bits."""
        read = arrays_of(record, "coefficients", "actuation_map", "deformation_map")
        coefficients = read.pop("coefficients")
        basis = EnergyBasis(np.asarray(record.arrays["exponents"], np.int64), **read)
        return EnergyLaw(basis, coefficients, **shared_fields(record))
