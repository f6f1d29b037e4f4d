"""Clearance of a chain from obstacles, as a residual of inverse statics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.mechanics.signed_distance import Solid, nearest
from pliant.records.design import Array

# Points on each straight piece of the chain, the end of the piece included.
PIECE_POINTS = 6


@dataclass(frozen=True, eq=False)
class Clearance:
    """A distance that the chain's capsules keep from all obstacles.

    Attributes:
        solids: the obstacles.
        radius_m: of the capsules, whose axes are the straight pieces between markers.
        least_m: the distance to keep.
        weight: of a metre of missing clearance against a metre of the target's distance.
    """

    solids: tuple[Solid, ...]
    radius_m: float
    least_m: float
    weight: float = 10.0

    def smallest_m(self, markers_m: Array) -> float:
        """Return the smallest distance of the capsules' surface from any obstacle; negative where they overlap."""
        return float(nearest(self.solids, _on_pieces(markers_m)).value_m.min()) - self.radius_m

    def residual(self, markers_m: Array, by_input: Array) -> tuple[Array, Array]:
        """Return weighted missing clearance (m,) of each point, and its slopes (m, k) by the inputs.

        Args:
            markers_m: (n + 2, 3) base, joints, tip.
            by_input: (k, n + 2, 3) their slopes.
        """
        points, moved = _on_pieces(markers_m), _on_pieces(by_input)
        value, normal = nearest(self.solids, points)
        missing = self.radius_m + self.least_m - value
        active = (missing > 0.0)[:, None]
        slopes = -np.einsum("mi,kmi->mk", normal, moved)
        return self.weight * np.maximum(missing, 0.0), self.weight * np.where(active, slopes, 0.0)

    def squared(self, markers_m: Array) -> Array:
        """Return (s,) the squared length of the residual of each of s chains (s, n + 2, 3)."""
        points = _on_pieces(markers_m)
        value = nearest(self.solids, points.reshape(-1, 3)).value_m.reshape(points.shape[:-1])
        missing = np.maximum(self.radius_m + self.least_m - value, 0.0)
        return np.asarray(self.weight**2 * np.sum(missing**2, axis=-1))


def _shares() -> Array:
    return np.linspace(0.0, 1.0, PIECE_POINTS + 1)[1:]


def _on_pieces(markers: Array) -> Array:
    """Return (…, m, 3) the points on the straight pieces between markers (…, n + 2, 3); the base itself is left out."""
    start, along = markers[..., :-1, None, :], np.diff(markers, axis=-2)[..., None, :]
    points = start + _shares()[:, None] * along
    return np.asarray(points.reshape(*markers.shape[:-2], -1, 3))
