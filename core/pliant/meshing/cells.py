"""Functions for cells of either kind, hexahedra or tetrahedra.

A mesh has cells of one kind, identified by their number of nodes: 27 (`hexahedra`) or 10 (`tetrahedra`); its faces
have 9 or 6.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pliant.errors import ContractError
from pliant.meshing import hexahedra, tetrahedra
from pliant.records.design import Array
from pliant.records.fem import IntArray

Quadrature = Callable[[Array, IntArray, int], tuple[Array, Array]]

# The 3 × 3 nodes of a quadratic face as eight triangles, local node a + 3b.
SQUARE: IntArray = np.array(
    [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [3, 4, 7], [3, 7, 6], [4, 5, 8], [4, 8, 7]], np.int64
)


@dataclass(frozen=True, eq=False)
class CellKind:
    """One kind of quadratic cell.

    Attributes:
        name: for messages.
        nodes: number of nodes of a cell.
        faces: (k, nodes of a face) local nodes, normals out of a right-handed cell.
        face_key: local nodes of a face that identify it.
        face_corners: local nodes of a face's corners, in order around it.
        triangles: (t, 3) a face's nodes as plane triangles.
        sample_points: reference points (q, 3) at which Jacobians are checked.
        shape_slopes, jacobians, quadrature, boundary_faces, face_quadrature: as in `hexahedra`.
    """

    name: str
    nodes: int
    faces: IntArray
    face_key: tuple[int, ...]
    face_corners: tuple[int, ...]
    triangles: IntArray
    sample_points: Callable[[], Array]
    shape_slopes: Callable[[Array], Array]
    jacobians: Callable[[Array, IntArray, Array], Array]
    quadrature: Quadrature
    boundary_faces: Callable[[IntArray], tuple[IntArray, IntArray]]
    face_quadrature: Callable[[Array, IntArray], tuple[Array, Array]]


HEXAHEDRON = CellKind(
    name="27-node hexahedra",
    nodes=27,
    faces=hexahedra.FACES,
    face_key=(hexahedra.FACE_CENTRE,),
    face_corners=(0, 2, 8, 6),
    triangles=SQUARE,
    sample_points=hexahedra.sample_points,
    shape_slopes=hexahedra.shape_slopes,
    jacobians=hexahedra.jacobians,
    quadrature=hexahedra.quadrature,
    boundary_faces=hexahedra.boundary_faces,
    face_quadrature=hexahedra.face_quadrature,
)
TETRAHEDRON = CellKind(
    name="10-node tetrahedra",
    nodes=10,
    faces=tetrahedra.FACES,
    face_key=(0, 1, 2),
    face_corners=(0, 1, 2),
    triangles=tetrahedra.TRIANGLES,
    sample_points=tetrahedra.sample_points,
    shape_slopes=tetrahedra.shape_slopes,
    jacobians=tetrahedra.jacobians,
    quadrature=tetrahedra.quadrature,
    boundary_faces=tetrahedra.boundary_faces,
    face_quadrature=tetrahedra.face_quadrature,
)
KINDS = (HEXAHEDRON, TETRAHEDRON)


def cell_kind(cells: IntArray) -> CellKind:
    """Return the kind of cells (m, 27) or (m, 10). Raises `ContractError` for others."""
    for kind in KINDS:
        if cells.ndim == 2 and cells.shape[1] == kind.nodes:
            return kind
    raise ContractError(
        f"cells have shape {cells.shape}, not (m, 27) (hexahedra) or (m, 10) (tetrahedra of order 2)"
    )


def face_cell_kind(faces: IntArray) -> CellKind:
    """Return the kind of cells that faces (f, 9) or (f, 6) belong to. Raises `ContractError` for others."""
    for kind in KINDS:
        if faces.ndim == 2 and faces.shape[1] == kind.faces.shape[1]:
            return kind
    raise ContractError(f"faces have shape {faces.shape}, not (f, 9) (hexahedra) or (f, 6) (tetrahedra)")


def face_keys(faces: IntArray) -> IntArray:
    """Return (f, k) keys of faces, independent of their orientation."""
    return np.sort(faces[:, face_cell_kind(faces).face_key], axis=1)


def loose_edges(faces: IntArray) -> IntArray:
    """Return (e, 2) corner node ids of the edges that belong to only one of the faces."""
    corners = faces[:, face_cell_kind(faces).face_corners]
    edges = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(unique[count == 1])


def cell_volumes(nodes_m: Array, cells: IntArray) -> Array:
    """Return signed volumes (m,) in m³, exact."""
    return np.asarray(cell_kind(cells).quadrature(nodes_m, cells, 3)[1].sum(axis=1))


def area_vectors(nodes_m: Array, faces: IntArray) -> Array:
    """Return ∫ n dA (f, 3) in m² over each face."""
    _, normals = face_cell_kind(faces).face_quadrature(nodes_m, faces)
    return np.asarray(normals.sum(axis=1))


def area_vector(nodes_m: Array, faces: IntArray) -> Array:
    """Return ∮ n dA (3,) in m² over faces: zero if they are closed."""
    return np.asarray(area_vectors(nodes_m, faces).sum(axis=0))


def enclosed_volume(nodes_m: Array, faces: IntArray) -> float:
    """Return ∮ x·n dA / 3 in m³ over closed faces with normals outward: the divergence theorem."""
    points, normals = face_cell_kind(faces).face_quadrature(nodes_m, faces)
    return float(np.einsum("fqi,fqi->", points, normals) / 3)


def hollow_volume(nodes_m: Array, faces: IntArray, y0_m: float = 0.0) -> float:
    """Return −∫ (y − y₀) n_y dA in m³ over a cavity's faces: its volume if planes x, z or y = y₀ close it."""
    points, normals = face_cell_kind(faces).face_quadrature(nodes_m, faces)
    return -float(np.sum((points[..., 1] - y0_m) * normals[..., 1]))


