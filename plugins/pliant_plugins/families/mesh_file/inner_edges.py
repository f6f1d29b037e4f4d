"""Where a body has sharp inner edges, from the triangles of its skin.

At such an edge, as between the floor and a wall of a chamber, stress grows without bound, as r^(−0.46) where the solid
takes 270° (Williams, J. Appl. Mech. 19 (1952) 526–528): cells of one size converge slowly there, whatever their order.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import IntArray

LEAST_TURN_RAD = np.pi / 6  # of the normals: a finer mesh of a rounded edge stays below


def inner_edges(points: Array, triangles: IntArray) -> Array:
    """Ends (k, 2, 3) of the edges at which the skin turns inward, sharply.

    Args:
        points: (n, 3).
        triangles: (t, 3) of a closed skin, normals out of the body. An edge of more than two of them is none.
    """
    corners = points[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    edges = np.sort(np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    opposite = np.concatenate([triangles[:, (k + 2) % 3] for k in range(3)])
    unique, own, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    pairs = np.argsort(own.ravel(), kind="stable")[(count == 2)[np.sort(own.ravel())]].reshape(-1, 2)
    first, second = pairs.T % len(triangles)
    away = points[opposite[pairs[:, 1]]] - points[edges[pairs[:, 0], 0]]
    turned = np.einsum("ki,ki->k", normal[first], normal[second]) < np.cos(LEAST_TURN_RAD)
    above = np.einsum("ki,ki->k", away, normal[first]) > 0
    return np.asarray(points[unique[count == 2][turned & above]])


def skin_of(mesh: Any) -> tuple[Array, IntArray]:
    """Points (n, 3) and triangles (t, 3) of a Netgen mesh's outside, normals outward, without borders of volumes."""
    points = np.array([point.p for point in mesh.Points()], float)
    triangles = np.array([[v.nr - 1 for v in e.vertices[:3]] for e in mesh.Elements2D()], np.int64)
    faces = list(mesh.FaceDescriptors())
    # of an OCC shape in one volume or several, and of an STL file: numbers of the volumes on either side, 0 outside
    sides = np.array([(faces[e.index - 1].domin, faces[e.index - 1].domout) for e in mesh.Elements2D()])
    triangles[sides[:, 0] == 0] = triangles[sides[:, 0] == 0][:, ::-1]
    return points, triangles[(sides == 0).any(axis=1)]
