"""Touching points of a Bullet world as records, in SI."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType

import numpy as np

from pliant.records.scene import Contact, Part
from pliant_plugins.physics.pybullet.scaling import WorldScale

ORDER = {"arm": 0, "object": 1, "floor": 2}


def read_contacts(
    bullet: ModuleType, client: int, parts: Mapping[int, Part], scale: WorldScale
) -> tuple[Contact, ...]:
    """Contacts with the forces of the last step; of two bodies, arms come first, then objects by number."""
    found = []
    for point in bullet.getContactPoints(physicsClientId=client):
        _, a, b, link_a, link_b, on_a, on_b, normal_on_b, distance, press, along1, dir1, along2, dir2 = point
        if press <= 0.0 and distance > 0.0:
            continue
        first, second = _part(parts[a], link_a), _part(parts[b], link_b)
        # Bullet's normal points from b to a, and its forces are those on a.
        to_a = np.asarray(normal_on_b, float)
        on_first = along1 * np.asarray(dir1, float) + along2 * np.asarray(dir2, float)
        sign = -1.0
        if (ORDER[first.kind], first.number) > (ORDER[second.kind], second.number):
            first, second, sign = second, first, 1.0
        middle = 0.5 * (np.asarray(on_a, float) + np.asarray(on_b, float)) / scale.length
        found.append(
            Contact(first, second, middle, sign * to_a, press / scale.force, sign * on_first / scale.force)
        )
    return tuple(found)


def _part(part: Part, link: int) -> Part:
    """Link −1 is body 0; the tip link has no shapes."""
    return part._replace(body=link + 1) if part.kind == "arm" else part
