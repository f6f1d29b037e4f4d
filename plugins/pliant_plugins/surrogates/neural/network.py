"""A network of an energy: one hidden layer of smooth ridges beside a quadratic form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array

# Rows that are evaluated together: their hidden layer stays in the cache.
BLOCK = 512


@dataclass(frozen=True, eq=False)
class Network:
    """Π(p, u) = Σ_j c_j √(1 + z_j²) − (t + g p)·u + ½ uᵀ S u with z_j = w_j·(p, u) + b_j, p of one input or of several.

    The ridge √(1 + z²) has the slopes z/√(1 + z²) and (1 + z²)^{−3/2}: a sigmoid and its bell that cost a root and a
    division (Carlile et al., arXiv:1710.09967, as an activation). Its sums need no layer by layer derivatives.

    Attributes:
        weights: (units, m + k) w_j of m actuations and k deformations, in 1/Pa (1/N) and 1/rad (1/m).
        offsets: (units,) b_j.
        factors: (units,) c_j in J.
        effort: (k,) t in N·m.
        gain: (k,) g; (k, m) of several actuations.
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
    def n_inputs(self) -> int:
        """Number m of actuations."""
        return self.weights.shape[1] - self.n_axes

    @property
    def gains(self) -> Array:
        """(k, m) g."""
        return self.gain.reshape(self.n_axes, self.n_inputs)

    @property
    def n_parameters(self) -> int:
        """Numbers that were fitted."""
        k = self.n_axes
        return self.weights.size + 2 * len(self.offsets) + k + self.gain.size + k * (k + 1) // 2

    def energy(self, points: Array) -> Array:
        """(n,) Π at points (n, m + k) of actuations and deformations."""
        p, u = np.split(points, [self.n_inputs], axis=1)
        z = points @ self.weights.T + self.offsets
        quadratic = np.sum(u * (u @ self.stiffness) / 2 - u * (self.effort + p @ self.gains.T), axis=1)
        return np.sqrt(1 + z * z) @ self.factors + quadratic

    def efforts(self, points: Array) -> tuple[Array, Array, Array]:
        """τ = −∂Π/∂u (n, k), ∂τ/∂p (n, k, m) and the symmetric ∂τ/∂u (n, k, k) at points (n, m + k)."""
        n, k, m = len(points), self.n_axes, self.n_inputs
        of_u = self.weights[:, m:] * self.factors[:, None]
        across = self.weights[:, :, None] * of_u[:, None, :]
        second = across.reshape(len(of_u), -1)
        tau, slopes = np.empty((n, k)), np.empty((n, (m + k) * k))
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
        p, u = np.split(points, [m], axis=1)
        tau = self.effort + p @ self.gains.T - u @ self.stiffness - tau
        by_p, by_u = np.split(slopes, [m * k], axis=1)
        gain = self.gains - np.swapaxes(by_p.reshape(n, m, k), 1, 2)
        return tau, gain, -self.stiffness - by_u.reshape(n, k, k)

    def arrays(self) -> dict[str, Array]:
        """The network as arrays for a `LawRecord`."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}
