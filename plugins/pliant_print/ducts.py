"""Openings of two end sections that face each other: ducts between them, and channels to cavities of another input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from pliant.errors import NotReachedError
from pliant.records.design import Array
from pliant_print.boolean import cylinder
from pliant_print.loops import Loop, deepest_point, reversed_loop
from pliant_print.pieces import StackedPiece, module_pose

DUCT = 0.6  # of the largest circle in an opening: radius of a duct between openings that do not meet
CHANNEL = 0.8  # of the largest circle in an opening: most of it that a channel takes
NEAR = 1e-3  # of the size: a cavity's node so near to an opening lies on it
CRUMB_MM3 = 1e-3


@dataclass(frozen=True, eq=False)
class Openings:
    """Loops of an end section: `holes` by the name of their cavity, `bores` without a pressure."""

    loops: Sequence[Loop]
    holes: Mapping[str, Loop]
    bores: Sequence[Loop]


def section_openings(piece: StackedPiece, loops: Sequence[Loop]) -> Openings:
    """Return the openings of a run's end, named by the cavities of its modules."""
    assert piece.module is not None
    rotation, _ = module_pose(piece, 0)
    shift = rotation @ np.array([0.0, 0.0, -piece.module.offset_m])
    trees = {
        name: cKDTree((points @ rotation.T + shift)[:, 1:]) for name, points in piece.module.cavities.items()
    }
    holes: dict[str, Loop] = {}
    bores: list[Loop] = []
    for loop in loops:
        if not loop.is_hole:
            continue
        size = float(np.ptp(loop.points_m, axis=0).max())
        away = {name: float(tree.query(loop.points_m)[0].min()) for name, tree in trees.items()}
        name = min(away, key=lambda one: away[one], default="")
        if name and away[name] < NEAR * size + 1e-6:
            holes[name] = loop
        else:
            bores.append(loop)
    return Openings(loops, holes, bores)


def ducts(left: Openings, right: Openings, low_m: float, high_m: float, closed: Sequence[str]) -> list[Any]:
    """Return a duct for each pair of openings, without the closed cavities: the hull of a disc in either.

    Raises:
        NotReachedError: two ducts would meet.
    """
    pairs = [(one, right.holes[name], DUCT) for name, one in left.holes.items() if name in right.holes]
    open_pairs = [pair for pair in pairs if pair[0] not in [left.holes[name] for name in closed]]
    straight = [(a, b, 1.0) for a, b in zip(left.bores, right.bores, strict=False)]
    made: list[Any] = []
    for a, b, share in (*open_pairs, *straight):
        (p, p_radius), (q, q_radius) = _circle(a), _circle(b)
        radius = share * min(p_radius, q_radius)
        duct = cylinder([low_m, *p], [high_m, *p], radius) + cylinder([low_m, *q], [high_m, *q], radius)
        made.append(duct.hull())
        if any(float((made[-1] ^ other).volume()) > CRUMB_MM3 for other in made[:-1]):
            raise NotReachedError(
                f"at {1e3 * low_m:.4g} mm the ducts of two cavities would meet, since the segments are turned against "
                "each other; nothing was written. Turn a segment by less, or give its chambers inputs of their own."
            )
    return made


def supply(section: Openings, name: str, low_m: float, high_m: float, width_m: float) -> Any:
    """Return the channel of a cavity that begins at `high`: back into the wall from `low` on, then aside.

    It leads to the bore if the section has one, else to the outside.
    """
    point, reach = _circle(section.holes[name])
    radius = min(width_m / 2, CHANNEL * reach, (high_m - low_m) / 4)
    middle = (low_m + high_m) / 2
    start = np.array([middle, *point])
    if section.bores:
        end = np.array([middle, *_circle(section.bores[0])[0]])
    else:
        rim = max(float(np.linalg.norm(one.points_m, axis=1).max()) for one in section.loops)
        end = np.array([middle, *(2 * rim * point / np.linalg.norm(point))])
    inward = cylinder(start - [radius, 0, 0], [high_m, *point], radius)
    return inward + cylinder(start, end, radius)


def _circle(loop: Loop) -> tuple[Array, float]:
    """Return centre and radius (m) of the largest circle in a hole."""
    return deepest_point(reversed_loop(loop))
