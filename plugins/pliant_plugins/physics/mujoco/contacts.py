"""Contacts of a MuJoCo scene as the scene's own records."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from pliant.records.scene import Contact, Part
from pliant_plugins.physics.mujoco.scene_mjcf import Geom

# Which of two bodies comes first.
RANK = {"arm": 0, "floor": 1, "object": 2}


class ContactReader:
    """Reads what the last solve left in `data`."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, geoms: Sequence[Geom]) -> None:
        self._model, self._data = model, data
        self._parts: dict[int, Part] = {model.geom(geom.name).id: geom.part for geom in geoms}

    def read(self) -> tuple[Contact, ...]:
        """Active contacts in MuJoCo's order; its normal and its force are those on the second geom."""
        data = self._data
        found = []
        for index in np.flatnonzero(data.contact.efc_address >= 0).tolist():
            contact = data.contact[index]
            first, second = (self._parts[int(geom)] for geom in contact.geom)
            frame, force = contact.frame.reshape(3, 3), np.zeros(6)
            mujoco.mj_contactForce(self._model, data, index, force)
            sign = 1.0
            if (RANK[first.kind], first.number) > (RANK[second.kind], second.number):
                first, second, sign = second, first, -1.0
            found.append(
                Contact(
                    first,
                    second,
                    position_m=contact.pos.copy(),
                    normal=sign * frame[0],
                    normal_n=float(force[0]),
                    friction_n=sign * (force[1:3] @ frame[1:]),
                )
            )
        return tuple(found)
