"""Structured 27-node hexahedra of half a tube's section, one slice along x, and the threads in its sleeve."""

from __future__ import annotations

import itertools

import numpy as np

from pliant.meshing.grids import grid_cells, grid_faces, grid_lines, module_sets, numbered
from pliant.meshing.hexahedra import CENTRE, boundary_faces
from pliant.records.design import Array
from pliant.records.fem import Fibres, IntArray, ModuleMesh
from pliant_plugins.families.fibre_reinforced.geometry import TubeGeometry

SHEET = "sheet"
# Elements along the slice, around half the section in arcs of at most so much, through liner and sleeve.
ALONG, ARC_RAD, LINER, SLEEVE = 1, 0.45, 2, 1


def build_mesh(geometry: TubeGeometry, refinement: int = 1) -> ModuleMesh:
    """The slice x ∈ [0, l/2], y ≥ 0, with the sheet as a region; `pin` is a corner of the sleeve at the bottom."""
    g = geometry
    ends, arcs = (0.0, g.sheet_angle_rad, np.pi), []
    for low, high in itertools.pairwise(ends):
        arcs.append(grid_lines((low, high), refinement * int(np.ceil((high - low) / ARC_RAD))))
    phi = np.concatenate([arcs[0], arcs[1][1:]])
    outer = g.radius_m + g.wall_m
    liner = grid_lines((g.radius_m, outer - g.sleeve_m), refinement * LINER)
    radius = np.concatenate([liner, grid_lines((outer - g.sleeve_m, outer), refinement * SLEEVE)[1:]])
    x = grid_lines((0.0, g.module_length_m / 2), refinement * ALONG)

    X, angle, rho = np.meshgrid(x, phi, radius, indexing="ij")
    places = np.stack([X, rho * np.sin(angle), g.axis_height_m - rho * np.cos(angle)], axis=-1)
    places[:, [0, -1], :, 1] = 0.0  # sin π leaves rounding
    nodes, ids = numbered(places)
    # the grid is left-handed in the module frame: one index runs backwards
    cells = grid_cells(ids[:, ::-1])
    skin, _ = boundary_faces(cells)
    sets = module_sets(nodes, g.module_length_m / 2, (0.0, 0.0, g.sleeve_m / 2))
    turn = _angles(g, nodes[cells[:, CENTRE]])
    sheet = np.intersect1d(in_sleeve(g, nodes, cells), np.flatnonzero(turn < g.sheet_angle_rad))
    return ModuleMesh(nodes, cells, grid_faces(ids[:, :, 0]), skin, sets, {SHEET: sheet})


def in_sleeve(geometry: TubeGeometry, nodes_m: Array, cells: IntArray) -> IntArray:
    """Numbers of the cells that hold threads."""
    y, z = nodes_m[cells[:, CENTRE], 1:].T
    beyond = geometry.radius_m + geometry.wall_m - geometry.sleeve_m
    return np.flatnonzero(np.hypot(y, z - geometry.axis_height_m) > beyond)


def winding(geometry: TubeGeometry, mesh: ModuleMesh, stiffness_n: float) -> tuple[Fibres, Fibres]:
    """Both windings, ±α from the axis: a thread of EA = `stiffness_n` at each spacing, spread over the sleeve."""
    cells = in_sleeve(geometry, mesh.nodes_m, mesh.cells)
    phi = _angles(geometry, mesh.nodes_m[mesh.cells[cells]])
    around = np.stack([np.zeros_like(phi), np.cos(phi), np.sin(phi)], axis=-1)
    along = np.broadcast_to(np.array([1.0, 0.0, 0.0]), around.shape)
    spread = stiffness_n / (geometry.thread_spacing_m * geometry.sleeve_m)
    c, s = np.cos(geometry.thread_angle_rad), np.sin(geometry.thread_angle_rad)
    plus, minus = (Fibres(cells, c * along + sign * s * around, spread) for sign in (1.0, -1.0))
    return plus, minus


def _angles(geometry: TubeGeometry, places: Array) -> Array:
    """φ of places (..., 3), from 0 at the bottom to π at the top."""
    return np.asarray(np.arctan2(places[..., 1], geometry.axis_height_m - places[..., 2]))
