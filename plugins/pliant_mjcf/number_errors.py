"""Numbers of a model that are known to a share only: masses, inertias, lengths, damping, stiffness, gains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant_mjcf.changes import ModelChange

OF_BODIES = ("body_mass", "body_inertia", "body_pos")
OF_OTHERS = ("jnt_stiffness", "dof_damping", "tendon_stiffness", "tendon_damping", "actuator_gainprm")


@dataclass(frozen=True)
class NumberChange(ModelChange):
    """A share by which a row of an array of the compiled model is larger."""

    array: str
    row: int
    share: float

    def change(self, model: Any) -> None:
        """Scale the row."""
        getattr(model, self.array)[self.row] *= 1.0 + self.share
        if self.array == "actuator_gainprm":  # a position drive's gain is also in its bias
            model.actuator_biasprm[self.row] *= 1.0 + self.share


def number_changes(model: Any, share: float) -> tuple[NumberChange, ...]:
    """Return a change by this share for each number that is not zero, of bodies that move, joints, tendons, drives."""
    moving = np.asarray(model.body_weldid) > 0
    found = []
    for name in (*OF_BODIES, *OF_OTHERS):
        values = np.asarray(getattr(model, name))
        there = np.any(values.reshape(len(values), -1) != 0.0, axis=1) if len(values) else np.zeros(0, bool)
        rows = np.flatnonzero(there & moving if name in OF_BODIES else there)
        found += [NumberChange(name, int(row), share) for row in rows]
    return tuple(found)
