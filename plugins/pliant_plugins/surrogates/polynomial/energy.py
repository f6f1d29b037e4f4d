"""Polynomial energies Π(p, u) of a joint with k axes, the derivatives that laws and fits need, and sets of terms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

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
        """Return (n, m) derivatives of all terms; `orders` (1 + k) by p and by each u, e.g. (1, 1) is ∂p∂u."""
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


def unit(coordinates: int, *places: int) -> tuple[int, ...]:
    """Return the orders of a derivative by the coordinates at `places`, once by each; actuations come first."""
    orders = np.zeros(coordinates, int)
    for place in places:
        orders[place] += 1
    return tuple(int(order) for order in orders)


# Of a module with mirror planes the energy is even in every lateral axis, or in all of them together.
Parity = Literal["each", "together", "none"]
PARITIES: tuple[Parity, ...] = ("each", "together", "none")
# Degree in the actuation, as shares of the degree in the main axis.
ACTUATION_SHARES = (1 / 3, 1 / 2, 1.0)
LATERAL_DEGREES = (2, 4, 6, 8)


@dataclass(frozen=True)
class Main:
    """Terms of the actuation and the main axis alone: exponents i and j with i/`actuation` + j/`main` ≤ 1."""

    actuation: int
    main: int


@dataclass(frozen=True)
class CoupledTerms:
    """Terms with lateral axes: exponents i, j and l with i/`actuation` + j/`main` + Σ l/`lateral` ≤ 1."""

    actuation: int
    main: int
    lateral: int
    parity: Parity


def main_sets(max_main: int) -> list[Main]:
    """Return all sets of terms of the main axis, small ones first."""
    found = [
        Main(max(1, round(share * top)), top) for top in range(2, max_main + 1) for share in ACTUATION_SHARES
    ]
    return list(dict.fromkeys(found))


def coupling_sets(parity: Parity, max_main: int) -> list[CoupledTerms]:
    """Return all sets of terms of lateral axes of one parity, small ones first."""
    mains = range(2, max_main + 1, 2)
    found = [
        CoupledTerms(max(1, round(share * top)), top, lateral, parity)
        for top, lateral, share in product(mains, LATERAL_DEGREES, ACTUATION_SHARES)
        if lateral <= max(top, 4)
    ]
    return list(dict.fromkeys(found))


def merge_exponents(sets: Sequence[Main | CoupledTerms], axes: int, main: int, with_rest: bool) -> Exponents:
    """Return (m, 1 + k) exponents; `with_rest` keeps terms of the actuation alone, which have no effort."""
    exponents = np.concatenate([_terms(one, axes, main) for one in sets])
    return exponents if with_rest else exponents[exponents[:, 1:].any(axis=1)]


def _terms(one: Main | CoupledTerms, axes: int, main: int) -> Exponents:
    lateral = [1 + k for k in range(axes) if k != main]
    top = one.lateral if isinstance(one, CoupledTerms) else 0
    tops = [one.actuation, *(one.main if k == main else top for k in range(axes))]
    grid = np.indices([top + 1 for top in tops]).reshape(len(tops), -1).T
    beside: Array = grid[:, lateral].sum(axis=1)
    share = grid[:, 0] / one.actuation + grid[:, 1 + main] / one.main
    if isinstance(one, Main):
        kept = share <= 1 + 1e-9
    else:
        kept = (share + beside / one.lateral <= 1 + 1e-9) & (beside > 0)
        if one.parity == "each":
            kept &= np.all(grid[:, lateral] % 2 == 0, axis=1)
        elif one.parity == "together":
            kept &= beside % 2 == 0
    return grid[kept].astype(np.int64)
