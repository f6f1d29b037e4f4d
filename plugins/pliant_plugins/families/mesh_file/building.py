"""A file's mesh as the piece that is solved: quadratic cells in the module frame, with its cavity and node sets.

What can be solved on has cells neither inverted nor collapsed, and is one body without cracks (`require_sound`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from pliant.errors import InvalidDesignError, closest
from pliant.meshing.cells import cell_kind, hollow_volume
from pliant.meshing.raising import as_quadratic, mirrored_y
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh
from pliant_plugins.families.mesh_file.placing import (
    FLAT,
    UNITS,
    end_planes,
    mirror_side,
    require_sections,
    require_unit,
    require_whole_section,
    rotation,
)
from pliant_plugins.families.mesh_file.reading import VolumeFile, read_volume
from pliant_plugins.families.mesh_file.surfaces import (
    Skin,
    named_faces,
    require_disjoint,
    require_watertight,
    rows_in,
)

WORST = 1e-3  # scaled Jacobian below which a cell is refused
POOR = 0.05  # and below which it is remarked upon
COINCIDENT = 1e-7  # of the body's size
PLANES = ("start", "end", "symmetry")


@dataclass(frozen=True)
class Wanted:
    """Options for a file: its unit, its axes, its surfaces' names, the reference line's position (m) in its frame."""

    unit: str
    along: str
    up: str
    base: str
    tip: str
    cavities: tuple[str, ...]
    symmetry: str | None
    regions: tuple[str, ...]
    line_height_m: float
    line_across_m: float


@dataclass(frozen=True, eq=False)
class FilePiece:
    """The piece that is solved.

    Attributes:
        mesh: in the module frame, x from 0 to span, the reference line at y = z = 0. Node sets: `start`, `end`, `pin`
            (the start section's node nearest to the line), `symmetry` (y = 0) where the piece is half the width, else
            `level` (the start section's node farthest above or below the pin).
        span_m: its length.
        symmetric: whether the piece is half the width.
        remarks: sentences for the user.
    """

    mesh: ModuleMesh
    span_m: float
    symmetric: bool
    remarks: tuple[str, ...]


def read_piece(path: Path, wanted: Wanted) -> FilePiece:
    """Read, check and place a file. Raises `UserError` and `InvalidDesignError`, a sentence each."""
    state = path.stat() if path.is_file() else None
    return _piece(path, wanted, (state.st_mtime_ns, state.st_size) if state else None)


@lru_cache(maxsize=8)
def _piece(path: Path, wanted: Wanted, _state: tuple[int, int] | None) -> FilePiece:
    """Build the piece, cached because a chain's stages request a design's mesh several times."""
    file = read_volume(path)
    turn = rotation(wanted.along, wanted.up)
    nodes, file, cells = _quadratic(file, UNITS[wanted.unit] * file.nodes @ turn.T)
    require_unit(nodes, wanted.unit, file.name)
    poor = require_sound(nodes, cells, file.nodes[file.cells].mean(axis=1), file.name)
    skin = Skin.from_cells(nodes, cells)
    roles = [(wanted.base, "base"), (wanted.tip, "tip"), *((name, "cavity") for name in wanted.cavities)]
    if wanted.symmetry is not None:
        roles.append((wanted.symmetry, "symmetry"))
    chosen = {name: named_faces(file, skin, name, role) for name, role in roles}
    require_disjoint(chosen, file)
    nodes, span, lower = _placed(nodes, skin, chosen, wanted)
    small = require_sections(
        nodes, cells, [(name, skin.faces[chosen[name]]) for name in (wanted.base, wanted.tip)]
    )
    sets = _node_sets(nodes, span, wanted.symmetry is not None)
    planes = [np.isin(np.arange(len(nodes)), sets[name]) for name in PLANES if name in sets]
    for name in wanted.cavities:
        require_watertight(file.nodes, skin, chosen[name], planes, name)
    walls = {name: skin.corners[chosen[name]] for name in wanted.cavities}
    if lower:
        nodes, cells = mirrored_y(nodes, cells)
    mesh = replace(_mesh(nodes, cells, walls, sets), regions=_regions(file, wanted.regions))
    return FilePiece(
        mesh, span, wanted.symmetry is not None, (*_remarks(file, len(cells), poor, wanted.regions), *small)
    )


def _quadratic(file: VolumeFile, nodes: Array) -> tuple[Array, VolumeFile, IntArray]:
    """Return nodes that solid cells use, the file's sets renumbered to them, and quadratic cells."""
    used = np.unique(file.cells)
    number = np.full(len(nodes), -1, np.int64)
    number[used] = np.arange(len(used))
    faces = {name: number[ids] for name, ids in file.faces.items()}
    sets = {name: number[ids][number[ids] >= 0] for name, ids in file.node_sets.items()}
    own = VolumeFile(file.name, file.nodes[used], file.kind, number[file.cells], faces, sets, file.volumes)
    all_nodes, cells = as_quadratic(nodes[used], file.kind, own.cells)
    return all_nodes, own, cells


def _placed(
    nodes: Array, skin: Skin, chosen: dict[str, NDArray[np.bool_]], wanted: Wanted
) -> tuple[Array, float, bool]:
    """Return the nodes in the module frame, exactly on its planes; the span; whether the solid is at y ≤ 0."""
    base, tip = (skin.faces[chosen[name]] for name in (wanted.base, wanted.tip))
    ends = end_planes(nodes, base, tip, (wanted.base, wanted.tip))
    near = FLAT * ends.span_m
    for place, name in ((ends.base_m, wanted.base), (ends.tip_m, wanted.tip)):
        require_whole_section(nodes, skin.faces, chosen[name], place, 0, near, name)
    across, lower = wanted.line_across_m, False
    if wanted.symmetry is not None:
        faces = skin.faces[chosen[wanted.symmetry]]
        across, lower = mirror_side(nodes, faces, ends.span_m, wanted.symmetry)
        require_whole_section(nodes, skin.faces, chosen[wanted.symmetry], across, 1, near, wanted.symmetry)
    moved = nodes - np.array([ends.base_m, across, wanted.line_height_m])
    for axis, place in ((0, 0.0), (0, ends.span_m), *(((1, 0.0),) if wanted.symmetry is not None else ())):
        moved[np.abs(moved[:, axis] - place) <= near, axis] = place
    return moved, ends.span_m, lower


def _node_sets(nodes: Array, span: float, symmetric: bool) -> dict[str, IntArray]:
    x, y, z = nodes.T
    start = np.flatnonzero(x == 0.0)
    candidates = start[y[start] == 0.0] if symmetric else start
    candidates = candidates if len(candidates) else start
    pin = candidates[np.argmin(np.hypot(y[candidates], z[candidates]))]
    sets = {"start": start, "end": np.flatnonzero(x == span), "pin": np.array([pin])}
    if symmetric:
        return {**sets, "symmetry": np.flatnonzero(y == 0.0)}
    return {**sets, "level": start[[np.argmax(np.abs(z[start] - z[pin]))]]}


def _mesh(nodes: Array, cells: IntArray, walls: dict[str, IntArray], sets: dict[str, IntArray]) -> ModuleMesh:
    """Assemble the mesh; `walls` are (f, corners) of each cavity's faces, ascending."""
    skin = Skin.from_cells(nodes, cells)
    cavities = {}
    for number, (name, wall) in enumerate(walls.items(), start=1):
        faces = skin.faces[rows_in(skin.corners, wall)]
        _require_hollow(nodes, faces, name)
        cavities[f"pressure_{number}_pa"] = faces
    every = np.concatenate([*cavities.values()])
    return ModuleMesh(nodes, cells, every, skin.faces, sets, cavities=cavities if len(cavities) > 1 else {})


def _require_hollow(nodes: Array, faces: IntArray, name: str) -> None:
    """Raise `InvalidDesignError` where a cavity's faces enclose the solid instead of a hollow."""
    if hollow_volume(nodes, faces) <= 0:
        raise InvalidDesignError(
            f"surface '{name}' encloses no hollow: the solid lies on its inner side; name the chamber's wall, not the "
            "skin."
        )


def _regions(file: VolumeFile, names: tuple[str, ...]) -> dict[str, IntArray]:
    """Return cells of the named volumes. Raises `InvalidDesignError` for a missing or overlapping volume."""
    taken = np.zeros(len(file.cells), int)
    for name in names:
        if name not in file.volumes:
            known = ", ".join(sorted(file.volumes)) or "none"
            raise InvalidDesignError(
                f"mesh file '{file.name}' has no volume '{name}', which family.regions names"
                f"{closest(name, file.volumes)} Its volumes: {known}."
            )
        taken[file.volumes[name]] += 1
    if np.any(taken > 1):
        raise InvalidDesignError(
            f"family.regions of '{file.name}': {int((taken > 1).sum())} cells belong to two regions; a cell is of one "
            "material."
        )
    return {name: file.volumes[name] for name in names}


def _remarks(file: VolumeFile, count: int, poor: str | None, regions: tuple[str, ...]) -> tuple[str, ...]:
    parts = [name for name, own in file.volumes.items() if len(own) < len(file.cells) and "=" not in name]
    one = None
    if parts and not regions:
        one = (
            f"'{file.name}' names the volumes {', '.join(sorted(parts))}, all taken as one material; 'regions' of "
            "the family gives some of them their own."
        )
    names = {"tetra": "tetrahedra", "hexahedron": "hexahedra"}
    raised = None
    if file.kind in names:
        raised = (
            f"the {count} {names[file.kind]} of '{file.name}' are of first order; they are raised to second order, "
            "their edges staying straight."
        )
    return tuple(remark for remark in (raised, poor, one) if remark)


def scaled_jacobians(nodes_m: Array, cells: IntArray) -> Array:
    """Return (m,) smallest det ∂x/∂ξ of each cell over the product of its edges there: 1 for a cube.

    (Knupp, Int. J. Numer. Meth. Engng 48 (2000) 1165–1185.)
    """
    kind = cell_kind(cells)
    slopes = np.einsum("qnj,mni->mqij", kind.shape_slopes(kind.sample_points()), nodes_m[cells])
    lengths = np.linalg.norm(slopes, axis=2).prod(axis=-1)
    return np.asarray((np.linalg.det(slopes) / np.maximum(lengths, np.finfo(float).tiny)).min(axis=1))


def require_sound(nodes_m: Array, cells: IntArray, places: Array, name: str) -> str | None:
    """Raise `InvalidDesignError` for a mesh that cannot be solved on; a sentence where it is only poor.

    Args:
        nodes_m: (n, 3), all of them used.
        cells: quadratic.
        places: (m, 3) of the cells in the file.
        name: of the file.
    """
    quality = scaled_jacobians(nodes_m, cells)
    inverted = np.flatnonzero(quality <= 0)
    if len(inverted) == len(cells):
        raise InvalidDesignError(
            f"all {len(cells)} cells of '{name}' are inverted: their nodes run the other way round; export the mesh "
            "with right-handed cells."
        )
    if len(inverted):
        where = _place(places, inverted)
        raise InvalidDesignError(
            f"{len(inverted)} of {len(cells)} cells of '{name}' are inverted, the first at {where}; "
            "use a finer mesh where curved walls are thin, or cells of first order."
        )
    flat = np.flatnonzero(quality < WORST)
    if len(flat):
        raise InvalidDesignError(
            f"{len(flat)} of {len(cells)} cells of '{name}' are flat (scaled Jacobian {quality.min():.2g}, at least "
            f"{WORST:g} is needed), the first at {_place(places, flat)}; let the mesher optimise "
            "the volume mesh."
        )
    _require_one_body(nodes_m, cells, name)
    poor = int((quality < POOR).sum())
    if not poor:
        return None
    return (
        f"{poor} of {len(cells)} cells of '{name}' are of poor shape (scaled Jacobian down to {quality.min():.2g}): "
        "stresses there are rough."
    )


def _place(places: Array, chosen: IntArray) -> str:
    return "({:.4g}, {:.4g}, {:.4g}) in the file".format(*places[chosen[0]])


def _require_one_body(nodes_m: Array, cells: IntArray, name: str) -> None:
    grid = COINCIDENT * float(np.ptp(nodes_m, axis=0).max())
    double = len(nodes_m) - len(np.unique(np.round(nodes_m / grid).astype(np.int64), axis=0))
    if double:
        raise InvalidDesignError(
            f"{double} nodes of '{name}' coincide with others: the body has a crack there; merge coincident nodes."
        )
    rows, columns = np.repeat(cells[:, 0], cells.shape[1]), cells.ravel()
    links = sparse.coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(len(nodes_m),) * 2)
    bodies, _ = connected_components(links, directed=False)
    if bodies > 1:
        raise InvalidDesignError(
            f"'{name}' holds {bodies} bodies that share no nodes; a module is one body: fuse them, or mesh them as one."
        )
