"""Volume meshes from files by meshio: nodes, solid cells of one kind, named surfaces and named volumes.

A name denotes a surface where it is a set of triangles or quadrilaterals (a physical group of gmsh, an element set
of Abaqus, a value of an integer cell array of VTK, named `array=value`), or a set of nodes (an Abaqus NSET, an
integer point array of VTK that is not zero there): then the faces are those whose corners all belong to it. A name
of a set of solid cells denotes a volume. Surfaces of an Abaqus or CalculiX deck (`*SURFACE, TYPE=ELEMENT`), which
meshio leaves out, are read here: a line of such a card is an element's number or the name of an element set, and the
side S1, S2, …
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import InvalidDesignError, UserError
from pliant.meshing.meshio_package import require_meshio
from pliant.meshing.raising import SOLID
from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant.regular_files import require_there

Members = list[tuple[int, int]]  # places of solid cells and their sides
FORMATS = {".msh": "gmsh", ".vtu": "vtu", ".vtk": "vtk", ".inp": "abaqus"}
SURFACE = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}  # corners of each kind of face
# Corners of a solid cell's faces, as Abaqus numbers them (S1, S2, …); nodes in VTK's order.
TETRA_FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
HEX_FACES = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))


@dataclass(frozen=True, eq=False)
class VolumeFile:
    """The content of a file, in its own frame and unit of length.

    Attributes:
        name: of the file, for messages.
        nodes: (n, 3).
        kind: of the solid cells, a key of `SOLID`.
        cells: (m, nodes of a cell) node ids in VTK's order.
        faces: name → corners (f, 3 or 4) of the surface's faces.
        node_sets: name → node ids.
        volumes: name → numbers of solid cells.
    """

    name: str
    nodes: Array
    kind: str
    cells: IntArray
    faces: Mapping[str, IntArray]
    node_sets: Mapping[str, IntArray]
    volumes: Mapping[str, IntArray]

    @property
    def surface_names(self) -> list[str]:
        """Names that may denote a surface; values of arrays only if there are no others."""
        names = sorted({*self.faces, *self.node_sets})
        return [name for name in names if "=" not in name] or names


def read_volume(path: Path) -> VolumeFile:
    """Read a mesh.

    Raises:
        UserError: no such file, a format that is not read, a file that meshio cannot read.
        InvalidDesignError: no solid cells, or solid cells of several kinds or of one that cannot be solved.
    """
    require_file(path)
    mesh = _read(path)
    solids = [k for k, block in enumerate(mesh.cells) if _dimension(block.type) == 3]
    kinds = {mesh.cells[k].type for k in solids}
    if not kinds:
        raise InvalidDesignError(
            f"mesh file '{path.name}' holds no solid cells, only {_listed(b.type for b in mesh.cells)}; mesh the "
            "volume, not its surface."
        )
    if len(kinds) > 1 or not kinds <= set(SOLID):
        raise InvalidDesignError(
            f"mesh file '{path.name}' holds {_listed(kinds)}; a module is meshed with cells of one kind: tetrahedra or "
            "hexahedra, of first or second order."
        )
    kind = kinds.pop()
    nodes = np.asarray(mesh.points, float)
    if nodes.ndim != 2 or nodes.shape[1] != 3 or not np.all(np.isfinite(nodes)):
        raise InvalidDesignError(f"mesh file '{path.name}' holds nodes that are no three finite coordinates.")
    cells = np.concatenate([np.asarray(mesh.cells[k].data, np.int64) for k in solids])
    starts = dict(zip(solids, np.cumsum([0, *(len(mesh.cells[k].data) for k in solids)])[:-1], strict=True))
    faces, volumes = _named(mesh, starts)
    for name, members in element_surfaces(path, volumes).items() if path.suffix.lower() == ".inp" else ():
        corners = TETRA_FACES if kind.startswith("tetra") else HEX_FACES
        faces[name] = np.array([cells[cell][list(corners[side - 1])] for cell, side in members], np.int64)
    return VolumeFile(path.name, nodes, kind, cells, faces, _node_sets(mesh), volumes)


def require_file(path: Path) -> None:
    """Raise `UserError` unless it is a file of a format that is read."""
    if path.suffix.lower() not in FORMATS:
        raise UserError(
            f"family.file '{path.name}' is none of {', '.join(FORMATS)} (gmsh, VTK, Abaqus); docs/your_cad_file.md "
            "shows how a STEP or STL file is meshed."
        )
    require_there(path, f"family.file '{path}'")


def _read(path: Path) -> Any:
    """Read meshio's mesh without its printed output."""
    meshio = require_meshio()
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            return meshio.read(path, file_format=FORMATS[path.suffix.lower()])
    except MemoryError:
        raise
    except (Exception, SystemExit) as error:  # meshio's readers raise whatever a broken file makes them raise
        why = " ".join(str(error).split())[:120] or type(error).__name__
        raise UserError(
            f"mesh file '{path.name}' could not be read as {FORMATS[path.suffix.lower()]}: {why}"
        ) from error


