"""Whole bodies for direct FEM: several modules in series, clamped at the base, closed at the end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh


@dataclass(frozen=True, eq=False)
class StructureProblem:
    """A body in space, x along it, under pressure in its cavity and a dead force at its tip.

    Attributes:
        mesh: half of the body, y ≥ 0. The cavity is closed, except where it ends in a fixed plane.
        fixed: displacement components (0, 1, 2 = x, y, z) fixed at zero, by node set.
        tip: nodes over which the tip's force is distributed, and their shares of it, which sum to 1.
        markers: one node each for base, joints 1…N and tip, as `markers_m` of a chain.
        sections: for each border between modules, including base and tip, nodes of a line across the body in the
            plane y = 0, first to last; its rotation about y is that of the section.
        modules: number of modules.
        symmetric: the mesh is half of a body that y = 0 cuts; forces and energies are those of the whole.
    """

    mesh: ModuleMesh
    fixed: Mapping[str, tuple[int, ...]]
    tip: IntArray
    tip_shares: Array
    markers: IntArray
    sections: tuple[IntArray, ...]
    modules: int
    symmetric: bool = True


@dataclass(frozen=True, eq=False)
class StructureState:
    """An equilibrium of a body.

    Attributes:
        pressure_pa: in the cavity.
        tip_force_n: (3,) dead force on the whole body's tip.
        markers_m: (N + 2, 3) base, joints, tip; the tip is the weighted mean on which the force does work.
        turns_rad: (N + 1,) rotation about y of the sections between modules, positive toward −z.
        energy_j: elastic energy of the whole body.
        volume_m3: of the whole cavity.
        solution: the backend's own unknowns.
    """

    pressure_pa: float
    tip_force_n: Array
    markers_m: Array
    turns_rad: Array
    energy_j: float
    volume_m3: float
    iterations: int
    wall_s: float
    solution: Array = field(repr=False, default_factory=lambda: np.zeros(0))
