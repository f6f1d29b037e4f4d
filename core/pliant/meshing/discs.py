"""A half disc of 9-node quadrilaterals that fits a given ring of nodes: what closes a tube's end.

The ring's arc of 2n + 1 nodes runs from y = 0 over y > 0 back to y = 0. An inner block of a × b elements takes the
middle, one layer of a + b + a = n elements joins it to the ring: no element degenerates at the centre.
"""

from __future__ import annotations

import numpy as np

from pliant.errors import ContractError
from pliant.meshing.grids import grid_faces
from pliant.records.design import Array
from pliant.records.fem import IntArray

INNER = 0.55  # size of the inner block, as a share of the ring's


def half_disc(ring: Array) -> tuple[Array, IntArray]:
    """Nodes (m, 2) and faces (f, 9) of the half disc in a ring (2n + 1, 2) of points (y, z), n ≥ 3.

    The first 2n + 1 nodes are the ring's. Faces are oriented as the ring runs: ∂/∂a × ∂/∂b along +x for a ring from
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
    """Points [i, j, 2] of the inner block: i from y = 0 outwards (2a + 1), j upwards (2b + 1)."""
    corners = ring[[0, 2 * a, 2 * (a + b), -1]]
    centre = (ring[0] + ring[-1]) / 2
    bottom, right_low, right_high, top = centre + INNER * (corners - centre)
    s = np.linspace(0, 1, 2 * a + 1)[:, None, None]
    t = np.linspace(0, 1, 2 * b + 1)[None, :, None]
    inner = bottom + t * (top - bottom)
    outer = right_low + t * (right_high - right_low)
    block: Array = inner + s * (outer - inner)
    return block