def _dimension(kind: str) -> int:
    if kind in SURFACE or kind.startswith(("triangle", "quad", "polygon")):
        return 2
    return 3 if kind.startswith(("tetra", "hexahedron", "wedge", "pyramid", "polyhedron")) else 1


def _listed(kinds: Any) -> str:
    names = sorted({str(kind) for kind in kinds})
    return " and ".join(names) if len(names) < 3 else ", ".join(names)


def _named(mesh: Any, starts: Mapping[int, int]) -> tuple[dict[str, IntArray], dict[str, IntArray]]:
    """Return corners of the faces, and numbers of the solid cells, of every named set."""
    faces: dict[str, list[IntArray]] = {}
    volumes: dict[str, list[IntArray]] = {}
    for name, k, chosen in _sets(mesh):
        block = mesh.cells[k]
        if block.type in SURFACE and len(chosen):
            faces.setdefault(name, []).append(np.asarray(block.data, np.int64)[chosen, : SURFACE[block.type]])
        elif k in starts and len(chosen):
            volumes.setdefault(name, []).append(chosen + starts[k])
    same = {name: parts for name, parts in faces.items() if len({part.shape[1] for part in parts}) == 1}
    return (
        {name: np.unique(np.concatenate(parts), axis=0) for name, parts in same.items()},
        {name: np.unique(np.concatenate(parts)) for name, parts in volumes.items()},
    )


def _sets(mesh: Any) -> Iterator[tuple[str, int, IntArray]]:
    """Yield (name, block, members) of cell sets, of gmsh's physical groups and of integer cell arrays."""
    names = {(int(tag), int(dimension)): name for name, (tag, dimension) in mesh.field_data.items()}
    for name, blocks in mesh.cell_sets.items():
        for k, members in enumerate(blocks):
            if members is not None and not name.startswith("gmsh:"):
                yield name, k, np.asarray(members, np.int64).ravel()
    for array, blocks in mesh.cell_data.items():
        for k, values in enumerate(blocks):
            values = np.asarray(values)
            if values.ndim != 1 or not np.issubdtype(values.dtype, np.integer):
                continue
            for value in np.unique(values).tolist():
                group = (
                    names.get((value, _dimension(mesh.cells[k].type))) if array == "gmsh:physical" else None
                )
                yield group or f"{array}={value}", k, np.flatnonzero(values == value)


def _node_sets(mesh: Any) -> dict[str, IntArray]:
    sets = {name: np.unique(np.asarray(ids, np.int64)) for name, ids in mesh.point_sets.items()}
    for name, values in mesh.point_data.items():
        values = np.asarray(values)
        if values.ndim == 1 and values.dtype.kind in "iub":
            sets[name] = np.flatnonzero(values)
    return sets


def element_surfaces(path: Path, volumes: Mapping[str, IntArray]) -> dict[str, Members]:
    """Return surface → (place of the solid cell, number of its side); other lines are skipped.

    Args:
        path: the deck.
        volumes: name → places of solid cells, of its element sets.
    """
    sets = {name.upper(): members for name, members in volumes.items()}
    surfaces: dict[str, list[tuple[str, int]]] = {}
    place: dict[int, int] = {}
    current: str | None = None
    kind = ""
    pending: list[str] = []
    for raw in path.read_text(errors="replace").splitlines():
        line = raw.strip()
        if not line or line.startswith("**"):
            continue
        if line.startswith("*"):
            kind, options = _card(line)
            current = (
                options.get("NAME")
                if kind == "SURFACE" and options.get("TYPE", "ELEMENT") == "ELEMENT"
                else None
            )
            solid = kind == "ELEMENT" and options.get("TYPE", "").startswith("C3D")
            kind = "SOLID" if solid else kind
            pending = []
        elif kind == "SOLID":
            pending += line.split(",")
            if not line.endswith(","):
                place[int(pending[0])] = len(place)
                pending = []
        elif current is not None:
            words = [word.strip().upper() for word in line.split(",")]
            if len(words) >= 2 and words[1][:1] == "S" and words[1][1:].isdigit():
                surfaces.setdefault(current, []).append((words[0], int(words[1][1:])))
    return {name: _members(lines, sets, place) for name, lines in surfaces.items()}


def _card(line: str) -> tuple[str, dict[str, str]]:
    """Return keyword and options in capitals; names of surfaces keep their case."""
    keyword, *options = line[1:].split(",")
    found = {}
    for option in options:
        key, _, value = option.partition("=")
        key = key.strip().upper()
        found[key] = value.strip() if key == "NAME" else value.strip().upper()
    return keyword.strip().upper(), found


def _members(lines: list[tuple[str, int]], sets: Mapping[str, IntArray], place: Mapping[int, int]) -> Members:
    found: Members = []
    for who, side in lines:
        if who.isdigit():
            found += [(place[int(who)], side)] if int(who) in place else []
        else:
            found += [(int(cell), side) for cell in np.asarray(sets.get(who, ()), int)]
    return found