def boundary_faces(cells: IntArray) -> tuple[IntArray, IntArray]:
    """Return the faces that belong to one cell only, normals out of it, and these cells' numbers (g,)."""
    return cell_kind(cells).boundary_faces(cells)


# A triangle's nodes as those of the square that collapses onto it, (a, b) → (a, b (1 − a)); 6 is the node at (½, ¼).
COLLAPSED = [0, 3, 1, 5, 6, 1, 2, 4, 1]


@dataclass(frozen=True, eq=False)
class SquareSkin:
    """Faces of either kind as faces of 9 nodes, for pictures.

    A quadratic triangle is exactly a square of 9 nodes with one collapsed edge; one of these nodes is interpolated.

    Attributes:
        nodes: (n,) used node ids.
        own: (g, 6) indices into them of each triangle's nodes; empty for hexahedra.
        faces: (g, 9) indices into the result of `values`.
    """

    nodes: IntArray
    own: IntArray
    faces: IntArray

    @staticmethod
    def from_faces(skin: IntArray) -> SquareSkin:
        """Return the square skin of faces (g, 9) or (g, 6)."""
        nodes, places = np.unique(skin, return_inverse=True)
        own: IntArray = places.reshape(skin.shape).astype(np.int64)
        if face_cell_kind(skin) is HEXAHEDRON:
            return SquareSkin(nodes, np.empty((0, 6), np.int64), own)
        extra = len(nodes) + np.arange(len(skin))[:, None]
        return SquareSkin(nodes, own, np.hstack([own, extra])[:, COLLAPSED])

    def values(self, nodal: Array) -> Array:
        """Return values at the points of `faces`, from those at all nodes of the mesh (n, …)."""
        kept = np.asarray(nodal[self.nodes])
        if not len(self.own):
            return kept
        weights = tetrahedra.face_shapes(np.array([[0.5, 0.25]]))[0]
        return np.concatenate([kept, np.tensordot(kept[self.own], weights, axes=(1, 0))])
