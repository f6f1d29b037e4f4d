"""Records of one design of a family: its parameters and its masses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Design:
    """One point of a family's parameter space. Values are SI, names carry their unit (`wall_m`)."""

    family: str
    parameters: Mapping[str, float | int | str | bool]


@dataclass(frozen=True, eq=False)
class MassProperties:
    """A rigid piece: mass (kg), centre of mass (3,) in m, inertia (3, 3) about that centre in kg·m²."""

    mass_kg: float
    com_m: Array
    inertia_kg_m2: Array

    def shifted(self, offset_m: Array) -> MassProperties:
        """Return the same piece with its frame's origin moved: coordinates become `com + offset`."""
        return MassProperties(self.mass_kg, self.com_m + np.asarray(offset_m, float), self.inertia_kg_m2)

    def rotated(self, rotation: Array) -> MassProperties:
        """Return the same piece in a frame in which its own axes are the columns of `rotation`."""
        inertia = rotation @ self.inertia_kg_m2 @ rotation.T
        return MassProperties(self.mass_kg, rotation @ self.com_m, inertia)

    def joined(self, other: MassProperties) -> MassProperties:
        """Combine two pieces of one rigid body, in the same frame (parallel-axis theorem)."""
        mass = self.mass_kg + other.mass_kg
        if mass == 0.0:
            return self
        com = (self.mass_kg * self.com_m + other.mass_kg * other.com_m) / mass
        inertia = np.zeros((3, 3))
        for piece in (self, other):
            arm = piece.com_m - com
            inertia += piece.inertia_kg_m2 + piece.mass_kg * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return MassProperties(mass, com, inertia)

    @staticmethod
    def none() -> MassProperties:
        """Return a piece without mass."""
        return MassProperties(0.0, np.zeros(3), np.zeros((3, 3)))


@dataclass(frozen=True, eq=False)
class ModuleMass:
    """Masses of a module's two halves, both in the module frame with the origin at the joint (mid-module).

    `start` has x in [−l/2, 0] and moves with the parent, `end` has x in [0, l/2] and moves with the child.
    """

    start: MassProperties
    end: MassProperties
