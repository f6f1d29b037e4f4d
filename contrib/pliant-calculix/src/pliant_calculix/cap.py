"""Caps: thin soft discs that close the cavity at a section and take the pressure's thrust.

The front is in the section and shares the rim's nodes. All other nodes of a cap are coupled to the rim's: free soft
nodes would not meet the programs' equilibrium criterion. The stiffness of caps is negligible.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleProblem

THICKNESS = 0.02  # of the span
Weights = Mapping[int, float]  # by node; empty: held at zero
IN_SECTION = (1, 2)
_EDGES = np.array([[0, 1, 2], [2, 5, 8], [8, 7, 6], [6, 3, 0]])  # of a 9-node face


@dataclass(frozen=True, eq=False)
class Cap:
    """Discs of 15-node wedges over the openings of one section.

    Attributes:
        nodes_m: (n, 3) new nodes, numbered on from the nodes that were there before.
        wedges: (m, 15) node ids; the first face of each (nodes 1, 2, 3) is the wetted one.
        front: ids of the new nodes in the section's plane.
        behind: node of the back or of the upright edges → the front's node before it, with the same motion.
        follows: within the section, displacement component (1, 2) of a node = Σ weight · that of rim nodes.
    """

    nodes_m: Array
    wedges: IntArray
    front: IntArray
    behind: Mapping[int, int]
    follows: Mapping[tuple[int, int], Weights]


def no_cap() -> Cap:
    """Return an empty cap."""
    return _Builder(np.zeros((0, 3)), 0.0).done()


def build_cap(problem: ModuleProblem, nodes_m: Array, section: str = "end") -> Cap:
    """Build caps over all openings of the cavity in a section; none without an opening.

    Args:
        problem: the module.
        nodes_m: (n, 3) the mesh's nodes and those added to them so far.
        section: "end", or "start", whose nodes do not move along x.
    """
    outward = 1.0 if section == "end" else -1.0
    builder = _Builder(nodes_m, outward * THICKNESS * problem.span_m)
    for rim in _rims(problem, section):
        builder.fan(rim, _hub(problem, rim))
    cap = builder.done()
    if section == "end":
        return cap
    still: dict[tuple[int, int], Weights] = {(node, 0): {} for node in [*map(int, cap.front), *cap.behind]}
    return replace(cap, follows={**cap.follows, **still})


def _rims(problem: ModuleProblem, section: str) -> list[IntArray]:
    """Return polylines (2k + 1,) of corner and mid-edge nodes along the cavity's edges in a section."""
    edges = problem.mesh.cavity[:, _EDGES].reshape(-1, 3)
    edges = edges[np.isin(edges, problem.mesh.node_sets[section]).all(axis=1)]
    # an edge between two wetted faces borders no opening
    _, first, count = np.unique(edges[:, 1], return_index=True, return_counts=True)
    left = [tuple(int(i) for i in edge) for edge in edges[first[count == 1]]]
    rims = []
    while left:
        ends = [n for edge in left for n in (edge[0], edge[2])]
        loose = [n for n in ends if ends.count(n) == 1]
        line = [loose[0] if loose else ends[0]]
        while (step := next((e for e in left if line[-1] in (e[0], e[2])), None)) is not None:
            left.remove(step)
            line += [step[1], step[2] if step[0] == line[-1] else step[0]]
        rims.append(np.array(line, np.int64))
    return rims


def _hub(problem: ModuleProblem, rim: IntArray) -> tuple[Array, tuple[int, ...]]:
    """Return the centre of a fan and its fixed components: on the mirror planes where the rim ends."""
    nodes = problem.mesh.nodes_m[rim]
    hub, held = nodes[:-1:2].mean(axis=0), set()
    if rim[0] == rim[-1]:
        return hub, ()
    hub = (nodes[0] + nodes[-1]) / 2
    for place in (0, -1):
        mirrors = {
            component
            for name, components in problem.fixed.items()
            for component in components
            if component and rim[place] in problem.mesh.node_sets[name]
        }
        if not mirrors:
            raise UserError(
                "fem 'calculix' closes a cavity whose edges in the end sections are rings or end on mirror "
                "planes; this one ends elsewhere."
            )
        for component in mirrors:
            hub[component] = nodes[place, component]
        held |= mirrors
    return hub, tuple(sorted(held))


class _Builder:
    """A builder of wedges and of the couplings of their nodes."""

    def __init__(self, nodes_m: Array, thickness_m: float) -> None:
        self.rest, self.thickness = nodes_m, thickness_m
        self.places: list[Array] = []
        self.wedges: list[list[int]] = []
        self.front: list[int] = []
        self.behind: dict[int, int] = {}
        self.follows: dict[tuple[int, int], Weights] = {}

    def fan(self, rim: IntArray, hub: tuple[Array, tuple[int, ...]]) -> None:
        """Add wedges from the hub to each edge of the rim."""
        corners = [int(c) for c in np.unique(rim[::2])]
        centre = self._new(hub[0])
        for component in IN_SECTION:
            held = component in hub[1]
            self.follows[centre, component] = {} if held else {c: 1 / len(corners) for c in corners}
        spokes = {corner: self._halfway(centre, corner) for corner in corners}
        self.front += [centre, *spokes.values()]
        back: dict[tuple[int, float], int] = {}
        for a, m, b in zip(rim[:-2:2], rim[1::2], rim[2::2], strict=True):
            face, middles = [centre, int(a), int(b)], [spokes[int(a)], int(m), spokes[int(b)]]
            along, across = (self._at(i) - self._at(centre) for i in face[1:])
            if np.cross(along, across)[0] * self.thickness < 0:
                face, middles = [face[0], *face[:0:-1]], middles[::-1]
            upper = [self._behind(i, 1.0, back) for i in [*face, *middles]]
            upright = [self._behind(i, 0.5, back) for i in face]
            self.wedges.append([*face, *upper[:3], *middles, *upper[3:], *upright])

    def done(self) -> Cap:
        return Cap(
            np.array(self.places).reshape(-1, 3),
            np.array(self.wedges, np.int64).reshape(-1, 15),
            np.array(self.front, np.int64),
            self.behind,
            self.follows,
        )

    def _at(self, node: int) -> Array:
        count = len(self.rest)
        place: Array = self.rest[node] if node < count else self.places[node - count]
        return place

    def _new(self, place: Array) -> int:
        self.places.append(place)
        return len(self.rest) + len(self.places) - 1

    def _halfway(self, centre: int, corner: int) -> int:
        """Return the node in the middle of a spoke."""
        node = self._new((self._at(centre) + self._at(corner)) / 2)
        for component in IN_SECTION:
            weights = {n: w / 2 for n, w in self.follows[centre, component].items()}
            weights[corner] = weights.get(corner, 0.0) + 0.5
            self.follows[node, component] = weights
        return node

    def _behind(self, node: int, depth: float, known: dict[tuple[int, float], int]) -> int:
        """Return the node behind one of the front."""
        if (node, depth) not in known:
            behind = self._new(self._at(node) + [depth * self.thickness, 0.0, 0.0])
            known[node, depth] = behind
            self.behind[behind] = node
            for component in IN_SECTION:
                self.follows[behind, component] = self.follows.get((node, component), {node: 1.0})
        return known[node, depth]
