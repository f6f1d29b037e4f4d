"""Histories of a chain under fractions of its load, for a page's load slider."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.formatting import display_unit
from pliant.records.design import Array
from pliant.records.rollout import Rollout


@dataclass(frozen=True, eq=False)
class LoadFrames:
    """Histories of the same actuations under other loads.

    Attributes:
        payload_kg: of the study, at the tip.
        force_n: of the study, at the tip.
        shares: (l,) of both; 1 is the study's own.
        joint_angles: (l, t, n, a).
        markers_m: (l, t, n + 2, 3).
    """

    payload_kg: float
    force_n: float
    shares: Array
    joint_angles: Array
    markers_m: Array

    @staticmethod
    def only(history: Rollout) -> LoadFrames:
        """Return the frames of a history under its own load only."""
        return LoadFrames(0.0, 0.0, np.ones(1), history.joint_angles[None], history.markers_m[None])

    @property
    def own(self) -> int:
        """The index of the study's own load."""
        return int(np.abs(self.shares - 1.0).argmin())

    @property
    def words(self) -> tuple[str, ...]:
        """The loads with their units; empty for a single load."""
        if len(self.shares) < 2:
            return ()
        parts = [(self.payload_kg, display_unit("kg")), (self.force_n, display_unit("N"))]
        return tuple(
            " and ".join(unit.text(share * size, 3) for size, unit in parts if size > 0.0)
            for share in self.shares.tolist()
        )
