"""A network of an energy: one hidden layer of smooth ridges beside a quadratic form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array

# Rows that are evaluated together: their hidden layer stays in the cache.
BLOCK = 512


@dataclass(frozen=True, eq=False)
class Network:
    """Π(p, u) = Σ_j c_j √(1 + z_j²) − (t + p g)·u + ½ uᵀ S u with z_j = w_j·(p, u) + b_j.

    The ridge √(1 + z²) has the slopes z/√(1 + z²) and (1 + z²)^{−3/2}: a sigmoid and its bell that cost a root and a
    division (Carlile et al., arXiv:1710.09967, as an activation). Its sums need no layer by layer derivatives.

    Attributes:
        weights: (m, 1 + k) w_j of actuation and deformations, in 1/Pa (1/N) and 1/rad (1/m).
        offsets: (m,) b_j.
        factors: (m,) c_j in J.
        effort: (k,) t in N·m.
        gain: (k,) g.
        stiffness: (k, k) S, symmetric.
    """

    weights: Array
    offsets: Array
    factors: Array
    effort: Array
    gain: Array
    stiffness: Array

    @property
    def n_axes(self) -> int:
        """Number k of the joint's axes."""
        return len(self.effort)

    @property
    def n_parameters(self) -> int:
        """Numbers that were fitted."""
        k = self.n_axes
        return self.weights.size + 2 * len(self.offsets) + 2 * k + k * (k + 1) // 2

    def energy(self, points: Array) -> Array:
        """(n,) Π at points (n, 1 + k) of actuation and deformations."""
        p, u = points[:, :1], points[:, 1:]
        z = points @ self.weights.T + self.offsets
        quadratic = np.sum(u * (u @ self.stiffness) / 2 - u * (self.effort + p * self.gain), axis=1)
        return np.sqrt(1 + z * z) @ self.factors + quadratic

    def efforts(self, points: Array) -> tuple[Array, Array, Array]:
        """τ = −∂Π/∂u (n, k), ∂τ/∂p (n, k) and the symmetric ∂τ/∂u (n, k, k) at points (n, 1 + k)."""
        n, k = len(points), self.n_axes
        of_u = self.weights[:, 1:] * self.factors[:, None]
        across = self.weights[:, :, None] * of_u[:, None, :]
        second = across.reshape(len(of_u), -1)
        tau, slopes = np.empty((n, k)), np.empty((n, (1 + k) * k))
        for start in range(0, n, BLOCK):
            rows = slice(start, start + BLOCK)
            z = points[rows] @ self.weights.T
            z += self.offsets
            bell = z * z
            bell += 1.0
            np.sqrt(bell, out=bell)
            np.divide(1.0, bell, out=bell)
            z *= bell
            tau[rows] = z @ of_u
            bell *= bell * bell
            slopes[rows] = bell @ second
        p, u = points[:, :1], points[:, 1:]
        tau = self.effort + p * self.gain - u @ self.stiffness - tau
        return tau, self.gain - slopes[:, :k], -self.stiffness - slopes[:, k:].reshape(n, k, k)

    def arrays(self) -> dict[str, Array]:
        """The network as arrays for a `LawRecord`."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}
