"""Basis data of a module's mesh: shape functions at the quadrature points, and the dof map.

scikit-fem's `ElementHex2`, `ElementQuad2` and their quadrature; the assembly uses no more than the
arrays below.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from skfem import CellBasis, ElementHex1, ElementHex2, ElementQuad2, MeshHex1, MeshHex2
from skfem.assembly import Dofs
from skfem.quadrature import get_quadrature
from skfem.refdom import RefQuad

from pliant.errors import ContractError
from pliant.interfaces.by_region import region_numbers
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh
from pliant_plugins.fem.config import Dilatation
from pliant_plugins.fem.skfem.dilatation import cell_modes

ORDER = 5  # integrates with three Gauss points along each edge


@dataclass(frozen=True, eq=False)
class PressureData:
    """Interpolation of the pressures of mixed cells.

    Attributes:
        value: (m or 1, q, k) functions.
        places: (m, k) numbers of the cells' pressures, from 0 to count − 1.
        vertices: (count,) nodes at which they stand, or None where they belong to cells.
        solids: (count,) numbers of the regions in which they are continuous, or None.
    """

    value: Array
    places: IntArray
    count: int
    vertices: IntArray | None
    solids: IntArray | None = None


@dataclass(frozen=True, eq=False)
class CellData:
    """Volume quadrature: m cells, q points, 27 nodes.

    Attributes:
        nodes: (m, 27) node ids in scikit-fem's local order.
        gradient: (m, q, 3, 27) ∂N/∂X_j.
        value: (q, 27) N.
        weight: (m, q) reference volumes.
        pressure: what interpolates the mixed element's pressure, or None.
    """

    nodes: IntArray
    gradient: Array
    value: Array
    weight: Array
    pressure: PressureData | None


@dataclass(frozen=True, eq=False)
class FaceData:
    """Cavity quadrature: f faces, q points, 9 nodes; slopes are taken along the face's own coordinates."""

    nodes: IntArray
    slope: Array  # (q, 2, 9)
    value: Array  # (q, 9)
    weight: Array  # (q,)


def cell_data(mesh: ModuleMesh, dilatation: Dilatation = "cell") -> CellData:
    """Tabulate the cells. Raises `ContractError` when one is inverted."""
    element = ElementHex2()
    # lexicographic position of each of scikit-fem's local nodes
    lattice = np.rint(2 * element.doflocs).astype(int) @ (1, 3, 9)
    nodes = np.ascontiguousarray(mesh.cells[:, lattice])
    vertices, corners = np.unique(nodes[:, :8], return_inverse=True)
    corners = corners.reshape(-1, 8)
    # skfem logs a remark about arrays that lie otherwise
    straight = MeshHex1(np.ascontiguousarray(mesh.nodes_m[vertices].T), np.ascontiguousarray(corners.T))
    dofs = Dofs(straight, element)
    locations = np.empty((3, dofs.N))
    locations[:, dofs.element_dofs] = mesh.nodes_m[nodes].transpose(2, 1, 0)
    basis = CellBasis(MeshHex2(locations, straight.t), element, intorder=ORDER)
    if not np.all(basis.mapping.detDF(basis.X) > 0):
        raise ContractError("the family's mesh has inverted cells: det ∂X/∂ξ ≤ 0 at a quadrature point")
    gradient = np.stack([field[0].grad for field in basis.basis], axis=-1).transpose(1, 2, 0, 3)
    value = np.stack([element.lbasis(basis.X, i)[0] for i in range(27)], axis=-1)
    weight = np.array(basis.dx)
    pressure: PressureData | None = None
    if dilatation == "cell":
        modes = cell_modes(value @ mesh.nodes_m[nodes], weight)
        places = np.arange(modes.shape[2] * len(nodes)).reshape(len(nodes), -1)
        pressure = PressureData(modes, places, places.size, None)
    elif dilatation == "continuous":
        linear = np.stack([ElementHex1().lbasis(basis.X, i)[0] for i in range(8)], axis=-1)
        owned = corners + len(vertices) * region_numbers(mesh)[:, None]
        own, places = np.unique(owned, return_inverse=True)
        at, solids = vertices[own % len(vertices)], own // len(vertices)
        pressure = PressureData(linear[None], places.reshape(-1, 8), len(own), at, solids)
    return CellData(nodes, np.ascontiguousarray(gradient), value, weight, pressure)


def face_data(faces: IntArray) -> FaceData:
    """Tabulate the cavity's faces."""
    element = ElementQuad2()
    lattice = np.rint(2 * element.doflocs).astype(int) @ (1, 3)
    point, weight = get_quadrature(RefQuad, ORDER)
    tables = [element.lbasis(point, i) for i in range(9)]
    value = np.stack([value for value, _ in tables], axis=-1)
    slope = np.stack([slope for _, slope in tables], axis=-1).transpose(1, 0, 2)
    return FaceData(np.ascontiguousarray(faces[:, lattice]), np.ascontiguousarray(slope), value, weight)
