"""Structured 27-node hexahedra of a tendon joint: a quarter of the flexure, and the end link.

Flexure: x ∈ [0, c/2], y ∈ [0, w/2], the whole thickness. Link: three bands, exact for its flat faces; with its surface
and its collision shapes."""

from __future__ import annotations

import numpy as np

from pliant.meshing.grids import block, grid_cells, grid_lines, module_sets, numbered
from pliant.meshing.hexahedra import boundary_faces
from pliant.meshing.surfaces import FACE, mirrored
from pliant.records.design import Array
from pliant.records.fem import ModuleMesh
from pliant.records.shape import HalfShapes, Shape, TriangleMesh
from pliant_plugins.families.tendon_joint.geometry import JointGeometry

ELEMENTS = (4, 3, 2)  # along x, y, z


def build_mesh(geometry: JointGeometry, refinement: int = 1) -> ModuleMesh:
    """The quarter; node sets `start` (x = 0), `end` (x = c/2), `symmetry` (y = 0), `pin` (the origin).

    Bonded corners are where strains change fastest: the cells at the link and at the free edge are the smaller.
    """
    t = geometry.flexure_thickness_m
    along, across, through = (refinement * n for n in ELEMENTS)
    nodes, ids = numbered(
        block(
            geometry.span_m * _graded(along),
            geometry.flexure_width_m / 2 * _graded(across),
            grid_lines((-t / 2, t / 2), through),
        )
    )
    cells = grid_cells(ids)
    skin, _ = boundary_faces(cells)
    sets = module_sets(nodes, geometry.span_m)
    return ModuleMesh(nodes, cells, np.empty((0, 9), np.int64), skin, sets)


def _graded(elements: int) -> Array:
    """Grid lines from 0 to 1, mid-nodes included, closer toward 1: s ↦ s (2 − s)."""
    ends = np.linspace(0, 1, elements + 1)
    return grid_lines(ends * (2 - ends), 1)


CORNERS = [0, 2, 6, 8, 18, 20, 24, 26]  # local nodes of a 27-node cell
# The cube's faces as triangles over those corners, counter-clockwise seen from outside.
HULL = np.array(
    [
        [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
        [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5],
    ],
    np.int64,
)  # fmt: skip


def link_mesh(geometry: JointGeometry) -> ModuleMesh:
    """The whole width of the end link: bands below, beside and above the flexure's end."""
    half, edge = geometry.flexure_thickness_m / 2, geometry.link_height_m / 2
    z = np.array([-edge, -half, half, edge])
    face = np.array([geometry.lower_edge_x_m, geometry.span_m, geometry.span_m, geometry.upper_edge_x_m])
    z, face = (np.interp(np.arange(7) / 2, np.arange(4), line) for line in (z, face))
    back = geometry.module_length_m / 2
    y = geometry.link_width_m / 2 * np.array([-1.0, 0.0, 1.0])
    share = np.array([0.0, 0.5, 1.0])[:, None, None]
    positions = np.empty((3, 3, 7, 3))
    positions[..., 0] = face + share * (back - face)
    positions[..., 1] = y[:, None]
    positions[..., 2] = z
    nodes, ids = numbered(positions)
    cells = grid_cells(ids)
    return ModuleMesh(nodes, cells, np.empty((0, 9), np.int64), boundary_faces(cells)[0], {})


def link_surface(mesh: ModuleMesh) -> TriangleMesh:
    """The end link's skin as triangles."""
    return TriangleMesh(mesh.nodes_m, mesh.skin[:, FACE].reshape(-1, 3))


def half_shapes(geometry: JointGeometry) -> HalfShapes:
    """For each half the link's three bands and half of the flexure, all convex."""
    mesh = link_mesh(geometry)
    end = [mesh.nodes_m[cell[CORNERS]] for cell in mesh.cells] + [_flexure(geometry)]
    hulls = [TriangleMesh(corners, HULL) for corners in end]
    return HalfShapes(
        start=tuple(_convex(mirrored(hull, 0)) for hull in hulls), end=tuple(_convex(hull) for hull in hulls)
    )


def _flexure(geometry: JointGeometry) -> Array:
    """Corners (8, 3) of the flexure's half in the order of `CORNERS`."""
    x = (0.0, geometry.span_m)
    y, z = geometry.flexure_width_m / 2, geometry.flexure_thickness_m / 2
    return np.array([(i, j, k) for k in (-z, z) for j in (-y, y) for i in x])


def _convex(hull: TriangleMesh) -> Shape:
    return Shape("mesh", (), np.zeros(3), np.eye(3), hull)
