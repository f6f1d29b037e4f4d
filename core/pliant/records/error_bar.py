"""Error bar of a law, from its errors on left-out states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from statistics import NormalDist
from typing import Protocol

import numpy as np

from pliant.records.design import Array

# Floor of the local error, as a share of the root mean square over all places.
FLOOR = 0.3
# Outside the box the band grows by its width for each of these shares of the box's half-width.
GROWTH = 0.25
# Number of points evaluated at once, to limit memory.
BLOCK = 4096
# States closer to the border than this share of the half-width are on it; smallest number of inner states for ranks.
BORDER, FEWEST_INNER = 1e-6, 5
ARRAYS = ("box", "places", "misses", "weights", "scores", "reach", "floor")


class ErrorBand(Protocol):
    """Interface of a law's error: any object that returns the half-width of its band."""

    def half_width(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array:
        """Return (n, a) half-widths at actuation (n,), or (n, m), and deformation (n, a), in the effort's unit."""
        ...


@dataclass(frozen=True, eq=False)
class ErrorBar:
    """Bands from residuals of left-out states, by normalised conformal prediction.

    The local size of the residuals at x = (p, u), scaled to [−1, 1] on the box, is a kernel mean

        s_a(x)² = Σ_m w_m k(x − x_m) e_ma² / Σ_m w_m k(x − x_m) + floor²

    and the half-width at a level is the level's quantile of the scores |e_ma| / s_a(x_m), each with place m excluded
    from s, times s_a(x). A fit with a model of its uncertainty provides that instead of the residuals, at any places,
    and the scores (`from_shape`) (Papadopoulos, Vovk, Gammerman, J. Artif. Intell. Res. 40, 2011;
    Vovk et al., Algorithmic Learning in a Random World, 2005). Levels are probabilities for states from the
    distribution of the left-out states.

    Attributes:
        box: (1 + a, 2) actuation and deformations, low and high; (m + a, 2) for m actuations.
        places: (m, 1 + a) scaled places of the left-out states.
        misses: (m, a) predicted minus true effort there, N·m (N for a prismatic joint), or its expected size.
        weights: (m,) of the places.
        scores: (k, a) sorted scores of each axis.
        reach: width of the kernel.
        floor: smallest root mean square of the residuals at any place.
    """

    box: Array
    places: Array
    misses: Array
    weights: Array
    scores: Array
    reach: float
    floor: float = FLOOR

    @staticmethod
    def from_residuals(
        box: Array, actuation: Array, deformation: Array, misses: Array, inner_scores: bool = False
    ) -> ErrorBar:
        """Return the bar of m left-out states: box (1 + a, 2), actuation (m,), deformation (m, a), residuals (m, a).

        Left-out states on the border of the box are predicted from one side only, worse than states inside. With
        `inner_scores` the ranks are those of the states inside, if there are at least `FEWEST_INNER`; the local sizes
        use all states.
        """
        box = np.asarray(box, float)
        places = _scaled(box, actuation, deformation)
        m, d = places.shape
        reach = float(m ** (-1.0 / (d + 4)))
        weights = np.ones(m)
        local = _local(places, places, misses, weights, reach, FLOOR, leave_own=True)
        scores = np.abs(misses) / np.maximum(local, np.finfo(float).tiny)
        inside = np.all(np.abs(places) < 1 - BORDER, axis=1)
        if inner_scores and np.sum(inside) >= FEWEST_INNER:
            scores = scores[inside]
        return ErrorBar(box, places, np.asarray(misses, float), weights, np.sort(scores, axis=0), reach)

    @staticmethod
    def from_shape(box: Array, places: Array, sizes: Array, scores: Array, reach: float) -> ErrorBar:
        """Return the bar of a fit with known uncertainty: `sizes` (m, a) at scaled `places` (m, 1 + a), any scale.

        `scores` (k, a) are residuals of left-out states over their predicted uncertainty in the same scale.
        """
        weights = np.ones(len(places))
        return ErrorBar(np.asarray(box, float), places, sizes, weights, np.sort(scores, axis=0), reach, 0.0)

    def half_width(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array:
        """Return (n, a) half-widths at actuation (n,) and deformation (n, a), in the effort's unit."""
        points = _scaled(self.box, actuation, deformation)
        inside = np.clip(points, -1.0, 1.0)
        blocks = np.array_split(inside, len(inside) // BLOCK + 1)
        bar = (self.places, self.misses, self.weights, self.reach, self.floor)
        local = np.concatenate([_local(block, *bar) for block in blocks])
        excess = np.abs(points - inside).max(axis=1)
        return np.asarray(local * (1 + excess / GROWTH)[:, None] * self.quantile(level))

    def quantile(self, level: float) -> Array:
        """Return (a,) the score that a state exceeds with probability 1 − level.

        It is the score of rank (k + 1) level, with linear interpolation between ranks (below the first toward 0). Above
        the resolution of k scores, the largest grows as quantiles of a normal error do.
        """
        k = len(self.scores)
        rank = (k + 1) * level
        if rank > k:
            normal = NormalDist()
            known, wanted = (normal.inv_cdf((1 + share) / 2) for share in (k / (k + 1), level))
            return np.asarray(self.scores[-1] * (wanted / known))
        below = int(rank)
        steps = np.vstack([np.zeros(self.scores.shape[1]), self.scores, self.scores[-1:]])
        return np.asarray(steps[below] + (rank - below) * (steps[below + 1] - steps[below]))

    def arrays(self) -> dict[str, Array]:
        """Return the bar as arrays for a `LawRecord`, with the prefix `error_` in their names."""
        return {f"error_{name}": np.asarray(getattr(self, name)) for name in ARRAYS}

    @staticmethod
    def from_arrays(arrays: Mapping[str, Array]) -> ErrorBar | None:
        """Return the bar that `arrays` wrote, or None without one."""
        if "error_box" not in arrays:
            return None
        fields = {name: np.asarray(arrays[f"error_{name}"], float) for name in ARRAYS[:-2]}
        return ErrorBar(**fields, reach=float(arrays["error_reach"]), floor=float(arrays["error_floor"]))


@dataclass(frozen=True, eq=False, init=False)
class BarsOfAxes(ErrorBar):
    """Bars of uncoupled axes, each a function of (p, u_a); an axis without a bar is assumed exact.

    It is not stored, since each axis' law contains its bar.
    """

    bars: tuple[ErrorBand | None, ...] = ()

    def __init__(self, bars: tuple[ErrorBand | None, ...]) -> None:
        object.__setattr__(self, "bars", bars)

    def half_width(self, actuation: Array, deformation: Array, level: float = 0.9) -> Array:
        """Return (n, a) half-widths, axis by axis."""
        u = np.asarray(deformation, float)
        widths = np.zeros_like(u)
        for k, bar in enumerate(self.bars):
            if bar is not None:
                widths[:, k] = bar.half_width(actuation, u[:, k : k + 1], level)[:, 0]
        return widths

    def quantile(self, level: float) -> Array:
        """Return (a,) the quantile of each axis."""
        return np.array([bar.quantile(level)[0] if isinstance(bar, ErrorBar) else 0.0 for bar in self.bars])


def _scaled(box: Array, actuation: Array, deformation: Array) -> Array:
    values = np.column_stack([np.asarray(actuation, float), np.asarray(deformation, float)])
    return np.asarray((values - box.mean(axis=1)) / (np.ptp(box, axis=1) / 2))


def _local(
    points: Array,
    places: Array,
    misses: Array,
    weights: Array,
    reach: float,
    floor: float,
    leave_own: bool = False,
) -> Array:
    """Return (n, a) local size of the residuals."""
    pairs = zip(points.T / reach, places.T / reach, strict=True)
    distance: Array = np.sum([np.subtract.outer(one, other) ** 2 for one, other in pairs], axis=0)
    if leave_own:
        np.fill_diagonal(distance, np.inf)
    nearest = np.where(np.isfinite(distance), distance, np.inf).min(axis=1, keepdims=True)
    kernel = weights * np.exp(-(distance - np.where(np.isfinite(nearest), nearest, 0.0)) / 2)
    squares = misses**2
    near = kernel @ squares / np.maximum(kernel.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    mean = np.average(squares, axis=0, weights=weights)
    return np.asarray(np.sqrt(near + floor**2 * mean))
