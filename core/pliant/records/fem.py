"""Finite-element records: the boundary-value problem of one module, its solved states, the data set."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pliant.records.actuation import Levels, split_actuation_names
from pliant.records.design import Array, Design
from pliant.records.law import JointKind

IntArray = NDArray[np.int64]
Branch = Literal["free", "constrained"]
Role = Literal["fit", "check"]
# Overlapping convolutions, overlap that the user allows (fem.self_contact: pass), and walls in contact
# (fem.self_contact: solve).
SELF_CONTACT, PASSED, TOUCHING = "self_contact", "passed_through", "touching"
TRUSTED = ("ok", PASSED, TOUCHING)
# `explored` of a state that prescribes several axes.
COUPLING = "coupling"
# Arrays of a module's data, one entry per state.
STATE_COLUMNS = (
    "actuation",
    "deformation",
    "tau",
    "dtau_dp",
    "dtau_du",
    "energy_j",
    "travel",
    "iterations",
    "wall_s",
    "explored",
    "branch",
    "status",
    "role",
)
# Arrays of a data set of one axis, one value per state.
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
    """A mesh of quadratic cells of one kind in the module frame (x along the chain, bending about y), in metres.

    Attributes:
        nodes_m: (n, 3) reference coordinates.
        cells: (m, 27) node ids of hexahedra in lexicographic order, local node i + 3j + 9k at (ξ, η, ζ) = (i, j, k)/2;
            or (m, 10) of tetrahedra, corners, then the middles of the edges 01, 12, 02, 03, 13, 23.
        cavity: (f, 9) node ids of the wetted faces, local node a + 3b, or (f, 6), corners, then the middles of the
            edges 01, 12, 02; ∂x/∂a × ∂x/∂b points out of the solid, into the cavity.
        skin: (g, 9) or (g, 6) node ids of all boundary faces, normals out of the solid, for pictures and contact.
        node_sets: named node ids. Every family provides `start` (x = 0) and `end` (x = span).
        regions: named disjoint sets of cell numbers of another material than the body's. The study states each
            material, including the density, under `material.regions`.
        cavities: wetted faces by the name of their pressure, for several pressures; `cavity` has all of them.
    """

    nodes_m: Array
    cells: IntArray
    cavity: IntArray
    skin: IntArray
    node_sets: Mapping[str, IntArray]
    regions: Mapping[str, IntArray] = field(default_factory=dict)
    cavities: Mapping[str, IntArray] = field(default_factory=dict)

    @property
    def region_numbers(self) -> IntArray:
        """(m,) for each cell the index of its region in `regions` from 1; 0 for the body."""
        numbers = np.zeros(len(self.cells), np.int64)
        for number, cells in enumerate(self.regions.values(), 1):
            numbers[cells] = number
        return numbers


@dataclass(frozen=True)
class Ribbon:
    """A thin band in the wall or cavity that resists elongation, so that a bellow bends to its side.

    It extends along x at height z, |y| ≤ width/2, bonded to the sections. A fibre at y has the strain
    ε(y) = e − Θ_z y/L + (Θ_x y/L)²/2 of the reference line, which must be at the ribbon's height; its energy is
    ½ EA L ⟨ε²⟩ over the width. A thread has no width.

    Attributes:
        width_m: its width along y.
        stiffness_n: EA, force per strain of the whole width (for the solved piece; half of it in a half model).
    """

    width_m: float
    stiffness_n: float


@dataclass(frozen=True)
class Tendon:
    """A cord from a hole in a rigid link that crosses the mirror plane x = 0 at a right angle.

    The hole moves with the end section: at rest it is at (span + x_m, z_m) in the module frame. Half the free length
    is the x of the hole; its shortening is drawn out of the module and gives the work of T.
    """

    x_m: float
    z_m: float


@dataclass(frozen=True)
class Stop:
    """An edge of a rigid link that limits the rotation by contact with its mirror image in the plane x = 0.

    It moves with the end section, which does not rise: at rest it is at (span + x_m, z_m) in the module frame.

    Attributes:
        x_m, z_m: position.
        area_m2: contact area (of the solved piece).
    """

    x_m: float
    z_m: float
    area_m2: float


@dataclass(frozen=True, eq=False)
class Fibres:
    """Threads of one direction, distributed over cells: ½ κ (λ − 1)² per reference volume, λ the stretch along them.

    They are bonded to the cells' material and resist shortening as much as stretching.

    Attributes:
        cells: (k,) numbers of the cells.
        directions: (k, 27, 3) vectors along the threads at the cells' nodes, in the module frame; of any length, with
            consistent senses in a cell.
        stiffness_pa: κ, a thread's EA over the section of the solid that it represents.
    """

    cells: IntArray
    directions: Array
    stiffness_pa: float


@dataclass(frozen=True, eq=False)
class Link:
    """Displacements of nodes `second` follow those of nodes `first`: v_c(second) = sign_c · v_c(first).

    Attributes:
        first, second: (n,) node ids, pairwise. Signs of 1 make a periodic cell, (−1, 1, −1)… other symmetries.
        signs: component (0, 1, 2 = x, y, z) → sign; missing components are not linked.
    """

    first: IntArray
    second: IntArray
    signs: Mapping[int, float]


@dataclass(frozen=True)
class Closing:
    """Limit of bending of a round module: rigid sections touch when its outermost fibre has its smallest length.

    The fibre is on a circle about (y, z) = (0, `centre_m`) in the rod frame and is shortened by
    radius √(u_y² + u_z²) − centre u_y.

    Attributes:
        radius_m: of the circle.
        centre_m: its height over the line whose length bending does not change.
        free_m: largest shortening of the fibre.
    """

    radius_m: float
    centre_m: float
    free_m: float

    def shortening_m(self, u_y: float, u_z: float = 0.0) -> float:
        """Return the shortening of the outermost fibre."""
        return self.radius_m * math.hypot(u_y, u_z) - self.centre_m * u_y

    @property
    def range(self) -> tuple[float, float]:
        """u_y at the limit, for bending against and with actuation."""
        return -self.free_m / (self.radius_m + self.centre_m), self.free_m / (self.radius_m - self.centre_m)


@dataclass(frozen=True, eq=False)
class ModuleProblem:
    """The boundary-value problem of one module that a family passes to an FEM backend.

    `frame = "rod"`: the line (y, z) = (0, `reference_z_m`) of the piece has the axial strain e and rotates uniformly
    by the rotation vector Θ along the span; sections move with it, and v is the displacement in their frame:

        x = r(s₁) + R(s₁)(0, ρ),  R' = R [k]×,  k = Θ / ((1 + e) L),  s₁ = (1 + e) X₁ + v₁,  ρ = X + v − line

    Joint axes x, y, z are Θ₁, Θ₂, Θ₃ (a positive Θ₂ turns the end toward −z); the axis of a prismatic joint and the
    axis e of an extensible one are the extension e L. Components of Θ that are no axes are zero. Pressure acts
    through the cavity's volume, so that the thrust on the end sections is exact; a tendon through its path.

    Attributes:
        mesh: the solved piece.
        span_m: its length L along x.
        reference_z_m: height of the line whose strain is e and about which angles are measured.
        deformation_scale: the module's joint coordinate u = scale · (Θ or e L) (2 for half a module).
        energy_scale: energy of the module / energy of the piece (4 for half a module cut by y = 0).
        fixed: displacement components (0, 1, 2 = x, y, z) fixed at zero, by node set.
        tied: components that are equal for all nodes of a set, one unknown for each set and component.
        links: pairs of nodes with equal or mirrored displacement.
        axes: the joint's axes that this piece can move about.
        main_axis: the axis that actuation drives.
        joint: kind of the module's joint.
        stretches: whether e is an unknown; else e = 0 (an inextensible line).
        ribbons: bands at the height of the reference line.
        fibres: threads in the solid, each set of one direction.
        actuation: name of the input, `pressure_pa` or `tendon_force_n`; for several, all names
            (`pressure_1_pa, pressure_2_pa`), each pressure with its faces in `mesh.cavities`.
        tendon: the cord of `tendon_force_n`.
        contact_planes: planes of mirror symmetry along x that material must not cross ("start", "end").
        contact_range: u of the main axis between which rigid parts next to the piece do not touch.
        stops: edges of these parts, for a code that solves contact, which then does not end at `contact_range`.
        closing: limit of bending of a round module, about y and z together; states beyond are never trusted.
        requires: names of requirements beyond this record, from a subclass of the problem. See `requirements`.
    """

    mesh: ModuleMesh
    span_m: float
    reference_z_m: float
    deformation_scale: float
    energy_scale: float
    fixed: Mapping[str, tuple[int, ...]]
    tied: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    links: tuple[Link, ...] = ()
    axes: tuple[str, ...] = ("y",)
    main_axis: str = "y"
    joint: JointKind = "revolute"
    stretches: bool = True
    ribbons: tuple[Ribbon, ...] = ()
    fibres: tuple[Fibres, ...] = ()
    actuation: str = "pressure_pa"
    tendon: Tendon | None = None
    frame: Literal["rod"] = "rod"
    contact_planes: tuple[str, ...] = ("start", "end")
    contact_range: tuple[float, float] | None = None
    stops: tuple[Stop, ...] = ()
    closing: Closing | None = None
    requires: frozenset[str] = frozenset()

    @property
    def requirements(self) -> frozenset[str]:
        """Names of all requirements on a backend: `requires`, and the optional parts of the problem."""
        parts = {
            "regions": self.mesh.regions,
            "tetrahedra": self.mesh.cells.shape[1] == 10,
            "ribbons": self.ribbons,
            "fibres": self.fibres,
            "tendon": self.tendon,
            "links": self.links,
            "ties": any(self.tied.values()),
            "several_actuations": len(self.actuations) > 1,
        }
        return self.requires | {name for name, part in parts.items() if part}

    @property
    def actuations(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return split_actuation_names(self.actuation)


@dataclass(frozen=True, eq=False)
class FemState:
    """One converged state of a module with k axes, in the module's joint coordinates.

    τ is the external effort that opposes the actuation, τ(p, u) = −∂Π/∂u, zero along axes that are free. Slopes
    are exact tangents with every other unknown at equilibrium, all of u being independent, so that dtau_du is
    symmetric. `status` is "ok", "touching" (walls in solved contact) or "self_contact" (convolutions or rigid parts
    overlap: the state is marked and not trusted).

    Attributes:
        actuation: pressure (Pa) or tendon force (N); (m,) for several.
        deformation: u, (k,) in rad, or m for a prismatic joint.
        tau: (k,) in N·m, or N.
        dtau_dp: (k,) by actuation; (k, m) by several.
        dtau_du: (k, k).
        energy_j: elastic energy of the module.
        travel: work conjugate of the actuation: change of the cavity's volume (m³), or tendon drawn out (m); (m,) for
            several.
        axial_strain: e.
        main: index of the axis that actuation drives.
        held: names of the axes whose u was prescribed; none on the free branch.
        solution: the backend's own unknowns.
    """

    actuation: Levels
    deformation: Array
    tau: Array
    dtau_dp: Array
    dtau_du: Array
    energy_j: float
    travel: Levels
    axial_strain: float
    branch: Branch
    status: str
    iterations: int
    wall_s: float
    main: int = 0
    held: tuple[str, ...] = ()
    solution: Array = field(repr=False, default_factory=lambda: np.zeros(0))

    @staticmethod
    def from_one_axis(
        actuation: float,
        angle_rad: float,
        moment_n_m: float,
        dmoment_dp: float,
        dmoment_du: float,
        **others: Any,
    ) -> FemState:
        """Return a state of a joint with one axis from numbers; `others` are the remaining attributes."""
        return FemState(
            actuation,
            np.array([angle_rad]),
            np.array([moment_n_m]),
            np.array([dmoment_dp]),
            np.array([[dmoment_du]]),
            **others,
        )

    @property
    def trusted(self) -> bool:
        """Return whether the state has no overlap, or an allowed one."""
        return self.status in TRUSTED

    @property
    def angle_rad(self) -> float:
        """u of the main axis (m for a prismatic joint)."""
        return float(self.deformation[self.main])

    @property
    def moment_n_m(self) -> float:
        """τ of the main axis (N for a prismatic joint)."""
        return float(self.tau[self.main])

    @property
    def dmoment_dp(self) -> float:
        """∂τ/∂p of the main axis."""
        return float(self.dtau_dp[self.main])

    @property
    def dmoment_du(self) -> float:
        """∂τ/∂u of the main axis, with the other axes fixed."""
        return float(self.dtau_du[self.main, self.main])


@dataclass(frozen=True, eq=False)
class ModuleFields:
    """Fields of the solved piece at one state, at the mesh's nodes, for ParaView and pictures.

    Attributes:
        points_m: (n, 3) reference positions in the module frame.
        displacement_m: (n, 3).
        cells: (m, 27) or (m, 10) as in `ModuleMesh`.
        point_data: named nodal values, (n,) or (n, 3): `von_mises_pa`, `hydrostatic_pa`, `energy_j_m3`,
            `volume_ratio`, `largest_stretch`.
    """

    points_m: Array
    displacement_m: Array
    cells: IntArray
    point_data: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class ModuleShape:
    """Deformed skin of the solved piece at one state, for pictures: points (n, 3) in m, faces (g, 9).

    Triangles of tetrahedra are squares with a collapsed edge (`meshing.cells.SquareSkin`).

    Attributes:
        von_mises_pa: (n,) von Mises stress on the skin, if requested and provided by the backend.
        mirrors: planes through the origin in which mirror images of the piece make the module, by their normals.
    """

    actuation: float
    angle_rad: float
    points_m: Array
    faces: IntArray
    von_mises_pa: Array | None = None
    mirrors: tuple[str, ...] = ("x", "y")


@dataclass(frozen=True, eq=False)
class FemDataset:
    """Data of one design on one axis: one row per state; all arrays have shape (n,).

    Slopes may be NaN (data from elsewhere). `role` is "fit" or "check": a check state is never fitted. For a
    prismatic joint `angle_rad` is the extension in m and `moment_n_m` the force in N. `travel` is that of
    `FemState`, None or NaN if it is not known.
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
    joint: JointKind = "revolute"
    travel: Array | None = None

    def __len__(self) -> int:
        return len(self.actuation)

    def select(self, role: Role) -> FemDataset:
        """Return the data set of the states with one role, without untrusted ones, such as self-contact."""
        return self.rows((self.role == role) & self.trusted)

    @property
    def trusted(self) -> NDArray[np.bool_]:
        """(n,) states whose status is one of `TRUSTED`."""
        return np.isin(self.status, TRUSTED)

    def rows(self, keep: NDArray[np.bool_]) -> FemDataset:
        """Return the states selected by a mask (n,), without failures and shapes, which describe all states."""
        arrays = {name: getattr(self, name)[keep] for name in COLUMNS}
        travel = None if self.travel is None else self.travel[keep]
        return FemDataset(
            self.design, self.axis, self.actuation_name, joint=self.joint, travel=travel, **arrays
        )


