"""One-axis laws with τ inside a box: a smooth, stable continuation outside it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from pliant.records.design import Array
from pliant.records.law import Effort, JointLaw

# Represents "without limit" in parameters, which are finite numbers.
UNBOUNDED = 1e300
# A continuation in p may take at most this share of the boundary's stiffness.
STIFFNESS_SHARE = 0.5


class ContinuedLaw(JointLaw):
    """A law of one axis that gives τ and its slopes inside the box of `domain`; what follows outside is here.

    With the nearest point (p̂, û) of the box and the excesses δp, δu:

    - in p: τ(p̂, û) + φ(δp) τ_p(p̂, û) + (δp − φ(δp)) τ_p(p̂, u_r), with φ(δ) = L tanh(δ/L) and u_r the
      angle of the box nearest to zero. The push grows linearly without end while the change of stiffness
      saturates: L is such that at least half of the border's stiffness remains; L = ∞ where leaving the box
      only stiffens.
    - in u: linear in δu, with the slope at the border under the same pressure.

    Both steps are C¹ and commute, so τ is C¹ in p and u everywhere; at fixed p it is a scalar function of u,
    so it has the potential of `potential`. ∂τ/∂u < 0 on the border implies ∂τ/∂u < 0 everywhere outside.
    """

    _reach: Array
    _reference_gain: Array

    @abstractmethod
    def _inside(self, p: Array, u: Array) -> Array:
        """Return (n, 4) τ, ∂p τ, ∂u τ, ∂p∂u τ at points of the box."""

    @abstractmethod
    def _areas(self, p: Array, u: Array) -> Array:
        """Return (2, n) ∫ τ du and ∫ ∂p τ du from a fixed angle, the same for all p, to u; points of the box."""

    def _continue(self) -> None:
        """Read the continuation off the law on its border; called once, when the law is made."""
        # Neutral values first: the true ones need the law.
        object.__setattr__(self, "_reach", np.array([np.inf, np.inf]))
        object.__setattr__(self, "_reference_gain", np.zeros(2))
        sides = [self._side(index) for index in (0, 1)]
        object.__setattr__(self, "_reach", np.array([reach for reach, _ in sides]))
        object.__setattr__(self, "_reference_gain", np.array([gain for _, gain in sides]))

    def evaluate(self, actuation: Array, deformation: Array) -> Effort:
        """Return τ (n, 1), ∂τ/∂p (n, 1) and ∂τ/∂u (n, 1, 1) for actuation (n,) and deformation (n, 1)."""
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)[:, 0]
        inside = self._clip(u)
        du = u - inside
        tau, gain, slope, cross = self._in_pressure(p, inside)
        tau = tau + slope * du
        gain = gain + cross * du
        return Effort(tau[:, None], gain[:, None], slope[:, None, None])

    def potential(self, actuation: Array, deformation: Array) -> Array:
        """Return Π(p, u) − Π(p, 0) in J, shape (n,), in closed form, continuation included."""
        p, u = np.asarray(actuation, float), np.asarray(deformation, float)[:, 0]
        return self._antiderivative(p, np.zeros_like(u)) - self._antiderivative(p, u)

    def _clip(self, u: Array) -> Array:
        low, high = self.domain.deformation[0]
        return np.minimum(np.maximum(u, low), high)

    def _in_pressure(self, p: Array, u: Array) -> tuple[Array, Array, Array, Array]:
        """Return τ, ∂p τ, ∂u τ, ∂p∂u τ at angles inside the box, continued in p."""
        inside = np.minimum(np.maximum(p, self.domain.actuation[0]), self.domain.actuation[1])
        tau, gain, slope, cross = self._inside(inside, u).T
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
        """Return φ(δp), φ'(δp) and the gain at the reference angle on the side that was left."""
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
        """Return L and the gain at the reference angle on the lower (0) or upper (1) side of the box in p."""
        border = self.domain.actuation[index]
        if not np.isfinite(border):
            return np.inf, 0.0
        low, high = np.clip(self.domain.deformation[0], -np.pi, np.pi)
        angles = np.append(np.linspace(low, high, 129), self._clip(np.zeros(1)))
        _, gain, slope, cross = self._inside(np.full(len(angles), border), angles).T
        softening = cross if index else -cross
        harmful = softening > 0
        if not harmful.any():
            return np.inf, float(gain[-1])
        reach = STIFFNESS_SHARE * np.min(np.maximum(-slope[harmful], 0.0) / softening[harmful])
        # An unstable border needs no protection: the law reports it, τ only has to stay defined.
        return float(max(reach, 1e-3 * self._half_width())), float(gain[-1])

    def _half_width(self) -> float:
        """Return half the width of the box in p."""
        return float(np.ptp(self.domain.actuation)) / 2

    def _antiderivative(self, p: Array, u: Array) -> Array:
        """Return ∫ τ du at fixed p, up to a function of p alone."""
        inside = self._clip(u)
        held = np.minimum(np.maximum(p, self.domain.actuation[0]), self.domain.actuation[1])
        area, area_gain = self._areas(held, inside)
        reach, _, reference = self._saturate(p - held)
        tau, _, slope, _ = self._in_pressure(p, inside)
        du = u - inside
        full: Array = area + reach * area_gain + (p - held - reach) * reference * inside
        return full + tau * du + slope * du**2 / 2


def share_actuation(
    parameters: Array, share: float, header: int, acting: Sequence[int], gains: slice
) -> Array:
    """Return parameters of a law of independent axes whose actuation is `share` times the given one.

    `parameters` has a block for each axis: `header` numbers, the first two the shape of the coefficients after them.

    Args:
        acting: places in a block of what has the unit of the actuation.
        gains: places of what has the inverse unit.
    """
    scaled, start = np.array(parameters, float), 0
    while start < len(scaled):
        for place in acting:
            if abs(scaled[start + place]) < UNBOUNDED:
                scaled[start + place] /= share
        scaled[start + gains.start : start + gains.stop] *= share
        start += header + round(scaled[start]) * round(scaled[start + 1])
    return scaled
