"""The box: a rectangular tube with its cavity off the axis, small enough to be solved in every check.

Half of its width is meshed (y ≥ 0, mirror plane y = 0), and half of a module's length. With the bend frame's
end conditions its small deformations are those of a uniform beam, so moments and angles have closed forms
(`BoxModule`): by reciprocity, pressure p bends it like the moment (1 − 2ν) A_c (z_c − z_e) p, with A_c, z_c
area and centroid of the cavity, z_e that of the solid section.
"""

from __future__ import annotations

from dataclasses import dataclass

from pliant.meshing.grids import block, carved, grid_cells, grid_lines, module_sets, numbered
from pliant.meshing.hexahedra import CENTRE, boundary_faces
from pliant.records.fem import ModuleMesh, ModuleProblem

# Lattice lines across the section, in m; the cavity is the cell y < Y[1], Z[1] < z < Z[2].
Y = (0.0, 3e-3, 4.5e-3)
Z = (0.0, 3e-3, 7e-3, 8.5e-3)
HALF_LENGTH_M = 6e-3


@dataclass(frozen=True)
class BoxModule:
    """Closed forms of the box for a solid of Young's modulus E and Poisson's ratio ν at small strain."""

    young_pa: float
    poisson: float

    @property
    def _parts(self) -> tuple[tuple[float, float, float], ...]:
        """(area, centroid, second moment about z = 0) of outline and cavity, full width."""
        pieces = ((2 * Y[-1], Z[0], Z[-1]), (2 * Y[1], Z[1], Z[2]))
        return tuple((b * (h - g), (g + h) / 2, b * (h**3 - g**3) / 3) for b, g, h in pieces)

    @property
    def centroid_m(self) -> float:
        """z_e of the solid section."""
        (A, z, _), (a, c, _) = self._parts
        return (A * z - a * c) / (A - a)

    @property
    def stiffness_n_m(self) -> float:
        """−∂τ/∂u of the module: E I / l."""
        (A, _, outer), (a, _, inner) = self._parts
        second = outer - inner - (A - a) * self.centroid_m**2
        return self.young_pa * second / (2 * HALF_LENGTH_M)

    @property
    def gain_m3(self) -> float:
        """∂τ/∂p = (1 − 2ν) A_c (z_c − z_e)."""
        _, (a, c, _) = self._parts
        return (1 - 2 * self.poisson) * a * (c - self.centroid_m)


@dataclass(frozen=True)
class BoxShape:
    """Lattice lines across the half section and half the module's length, in m."""

    y: tuple[float, float, float] = Y
    z: tuple[float, float, float, float] = Z
    half_length_m: float = HALF_LENGTH_M


def box_problem(
    shape: BoxShape = BoxShape(), refinement: int = 1, energy_scale: float = 4.0
) -> ModuleProblem:
    """Half a module of the box, half its width; its angle is half the joint's."""
    return ModuleProblem(
        mesh=box_mesh(shape, refinement),
        span_m=shape.half_length_m,
        reference_z_m=shape.z[1] / 2,
        deformation_scale=2.0,
        energy_scale=energy_scale,
        fixed={"start": (0,), "end": (0,), "symmetry": (1,), "pin": (2,)},
    )


def box_mesh(shape: BoxShape = BoxShape(), refinement: int = 1) -> ModuleMesh:
    """Structured 27-node hexahedra of the half section, without those of the cavity."""
    lines = (grid_lines(ends, refinement) for ends in ((0.0, shape.half_length_m), shape.y, shape.z))
    nodes, ids = numbered(block(*lines))
    cells = grid_cells(ids)
    y, z = nodes[cells[:, CENTRE], 1:].T
    nodes, cells, cavity = carved(nodes, cells, (y < shape.y[1]) & (z > shape.z[1]) & (z < shape.z[2]))
    skin, _ = boundary_faces(cells)
    return ModuleMesh(nodes, cells, cavity, skin, module_sets(nodes, shape.half_length_m))
