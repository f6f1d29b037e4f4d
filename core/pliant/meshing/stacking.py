"""Meshes of whole bodies from that of half a module: mirrored, repeated, welded, closed by a cap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pliant.errors import ContractError
from pliant.meshing.grids import grid_faces
from pliant.meshing.hexahedra import boundary_faces
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh

SAME = 1e-6  # of the body's size: closer nodes are merged
_CELL = np.arange(27).reshape(3, 3, 3)
_FACE = np.arange(9).reshape(3, 3)


def mirrored_mesh(mesh: ModuleMesh) -> ModuleMesh:
    """Return the mirror image in x = 0; cells stay right-handed, normals stay on their sides."""
    cells = mesh.cells[:, _CELL[:, :, ::-1].ravel()]
    cavity, skin = (faces[:, _FACE[:, ::-1].ravel()] for faces in (mesh.cavity, mesh.skin))
    sets = {**mesh.node_sets}
    sets["start"], sets["end"] = mesh.node_sets["end"], mesh.node_sets["start"]
    return ModuleMesh(mesh.nodes_m * np.array([-1.0, 1.0, 1.0]), cells, cavity, skin, sets, mesh.regions)


def moved_mesh(mesh: ModuleMesh, along_x_m: float) -> ModuleMesh:
    """Return the mesh translated along x."""
    return replace(mesh, nodes_m=mesh.nodes_m + np.array([along_x_m, 0.0, 0.0]))


def welded_meshes(pieces: Sequence[ModuleMesh]) -> ModuleMesh:
    """Weld adjacent pieces to one body: equal nodes are merged, inner faces are removed from the skin.

    Only the node set `symmetry` is kept; the caller defines the others. Regions of the same name are merged.
    """
    nodes = np.concatenate([piece.nodes_m for piece in pieces])
    grid = SAME * float(np.ptp(nodes, axis=0).max())
    _, first, number = np.unique(
        np.round(nodes / grid).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    number = number.reshape(-1)
    starts = np.cumsum([0] + [len(piece.nodes_m) for piece in pieces[:-1]])

    def renumbered(name: str) -> IntArray:
        parts = [getattr(piece, name) + start for piece, start in zip(pieces, starts, strict=True)]
        ids: IntArray = number[np.concatenate(parts)].astype(np.int64)
        return ids

    cells = renumbered("cells")
    symmetry = [p.node_sets["symmetry"] + s for p, s in zip(pieces, starts, strict=True)]
    skin, _ = boundary_faces(cells)
    sets = {"symmetry": np.unique(number[np.concatenate(symmetry)]).astype(np.int64)}
    return ModuleMesh(nodes[first], cells, renumbered("cavity"), skin, sets, _joined_regions(pieces))


def _joined_regions(pieces: Sequence[ModuleMesh]) -> dict[str, IntArray]:
    """Return the pieces' regions by name, with consecutive cell numbers."""
    starts = np.cumsum([0] + [len(piece.cells) for piece in pieces[:-1]])
    names = dict.fromkeys(name for piece in pieces for name in piece.regions)
    return {
        name: np.concatenate(
            [p.regions[name] + start for p, start in zip(pieces, starts, strict=True) if name in p.regions]
        )
        for name in names
    }


def stacked(half: ModuleMesh, span_m: float, modules: int) -> ModuleMesh:
    """Return modules in series from x = 0: each is the mesh of its end half, x ∈ [0, span], and its mirror image."""
    if modules < 1:
        raise ContractError(f"a stack needs at least one module, not {modules}")
    pieces = []
    for number in range(modules):
        joint = (2 * number + 1) * span_m
        pieces += [moved_mesh(mirrored_mesh(half), joint), moved_mesh(half, joint)]
    return welded_meshes(pieces)


def capped(body: ModuleMesh, at_x_m: float, thickness_m: float, layers: int = 1) -> ModuleMesh:
    """Return the body with its open end at x closed by a plate: end section and hole of the tube, extruded along x.

    The hole's rim must be an arc from the plane y = 0 back to it. The inner face of the plate joins the cavity.
    """
    tolerance = SAME * float(np.ptp(body.nodes_m, axis=0).max())
    on_end = np.abs(body.nodes_m[:, 0] - at_x_m) < tolerance
    section = body.skin[on_end[body.skin].all(axis=1)]
    rim = np.flatnonzero(on_end & np.isin(np.arange(len(on_end)), body.cavity))
    ring = _ordered(body.nodes_m[rim][:, 1:])
    disc, disc_faces = half_disc(body.nodes_m[rim][ring][:, 1:])

    used, faces = np.unique(section, return_inverse=True)
    flat = np.concatenate([body.nodes_m[used][:, 1:], disc])
    quads = np.concatenate([faces.reshape(section.shape), disc_faces + len(used)]).astype(np.int64)
    plate = _extruded(flat, quads, at_x_m, thickness_m, layers)
    # the disc's face towards the tube points along −x, out of the plate into the cavity
    inner = (disc_faces + len(used))[:, _FACE.T.ravel()]
    sets = {"symmetry": np.flatnonzero(np.abs(plate.nodes_m[:, 1]) < tolerance)}
    return welded_meshes([body, replace(plate, cavity=inner, node_sets=sets)])


