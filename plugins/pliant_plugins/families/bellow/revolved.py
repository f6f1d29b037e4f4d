"""Structured 27-node hexahedra of the wall alone: the profile, −t/2 to t/2 thick, revolved about the tube's axis.

Angles φ about the axis start at its −z side: y = ρ sin φ, z = axis height − ρ cos φ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.meshing.grids import grid_cells, grid_faces, numbered
from pliant.meshing.hexahedra import boundary_faces
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh
from pliant_plugins.families.bellow.profile import BellowProfile


@dataclass(frozen=True)
class RevolvedCounts:
    """Elements along each edge: each arc, flank, a quarter turn about the axis, through the wall.

    Two through the wall: with one, bending of the flanks is 10 % too soft.
    """

    arc: int
    flank: int
    quarter: int
    wall: int

    @staticmethod
    def from_profile(
        profile: BellowProfile, refinement: int, arc: int = 2, quarter: int = 3
    ) -> RevolvedCounts:
        """Return counts of a design: all given but the flank's, which follows its length."""
        flank = int(np.ceil(profile.flank_m / (0.7 * profile.module_length_m)))
        return RevolvedCounts(*(refinement * n for n in (arc, flank, quarter, 2)))


def half_profile(profile: BellowProfile, counts: RevolvedCounts) -> tuple[Array, Array]:
    """Return x and radius [i, k] of the wall from mid-crest to mid-trough, k through the wall from the cavity."""
    depth = profile.wall_m * np.linspace(-0.5, 0.5, 2 * counts.wall + 1)
    arc = np.linspace(0, np.pi / 2, 2 * counts.arc + 1)[:, None]
    parts = [profile.crest(arc, depth)]
    if counts.flank:
        parts.append(profile.flank(np.linspace(0, 1, 2 * counts.flank + 1)[1:, None], depth))
    parts.append(profile.trough(arc[1:], depth))
    x, radius = (np.concatenate(p) for p in zip(*parts, strict=True))
    x[-1] = profile.half_length_m  # cos π/2 leaves rounding
    return x, radius


def sector(
    profile: BellowProfile, counts: RevolvedCounts, quarters: int, axis_height_m: float = 0.0
) -> ModuleMesh:
    """Return half a module, x ∈ [0, l/2] from mid-crest to mid-trough, φ from 0 to 1 or 2 quarter turns.

    Node sets: `start` (x = 0), `end` (x = l/2), `symmetry` (y = 0), `level` (the plane z = axis height where one
    quarter ends there), `pin` (the trough's inner node at φ = 0).
    """
    x, radius = half_profile(profile, counts)
    phi = np.linspace(0, quarters * np.pi / 2, 2 * quarters * counts.quarter + 1)
    nodes, ids = numbered(_revolved(x, radius, phi, axis_height_m))
    sets = {**_ends(ids), "pin": ids[-1, :1, 0]}
    on_plane = ids[:, [0, -1]] if quarters == 2 else ids[:, 0]
    nodes[on_plane, 1] = 0.0  # sin π leaves rounding
    sets["symmetry"] = on_plane.ravel()
    if quarters == 1:
        nodes[ids[:, -1], 2] = axis_height_m
        sets["level"] = ids[:, -1].ravel()
    return _mesh(nodes, ids, sets)


def ring(profile: BellowProfile, counts: RevolvedCounts, axis_height_m: float = 0.0) -> ModuleMesh:
    """Return a whole module, x ∈ [0, l] from mid-trough over the crest to mid-trough, the full circumference.

    Node sets: `start` and `end`, whose nodes correspond in order, and `crest`, the section at mid-module.
    """
    x, radius = half_profile(profile, counts)
    x = np.concatenate([profile.half_length_m - x[::-1], profile.half_length_m + x[1:]])
    radius = np.concatenate([radius[::-1], radius[1:]])
    steps = 8 * counts.quarter
    phi = np.linspace(0, 2 * np.pi, steps + 1)[:-1]
    nodes, ids = numbered(_revolved(x, radius, phi, axis_height_m))
    mesh_ids = np.concatenate([ids, ids[:, :1]], axis=1)
    sets = {**_ends(ids), "crest": ids[len(x) // 2].ravel()}
    return _mesh(nodes, mesh_ids, sets)


def _revolved(x: Array, radius: Array, phi: Array, axis_height_m: float) -> Array:
    """Return positions [i, j, k, 3] of profile points [i, k] at angles [j]."""
    shape = (x.shape[0], len(phi), x.shape[1])
    y = radius[:, None] * np.sin(phi)[:, None]
    z = axis_height_m - radius[:, None] * np.cos(phi)[:, None]
    return np.stack([np.broadcast_to(x[:, None], shape), y, z], axis=-1)


def _ends(ids: IntArray) -> dict[str, IntArray]:
    return {"start": ids[0].ravel(), "end": ids[-1].ravel()}


def _mesh(nodes: Array, ids: IntArray, sets: dict[str, IntArray]) -> ModuleMesh:
    # the grid is left-handed in the module frame: one index runs backwards
    cells = grid_cells(ids[:, ::-1])
    skin, _ = boundary_faces(cells)
    return ModuleMesh(nodes, cells, grid_faces(ids[:, :, 0]), skin, sets)
