"""Finite-element records: the boundary-value problem of one module, its solved states, the data set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array, Design

IntArray = NDArray[np.int64]
Branch = Literal["free", "constrained"]
Role = Literal["fit", "check"]
# Arrays of a data set, one value per state.
COLUMNS = (
    "actuation",
    "angle_rad",
    "moment_n_m",
    "dmoment_dp",
    "dmoment_du",
    "energy_j",
    "branch",
    "status",
    "role",
)


@dataclass(frozen=True, eq=False)
class ModuleMesh:
    """A mesh of 27-node hexahedra in the module frame (x along the chain, bending about y), in metres.

    Attributes:
        nodes_m: (n, 3) reference coordinates.
        cells: (m, 27) node ids in lexicographic order, local node i + 3j + 9k at (ξ, η, ζ) = (i, j, k)/2.
        cavity: (f, 9) node ids of the wetted faces, local node a + 3b; ∂x/∂a × ∂x/∂b points out of the
            solid, into the cavity.
        skin: (g, 9) node ids of all boundary faces, normals out of the solid, for pictures and contact.
        node_sets: named node ids. Every family gives `start` (x = 0) and `end` (x = span).
    """

    nodes_m: Array
    cells: IntArray
    cavity: IntArray
    skin: IntArray
    node_sets: Mapping[str, IntArray]


@dataclass(frozen=True, eq=False)
class ModuleProblem:
    """The boundary-value problem that a family hands to an FEM backend.

    `frame = "bend"`: a piece of length `span_m` between two plane cross-sections bends about y by an angle θ with
    axial strain e of the line z = `reference_z_m`; both are unknowns. Pressure acts
    through the cavity's volume, so the thrust on the end sections is exact.

    Attributes:
        mesh: the piece that is solved.
        span_m: its length along x.
        reference_z_m: height of the line whose strain is e and about which the angle is measured.
        angle_scale: module joint angle u = angle_scale · θ (2 for half a module).
        energy_scale: energy of the module / energy of the piece (4 for half a module cut by y = 0).
        fixed: displacement components (0, 1, 2 = x, y, z) held at zero, by node set.
        axis: module axis of the joint angle.
        actuation: name of the input, `pressure_pa` or `tendon_force_n`.
        contact_planes: planes of mirror symmetry along x that material must not cross ("start", "end").
    """

    mesh: ModuleMesh
    span_m: float
    reference_z_m: float
    angle_scale: float
    energy_scale: float
    fixed: Mapping[str, tuple[int, ...]]
    axis: str = "y"
    actuation: str = "pressure_pa"
    frame: Literal["bend"] = "bend"
    contact_planes: tuple[str, ...] = ("start", "end")


@dataclass(frozen=True, eq=False)
class FemState:
    """One converged state of a module. Moments are those of the whole module; u is the module joint angle.

    `moment_n_m` is the external moment that opposes the actuation, equal to τ(p, u); `dmoment_dp` and
    `dmoment_du` are exact tangents with all other unknowns at equilibrium. `status` is "ok" or
    "self_contact" (convolutions overlap; the model has no contact, so the state is marked, not trusted).
    """

    actuation: float
    angle_rad: float
    moment_n_m: float
    dmoment_dp: float
    dmoment_du: float
    energy_j: float
    axial_strain: float
    branch: Branch
    status: str
    iterations: int
    wall_s: float
    solution: Array = field(repr=False)


@dataclass(frozen=True, eq=False)
class ModuleShape:
    """Deformed skin of the solved piece at one state, for pictures: points (n, 3) in m, faces (g, 9)."""

    actuation: float
    angle_rad: float
    points_m: Array
    faces: IntArray


@dataclass(frozen=True, eq=False)
class FemDataset:
    """FEM data of one design on one axis: one row per state; all arrays have shape (n,).

    Slopes may be NaN (data from elsewhere). `role` is "fit" or "check": a check state is never fitted.
    """

    design: Design
    axis: str
    actuation_name: str
    actuation: Array
    angle_rad: Array
    moment_n_m: Array
    dmoment_dp: Array
    dmoment_du: Array
    energy_j: Array
    branch: NDArray[np.str_]
    status: NDArray[np.str_]
    role: NDArray[np.str_]
    failed: tuple[Mapping[str, object], ...] = ()
    shapes: tuple[ModuleShape, ...] = ()

    def __len__(self) -> int:
        return len(self.actuation)

    def select(self, role: Role) -> FemDataset:
        """The states of one role."""
        return self.rows(self.role == role)

    def rows(self, keep: NDArray[np.bool_]) -> FemDataset:
        """The states that a mask (n,) chooses, without what belongs to the whole: failures and shapes."""
        arrays = {name: getattr(self, name)[keep] for name in COLUMNS}
        return FemDataset(self.design, self.axis, self.actuation_name, **arrays)