def _ordered(points: Array) -> IntArray:
    """Return the order of the rim's points (y, z) from the bottom over y > 0 to the top."""
    middle = (points[:, 1].min() + points[:, 1].max()) / 2
    return np.argsort(np.arctan2(points[:, 0], middle - points[:, 1])).astype(np.int64)


def _extruded(flat: Array, quads: IntArray, x_m: float, thickness_m: float, layers: int) -> ModuleMesh:
    """Return cells over quadrilaterals (f, 9) in the plane (y, z); the first layer of nodes keeps its numbers."""
    lines = np.linspace(x_m, x_m + thickness_m, 2 * layers + 1)
    n = len(flat)
    nodes = np.column_stack([np.repeat(lines, n), np.tile(flat, (len(lines), 1))])
    quads = _facing_x(flat, quads)
    cells = np.concatenate(
        [np.concatenate([quads + n * (2 * k + i) for i in range(3)], axis=1) for k in range(layers)]
    )
    skin, _ = boundary_faces(cells)
    return ModuleMesh(nodes, cells, np.empty((0, 9), np.int64), skin, {})


def _facing_x(flat: Array, quads: IntArray) -> IntArray:
    """Orient the quadrilaterals' normals along +x, so that extruded cells are right-handed (ξ, η in the plane)."""
    corner, along_a, along_b = (flat[quads[:, node]] for node in (0, 2, 6))
    a, b = along_a - corner, along_b - corner
    turned = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0
    quads = quads.copy()
    quads[turned] = quads[turned][:, _FACE.T.ravel()]
    return quads


INNER = 0.55  # size of the inner block, as a share of the ring's


def half_disc(ring: Array) -> tuple[Array, IntArray]:
    """Return nodes (m, 2) and faces (f, 9) of the half disc in a ring (2n + 1, 2) of points (y, z), n ≥ 3.

    The ring's arc goes from y = 0 over y > 0 back to y = 0. An inner block of a × b elements fills the middle, and one
    layer of a + b + a = n elements joins it to the ring, so that no element degenerates at the centre.

    The first 2n + 1 nodes are the ring's. Faces are oriented as the ring: ∂/∂a × ∂/∂b along +x for a ring from
    the bottom (−z) over +y to the top.
    """
    elements = (len(ring) - 1) // 2
    if elements < 3 or len(ring) % 2 == 0:
        raise ContractError(f"a half disc needs a ring of 2n + 1 ≥ 7 nodes, not {len(ring)}")
    a = max(1, round(elements / 4))
    b = elements - 2 * a
    block = _inner_block(ring, a, b)
    rim = np.concatenate([block[:, 0], block[-1, 1:-1], block[::-1, -1]])  # bottom, far side, top
    layer = np.stack([ring, (ring + rim) / 2, rim], axis=1)  # [along the ring, inwards]

    count = len(ring)
    middle_ids = count + np.arange(count)
    block_ids = 2 * count + np.arange(block.shape[0] * block.shape[1]).reshape(block.shape[:2])
    rim_ids = np.concatenate([block_ids[:, 0], block_ids[-1, 1:-1], block_ids[::-1, -1]])
    layer_ids = np.stack([np.arange(count), middle_ids, rim_ids], axis=1)
    nodes = np.concatenate([ring, layer[:, 1], block.reshape(-1, 2)])
    faces = np.concatenate([grid_faces(layer_ids), grid_faces(block_ids)])
    return nodes, faces.astype(np.int64)


def _inner_block(ring: Array, a: int, b: int) -> Array:
    """Return points [i, j, 2] of the inner block: i from y = 0 outwards (2a + 1), j upwards (2b + 1)."""
    corners = ring[[0, 2 * a, 2 * (a + b), -1]]
    centre = (ring[0] + ring[-1]) / 2
    bottom, right_low, right_high, top = centre + INNER * (corners - centre)
    s = np.linspace(0, 1, 2 * a + 1)[:, None, None]
    t = np.linspace(0, 1, 2 * b + 1)[None, :, None]
    inner = bottom + t * (top - bottom)
    outer = right_low + t * (right_high - right_low)
    return np.asarray(inner + s * (outer - inner))
