"""Mesh files from CAD with Netgen, which comes with ngsolve (LGPL): `pip install 'pliant[ngsolve]'`.

A face gets its name from the CAD shape (`face.name = "base"`) or from a function of the points on it. Names of solids
become names of volumes. `docs/your_cad_file.md` goes through it.

Cells may be smaller along sharp inner edges. There, as between the floor and a wall of a chamber, stress grows without
bound, as r^(−0.46) where the solid takes 270° (Williams, J. Appl. Mech. 19 (1952) 526–528): cells of one size converge
slowly, whatever their order.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.meshing.meshio_package import require_meshio
from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant_plugins.native import torch_first

UNNAMED = ("", "default")
LEAST_TURN_RAD = np.pi / 6  # of the normals: a finer mesh of a rounded edge stays below
Naming = Callable[[Array], str | None]
# meshio's names of cells, and Netgen's nodes in their order: Netgen's tetrahedra are left-handed.
KINDS = {4: "tetra", 10: "tetra10", 3: "triangle", 6: "triangle6"}
SOLID_ORDER, FACE_ORDER = (1, 0, 2, 3, 4, 5, 7, 8, 6, 9), (0, 1, 2, 5, 3, 4)


def mesh_cad(
    source: str | Path | Any,
    path: str | Path,
    largest: float,
    name: Naming | None = None,
    order: int = 2,
    grading: float = 0.3,
    inner: float | None = None,
) -> Path:
    """Mesh a body with tetrahedra and write it with its names: a gmsh .msh file.

    Args:
        source: a STEP or STL file, or a `netgen.occ` shape; lengths are those of the CAD program.
        path: of the mesh, with the suffix .msh.
        largest: largest edge of a cell, in the source's unit.
        name: from the points (n, 3) on a face to its name, None for the name that the shape gave it. An STL file's
            faces end at its sharp edges.
        order: 2 for curved cells, 1 for straight ones.
        grading: how fast cells grow away from fine detail, 0 to 1.
        inner: largest edge of a cell along sharp inner edges, where stress has its peaks; None: as elsewhere.

    Raises:
        UserError: no such file, another suffix than these, an `inner` out of its range, a body without named faces, one
            that Netgen cannot mesh.
    """
    path = Path(path)
    if path.suffix.lower() != ".msh":
        raise UserError(f"'{path.name}': meshes are written as gmsh files; end the name with .msh.")
    if inner is not None and not 0 < inner <= largest:
        raise UserError(
            f"inner = {inner:g}: the largest edge at inner edges is above 0 and at most {largest:g}."
        )
    geometry = _geometry(source)
    try:
        mesh = geometry.GenerateMesh(_sizes(geometry, largest, grading, inner))
    except Exception as error:  # Netgen's own exception has no public name
        raise UserError(
            f"Netgen could not mesh the body with edges up to {largest:g} ({error}); is it one closed solid?"
        ) from error
    if order == 2:
        mesh.SecondOrder()
    write_netgen(mesh, path, name)
    return path


def _sizes(geometry: Any, largest: float, grading: float, inner: float | None) -> Any:
    """Return Netgen's parameters; the inner edges are those of a first mesh of the skin."""
    from netgen.meshing import MeshingParameters, MeshingStep, Pnt

    sizes = MeshingParameters(maxh=largest, grading=grading)
    if inner is not None:
        skin = geometry.GenerateMesh(sizes, perfstepsend=MeshingStep.MESHSURFACE)
        for start, end in inner_edges(*outer_skin(skin)):
            sizes.RestrictHLine(Pnt(*start), Pnt(*end), inner)
    return sizes


