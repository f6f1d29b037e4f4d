"""A `ModuleMesh` as a curved NGSolve mesh, and which of a space's unknowns belong to which mesh node.

Straight hexahedra are made of the corner nodes; a quadratic vector field then bends them, so that the geometry is
exactly that of the 27 nodes.

Fixed, tied and linked displacements: each unknown is zero or ± one of those that are left.

Unknowns of a high-order field are no nodal values: those of an edge or face multiply functions that vanish at its
ends. A component is held, or equal, on an edge or face when the unknowns of all its nodes are treated so; how the
functions of two linked faces correspond is found by comparing their values.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from pliant.errors import ContractError, UserError
from pliant.meshing.hexahedra import FACES, jacobians, sample_points
from pliant.records.design import Array
from pliant.records.fem import IntArray, Link, ModuleMesh, ModuleProblem
from pliant_plugins.fem.constraints import Constraints, Forest
from pliant_plugins.fem.ngsolve.library import netgen, ngs

CORNERS = (0, 2, 8, 6, 18, 20, 26, 24)  # lexicographic places of NGSolve's hexahedron's vertices
FACE_CORNERS = (0, 2, 8, 6)  # of a face, in the order that keeps its normal
CAVITY, END, OUTSIDE = "cavity", "end", "outside"
SOLID = "solid"  # begins the name of a domain; the number of its region follows, 0 for the body
# (ξ, η, ζ) ∈ {0, ½, 1}³ of a cell's nodes
LATTICE = np.array([(i, j, k) for k in range(3) for j in range(3) for i in range(3)]) / 2


def curved_mesh(mesh: ModuleMesh) -> Any:
    """Return the NGSolve mesh; its cells are those of `mesh` in order, its vertices the corner nodes, ascending.

    Domains are named `solid0` (the body), `solid1`, … in the order of the mesh's regions; boundary elements `cavity`,
    `end` (of the end section) or `outside`. Raises `ContractError` where a cell is inverted.
    """
    if not np.all(jacobians(mesh.nodes_m, mesh.cells, sample_points()) > 0):
        raise ContractError("the family's mesh has inverted cells: det ∂X/∂ξ ≤ 0")
    corners = corner_nodes(mesh)
    straight = netgen.Mesh(dim=3)
    points = {int(node): straight.Add(netgen.MeshPoint(netgen.Pnt(*mesh.nodes_m[node]))) for node in corners}
    for number in range(len(mesh.regions) + 1):
        straight.SetMaterial(number + 1, f"{SOLID}{number}")
    for number, cell in zip(mesh.region_numbers.tolist(), mesh.cells[:, CORNERS].tolist(), strict=True):
        straight.Add(netgen.Element3D(number + 1, [points[node] for node in cell]))
    numbers = {}
    for place, name in enumerate((CAVITY, END, OUTSIDE)):
        face = netgen.FaceDescriptor(surfnr=place + 1, domin=1, domout=0, bc=place + 1)
        numbers[name] = straight.Add(face)
        straight.SetBCName(place, name)
    end = set(mesh.node_sets["end"].tolist())
    wetted = {tuple(sorted(face)) for face in mesh.cavity.tolist()}
    for face in mesh.skin.tolist():
        name = CAVITY if tuple(sorted(face)) in wetted else END if end.issuperset(face) else OUTSIDE
        straight.Add(netgen.Element2D(numbers[name], [points[face[i]] for i in FACE_CORNERS]))
    made = ngs.Mesh(straight)
    _bend(made, mesh, corners)
    return made


def corner_nodes(mesh: ModuleMesh) -> IntArray:
    """Return node ids of the cells' corners, ascending: NGSolve's vertex i is node `corner_nodes(mesh)[i]`."""
    return np.unique(mesh.cells[:, CORNERS])


def _bend(made: Any, mesh: ModuleMesh, corners: IntArray) -> None:
    """Set the quadratic deformation that puts every lattice point on its node."""
    scalar, vector = ngs.H1(made, order=2), ngs.VectorH1(made, order=2)
    table = nodal_table(scalar, mesh)
    straight = np.zeros((scalar.ndof, 3))
    straight[: len(corners)] = mesh.nodes_m[corners]
    bent = splu(table.tocsc()).solve(mesh.nodes_m - table @ straight)
    field = ngs.GridFunction(vector)
    for component in range(3):
        field.components[component].vec.FV().NumPy()[:] = bent[:, component]
    made.SetDeformation(field)


def nodal_table(space: Any, mesh: ModuleMesh) -> sparse.csr_matrix:
    """Return (nodes, unknowns): values of a scalar H1 field at the mesh's nodes."""
    # one cell for each node
    _, first = np.unique(mesh.cells, return_index=True)
    rows, columns, values = [], [], []
    wanted: dict[int, list[int]] = {}
    for place in first.tolist():
        wanted.setdefault(place // 27, []).append(place % 27)
    for cell, places in wanted.items():
        element = ngs.ElementId(ngs.VOL, cell)
        shape, dofs = space.GetFE(element), space.GetDofNrs(element)
        for place in places:
            value = np.array(shape.CalcShape(*LATTICE[place]))
            rows += [int(mesh.cells[cell, place])] * len(dofs)
            columns += dofs
            values.append(value)
    flat = np.concatenate(values)
    table = sparse.csr_matrix((flat, (rows, columns)), shape=(len(mesh.nodes_m), space.ndof))
    table.data[np.abs(table.data) < 1e-14] = 0.0
    table.eliminate_zeros()
    return table


def cell_values(space: Any, unknowns: Array, cells: IntArray) -> Array:
    """Return (k, 27) values of a scalar field at the nodes of some cells (k,), from all its unknowns."""
    values = np.empty((len(cells), 27))
    for place, cell in enumerate(cells.tolist()):
        element = ngs.ElementId(ngs.VOL, cell)
        shape, own = space.GetFE(element), unknowns[list(space.GetDofNrs(element))]
        values[place] = [np.array(shape.CalcShape(*point)) @ own for point in LATTICE]
    return values


def node_unknowns(space: Any, mesh: ModuleMesh) -> list[IntArray]:
    """Return for each mesh node the scalar unknowns of its vertex, edge, face or cell.

    A field vanishes on an edge or face when those of all the nodes on it do.
    """
    corners = corner_nodes(mesh)
    owned: list[IntArray] = [np.zeros(0, np.int64) for _ in mesh.nodes_m]
    between = _between(mesh)
    for place, node in enumerate(corners):
        owned[node] = np.array(space.GetDofNrs(ngs.NodeId(ngs.VERTEX, place)), np.int64)
    for entities in (space.mesh.edges, space.mesh.faces):
        for entity in entities:
            ends = tuple(sorted(int(corners[vertex.nr]) for vertex in entity.vertices))
            owned[between[ends]] = np.array(space.GetDofNrs(entity), np.int64)
    return owned


def supports(mesh: ModuleMesh) -> dict[int, tuple[int, ...]]:
    """Return for each node in the middle of an edge or face the corner nodes of that edge or face."""
    return {node: ends for ends, node in _between(mesh).items()}


def _between(mesh: ModuleMesh) -> dict[tuple[int, ...], int]:
    """Map sorted corner nodes of every edge and face to the node in its middle."""
    found: dict[tuple[int, ...], int] = {}
    for place, point in enumerate(np.rint(2 * LATTICE).astype(int)):
        if np.count_nonzero(point == 1) not in (1, 2):
            continue
        ranges = [(0, 2) if value == 1 else (int(value),) for value in point]
        ends = [i + 3 * j + 9 * k for i, j, k in itertools.product(*ranges)]
        keys = np.sort(mesh.cells[:, ends], axis=1)
        found.update(zip(map(tuple, keys.tolist()), mesh.cells[:, place].tolist(), strict=True))
    return found


SAME = 1e-8  # difference of two shape functions' values that is rounding
# (ξ, η) of sample points inside a face: enough to distinguish cubic functions
SAMPLES = np.array([(a, b) for b in np.linspace(0.05, 0.95, 6) for a in np.linspace(0.05, 0.95, 6)])


def eliminate(problem: ModuleProblem, scalar: Any, count: int) -> Constraints:
    """Return the map to the independent ones of `count` unknowns, the first 3 n of which are displacement components.

    Args:
        problem: names what is fixed, tied and linked.
        scalar: the H1 space (n unknowns) of one component.
        count: unknowns in all, pressures behind the displacements.

    Raises `ContractError` for a set that contains the middle of an edge or face but not its corners, `UserError` for
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
    """Return a set's nodes. Raises `ContractError` for a middle node of an edge or face whose corners are not in it."""
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
    """Return (first, second, sign) of unknowns on the linked faces. Raises `UserError` for loose nodes."""
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
    """Return unknowns of a cell's face and their functions' values (samples, unknowns) inside it."""
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
    """Return pairs of unknowns whose functions are equal but for a sign at the linked points."""
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
