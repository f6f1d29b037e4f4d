"""Rigid plates in the planes that walls must not cross: the counterpart of the skin in CalculiX' contact.

A plate is one 8-node brick whose face is in the plane and whose nodes are prescribed: at the start section they are
fixed, at the end section they stay in the section's plane like the cap's (`equation_cards`; contact cannot be combined
with `*MPC PLANE` in CalculiX 2.20). Its stiffness is negligible. Faces of the skin that reach the plane at rest are no
part of the contact surface: their nodes are already kept in the plane.

Contact is CalculiX' face-to-face penalty method without friction, linear in the overclosure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleProblem
from pliant_calculix.elements import deck_faces

MARGIN = 1.5  # of the piece's largest extent, beyond it on every side
THICK = 0.05  # of the span
STIFFNESS = 200.0  # of contact: shear moduli of pressure per mm of overclosure
PLATE_STIFFNESS = (
    1e-12  # Young's modulus over the contact's stiffness times 1 mm: all its nodes are prescribed
)
FACING = "S1"


@dataclass(frozen=True, eq=False)
class Plates:
    """Bricks at the planes.

    Attributes:
        nodes_m: (8 n, 3) new nodes; of each brick those of its face in the plane, then those behind.
        first: id of the first.
        planes: by plane, number of its brick.
        skin: (g, 9) faces of the skin that may meet a plane.
    """

    nodes_m: Array
    first: int
    planes: dict[str, int]
    skin: IntArray

    @property
    def bricks(self) -> IntArray:
        """(n, 8) node ids."""
        return self.first + np.arange(len(self.nodes_m)).reshape(-1, 8)

    def face(self, plane: str) -> IntArray:
        """Return (4,) ids in the plane, none without a plate."""
        return self.bricks[self.planes[plane], :4] if plane in self.planes else np.empty(0, np.int64)

    def back(self, plane: str) -> IntArray:
        """Return (4,) ids behind it."""
        return self.bricks[self.planes[plane], 4:] if plane in self.planes else np.empty(0, np.int64)


def build_plates(problem: ModuleProblem, first: int, contact: bool) -> Plates:
    """Build the plates of a module, none without contact; `first` is the id of their first node."""
    mesh = problem.mesh
    names = problem.contact_planes if contact else ()
    low, high = mesh.nodes_m.min(axis=0), mesh.nodes_m.max(axis=0)
    margin = MARGIN * float((high - low).max())
    (y0, z0), (y1, z1) = low[1:] - margin, high[1:] + margin
    # the first face turns so that its normal points to the nodes behind
    corners = {"end": [(y0, z0), (y1, z0), (y1, z1), (y0, z1)]}
    corners["start"] = corners["end"][::-1]
    nodes = []
    for name in names:
        x, outward = (0.0, -1.0) if name == "start" else (problem.span_m, 1.0)
        for at in (x, x + outward * THICK * problem.span_m):
            nodes += [(at, *corner) for corner in corners[name]]
    held = [*mesh.node_sets["start"], *mesh.node_sets["end"]]
    cut = np.isin(mesh.skin, held).any(axis=1)
    for ids in (mesh.node_sets[name] for name in problem.fixed):
        cut |= np.isin(mesh.skin, ids).all(axis=1)
    places = np.array(nodes).reshape(-1, 3)
    return Plates(places, first, {name: k for k, name in enumerate(names)}, mesh.skin[~cut])


def contact_cards(plates: Plates, cells: IntArray, first_element: int, stiffness: float) -> list[str]:
    """Return surfaces and pairs; `first_element` is the number of the first brick, `stiffness` in stress per mm."""
    if not plates.planes:
        return []
    elements, numbers = deck_faces(cells, plates.skin)
    cards = ["*SURFACE, NAME=SKIN, TYPE=ELEMENT"]
    cards += [f"{e + 1}, S{n}" for e, n in zip(elements, numbers, strict=True)]
    for name, k in plates.planes.items():
        cards += [f"*SURFACE, NAME=PLATE_{name.upper()}, TYPE=ELEMENT", f"{first_element + k}, {FACING}"]
    cards += ["*SURFACE INTERACTION, NAME=WALLS", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    cards += [f"{stiffness:.10g}, 0."]
    for name in plates.planes:
        cards += ["*CONTACT PAIR, INTERACTION=WALLS, TYPE=SURFACE TO SURFACE", f"SKIN, PLATE_{name.upper()}"]
    return cards
