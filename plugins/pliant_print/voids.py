"""The voids of a stack of modules: which wall of the surface bounds which cavity, and the openings at both ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pliant.records.design import Array
from pliant.records.fem import IntArray
from pliant.records.shape import TriangleMesh
from pliant_print.boolean import surface, united
from pliant_print.chain_solid import ChainSolid
from pliant_print.loops import Loop, Mask, end_loops, on_plane

NEAR = 1e-4  # of the size: a cavity's node so near to a wall lies on it
BORE = "bore"  # a passage that no pressure acts in


@dataclass(frozen=True, eq=False)
class Ends:
    """Both ends of a stack of modules.

    Attributes:
        whole: the surface of all bodies as one.
        base, tip: loops of the two end sections; `Loop.void` numbers the voids, −1 for outer edges.
        voids: number → the name of the pressure in it, or `bore`; `closed_…` for voids without an opening.
        outer: which faces of `whole` belong to the outer skin, without the end sections.
    """

    whole: TriangleMesh
    base: list[Loop]
    tip: list[Loop]
    voids: dict[int, str]
    outer: Mask

    def named(self, loop: Loop) -> str:
        """Return the name of the void behind a hole."""
        return self.voids.get(loop.void, BORE)

    def kept(self, loops: list[Loop], names: tuple[str, ...]) -> list[Loop]:
        """Return the outer loops, and the holes of voids with these names."""
        return [one for one in loops if not one.is_hole or self.named(one) in names]


def stack_ends(chain: ChainSolid) -> Ends:
    """Return the openings of a chain's modules before it is closed."""
    whole = surface(united(chain.bodies.values()))
    size = float(np.ptp(whole.vertices_m, axis=0).max())
    normal = _normal_x(whole)
    base = on_plane(whole, chain.start_m, size) & (normal < 0)
    tip = on_plane(whole, chain.end_m, size) & (normal > 0)
    label, outer = _components(whole, ~(base | tip))
    voids = _named(whole, label, outer, chain, size)
    vertex = np.where(label == outer, -1, label)
    sides = ~(base | tip)
    of_face = label[whole.faces[:, 0]]
    return Ends(
        whole,
        end_loops(whole, base, vertex),
        end_loops(whole, tip, vertex),
        voids,
        sides & (of_face == outer),
    )


def _normal_x(whole: TriangleMesh) -> Array:
    corners = whole.vertices_m[whole.faces]
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 0])


def _components(whole: TriangleMesh, sides: Mask) -> tuple[IntArray, int]:
    """Return for each vertex the component of the side faces that it is on, and the number of the outer one."""
    faces, n = whole.faces[sides], len(whole.vertices_m)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    graph = sparse.coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    used = np.unique(faces)
    label = label.astype(np.int64)
    outer = label[used[np.argmax(np.abs(whole.vertices_m[used, 1:]).max(axis=1))]]
    return label, int(outer)


def _named(
    whole: TriangleMesh, label: IntArray, outer: int, chain: ChainSolid, size: float
) -> dict[int, str]:
    """Return the names of the walls that are not the outer skin, from the cavities of the first and the last module."""
    numbers = np.unique(label[label != outer])
    found: dict[int, str] = {}
    for module, (rotation, position) in ((chain.first, chain.first_pose), (chain.last, chain.last_pose)):
        for name, points in module.cavities.items():
            tree = cKDTree(points @ rotation.T + position)
            for number in numbers.tolist():
                if number in found:
                    continue
                distance, _ = tree.query(whole.vertices_m[label == number])
                if distance.min() < NEAR * size:
                    found[number] = name
    return found


def void_bodies(filled: Any, part: Any) -> list[Any]:
    """Return the connected hollows of a part: its filled outline without it, without crumbs of rounding."""
    pieces = (filled - part).decompose()
    largest = max((float(one.volume()) for one in pieces), default=0.0)
    return [one for one in pieces if float(one.volume()) > 1e-4 * largest]