@dataclass(frozen=True, eq=False)
class ModuleData:
    """FEM data of one design on all k axes of its joint: one row per state, units as in `FemState`.

    Attributes:
        actuation (n,), deformation (n, k), tau (n, k), dtau_dp (n, k), dtau_du (n, k, k), energy_j (n,),
        travel (n,), iterations (n,), wall_s (n,): as in `FemState`.
            With m > 1 actuations: actuation and travel (n, m), dtau_dp (n, k, m).
        explored: (n,) the axis whose law the state explores: the main one if only that is prescribed or all are
            free; "coupling" if several are prescribed.
        branch, status, role: (n,) as in `FemDataset`.
        failed: states that were not reached, with their cause.
        shapes: deformed skins of the free branch.
        sampling: how the states were chosen and what error the sampler states, for the report.
    """

    design: Design
    joint: JointKind
    axes: tuple[str, ...]
    main_axis: str
    actuation_name: str
    actuation: Array
    deformation: Array
    tau: Array
    dtau_dp: Array
    dtau_du: Array
    energy_j: Array
    travel: Array
    iterations: Array
    wall_s: Array
    explored: NDArray[np.str_]
    branch: NDArray[np.str_]
    status: NDArray[np.str_]
    role: NDArray[np.str_]
    failed: tuple[Mapping[str, object], ...] = ()
    shapes: tuple[ModuleShape, ...] = ()
    sampling: Mapping[str, object] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.actuation)

    @property
    def actuations(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return split_actuation_names(self.actuation_name)

    def select(self, role: Role) -> ModuleData:
        """Return the states with one role, without untrusted ones, such as self-contact."""
        return self.rows((self.role == role) & self.trusted)

    @property
    def trusted(self) -> NDArray[np.bool_]:
        """(n,) states whose status is one of `TRUSTED`."""
        return np.isin(self.status, TRUSTED)

    def rows(self, keep: NDArray[np.bool_] | IntArray) -> ModuleData:
        """Return the states selected by a mask (n,) or indices."""
        return replace(self, **{name: getattr(self, name)[keep] for name in STATE_COLUMNS})

    def axis(self, name: str) -> FemDataset:
        """Return the states that explore one axis, as data of that axis.

        While a lateral axis is explored the others are free, so its slopes are those with the others following.
        """
        k, rows = self.axes.index(name), self.explored == name
        dtau_dp, dtau_du = self._slopes(k, rows)
        arrays = {c: getattr(self, c)[rows] for c in ("actuation", "energy_j", "branch", "status", "role")}
        return FemDataset(
            design=self.design,
            axis=name,
            actuation_name=self.actuation_name,
            angle_rad=self.deformation[rows, k],
            moment_n_m=self.tau[rows, k],
            dmoment_dp=dtau_dp,
            dmoment_du=dtau_du,
            failed=self.failed if name == self.main_axis else (),
            shapes=self.shapes if name == self.main_axis else (),
            joint=self.joint,
            travel=self.travel[rows],
            **arrays,
        )

    def _slopes(self, k: int, rows: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return ∂τ/∂p and ∂τ/∂u of axis k, both (n,), with free other axes condensed."""
        by_p, by_u = self.dtau_dp[rows, k], self.dtau_du[rows, k, k]
        others = [j for j in range(len(self.axes)) if j != k]
        if self.axes[k] == self.main_axis or not others or len(by_p) == 0:
            return by_p, by_u
        K, g = self.dtau_du[rows], self.dtau_dp[rows]
        inner, across = K[:, others][:, :, others], K[:, k][:, others]
        follow = np.linalg.solve(inner, np.stack([g[:, others], K[:, others, k]], axis=-1))
        by_p = by_p - np.einsum("nj,nj->n", across, follow[..., 0])
        by_u = by_u - np.einsum("nj,nj->n", across, follow[..., 1])
        return by_p, by_u

    def explored_axes(self) -> tuple[str, ...]:
        """Return the axes with states that explore them, the main one first."""
        found = [name for name in self.axes if np.any(self.explored == name)]
        return tuple(sorted(found, key=lambda name: name != self.main_axis))
