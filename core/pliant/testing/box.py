"""Box for checks: a rectangular tube with its cavity off the axis, small enough to be solved in every check.

For bending about y half of its width is meshed (y ≥ 0, mirror plane y = 0), and half of a module's length
(`box_problem`); for several axes the whole module as one cell of a periodic chain (`spatial_box_problem`). With
the rod frame's end conditions its small deformations are those of a uniform beam, so moments and angles have
closed forms (`BoxModule`): by reciprocity, pressure p bends it like the moment (1 − 2ν) A_c (z_c − z_e) p, with
A_c, z_c area and centroid of the cavity, z_e that of the solid section.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from pliant.meshing.grids import block, carved, grid_cells, grid_lines, module_sets, numbered
from pliant.meshing.hexahedra import CENTRE, boundary_faces
from pliant.meshing.tetrahedra import EDGES
from pliant.meshing.tetrahedra import boundary_faces as tetrahedral_faces
from pliant.records.fem import Link, ModuleMesh, ModuleProblem, Tendon

# Lattice lines across the section, in m; the cavity is the cell y < Y[1], Z[1] < z < Z[2].
Y = (0.0, 3e-3, 4.5e-3)
Z = (0.0, 3e-3, 7e-3, 8.5e-3)
HALF_LENGTH_M = 6e-3


class BoxModule:
    """Closed forms of the box for a solid of Young's modulus E and Poisson's ratio ν at small strain.

    Attributes:
        centroid_m: z_e of the solid section.
        stiffness_n_m: −∂τ/∂u of the module, E I / l.
        gain_m3: ∂τ/∂p = (1 − 2ν) A_c (z_c − z_e).
        side_stiffness_n_m: −∂τ_z/∂u_z of the module, E I_z / l, the section being symmetric about y = 0.
        twist_bounds_n_m: bounds of −∂τ_x/∂u_x: G/l times Bredt's closed tube on the walls' mid-lines, and I_y + I_z
            (no warping).
        axial_stiffness_n_m: −∂F/∂(extension) of the module as a prismatic joint, E A / l, in N/m.
        thrust_m2: ∂F/∂p of the module as a prismatic joint, (1 − 2ν) A_c.
    """

    def __init__(self, young_pa: float, poisson: float) -> None:
        length, shear_pa = 2 * HALF_LENGTH_M, young_pa / (2 * (1 + poisson))
        self._young_pa = young_pa
        # Area, centroid and second moment about z = 0 of outline and cavity, full width.
        pieces = ((2 * Y[-1], Z[0], Z[-1]), (2 * Y[1], Z[1], Z[2]))
        (A, z, outer), (a, c, inner) = (
            (b * (h - g), (g + h) / 2, b * (h**3 - g**3) / 3) for b, g, h in pieces
        )
        self.centroid_m = (A * z - a * c) / (A - a)
        self.stiffness_n_m = young_pa * (outer - inner - (A - a) * self.centroid_m**2) / length
        self.gain_m3 = (1 - 2 * poisson) * a * (c - self.centroid_m)
        outer, inner = (h * (2 * b) ** 3 / 12 for b, h in ((Y[-1], Z[-1]), (Y[1], Z[2] - Z[1])))
        self.side_stiffness_n_m = young_pa * (outer - inner) / length
        side, floor, roof = Y[-1] - Y[1], Z[1] - Z[0], Z[-1] - Z[2]
        width, height = Y[1] + Y[-1], Z[-1] - roof / 2 - floor / 2
        bredt = 4 * (width * height) ** 2 / (2 * height / side + width / floor + width / roof)
        stiff = (self.stiffness_n_m + self.side_stiffness_n_m) * (shear_pa / young_pa)
        self.twist_bounds_n_m = shear_pa * bredt / length, stiff
        self.axial_stiffness_n_m = young_pa * (A - a) / length
        self.thrust_m2 = (1 - 2 * poisson) * a

    def layered_stiffness_n_m(self, factor: float) -> float:
        """Return −∂τ/∂u with a floor `factor` times as stiff at the same ν: Σ E I / l about the weighted centroid."""
        parts = (  # modulus, width, low, high; the cavity is subtracted
            (factor, 2 * Y[-1], Z[0], Z[1]),
            (1.0, 2 * Y[-1], Z[1], Z[3]),
            (-1.0, 2 * Y[1], Z[1], Z[2]),
        )
        first, second, third = (sum(e * b * (h**n - g**n) / n for e, b, g, h in parts) for n in (1, 2, 3))
        return self._young_pa * (third - second**2 / first) / (2 * HALF_LENGTH_M)


@dataclass(frozen=True)
class BoxShape:
    """Lattice lines across the half section and half the module's length, in m."""

    y: tuple[float, float, float] = Y
    z: tuple[float, float, float, float] = Z
    half_length_m: float = HALF_LENGTH_M


