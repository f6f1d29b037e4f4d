"""First-order directions of effects: the changes of the readings that they could explain in a residual."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.evidence_table import NOTHING, Kinds, sorted_kinds
from pliant.diagnosis.excitation import Excitation
from pliant.records.design import Array

# Directions shorter than this share of the longest, or of their remainder after projection, are dropped.
SHORT = 1e-6


@dataclass(frozen=True, eq=False)
class Directions:
    """The directions of each kind in the space of the readings.

    Attributes:
        kinds: all of them.
        columns: (N, m) unit vectors.
        owner: (m,) index of the kind of each.
        there: (N,) readings at which every direction is known.
        gram: (m, m) their products.
    """

    kinds: tuple[str, ...]
    columns: Array
    owner: NDArray[np.intp]
    there: NDArray[np.bool_]
    gram: Array

    @staticmethod
    def from_fits(
        kinds: Sequence[str],
        fits: Mapping[Kinds, EffectFit],
        shown: Mapping[str, Excitation],
        most_lost: float,
        whitened: Callable[[Array], Array] = lambda values: values,
    ) -> Directions:
        """Return directions from fits of single effects and their plausible ends; none without an equilibrium.

        Args:
            kinds, fits, shown: effects, fits of each alone, and each at its plausible end.
            most_lost: the share of readings without an equilibrium at which a direction is still used.
            whitened: removes the possible changes by the law's own error from (N,) readings.
        """
        nothing = fits[NOTHING]
        found: list[tuple[int, Array]] = []
        for number, kind in enumerate(kinds):
            fit, end = fits[(kind,)], shown[kind]
            pieces = [nothing.raw - fit.raw, *fit.slopes.T, end.change, *end.slopes.T]
            known = [p for p in pieces if np.isnan(p).mean() <= most_lost]
            found += [(number, whitened(p) if np.isfinite(p).all() else p) for p in known]
        there = (
            np.all([np.isfinite(piece) for _, piece in found], axis=0) if found else np.isfinite(nothing.raw)
        )
        lengths = [float(np.linalg.norm(piece[there])) for _, piece in found]
        longest = max(lengths, default=0.0)
        kept = [
            (n, p[there] / size)
            for (n, p), size in zip(found, lengths, strict=True)
            if size > SHORT * longest
        ]
        columns = np.array([p for _, p in kept]).T.reshape(int(there.sum()), len(kept))
        return Directions(
            tuple(kinds), columns, np.array([n for n, _ in kept], np.intp), there, columns.T @ columns
        )

    def highest_ranked(self, residual: Array, size: int, count: int) -> list[Kinds]:
        """Return the `count` sets of `size` effects that could explain most of a residual (N,), the best first."""
        right = self.columns.T @ residual[self.there]
        places = self._places()
        names = [kind for kind in self.kinds if len(places[kind])]
        gains = {}
        for kinds in itertools.combinations(names, size):
            at = np.concatenate([places[kind] for kind in kinds])
            gains[sorted_kinds(kinds)] = self._explained(at, right)
        return sorted(gains, key=lambda kinds: -gains[kinds])[:count]

    def next_to(self, residual: Array, slopes: Array, without: Sequence[str], count: int) -> list[str]:
        """Return the `count` kinds, except `without`, that explain most in addition to a base's slopes (N, k)."""
        basis = slopes[self.there]
        basis = basis[:, np.linalg.norm(basis, axis=0) > 0.0]
        rest, columns = residual[self.there], self.columns
        if basis.shape[1]:
            q = np.linalg.qr(basis)[0]
            rest, columns = rest - q @ (q.T @ rest), columns - q @ (q.T @ columns)
        beside = Directions(self.kinds, columns, self.owner, self.there, columns.T @ columns)
        right, places = columns.T @ rest, self._places()
        gains = {k: beside._explained(at, right) for k, at in places.items() if len(at) and k not in without}
        return sorted(gains, key=lambda kind: -gains[kind])[:count]

    def _places(self) -> dict[str, NDArray[np.intp]]:
        return {kind: np.flatnonzero(self.owner == number) for number, kind in enumerate(self.kinds)}

    def _explained(self, at: NDArray[np.intp], right: Array) -> float:
        """Return the sum of squares of the projection of a vector on some columns, by their normal equations."""
        values, vectors = np.linalg.eigh(self.gram[np.ix_(at, at)])
        felt = values > SHORT * max(float(values[-1]), 1.0)
        along = vectors[:, felt].T @ right[at]
        return float(np.sum(along**2 / values[felt]))
