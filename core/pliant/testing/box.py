"""The box: a rectangular tube with its cavity off the axis, small enough to be solved in every check.

Half of its width is meshed (y ≥ 0, mirror plane y = 0), and half of a module's length. With the bend frame's
end conditions its small deformations are those of a uniform beam, so moments and angles have closed forms
(`BoxModule`): by reciprocity, pressure p bends it like the moment (1 − 2ν) A_c (z_c − z_e) p, with A_c, z_c
area and centroid of the cavity, z_e that of the solid section.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh, ModuleProblem
from pliant.testing.hexahedra import boundary_faces

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
        angle_scale=2.0,
        energy_scale=energy_scale,
        fixed={"start": (0,), "end": (0,), "symmetry": (1,), "pin": (2,)},
    )


def box_mesh(shape: BoxShape = BoxShape(), refinement: int = 1) -> ModuleMesh:
    """Structured 27-node hexahedra of the half section, without those of the cavity."""
    lines = [_subdivided(ends, 2 * refinement) for ends in ((0.0, shape.half_length_m), shape.y, shape.z)]
    lattice = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    ids = np.arange(lattice[..., 0].size).reshape(lattice.shape[:3])
    corners = np.stack(
        np.meshgrid(*[np.arange(0, len(line) - 1, 2) for line in lines], indexing="ij"), axis=-1
    )
    cells: IntArray = np.array(
        [
            ids[i : i + 3, j : j + 3, k : k + 3].transpose(2, 1, 0).ravel()
            for i, j, k in corners.reshape(-1, 3)
        ]
    )
    # local node 13 is a cell's centre
    cells = cells[~_in_cavity(shape, lattice.reshape(-1, 3)[cells[:, 13]])]
    used, flat = np.unique(cells, return_inverse=True)
    cells = flat.reshape(-1, 27)
    nodes = lattice.reshape(-1, 3)[used]
    skin, _ = boundary_faces(cells)
    middle = nodes[skin[:, 4]]
    on_cut = (middle[:, 0] == 0.0) | (middle[:, 0] == shape.half_length_m) | (middle[:, 1] == 0.0)
    sets = {
        "start": np.flatnonzero(nodes[:, 0] == 0.0),
        "end": np.flatnonzero(nodes[:, 0] == shape.half_length_m),
        "symmetry": np.flatnonzero(nodes[:, 1] == 0.0),
        "pin": np.flatnonzero((nodes == 0.0).all(axis=1)),
    }
    return ModuleMesh(nodes, cells, skin[_in_cavity(shape, middle) & ~on_cut], skin, sets)


def _in_cavity(shape: BoxShape, points: Array) -> NDArray[np.bool_]:
    y, z = points[:, 1], points[:, 2]
    inside: NDArray[np.bool_] = (y <= shape.y[1]) & (z >= shape.z[1]) & (z <= shape.z[2])
    return inside


def _subdivided(ends: Sequence[float], parts: int) -> Array:
    """Lattice lines with `parts` intervals between neighbouring ends; the ends are kept exactly."""
    pieces = [np.linspace(a, b, parts + 1)[:-1] for a, b in pairwise(ends)]
    return np.append(np.concatenate(pieces), ends[-1])