def box_problem(
    shape: BoxShape = BoxShape(), refinement: int = 1, energy_scale: float = 4.0
) -> ModuleProblem:
    """Return half a module of the box, half its width; its angle is half the joint's."""
    return ModuleProblem(
        mesh=box_mesh(shape, refinement),
        span_m=shape.half_length_m,
        reference_z_m=shape.z[1] / 2,
        deformation_scale=2.0,
        energy_scale=energy_scale,
        fixed={"start": (0,), "end": (0,), "symmetry": (1,), "pin": (2,)},
    )


def box_mesh(shape: BoxShape = BoxShape(), refinement: int = 1) -> ModuleMesh:
    """Return structured 27-node hexahedra of the half section, without those of the cavity."""
    lines = (grid_lines(ends, refinement) for ends in ((0.0, shape.half_length_m), shape.y, shape.z))
    nodes, ids = numbered(block(*lines))
    cells = grid_cells(ids)
    y, z = nodes[cells[:, CENTRE], 1:].T
    nodes, cells, cavity = carved(nodes, cells, (y < shape.y[1]) & (z > shape.z[1]) & (z < shape.z[2]))
    skin, _ = boundary_faces(cells)
    return ModuleMesh(nodes, cells, cavity, skin, module_sets(nodes, shape.half_length_m))


def layered_box_problem() -> ModuleProblem:
    """Return the quarter box with its floor as the region `floor`."""
    problem = box_problem()
    mesh = problem.mesh
    floor = np.flatnonzero(mesh.nodes_m[mesh.cells[:, CENTRE], 2] < Z[1])
    return replace(problem, mesh=replace(mesh, regions={"floor": floor}))


def tendon_box_problem() -> ModuleProblem:
    """Return the quarter box pulled by a tendon below it; its end section may rise as one."""
    return replace(
        box_problem(),
        tied={"end": (2,)},
        actuation="tendon_force_n",
        tendon=Tendon(x_m=1e-3, z_m=-2e-3),
    )


def spatial_box_problem(refinement: int = 1) -> ModuleProblem:
    """Return a whole module of the box, one cell of a periodic chain, that bends about y and z and twists.

    v is periodic, so that sections may warp. The pins remove the rigid motions of v: three shifts, and the
    rotation about x by a second node of the plane y = 0.
    """
    mesh = spatial_box_mesh(refinement)
    ends = Link(mesh.node_sets["start"], mesh.node_sets["end"], {0: 1.0, 1: 1.0, 2: 1.0})
    return ModuleProblem(
        mesh=mesh,
        span_m=2 * HALF_LENGTH_M,
        reference_z_m=Z[1] / 2,
        deformation_scale=1.0,
        energy_scale=1.0,
        fixed={"pin": (0, 1, 2), "level": (1,)},
        links=(ends,),
        axes=("x", "y", "z"),
        main_axis="y",
        joint="spherical",
        contact_planes=(),
    )


def prismatic_box_problem() -> ModuleProblem:
    """Return the whole module as a prismatic joint, which extends without rotation."""
    return replace(spatial_box_problem(), axes=("x",), main_axis="x", joint="prismatic")


def spatial_box_mesh(refinement: int = 1) -> ModuleMesh:
    """Return the quarter's lattice with its mirror images: sections at x = 0 and x = l match node by node."""
    length = 2 * HALF_LENGTH_M
    y_lines = (-Y[2], -Y[1], 0.0, Y[1], Y[2])
    lines = (grid_lines(ends, refinement) for ends in ((0.0, length / 2, length), y_lines, Z))
    nodes, ids = numbered(block(*lines))
    cells = grid_cells(ids)
    y, z = nodes[cells[:, CENTRE], 1:].T
    nodes, cells, cavity = carved(nodes, cells, (np.abs(y) < Y[1]) & (z > Z[1]) & (z < Z[2]))
    skin, _ = boundary_faces(cells)
    sets = module_sets(nodes, length)
    sets["level"] = np.flatnonzero(
        np.linalg.norm(nodes - np.array([0.0, 0.0, Z[-1]]), axis=1) < 1e-9 * length
    )
    return ModuleMesh(nodes, cells, cavity, skin, sets)


def tetrahedral(mesh: ModuleMesh) -> ModuleMesh:
    """Return the same body with each hexahedron cut into six 10-node tetrahedra along its main diagonal (Kuhn).

    All cells must belong to one structured grid, or the diagonals of common faces would cross.
    """
    steps, pieces = np.array([2, 6, 18]), []
    for order in permutations(range(3)):
        corners = np.concatenate([[0], np.cumsum(steps[list(order)])])
        if np.linalg.det(np.eye(3)[list(order)]) < 0:
            corners = corners[[0, 2, 1, 3]]
        pieces.append(np.concatenate([corners, (corners[EDGES[:, 0]] + corners[EDGES[:, 1]]) // 2]))
    cells = mesh.cells[:, np.array(pieces)].reshape(-1, 10)
    skin, _ = tetrahedral_faces(cells)
    wetted = np.isin(skin, mesh.cavity).all(axis=1)
    number = np.arange(len(cells)).reshape(len(mesh.cells), -1)
    regions = {name: number[own].ravel() for name, own in mesh.regions.items()}
    return replace(mesh, cells=cells, cavity=skin[wetted], skin=skin, regions=regions)
