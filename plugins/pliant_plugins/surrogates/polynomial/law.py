"""The polynomial joint law of one axis, with a smooth, stable continuation outside the box of its data."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pliant.records.design import Array
from pliant.records.law import Domain, Effort, JointKind, JointLaw, LawRecord, ScalarLaw
from pliant_plugins.surrogates.polynomial.scalar import axes_effort, block

KIND = "polynomial"
# A continuation in p may take at most this share of the boundary's stiffness.
STIFFNESS_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class PolynomialLaw(JointLaw):
    """τ(p, u) = Σ c_ij x^i v^j + c_odd u|u|, with x = (p − p₀)/p₁ and v = (u − u₀)/u₁.

    Outside the box of `domain`, with the nearest point (p̂, û) and the excesses δp, δu:

    - in p: τ(p̂, û) + φ(δp) τ_p(p̂, û) + (δp − φ(δp)) τ_p(p̂, u_r), with φ(δ) = L tanh(δ/L) and u_r the
      angle of the box nearest to zero. The push grows linearly without end while the change of stiffness
      saturates: L is such that at least half of the border's stiffness remains; L = ∞ where leaving the box
      only stiffens.
    - in u: linear in δu, with the slope at the border under the same pressure.

    Both steps are C¹ and commute, so τ is C¹ in p and u everywhere; at fixed p it is a scalar function of u,
    so it has the potential of `potential`. ∂τ/∂u < 0 on the border implies ∂τ/∂u < 0 everywhere outside.

    Attributes:
        coefficients: (I + 1, J + 1) c_ij, N·m.
        actuation_map: (2,) p₀, p₁.
        deformation_map: (2,) u₀, u₁.
        domain: the box of the data.
        odd: c_odd, N·m/rad².
    """

    coefficients: Array
    actuation_map: Array
    deformation_map: Array
    domain: Domain
    odd: float = 0.0
    actuation_name: str = "pressure_pa"
    axes: tuple[str, ...] = ("y",)
    joint: JointKind = "revolute"
    _table: Array = field(init=False, repr=False)
    _reach: Array = field(init=False, repr=False)
    _reference_gain: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_table", self._derivative_table())
        # Neutral values first: the true ones are read off the law on its border.
        object.__setattr__(self, "_reach", np.array([np.inf, np.inf]))
        object.__setattr__(self, "_reference_gain", np.zeros(2))
        sides = [self._side(index) for index in (0, 1)]
        object.__setattr__(self, "_reach", np.array([reach for reach, _ in sides]))
        object.__setattr__(self, "_reference_gain", np.array([gain for _, gain in sides]))

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """τ (n, 1), ∂τ/∂p (n, 1) and ∂τ/∂u (n, 1, 1) for actuation (n,) and deformation (n, 1)."""
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)[:, 0]
        inside = self._clip(u)
        du = u - inside
        tau, gain, slope, cross = self._in_pressure(p, inside)
        tau = tau + slope * du
        gain = gain + cross * du
        return Effort(tau[:, None], gain[:, None], slope[:, None, None])

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Π(p, u) − Π(p, 0) in J, shape (n,), in closed form, continuation included."""
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)[:, 0]
        return self._antiderivative(p, np.zeros_like(u)) - self._antiderivative(p, u)

    def scalar(self) -> ScalarLaw:
        """The same law for compiled engines; the continuation's reaches are held parameters there."""
        box = np.concatenate([self.domain.actuation[None], self.domain.deformation])
        maps = (self.actuation_map, self.deformation_map)
        parameters = block(self.coefficients, maps, box, self._reach, self._reference_gain, self.odd)
        return ScalarLaw(axes_effort, parameters)

    def record(self) -> LawRecord:
        """Coefficients, scales and domain; `Polynomial.load` makes the same law of them."""
        values = {
            "joint": self.joint,
            "axes": list(self.axes),
            "actuation_name": self.actuation_name,
            "odd": self.odd,
        }
        arrays = {
            "coefficients": self.coefficients,
            "actuation_map": self.actuation_map,
            "deformation_map": self.deformation_map,
            "domain_actuation": self.domain.actuation,
            "domain_deformation": self.domain.deformation,
        }
        return LawRecord(KIND, values, arrays)

    @staticmethod
    def of_record(record: LawRecord) -> PolynomialLaw:
        """The law of a record; both evaluate to the same bits."""
        arrays, values = record.arrays, record.values
        return PolynomialLaw(
            np.asarray(arrays["coefficients"], float),
            np.asarray(arrays["actuation_map"], float),
            np.asarray(arrays["deformation_map"], float),
            Domain(
                np.asarray(arrays["domain_actuation"], float), np.asarray(arrays["domain_deformation"], float)
            ),
            odd=float(values["odd"]),
            actuation_name=str(values["actuation_name"]),
            axes=tuple(values["axes"]),
            joint=values["joint"],
        )

    def _derivative_table(self) -> Array:
        """(I + 1, 4 (J + 3)): τ, ∂p τ, ∂u τ, ∂p∂u τ as polynomials in x over the columns v^j, u|u|, |u|."""
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

    def _clip(self, u: Array) -> Array:
        low, high = self.domain.deformation[0]
        return np.minimum(np.maximum(u, low), high)

    def _polynomials(self, p: Array, u: Array) -> Array:
        """(n, 4) τ, ∂p τ, ∂u τ, ∂p∂u τ of the bare polynomial."""
        x = (p - self.actuation_map[0]) / self.actuation_map[1]
        v = (u - self.deformation_map[0]) / self.deformation_map[1]
        columns = np.empty((len(u), self.coefficients.shape[1] + 2))
        columns[:, :-2] = np.vander(v, self.coefficients.shape[1], increasing=True)
        columns[:, -1] = np.abs(u)
        columns[:, -2] = u * columns[:, -1]
        rows = np.vander(x, len(self.coefficients), increasing=True) @ self._table
        result: Array = np.einsum("nkj,nj->nk", rows.reshape(len(u), 4, -1), columns)
        return result

    def _in_pressure(self, p: Array, u: Array) -> tuple[Array, Array, Array, Array]:
        """τ, ∂p τ, ∂u τ, ∂p∂u τ at angles inside the box, continued in p."""
        inside = np.minimum(np.maximum(p, self.domain.actuation[0]), self.domain.actuation[1])
        tau, gain, slope, cross = self._polynomials(inside, u).T
        dp = p - inside
        if not dp.any():
            return tau, gain, slope, cross
        reach, rate, reference = self._saturate(dp)
        return (
            tau + reach * gain + (dp - reach) * reference,
            rate * gain + (1 - rate) * reference,
            slope + reach * cross,
            rate * cross,
        )

    def _saturate(self, dp: Array) -> tuple[Array, Array, Array]:
        """φ(δp), φ'(δp) and the gain at the reference angle on the side that was left."""
        side = (dp > 0).astype(int)
        limit = self._reach[side]
        bounded = np.isfinite(limit)
        safe = np.where(bounded, limit, 1.0)
        tanh = np.tanh(dp / safe)
        return (
            np.where(bounded, safe * tanh, dp),
            np.where(bounded, 1 - tanh**2, 1.0),
            self._reference_gain[side],
        )

    def _side(self, index: int) -> tuple[float, float]:
        """L and the gain at the reference angle on the lower (0) or upper (1) side of the box in p."""
        border = self.domain.actuation[index]
        if not np.isfinite(border):
            return np.inf, 0.0
        low, high = np.clip(self.domain.deformation[0], -np.pi, np.pi)
        angles = np.append(np.linspace(low, high, 129), self._clip(np.zeros(1)))
        _, gain, slope, cross = self._polynomials(np.full(len(angles), border), angles).T
        softening = cross if index else -cross
        harmful = softening > 0
        if not harmful.any():
            return np.inf, float(gain[-1])
        reach = STIFFNESS_SHARE * np.min(np.maximum(-slope[harmful], 0.0) / softening[harmful])
        # An unstable border has nothing to protect: the law reports it, τ only has to stay defined.
        return float(max(reach, 1e-3 * self.actuation_map[1])), float(gain[-1])

    def _antiderivative(self, p: Array, u: Array) -> Array:
        """∫ τ du at fixed p, up to a function of p alone."""
        inside = self._clip(u)
        width = self.coefficients.shape[1]
        v = (inside - self.deformation_map[0]) / self.deformation_map[1]
        columns = np.empty((len(u), width + 1))
        powers = np.vander(v, width + 1, increasing=True)[:, 1:]
        columns[:, :-1] = powers * (self.deformation_map[1] / np.arange(1, width + 1))
        columns[:, -1] = inside**2 * np.abs(inside) / 3
        held = np.minimum(np.maximum(p, self.domain.actuation[0]), self.domain.actuation[1])
        x = np.vander(
            (held - self.actuation_map[0]) / self.actuation_map[1], len(self.coefficients), increasing=True
        )
        blocks = self._table.reshape(len(self.coefficients), 4, width + 2)[:, :2, :-1]
        area, area_gain = np.einsum("ni,ikj,nj->kn", x, blocks, columns)
        reach, _, reference = self._saturate(p - held)
        tau, _, slope, _ = self._in_pressure(p, inside)
        du = u - inside
        full: Array = area + reach * area_gain + (p - held - reach) * reference * inside
        return full + tau * du + slope * du**2 / 2


def largest_slope(law: JointLaw) -> float:
    """Largest ∂τ/∂u of a one-axis law on a 61 × 61 grid of its (finite) domain, N·m/rad."""
    (low_p, high_p), (low_u, high_u) = law.domain.actuation, law.domain.deformation[0]
    p, u = np.meshgrid(np.linspace(low_p, high_p, 61), np.linspace(low_u, high_u, 61))
    return float(law.evaluate(p.ravel(), u.reshape(-1, 1)).dtau_du.max())
