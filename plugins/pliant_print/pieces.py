"""Pieces of a chain along its centre line: runs of equal modules and rigid pieces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pliant.mechanics.rotations import exp_map
from pliant.records.design import Array
from pliant_print.module_solid import ModuleSolid


@dataclass(frozen=True, eq=False)
class StackedPiece:
    """Equal modules in a row, or a rigid piece (`module` is None), from `start_m` on along the chain's centre line.

    `rotation_rad` is about the centre line, relative to the base; `radius_m` that of a rigid rod; `inputs` name the
    signal in each cavity.
    """

    module: ModuleSolid | None
    count: int
    rotation_rad: float
    start_m: float
    length_m: float
    radius_m: float | None = None
    inputs: Mapping[str, str] = field(default_factory=dict)

    @property
    def end_m(self) -> float:
        return self.start_m + self.count * self.length_m


def module_pose(piece: StackedPiece, number: int) -> tuple[Array, Array]:
    """Return rotation and position of a module's frame in the frame of the base."""
    assert piece.module is not None
    rotation = exp_map(np.array([piece.rotation_rad, 0.0, 0.0]))
    centre = np.array([piece.start_m + (number + 0.5) * piece.length_m, 0.0, 0.0])
    return rotation, centre - rotation @ np.array([0.0, 0.0, piece.module.offset_m])
