"""Fields as VTU files for ParaView, and PVD files that list the states of a branch.

Cells are VTK's triquadratic hexahedra or quadratic tetrahedra. A file's points are those at rest; `displacement_m`
moves them ("Warp By Vector").
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from pliant.meshing.meshio_package import require_meshio
from pliant.meshing.raising import VTK_ORDER
from pliant.records.fem import IntArray, ModuleFields
from pliant.store.store import write_atomically


def vtk_cells(cells: IntArray) -> IntArray:
    """Return (m, 27) cells in VTK's order of nodes, from lexicographic ones."""
    return np.asarray(cells)[:, VTK_ORDER]


def _block(cells: IntArray) -> tuple[str, IntArray]:
    """Return meshio's name of the cells (m, 27) or (m, 10), and the cells in VTK's order of nodes."""
    return ("tetra10", cells) if cells.shape[1] == 10 else ("hexahedron27", vtk_cells(cells))


def write_vtu(path: Path, fields: ModuleFields) -> None:
    """Write one state as a VTU file; nodes without a cell are left out."""
    meshio = require_meshio()
    used, cells = np.unique(fields.cells, return_inverse=True)
    data = {name: np.ascontiguousarray(values[used]) for name, values in fields.point_data.items()}
    mesh = meshio.Mesh(
        np.ascontiguousarray(fields.points_m[used]),
        [_block(cells.reshape(fields.cells.shape))],
        point_data={"displacement_m": np.ascontiguousarray(fields.displacement_m[used]), **data},
    )
    temporary = path.with_name(f".{path.name}")
    meshio.write(temporary, mesh, file_format="vtu")
    temporary.replace(path)


def write_pvd(path: Path, files: Sequence[tuple[float, str]]) -> None:
    """Write a ParaView collection: (time, file name) of each state."""
    sets = [f'    <DataSet timestep="{time:.10g}" part="0" file="{escape(name)}"/>' for time, name in files]
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">',
        "  <Collection>",
        *sets,
        "  </Collection>",
        "</VTKFile>",
    ]
    write_atomically(path, "\n".join(lines) + "\n")
