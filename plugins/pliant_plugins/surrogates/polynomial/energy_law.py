"""The law of a joint with one to three coupled axes, derived from a polynomial energy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from pliant.mechanics.law_draws import error_tables
from pliant.records.design import Array
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.polynomial.energy import EnergyBasis, unit
from pliant_plugins.surrogates.polynomial.energy_kernel import (
    UNBOUNDED,
    energy_effort,
    evaluate,
    shared,
)
from pliant_plugins.surrogates.polynomial.law import KIND, monomials
from pliant_plugins.surrogates.records import float_arrays, law_record, shared_fields

# A continuation leaves at least this share of the border's stiffness.
STIFFNESS_SHARE = 0.5
# Coupling terms see the deformation up to this share of the box's half-width outside it: the first that bowls can
# make stable, since a bowl helps no axis that is inside.
REACHES = (0.2, 0.1, 0.05, 0.025)
# Bowls that are tried, as shares of the typical stiffness of their axis in the box: doubled, then halved between.
FIRST, DOUBLINGS, HALVINGS = 1 / 16, 11, 4
# Places outside the box, in reaches beyond it, where the continuation is looked at: where coupling terms bend
# most, and where they are as good as constant and bowls at five sixths of their stiffness; beyond, bowls only grow.
BEYOND = (0.6, 5.0)
# Where the reaches in p are read off.
BESIDE = (0.6,)
# Places of ∂τ_i/∂u_j among the kernel's six slopes.
UPPER = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


@dataclass(frozen=True, eq=False)
class EnergyContinuation:
    """Reaches in p (2,) and u (k,), bowls (k,) in N·m/rad and gains at the reference point (2, k)."""

    reach_p: Array
    reach_u: Array
    bowls: Array
    gains: Array


def packed(basis: EnergyBasis, coefficients: Array, box: Array, how: EnergyContinuation) -> Array:
    """Return the parameters of `energy_kernel.energy_effort`; box (1 + k, 2). Terms of p alone are left out."""
    k, exponents = len(box) - 1, basis.exponents
    axes = np.tile([0.0, 1.0, -UNBOUNDED, UNBOUNDED, 1.0, 0.0], (3, 1))
    axes[:k] = np.column_stack([basis.deformation_map, box[1:], how.reach_u, how.bowls])
    reference = np.zeros((2, 3))
    reference[:, :k] = how.gains
    columns = int(exponents[:, 0].max(initial=0)) + 1
    monomials, place = _distinct_monomials(exponents[:, 1:].astype(np.int64).tobytes(), len(exponents), k)
    table = np.zeros((len(monomials), columns))
    np.add.at(table, (place, exponents[:, 0]), coefficients)
    rows = np.column_stack([monomials, table])[monomials.any(axis=1)]
    header = [len(rows), columns, *basis.actuation_map, *box[0], *how.reach_p]
    numbers = np.concatenate([header, axes.ravel(), reference.ravel(), rows.ravel()])
    return np.clip(numbers, -UNBOUNDED, UNBOUNDED)


@lru_cache(maxsize=64)
def _distinct_monomials(powers: bytes, terms: int, k: int) -> tuple[Array, NDArray[np.int64]]:
    """Return the monomials (coupled or not, exponents of u₁ … u₃) of terms with exponents (terms, k) of u, and their
    terms.

    The result is cached: laws of one form, of which a search packs thousands, differ in coefficients only.
    """
    exponents = np.zeros((terms, 3), np.int64)
    exponents[:, :k] = np.frombuffer(powers, np.int64).reshape(terms, k)
    monomials, place = np.unique(exponents, axis=0, return_inverse=True)
    coupled = np.count_nonzero(monomials, axis=1) > 1
    return np.column_stack([coupled, monomials]).astype(float), place.ravel()


def continuation(basis: EnergyBasis, coefficients: Array, box: Array) -> EnergyContinuation:
    """Return the smallest bowls, then reaches in p, with which half of the border's stiffness remains outside.

    Where the law is unstable on its border there is nothing to protect: bowls are those of a stable law's size.
    """
    k = len(box) - 1
    bounded = np.all(np.isfinite(box[1:]), axis=1, keepdims=True)
    half = np.ptp(np.where(bounded, box[1:], [-1.0, 1.0]), axis=1) / 2
    tried = EnergyContinuation(np.full(2, np.inf), REACHES[0] * half, np.zeros(k), np.zeros((2, k)))
    at_p = [p for p in np.clip(box[0], -UNBOUNDED, UNBOUNDED) if abs(p) < UNBOUNDED]
    if k > 1 and at_p:
        tried = _with_bowls(basis, coefficients, box, half, at_p, tried)
    parameters = packed(basis, coefficients, box, tried)
    places = _places(box, tried.reach_u, BESIDE)
    sides = [_side(parameters, box, places, index) for index in (0, 1)]
    reach = np.array([limit for limit, _ in sides])
    return EnergyContinuation(reach, tried.reach_u, tried.bowls, np.array([gain for _, gain in sides]))


def stiffness(parameters: Array, actuation: list[float], places: Array) -> Array:
    """Return (n, k, k) −∂τ/∂u at all places (m, k) under each of the actuations."""
    k = places.shape[1]
    p = np.repeat(actuation, len(places))
    found = evaluate(p, np.tile(places, (len(actuation), 1)), parameters)
    return -found[:, 7:][:, UPPER[:k, :k]]


def _with_bowls(
    basis: EnergyBasis,
    coefficients: Array,
    box: Array,
    half: Array,
    at_p: list[float],
    plain: EnergyContinuation,
) -> EnergyContinuation:
    """Return the continuation with bowls, all in proportion to the typical stiffness of their axis."""
    k = len(half)
    inner = stiffness(packed(basis, coefficients, box, plain), at_p, _places(box, half, ()))
    typical = np.median(np.abs(np.diagonal(inner, axis1=1, axis2=2)), axis=0)
    typical = np.maximum(typical, np.finfo(float).tiny)
    needed = STIFFNESS_SHARE * max(float(np.linalg.eigvalsh(inner).min()), 0.0)
    if needed <= 0:
        return replace(plain, bowls=typical)
    for share in REACHES:
        tried = replace(plain, reach_u=share * half)
        outer = _places(box, tried.reach_u, BEYOND)
        bare = stiffness(packed(basis, coefficients, box, tried), at_p, outer) - needed * np.eye(k)
        excess = np.maximum(np.maximum(box[1:, 0] - outer, outer - box[1:, 1]), 0.0) / tried.reach_u
        size = _smallest(bare, np.tile(typical * excess / (1 + excess), (len(at_p), 1)))
        if size is not None:
            return replace(tried, bowls=size * typical)
    return replace(tried, bowls=typical)


def _smallest(matrices: Array, diagonals: Array) -> float | None:
    """Return the smallest factor, within a few per cent, that makes matrices + factor · diagonals positive."""
    if _definite(matrices, 0.0 * diagonals):
        return 0.0
    sizes = FIRST * 2.0 ** np.arange(DOUBLINGS)
    if not _definite(matrices, sizes[-1] * diagonals):
        return None
    high = float(next(size for size in sizes if _definite(matrices, size * diagonals)))
    low = 0.0 if high == FIRST else high / 2
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if _definite(matrices, middle * diagonals) else (middle, high)
    return high


def _definite(matrices: Array, diagonals: Array) -> bool:
    """Return whether all symmetric matrices (n, k, k) with diagonals (n, k) added are positive definite."""
    return bool(np.all(_each_definite(matrices, diagonals)))


def _each_definite(matrices: Array, diagonals: Array) -> NDArray[np.bool_]:
    """Return (n,) which of symmetric (n, k, k) + diagonals (n, k), k ≤ 3, are definite, by leading minors."""
    d = [matrices[:, i, i] + diagonals[:, i] for i in range(diagonals.shape[1])]
    found: NDArray[np.bool_] = d[0] > 0
    if len(d) > 1:
        b = matrices[:, 0, 1]
        second = d[0] * d[1] - b**2
        found &= second > 0
    if len(d) > 2:
        c, e = matrices[:, 0, 2], matrices[:, 1, 2]
        found &= d[2] * second > d[0] * e**2 - 2 * b * c * e + d[1] * c**2
    return found


def _places(box: Array, steps: Array, beyond: tuple[float, ...]) -> Array:
    """Return a grid (m, k) over the box in u and points outside it at multiples `beyond` of `steps` (k,)."""
    low, high = np.clip(box[1:], -np.pi, np.pi).T[:, :, None]
    outside = np.asarray(steps)[:, None] * np.array(beyond)
    inside = np.linspace(low[:, 0], high[:, 0], 3 if len(box) > 2 else 65, axis=1)
    levels = np.concatenate([inside, low - outside, high + outside], axis=1)
    return levels[np.arange(len(levels)), _grid(levels.shape[1], len(levels))]


@cache
def _grid(levels: int, axes: int) -> NDArray[np.int64]:
    """Return (levels^axes, axes) every combination of levels, the last axis fastest."""
    return np.indices((levels,) * axes).reshape(axes, -1).T


def _side(parameters: Array, box: Array, places: Array, index: int) -> tuple[float, Array]:
    """Return L and the gain at the reference point on the lower (0) or upper (1) side of the box in p."""
    k = places.shape[1]
    border = float(box[0, index])
    if not np.isfinite(border):
        return np.inf, np.zeros(k)
    nearest = np.clip(np.zeros(k), box[1:, 0], box[1:, 1])[None]
    gain = evaluate(np.array([border]), nearest, parameters)[0, 4 : 4 + k]
    step = float(np.ptp(box[0])) * (1 if index else -1)
    K = stiffness(parameters, [border], places)
    softening = K - stiffness(parameters, [border + step], places)  # per step: linear in p there
    stable = _each_definite(K, np.zeros(places.shape))
    if not stable.any():
        return 1e-3 * abs(step), gain
    # the largest λ with softening v = λ K v
    L = np.linalg.inv(np.linalg.cholesky(K[stable]))
    worst = float(np.linalg.eigvalsh(L @ softening[stable] @ np.swapaxes(L, 1, 2)).max())
    return (STIFFNESS_SHARE * abs(step) / worst if worst > 0 else np.inf), gain


# Of the efforts' ranges: smaller changes of τ are no loss.
NEGLIGIBLE = 1e-7


@dataclass(frozen=True, eq=False)
class EnergyPolynomialLaw(JointLaw):
    """τ = −∂Π/∂u with Π(p, u) = Σ_t c_t φ_t(p, u), so that ∂τ_i/∂u_j = ∂τ_j/∂u_i everywhere.

    Π is continued outside the box of `domain`, so that τ stays C¹ in p and u and a gradient. With the excesses δ and
    φ(δ) = L tanh(δ/L):

    - in p: Π(p̂, u) + φ(δp) Π_p(p̂, u) − (δp − φ(δp)) g·u, g the gain ∂τ/∂p of the border at the u nearest to zero:
      the effort of p grows without bound, its influence on the stiffness saturates.
    - in u: terms of one axis by their second-order Taylor polynomial at the border, so that τ of an axis alone is
      linear there; terms that couple axes take û + φ(δu), so that coupling is bounded; and a convex term
      K L² (a²/2 + a − (1 + a) ln(1 + a)), a = |δu|/L, whose stiffness rises from zero to K.

    With the L of u, the largest of four, and the least K, half of the border's smallest stiffness remains at a few
    places outside: where the curvature of terms is largest, and where they are nearly constant (see `continuation`).

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
        """Return τ (n, k), ∂τ/∂p (n, k) and the symmetric ∂τ/∂u (n, k, k) for deformation (n, k)."""
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)
        k = len(self.axes)
        found = evaluate(p, u, self._parameters)
        slopes = found[:, 7:][:, UPPER[:k, :k].ravel()].reshape(-1, k, k)
        return Effort(found[:, 1 : 1 + k], found[:, 4 : 4 + k], slopes)

    def pruned(self, ranges: Array) -> EnergyPolynomialLaw:
        """Return law without the terms that together change τ in the box by less than `NEGLIGIBLE` of `ranges` (k,)."""
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
        """Return −∂τ/∂u (n, k, k) of the bare polynomial, without the cost of its continuation."""
        u = np.asarray(deformation, float)
        k = u.shape[1]
        matrix = np.empty((len(u), k, k))
        for i, j in combinations_with_replacement(range(k), 2):
            entry = self.basis.derivative(actuation, u, unit(1 + k, 1 + i, 1 + j)) @ self.coefficients
            matrix[:, i, j] = matrix[:, j, i] = entry
        return matrix

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Return Π(p, u) − Π(p, 0) in J, shape (n,), in closed form, continuation included."""
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)
        full = evaluate(p, u, self._parameters)[:, 0]
        return full - evaluate(p, np.zeros_like(u), self._parameters)[:, 0]

    def scalar(self) -> ScalarLaw:
        """Return the law as a scalar function for compiled engines."""
        return ScalarLaw(energy_effort, self._parameters, shared)

    @cached_property
    def _parameters(self) -> Array:
        box = np.concatenate([self.domain.actuation[None], self.domain.deformation])
        how = continuation(self.basis, self.coefficients, box)
        return packed(self.basis, self.coefficients, box, how)

    def draws(self, count: int, seed: int) -> tuple[JointLaw, ...]:
        """Return laws whose energy is reduced by the work of drawn errors (`mechanics.law_draws`), if any."""
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
        """Return terms, coefficients, scales, domain and error bar."""
        basis = self.basis
        arrays = {
            "exponents": basis.exponents.astype(float),
            "coefficients": self.coefficients,
            "actuation_map": basis.actuation_map,
            "deformation_map": basis.deformation_map,
        }
        return law_record(KIND, self, arrays, form="energy")

    @staticmethod
    def from_record(record: LawRecord) -> EnergyPolynomialLaw:
        """Return the law of a record, identical bit for bit."""
        read = float_arrays(record, "coefficients", "actuation_map", "deformation_map")
        coefficients = read.pop("coefficients")
        basis = EnergyBasis(np.asarray(record.arrays["exponents"], np.int64), **read)
        return EnergyPolynomialLaw(basis, coefficients, **shared_fields(record))
