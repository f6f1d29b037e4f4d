"""Mesh files from CAD with Netgen, which comes with ngsolve (LGPL): `pip install 'pliant[ngsolve]'`.

    from netgen.occ import OCCGeometry
    from pliant_plugins.families.mesh_file.netgen import write_mesh

    finger = OCCGeometry("finger.step").shape
    finger.faces.Min(X).name, finger.faces.Max(X).name = "base", "tip"
    write_mesh(finger, "finger.msh", largest=2.0)

Names of faces become names of surfaces, those of solids become names of volumes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.report.vtu import require_meshio
from pliant_plugins.native import torch_first

UNNAMED = ("", "default")


def write_mesh(shape: Any, path: str | Path, largest: float, order: int = 2, grading: float = 0.3) -> Path:
    """Mesh a `netgen.occ` shape with tetrahedra and write it with its names: a gmsh .msh file.

    Args:
        shape: the solid, its faces named (`face.name = "base"`); lengths are the CAD file's.
        path: of the file, with the suffix .msh.
        largest: largest edge of a cell, in the shape's unit.
        order: 2 for curved cells, 1 for straight ones.
        grading: how fast cells grow away from fine detail, 0 to 1.

    Raises:
        UserError: no .msh file, a shape without named faces.
    """
    path = Path(path)
    if path.suffix.lower() != ".msh":
        raise UserError(f"'{path.name}': meshes are written as gmsh files; end the name with .msh.")
    torch_first()
    from netgen.occ import OCCGeometry

    mesh = OCCGeometry(shape).GenerateMesh(maxh=largest, grading=grading)
    if order == 2:
        mesh.SecondOrder()
    write_netgen(mesh, path)
    return path


def write_netgen(mesh: Any, path: Path) -> None:
    """A `netgen.meshing.Mesh` with its names as a gmsh file. Raises `UserError` where no face has a name."""
    meshio = require_meshio()
    points = np.array([point.p for point in mesh.Points()], float)
    solid, solid_groups = _cells(mesh.Elements3D(), "tetra", (1, 0, 2, 3, 4, 5, 7, 8, 6, 9))
    faces, face_groups = _cells(mesh.Elements2D(), "triangle", (0, 1, 2, 5, 3, 4))
    names = {(k, 2): mesh.GetBCName(k - 1) for k in np.unique(face_groups).tolist()}
    names |= {(k, 3): mesh.GetMaterial(k) for k in np.unique(solid_groups).tolist()}
    names = {key: name for key, name in names.items() if name not in UNNAMED}
    if not any(dimension == 2 for _, dimension in names):
        raise UserError("no face of the shape has a name; name them as in face.name = 'base'.")
    # one number for each name: several faces may share one
    tags = {name: tag for tag, name in enumerate(sorted({(d, n) for (_, d), n in names.items()}), start=1)}
    groups = [
        np.array(
            [tags.get((dimension, names.get((k, dimension), "")), 0) for k in members.tolist()], np.int64
        )
        for members, dimension in ((solid_groups, 3), (face_groups, 2))
    ]
    out = meshio.Mesh(
        points,
        [solid, faces],
        cell_data={"gmsh:physical": groups, "gmsh:geometrical": groups},
        field_data={name: np.array([tag, dimension]) for (dimension, name), tag in tags.items()},
    )
    meshio.write(path, out, file_format="gmsh22", binary=False)


def _cells(elements: Any, kind: str, order: tuple[int, ...]) -> tuple[tuple[str, Any], Any]:
    """meshio's block of the elements, and the number of each one's face or solid."""
    nodes = np.array([[point.nr - 1 for point in element.points] for element in elements], np.int64)
    names = {"tetra": {4: "tetra", 10: "tetra10"}, "triangle": {3: "triangle", 6: "triangle6"}}
    groups = np.array([element.index for element in elements], np.int64)
    return (names[kind][nodes.shape[1]], nodes[:, list(order[: nodes.shape[1]])]), groups
