"""The network of an energy over designs: one hidden layer of the design, one of actuation and deformation.

    Π(p, u; s) / E(s) = Σ_j c_j √(1 + z_j²) − (t + x g)·v + ½ vᵀ S v,  z_j = w_j·(x, v) + b_j
    (b, c, t, g, S)(s) = W₂ tanh(W₁ s + a₁) + a₂

with x = p / p_max, v_k = u_k / u_k(s) and the reaches u_k(s) and energy E(s) of the common form. For one design it is a
`Network` of the neural surrogate, whose offsets and factors hold the design.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array
from pliant_plugins.surrogates.neural.network import Network


@dataclass(frozen=True, eq=False)
class RidgeFamily:
    """The weights of the network.

    Attributes:
        inner: (d, h) W₁; inner_bias: (h,) a₁.
        outer: (h, q) W₂; outer_bias: (q,) a₂, in the order b (m), c (m), t (k), g (k), S (k, k).
        ridges: (m, 1 + k) w.
        mirror: (k,) −1 for axes whose sign, together, leaves the energy as it is; all 1 without such a symmetry.
    """

    inner: Array
    inner_bias: Array
    outer: Array
    outer_bias: Array
    ridges: Array
    mirror: Array

    def network(self, place: Array, energy: float, top: float, reach: Array) -> Network:
        """The network of a design with scaled parameters (d,), in SI."""
        m, k = len(self.ridges), len(reach)
        hidden = np.tanh(place @ self.inner + self.inner_bias)
        values = hidden @ self.outer + self.outer_bias
        offsets, factors, effort, gain, matrix = np.split(values, np.cumsum([m, m, k, k]))
        stiffness = symmetric(matrix.reshape(k, k))
        weights = self.ridges / np.concatenate([[top], reach])
        if np.any(self.mirror < 0):
            own = (1 + self.mirror) / 2
            effort, gain = effort * own, gain * own
            stiffness = (stiffness + stiffness * np.outer(self.mirror, self.mirror)) / 2
            weights = np.concatenate([weights, weights * np.concatenate([[1.0], self.mirror])])
            offsets, factors = np.tile(offsets, 2), np.tile(factors, 2) / 2
        return Network(
            weights,
            offsets,
            energy * factors,
            energy * effort / reach,
            energy * gain / (top * reach),
            energy * stiffness / np.outer(reach, reach),
        )

    def arrays(self) -> dict[str, Array]:
        """The weights by name."""
        return {f"ridge_{name}": getattr(self, name) for name in self.__dataclass_fields__}

    @staticmethod
    def of_arrays(arrays: Mapping[str, Array]) -> RidgeFamily:
        """The weights that `arrays` gave."""
        return RidgeFamily(
            **{name: np.asarray(arrays[f"ridge_{name}"], float) for name in RidgeFamily.__dataclass_fields__}
        )


def symmetric(matrix: Array) -> Array:
    """(k, k) from any."""
    found: Array = (matrix + matrix.T) / 2
    return found
