"""Fixed, tied and linked displacements: each unknown is zero or ± one of those that are left.

Unknowns of a high-order field are no nodal values: those of an edge or face multiply functions that vanish at its
ends. A component is held, or equal, on an edge or face when the unknowns of all its nodes are treated so; how the
functions of two linked faces correspond is found by comparing their values.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.errors import ContractError, UserError
from pliant.meshing.hexahedra import FACES
from pliant.records.design import Array
from pliant.records.fem import IntArray, Link, ModuleMesh, ModuleProblem
from pliant_plugins.fem.constraints import Constraints, Forest
from pliant_plugins.fem.ngsolve.library import ngs
from pliant_plugins.fem.ngsolve.mesh import FACE_CORNERS, LATTICE, node_unknowns, supports

SAME = 1e-8  # difference of two shape functions' values that is rounding
# (ξ, η) of sample points inside a face: enough to tell cubic functions apart
SAMPLES = np.array([(a, b) for b in np.linspace(0.05, 0.95, 6) for a in np.linspace(0.05, 0.95, 6)])


def eliminate(problem: ModuleProblem, scalar: Any, count: int) -> Constraints:
    """The unknowns left of `count`, of which the first 3 n are those of the displacement components.

    Args:
        problem: names what is fixed, tied and linked.
        scalar: the H1 space (n unknowns) of one component.
        count: unknowns in all, pressures behind the displacements.

    Raises `ContractError` for a set that holds the middle of an edge or face but not its corners, `UserError` for
    links between other things than faces.
    """
    mesh, groups = problem.mesh, Forest(count)
    owned, ends = node_unknowns(scalar, mesh), supports(mesh)
    for name, components in problem.tied.items():
        nodes = _closed(name, mesh, ends)
        corner = [int(owned[node][0]) for node in nodes if node not in ends]
        inner = _joined(owned, [node for node in nodes if node in ends])
        for component in components:
            offset = component * scalar.ndof
            groups.fix(offset + inner)
            others = offset + np.array(corner[1:], np.int64)
            groups.join(np.full(len(others), offset + corner[0]), others, 1.0)
    for link in problem.links:
        for first, second, sign in _linked(link, mesh, scalar):
            for component, mirrored in link.signs.items():
                offset = component * scalar.ndof
                groups.join(np.array([offset + first]), np.array([offset + second]), sign * mirrored)
    for name, components in problem.fixed.items():
        nodes = _closed(name, mesh, ends)
        for component in components:
            groups.fix(component * scalar.ndof + _joined(owned, nodes))
    return groups.constraints()


def _joined(owned: list[IntArray], nodes: list[int]) -> IntArray:
    return np.concatenate([np.zeros(0, np.int64), *(owned[node] for node in nodes)])


def _closed(name: str, mesh: ModuleMesh, ends: dict[int, tuple[int, ...]]) -> list[int]:
    """A set's nodes. Raises `ContractError` where one stands in the middle of what does not belong to the set."""
    nodes = [int(node) for node in mesh.node_sets[name]]
    inside = set(nodes)
    for node in nodes:
        if not inside.issuperset(ends.get(node, ())):
            raise ContractError(
                f"the family's node set '{name}' holds node {node} in the middle of an edge or face whose corners "
                "are not in it; fem 'ngsolve' holds corners, whole edges and whole faces."
            )
    return nodes


def _linked(link: Link, mesh: ModuleMesh, scalar: Any) -> list[tuple[int, int, float]]:
    """(first, second, sign) of a scalar field's unknowns on the linked faces. Raises `UserError` for loose nodes."""
    partner = dict(zip(link.first.tolist(), link.second.tolist(), strict=True))
    faces = [face for face in mesh.skin.tolist() if all(node in partner for node in face)]
    loose = set(partner).difference(*faces)
    if loose:
        raise UserError(
            f"fem 'ngsolve' links whole faces of the mesh; {len(loose)} of {len(partner)} linked nodes are on none. "
            "Use fem.kind 'skfem' for this family."
        )
    ends = mesh.cells[:, FACES[:, FACE_CORNERS]].reshape(-1, 4).tolist()
    cells = {frozenset(corners): place // len(FACES) for place, corners in enumerate(ends)}
    found = []
    for face in faces:
        corners = [face[i] for i in FACE_CORNERS]
        other = [partner[node] for node in corners]
        if frozenset(other) not in cells:
            raise UserError("fem 'ngsolve': a link's second nodes are no faces of the mesh as its first are.")
        found += _same_functions(
            *(_trace(mesh, scalar, cells[frozenset(nodes)], nodes) for nodes in (corners, other))
        )
    return found


def _trace(mesh: ModuleMesh, scalar: Any, cell: int, corners: list[int]) -> tuple[IntArray, Array]:
    """Unknowns of a cell's face and their functions' values (samples, unknowns) inside it."""
    local = [int(np.flatnonzero(mesh.cells[cell] == node)[0]) for node in corners]
    a, b = SAMPLES[:, :1], SAMPLES[:, 1:]
    weights = ((1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b)
    points = sum(weight * LATTICE[place] for weight, place in zip(weights, local, strict=True))
    element = ngs.ElementId(ngs.VOL, cell)
    shape = scalar.GetFE(element)
    values = np.array([list(shape.CalcShape(*point)) for point in np.asarray(points)])
    present = np.abs(values).max(axis=0) > SAME
    return np.array(scalar.GetDofNrs(element), np.int64)[present], values[:, present]


def _same_functions(
    first: tuple[IntArray, Array], second: tuple[IntArray, Array]
) -> list[tuple[int, int, float]]:
    """Pairs of unknowns whose functions are equal but for a sign at the linked points."""
    pairs = []
    for unknown, values in zip(first[0].tolist(), first[1].T, strict=True):
        for sign in (1.0, -1.0):
            match = np.flatnonzero(np.abs(second[1] - sign * values[:, None]).max(axis=0) < SAME)
            if len(match) == 1:
                pairs.append((unknown, int(second[0][match[0]]), sign))
                break
        else:
            raise ContractError("fem 'ngsolve': the functions of two linked faces do not correspond.")
    return pairs