def inner_edges(points: Array, triangles: IntArray) -> Array:
    """Return the ends (k, 2, 3) of the sharp re-entrant edges of the skin.

    Args:
        points: (n, 3).
        triangles: (t, 3) of a closed skin, normals out of the body. An edge shared by more than two of them is ignored.
    """
    corners = points[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    edges = np.sort(np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    opposite = np.concatenate([triangles[:, (k + 2) % 3] for k in range(3)])
    unique, own, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    pairs = np.argsort(own.ravel(), kind="stable")[(count == 2)[np.sort(own.ravel())]].reshape(-1, 2)
    first, second = pairs.T % len(triangles)
    away = points[opposite[pairs[:, 1]]] - points[edges[pairs[:, 0], 0]]
    turned = np.einsum("ki,ki->k", normal[first], normal[second]) < np.cos(LEAST_TURN_RAD)
    above = np.einsum("ki,ki->k", away, normal[first]) > 0
    return np.asarray(points[unique[count == 2][turned & above]])


def outer_skin(mesh: Any) -> tuple[Array, IntArray]:
    """Return points (n, 3) and triangles (t, 3) of a Netgen mesh's outside, normals outward, no inner borders."""
    points = np.array([point.p for point in mesh.Points()], float)
    triangles = np.array([[v.nr - 1 for v in e.vertices[:3]] for e in mesh.Elements2D()], np.int64)
    faces = list(mesh.FaceDescriptors())
    # of an OCC shape in one volume or several, and of an STL file: numbers of the volumes on either side, 0 outside
    sides = np.array([(faces[e.index - 1].domin, faces[e.index - 1].domout) for e in mesh.Elements2D()])
    triangles[sides[:, 0] == 0] = triangles[sides[:, 0] == 0][:, ::-1]
    return points, triangles[(sides == 0).any(axis=1)]


def _geometry(source: str | Path | Any) -> Any:
    torch_first()
    from netgen.occ import OCCGeometry
    from netgen.stl import STLGeometry

    if not isinstance(source, str | Path):
        return OCCGeometry(source)
    source = Path(source)
    if not source.is_file():
        raise UserError(f"CAD file '{source}' is no file.")
    if source.suffix.lower() in (".step", ".stp"):
        return OCCGeometry(str(source))
    if source.suffix.lower() == ".stl":
        return STLGeometry(str(source))
    raise UserError(f"CAD file '{source.name}' is none of .step, .stp, .stl.")


def write_netgen(mesh: Any, path: Path, name: Naming | None = None) -> None:
    """Write a `netgen.meshing.Mesh` with its names as a gmsh file. Raises `UserError` if no face has a name."""
    meshio = require_meshio()
    points = np.array([point.p for point in mesh.Points()], float)
    solid, solid_groups = _cells(mesh.Elements3D(), SOLID_ORDER)
    faces, face_groups = _cells(mesh.Elements2D(), FACE_ORDER)
    names = {(3, k): mesh.GetMaterial(k) for k in np.unique(solid_groups).tolist()}
    for k in np.unique(face_groups).tolist():
        given = name(points[np.unique(faces[1][face_groups == k])]) if name else None
        names[2, k] = given or mesh.GetBCName(k - 1)
    names = {key: own for key, own in names.items() if own not in UNNAMED}
    if not any(dimension == 2 for dimension, _ in names):
        raise UserError("no face of the body has a name; name them as in face.name = 'base'.")
    # one number for each name: several faces may share one
    pairs = sorted({(dimension, own) for (dimension, _), own in names.items()})
    tags = {pair: tag for tag, pair in enumerate(pairs, start=1)}
    groups = [
        np.array([tags.get((d, names.get((d, k), "")), 0) for k in members.tolist()], np.int64)
        for members, d in ((solid_groups, 3), (face_groups, 2))
    ]
    out = meshio.Mesh(
        points,
        [solid, faces],
        cell_data={"gmsh:physical": groups, "gmsh:geometrical": groups},
        field_data={own: np.array([tag, dimension]) for (dimension, own), tag in tags.items()},
    )
    meshio.write(path, out, file_format="gmsh22", binary=False)


def _cells(elements: Any, order: tuple[int, ...]) -> tuple[tuple[str, Any], Any]:
    """Return meshio's block of the elements, and the number of each one's face or solid."""
    nodes = np.array([[point.nr - 1 for point in element.points] for element in elements], np.int64)
    groups = np.array([element.index for element in elements], np.int64)
    count = nodes.shape[1]
    return (KINDS[count], nodes[:, list(order[:count])]), groups
