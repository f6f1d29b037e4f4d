"""Structured 27-node hexahedra of x ∈ [0, l/2], y ≥ 0: a grid along the tube, around it and through its wall.

At angle φ from the bottom the wall's line runs straight from the bore's circle (a sin φ, d − a cos φ) to the tube's
(R sin φ, −R cos φ); nodes lie on both circles, so quadratic faces follow them to fourth order.
"""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh
from pliant_eccentric_tube.section import Section

AROUND, WALL, ALONG = 8, 2, 1


def build_mesh(section: Section, half_length_m: float, refinement: int = 1) -> ModuleMesh:
    """The mesh of half a module. Node sets: `start`, `end`, `symmetry` (y = 0), `pin` (bottom of the start)."""
    nodes = _grid(section, half_length_m, refinement)
    ids = np.arange(nodes[..., 0].size).reshape(nodes.shape[:3])  # [along, around, outward]
    cells = _cells(ids)
    # Outward is the last axis: the bore is its first layer, seen from inside.
    bore = _faces(ids[:, :, 0])
    skin = np.concatenate(
        [
            bore,
            _flipped(_faces(ids[:, :, -1])),
            _faces(ids[0]),
            _flipped(_faces(ids[-1])),
            _flipped(_faces(ids[:, 0])),
            _faces(ids[:, -1]),
        ]
    )
    flat = nodes.reshape(-1, 3)
    sets = {
        "start": ids[0].ravel(),
        "end": ids[-1].ravel(),
        "symmetry": np.concatenate([ids[:, 0].ravel(), ids[:, -1].ravel()]),
        "pin": ids[0, 0, -1:],
    }
    return ModuleMesh(flat, cells, bore, skin, sets)


def _grid(section: Section, half_length_m: float, refinement: int) -> Array:
    """Node positions [along, around, outward, 3]."""
    x = np.linspace(0.0, half_length_m, 2 * ALONG * refinement + 1)
    phi = np.linspace(0.0, np.pi, 2 * AROUND * refinement + 1)
    depth = np.linspace(0.0, 1.0, 2 * WALL * refinement + 1)[:, None]
    around = np.stack([np.sin(phi), -np.cos(phi)], axis=1)
    around[-1, 0] = 0.0  # sin π leaves rounding on the mirror plane
    inner = section.bore_m * around + np.array([0.0, section.offset_m])
    outer = section.outer_m * around
    wall = (1 - depth) * inner[:, None] + depth * outer[:, None]
    nodes = np.empty((len(x), *wall.shape[:2], 3))
    nodes[..., 0] = x[:, None, None]
    nodes[..., 1:] = wall
    return nodes


def _cells(ids: IntArray) -> IntArray:
    """Cells with ξ along the tube, η outward, ζ around: at the bottom x, −z, y, which is right-handed."""
    ordered = ids.transpose(0, 2, 1)
    windows = np.lib.stride_tricks.sliding_window_view(ordered, (3, 3, 3))[::2, ::2, ::2]
    return np.ascontiguousarray(windows.transpose(0, 1, 2, 5, 4, 3)).reshape(-1, 27)


def _faces(ids: IntArray) -> IntArray:
    """Faces of a layer [i, j]; local node a + 3b with a along i."""
    windows = np.lib.stride_tricks.sliding_window_view(ids, (3, 3))[::2, ::2]
    return np.ascontiguousarray(windows.transpose(0, 1, 3, 2)).reshape(-1, 9)


def _flipped(faces: IntArray) -> IntArray:
    """The same faces with the other normal."""
    return faces[:, np.arange(9).reshape(3, 3).T.ravel()]
