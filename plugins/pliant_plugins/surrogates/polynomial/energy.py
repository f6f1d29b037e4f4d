"""Polynomial energies Π(p, u) of a joint with k axes and the derivatives that laws and fits need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array

Exponents = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class EnergyBasis:
    """Terms φ_t(p, u) = x^{e_t0} Π_k v_k^{e_tk} with x = (p − p₀)/p₁ and v_k = (u_k − u₀_k)/u₁_k.

    Attributes:
        exponents: (m, 1 + k) powers of each term.
        actuation_map: (2,) p₀, p₁.
        deformation_map: (k, 2) u₀, u₁ of each axis.
    """

    exponents: Exponents
    actuation_map: Array
    deformation_map: Array

    def derivative(self, actuation: Array, deformation: Array, orders: tuple[int, ...]) -> Array:
        """(n, m) derivatives of all terms; `orders` (1 + k) says how often by p and by each u, e.g. (1, 1) is ∂p∂u."""
        coordinates = np.column_stack([np.asarray(actuation, float), np.asarray(deformation, float)])
        maps = np.vstack([self.actuation_map, self.deformation_map])
        out = np.ones((len(coordinates), len(self.exponents)))
        for d, (order, (centre, scale)) in enumerate(zip(orders, maps, strict=True)):
            powers = self.exponents[:, d]
            x = (coordinates[:, d] - centre) / scale
            table = np.vander(x, int(powers.max(initial=0)) + 1, increasing=True)
            factor = np.ones(len(powers))
            for k in range(order):
                factor = factor * np.maximum(powers - k, 0) / scale
            out *= factor * table[:, np.maximum(powers - order, 0)]
        return out


def unit(k: int, *places: int) -> tuple[int, ...]:
    """Orders of a derivative of a function of p and k deformations: place 0 is p, 1 … k the deformations."""
    orders = np.zeros(1 + k, int)
    for place in places:
        orders[place] += 1
    return tuple(int(order) for order in orders)
