"""A file's names as faces of the solid: which of its outer faces belong to each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.errors import InvalidDesignError, closest
from pliant.meshing.cells import boundary_faces, face_cell_kind, loose_edges
from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant_plugins.families.mesh_file.reading import VolumeFile

FEW = 3  # places that a message names


@dataclass(frozen=True, eq=False)
class Skin:
    """Outer faces of the solid.

    Attributes:
        faces: (g, 9) or (g, 6) node ids, normals out of the solid.
        corners: (g, 4 or 3) the faces' corners, ascending.
        middle: (g, 3) means of the corners, in the nodes' frame.
    """

    faces: IntArray
    corners: IntArray
    middle: Array

    @staticmethod
    def from_cells(nodes: Array, cells: IntArray) -> Skin:
        """Return the outer faces of quadratic cells."""
        faces, _ = boundary_faces(cells)
        corners = faces[:, face_cell_kind(faces).face_corners]
        return Skin(faces, np.sort(corners, axis=1), nodes[corners].mean(axis=1))


def named_faces(file: VolumeFile, skin: Skin, name: str, role: str) -> NDArray[np.bool_]:
    """Return (g,) which outer faces the name denotes.

    Args:
        file: has the names; its node ids are those of `skin`.
        skin: the outer faces.
        name: in the file.
        role: the family's key whose value is the name, for messages.

    Raises:
        InvalidDesignError: the file has no such surface, or faces of it are inside the solid or do not belong to it.
    """
    if name in file.faces:
        wanted = np.sort(file.faces[name], axis=1)
        found = rows_in(skin.corners, wanted) if wanted.shape[1] == skin.corners.shape[1] else _none(skin)
        lost = len(wanted) - int(found.sum())
        if lost:
            raise InvalidDesignError(
                f"surface '{name}' ({role}) of '{file.name}': {lost} of its {len(wanted)} faces are no outer faces of "
                "the solid; mesh surface and volume together, so that they share their nodes."
            )
        return found
    if name in file.node_sets:
        found = np.all(np.isin(skin.corners, file.node_sets[name]), axis=1)
        if not np.any(found):
            raise InvalidDesignError(
                f"node set '{name}' ({role}) of '{file.name}' holds all corners of no outer face of the solid."
            )
        return found
    known = file.surface_names
    listed = (
        ", ".join(known[:12]) if known else "none: name them where the mesh is made (docs/your_cad_file.md)"
    )
    raise InvalidDesignError(
        f"mesh file '{file.name}' has no surface '{name}', which family.{role} names{closest(name, known)} Its "
        f"surfaces: {listed}."
    )


def require_disjoint(chosen: Mapping[str, NDArray[np.bool_]], file: VolumeFile) -> None:
    """Raise `InvalidDesignError` where a face belongs to two surfaces."""
    names = list(chosen)
    for k, first in enumerate(names):
        for second in names[:k]:
            both = int((chosen[first] & chosen[second]).sum())
            if both:
                raise InvalidDesignError(
                    f"surfaces '{second}' and '{first}' of '{file.name}' share {both} faces; a face has one role."
                )


def require_watertight(
    places: Array, skin: Skin, cavity: NDArray[np.bool_], planes: Sequence[NDArray[np.bool_]], name: str
) -> None:
    """Raise `InvalidDesignError` where the cavity has an edge that no plane closes.

    Args:
        places: (n, 3) of the nodes in the file.
        skin: outer faces.
        cavity: (g,) which of them are wetted.
        planes: (n,) which nodes are on each end section and mirror plane, where neighbours and mirror images continue
            the solid.
        name: the surface's, for messages.
    """
    loose = loose_edges(skin.faces[cavity])
    for on_plane in planes:
        loose = loose[~on_plane[loose].all(axis=1)]
    if len(loose):
        at = "; ".join(_place(places[edge].mean(axis=0)) for edge in loose[:FEW])
        raise InvalidDesignError(
            f"the cavity '{name}' leaks: {len(loose)} edges of it belong to no second face of it and lie on no end "
            f"section or symmetry plane, the first at {at} in the file; add the faces that are missing to the surface."
        )


def _place(point: Array) -> str:
    return "({:.4g}, {:.4g}, {:.4g})".format(*point)


def _none(skin: Skin) -> NDArray[np.bool_]:
    return np.zeros(len(skin.faces), bool)


def rows_in(rows: IntArray, wanted: IntArray) -> NDArray[np.bool_]:
    """Return (n,) which rows are among the wanted ones."""
    both = np.unique(np.concatenate([wanted, rows]), axis=0, return_inverse=True)[1].reshape(-1)
    return np.isin(both[len(wanted) :], both[: len(wanted)])
