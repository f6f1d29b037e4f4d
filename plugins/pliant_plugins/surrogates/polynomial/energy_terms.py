"""Sets of terms of a polynomial energy, among which a fit chooses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from pliant.records.design import Array
from pliant_plugins.surrogates.polynomial.energy import Exponents

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
class Coupling:
    """Terms with lateral axes: exponents i, j and l with i/`actuation` + j/`main` + Σ l/`lateral` ≤ 1."""

    actuation: int
    main: int
    lateral: int
    parity: Parity


def main_sets(max_main: int) -> list[Main]:
    """All sets of the main axis, small ones first."""
    found = [
        Main(max(1, round(share * top)), top) for top in range(2, max_main + 1) for share in ACTUATION_SHARES
    ]
    return list(dict.fromkeys(found))


def coupling_sets(parity: Parity, max_main: int) -> list[Coupling]:
    """All sets of lateral axes of one parity, small ones first."""
    mains = range(2, max_main + 1, 2)
    found = [
        Coupling(max(1, round(share * top)), top, lateral, parity)
        for top, lateral, share in product(mains, LATERAL_DEGREES, ACTUATION_SHARES)
        if lateral <= max(top, 4)
    ]
    return list(dict.fromkeys(found))


def terms_of(sets: Sequence[Main | Coupling], axes: int, main: int, with_rest: bool) -> Exponents:
    """(m, 1 + k) exponents; `with_rest` keeps terms of the actuation alone, which have no effort."""
    exponents = np.concatenate([_terms(one, axes, main) for one in sets])
    kept: Exponents = exponents if with_rest else exponents[exponents[:, 1:].any(axis=1)]
    return kept


def _terms(one: Main | Coupling, axes: int, main: int) -> Exponents:
    lateral = [1 + k for k in range(axes) if k != main]
    top = one.lateral if isinstance(one, Coupling) else 0
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
    found: Exponents = grid[kept].astype(np.int64)
    return found
