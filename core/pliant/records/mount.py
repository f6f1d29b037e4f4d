"""Mount of a chain whose base is not fixed in the world: an imported arm and its pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pliant.records.design import Array


@dataclass(frozen=True, eq=False)
class Mount:
    """An arm in a file of the engine's format; the chain's base pose is in the frame of one of its sites or bodies.

    Attributes:
        file: the arm's.
        at: name of the site or body.
        keyframe: initial pose and actuator commands of the arm; None: the file's first, else its zero pose.
        joints: position by name, rad or m, replacing the keyframe's; also the command of a position servo there.
        ctrl: command by actuator, in its own unit.
        units: rad or m, of those `joints` that were stated with a unit.
    """

    file: Path
    at: str
    keyframe: str | None = None
    joints: Mapping[str, float] = field(default_factory=dict)
    ctrl: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Carrier:
    """The arm under a chain at one instant, or at several: arrays then have these as their first axis.

    Attributes:
        names: of its joints with one coordinate, unit at the end.
        coordinates: (…, k) of these joints, rad or m.
        position_m, rotation: (…, 3) and (…, 3, 3) the mount's frame in the world.
        moved_m: (…, 3) displacement of its origin from the arm's first pose.
        bodies_m, body_rotations: (…, b, 3) and (…, b, 3, 3) frames of the arm's bodies.
    """

    names: tuple[str, ...]
    coordinates: Array
    position_m: Array
    rotation: Array
    moved_m: Array
    bodies_m: Array
    body_rotations: Array

    @staticmethod
    def stacked(each: Sequence[Carrier | None]) -> Carrier | None:
        """Stack the carriers of several instants; return None without a mount."""
        known = [one for one in each if one is not None]
        if not known:
            return None

        def column(name: str) -> Any:
            return np.array([getattr(one, name) for one in known])

        arrays = ("coordinates", "position_m", "rotation", "moved_m", "bodies_m", "body_rotations")
        return Carrier(known[0].names, *map(column, arrays))

    def on_mount(self, points_m: Array) -> Array:
        """Transform world points (…, 3) to the frame of the mount, at one instant."""
        return np.asarray((points_m - self.position_m) @ self.rotation)

    def in_world(self, points_m: Array) -> Array:
        """Transform points (…, 3) of the mount's frame to the world, at one instant."""
        return np.asarray(points_m @ self.rotation.T + self.position_m)
