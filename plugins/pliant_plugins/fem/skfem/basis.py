"""Basis data of a module's mesh: shape functions at the quadrature points, and the dof map.

scikit-fem's quadratic elements and their quadrature, of hexahedra or tetrahedra; the assembly uses no more than the
arrays below.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from skfem import (
    CellBasis,
    ElementHex1,
    ElementHex2,
    ElementQuad2,
    ElementTetP1,
    ElementTetP2,
    ElementTriP2,
    MeshHex1,
    MeshHex2,
    MeshTet1,
    MeshTet2,
)
from skfem.assembly import Dofs
from skfem.quadrature import get_quadrature
from skfem.refdom import RefQuad, RefTri

from pliant.errors import ContractError
from pliant.meshing.cells import cell_kind, face_cell_kind
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh
from pliant_plugins.fem.config import Dilatation
from pliant_plugins.fem.skfem.dilatation import cell_modes

ORDER = 5  # integrates with three Gauss points along each edge
TETRAHEDRAL_ORDER = 2


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
    """Volume quadrature: m cells, q points, n = 27 or 10 nodes.

    Attributes:
        nodes: (m, n) node ids in scikit-fem's local order.
        gradient: (m, q, 3, n) ∂N/∂X_j.
        value: (q, n) N.
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
    """Cavity quadrature: f faces, q points, n = 9 or 6 nodes; slopes are taken along the face's own coordinates."""

    nodes: IntArray
    slope: Array  # (q, 2, n)
    value: Array  # (q, n)
    weight: Array  # (q,)


@dataclass(frozen=True, eq=False)
class Element:
    """scikit-fem's elements of one kind of cell.

    Attributes:
        solid, corners: quadratic and linear element of the cell, face: quadratic element of its faces.
        curved, straight: meshes of quadratic and of linear cells.
        face_shape: reference domain of the faces.
        vertices: number of a cell's corners, first in scikit-fem's order of nodes.
        order: nodes of `ModuleMesh` in scikit-fem's order, of cells; `face_order` of faces.
        rule: order of the cells' quadrature.
    """

    solid: Any
    corners: Any
    face: Any
    curved: Any
    straight: Any
    face_shape: Any
    vertices: int
    order: IntArray
    face_order: IntArray
    rule: int

    def linear(self, points: Array) -> Array:
        """Return (n, corners) linear functions at reference points (n, 3)."""
        return np.stack([self.corners.lbasis(points.T, i)[0] for i in range(self.vertices)], axis=-1)


# Three Gauss points along each edge of a hexahedron; four in a tetrahedron, which is what its linear terms need.
HEXAHEDRON = Element(
    solid=ElementHex2(),
    corners=ElementHex1(),
    face=ElementQuad2(),
    curved=MeshHex2,
    straight=MeshHex1,
    face_shape=RefQuad,
    vertices=8,
    # lexicographic position of each of scikit-fem's local nodes
    order=np.rint(2 * ElementHex2().doflocs).astype(int) @ (1, 3, 9),
    face_order=np.rint(2 * ElementQuad2().doflocs).astype(int) @ (1, 3),
    rule=ORDER,
)
TETRAHEDRON = Element(
    solid=ElementTetP2(),
    corners=ElementTetP1(),
    face=ElementTriP2(),
    curved=MeshTet2,
    straight=MeshTet1,
    face_shape=RefTri,
    vertices=4,
    order=np.arange(10),
    face_order=np.arange(6),
    rule=TETRAHEDRAL_ORDER,
)


ELEMENTS = {"27-node hexahedra": HEXAHEDRON, "10-node tetrahedra": TETRAHEDRON}


def mesh_element(cells: IntArray) -> Element:
    """Return the elements of a mesh's cells. Raises `ContractError` for cells of another kind."""
    return ELEMENTS[cell_kind(cells).name]


def cell_data(mesh: ModuleMesh, dilatation: Dilatation = "cell") -> CellData:
    """Tabulate the cells. Raises `ContractError` when one is inverted.

    Tetrahedra have no pressures per cell: quadratic ones with one or four per cell lock or are not stable, so that
    *cell* means continuous pressures there.
    """
    of = mesh_element(mesh.cells)
    element, count = of.solid, of.vertices
    nodes = np.ascontiguousarray(mesh.cells[:, of.order])
    vertices, corners = np.unique(nodes[:, :count], return_inverse=True)
    corners = corners.reshape(-1, count)
    # skfem logs a warning about arrays with another memory layout
    straight = of.straight(np.ascontiguousarray(mesh.nodes_m[vertices].T), np.ascontiguousarray(corners.T))
    dofs = Dofs(straight, element)
    locations = np.empty((3, dofs.N))
    locations[:, dofs.element_dofs] = mesh.nodes_m[nodes].transpose(2, 1, 0)
    basis = CellBasis(of.curved(locations, straight.t), element, intorder=of.rule)
    if not np.all(basis.mapping.detDF(basis.X) > 0):
        raise ContractError("the family's mesh has inverted cells: det ∂X/∂ξ ≤ 0 at a quadrature point")
    gradient = np.stack([field[0].grad for field in basis.basis], axis=-1).transpose(1, 2, 0, 3)
    value = np.stack([element.lbasis(basis.X, i)[0] for i in range(len(of.order))], axis=-1)
    weight = np.array(basis.dx)
    pressure: PressureData | None = None
    if dilatation == "continuous" or (dilatation == "cell" and of is TETRAHEDRON):
        # a corner has a pressure for each solid that meets there
        own, places = np.unique(corners + len(vertices) * mesh.region_numbers[:, None], return_inverse=True)
        at, solids = vertices[own % len(vertices)], own // len(vertices)
        pressure = PressureData(of.linear(basis.X.T)[None], places.reshape(-1, count), len(own), at, solids)
    elif dilatation == "cell":
        modes = cell_modes(value @ mesh.nodes_m[nodes], weight)
        places = np.arange(modes.shape[2] * len(nodes)).reshape(len(nodes), -1)
        pressure = PressureData(modes, places, places.size, None)
    return CellData(nodes, np.ascontiguousarray(gradient), value, weight, pressure)


def face_data(faces: IntArray) -> FaceData:
    """Tabulate faces, the cavity's or others. Raises `ContractError` for faces of another kind."""
    of = ELEMENTS[face_cell_kind(faces).name]
    point, weight = get_quadrature(of.face_shape, ORDER)
    tables = [of.face.lbasis(point, i) for i in range(len(of.face_order))]
    value = np.stack([value for value, _ in tables], axis=-1)
    slope = np.stack([slope for _, slope in tables], axis=-1).transpose(1, 0, 2)
    return FaceData(np.ascontiguousarray(faces[:, of.face_order]), np.ascontiguousarray(slope), value, weight)
