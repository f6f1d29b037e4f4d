"""Checks of a family's problem, which describe errors in its mesh and supports in sentences.

Each function yields its findings, the first cause first. The conformance suite calls all of them; the FEM stage calls
those of `found_wrong` before the solution, since a cavity with a hole would give a module that is too stiff.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from pliant.errors import ContractError
from pliant.meshing.cells import (
    area_vector,
    area_vectors,
    boundary_faces,
    cell_kind,
    cell_volumes,
    enclosed_volume,
    face_keys,
    hollow_volume,
    loose_edges,
)
from pliant.records.actuation import actuation_kind, is_known
from pliant.records.design import Array
from pliant.records.fem import IntArray, ModuleMesh, ModuleProblem

NEAR = 1e-7  # of the span or the body's size: tolerance for planes and coincident points
FEW = 3  # largest number of places that a sentence names


def found_wrong(problem: ModuleProblem) -> str:
    """Return the first error that prevents a valid solution of the problem, else ""."""
    findings = chain(
        *(of(problem.mesh) for of in (cells_found, nodes_found)),
        *(of(problem) for of in (ends_found, links_found, supports_found, cavities_found, hollows_found)),
    )
    return next(findings, "")


def cells_found(mesh: ModuleMesh) -> Iterator[str]:
    """Yield errors of cells: an unknown kind, inverted or collapsed ones."""
    nodes, cells = mesh.nodes_m, mesh.cells
    try:
        kind = cell_kind(cells)
    except ContractError as error:
        yield str(error)
        return
    if not np.all(np.isfinite(nodes)):
        yield "a node's position is not finite"
        return
    bad = np.flatnonzero(np.any(kind.jacobians(nodes, cells, kind.sample_points()) <= 0, axis=1))
    if len(bad):
        place = _place(nodes[cells[bad[0]]].mean(axis=0))
        yield (
            f"{len(bad)} of {len(cells)} elements are inverted or collapsed (first: {bad[0]}, at {place} m): a "
            "left-handed node order, or an edge of no length"
        )


def nodes_found(mesh: ModuleMesh) -> Iterator[str]:
    """Yield nodes that belong to no cell."""
    used, count = np.unique(mesh.cells), len(mesh.nodes_m)
    if len(used) and (used[0] < 0 or used[-1] >= count):
        yield f"cells name nodes {used[0]} to {used[-1]}, and there are {count}"
    elif len(used) < count:
        yield f"{count - len(used)} nodes belong to no element: the stiffness would be singular"


def body_found(mesh: ModuleMesh) -> Iterator[str]:
    """Yield cracks, and a skin that is not the body's."""
    size = float(np.ptp(mesh.nodes_m, axis=0).max())
    count = len(mesh.nodes_m)
    double = count - len(np.unique(np.round(mesh.nodes_m / (NEAR * size)).astype(np.int64), axis=0))
    if double:
        yield f"{double} nodes coincide with others: the body has a crack there; merge them"
    volume = float(cell_volumes(mesh.nodes_m, mesh.cells).sum())
    area, enclosed = area_vector(mesh.nodes_m, mesh.skin), enclosed_volume(mesh.nodes_m, mesh.skin)
    if np.abs(area).max() >= 1e-6 * size**2 or abs(enclosed - volume) >= 1e-6 * volume:
        yield (
            f"the skin encloses {enclosed:.4g} m³ and the elements fill {volume:.4g} m³: the skin misses faces or "
            "some normals point inward"
        )


def cavities_found(problem: ModuleProblem) -> Iterator[str]:
    """Yield cavities whose faces are missing, inside the solid, reversed, or not divided among several pressures."""
    mesh, pressures = problem.mesh, _pressures(problem)
    if not pressures:
        if len(mesh.cavity):
            yield f"a cavity has no meaning under {problem.actuation}"
        return
    if not len(mesh.cavity):
        yield "the cavity has no faces: pressure would do nothing"
        return
    if len(problem.actuations) > 1:
        yield from _parts_found(mesh, pressures)
    yield from _faces_found(mesh)


def hollows_found(problem: ModuleProblem) -> Iterator[str]:
    """Yield cavities that leak, have faces on a plane where the module continues, or enclose the solid."""
    mesh, pressures = problem.mesh, _pressures(problem)
    if not pressures or not len(mesh.cavity):
        return
    planes, linked = _planes(problem), _linked(problem)
    several = len(problem.actuations) > 1
    each = (
        {name: mesh.cavities.get(name, mesh.cavity[:0]) for name in pressures}
        if several
        else {"": mesh.cavity}
    )
    for name, faces in each.items():
        if len(faces):
            whose = f"the cavity of '{name}'" if name else "the cavity"
            yield from _hollow_found(mesh, faces, planes, linked, whose)


def _pressures(problem: ModuleProblem) -> list[str]:
    return [
        name for name in problem.actuations if is_known(name) and actuation_kind(name).name == "pressure_pa"
    ]


def _parts_found(mesh: ModuleMesh, pressures: Sequence[str]) -> Iterator[str]:
    """Yield an error unless `cavities` divide the faces of `cavity`."""
    for name in pressures:
        if not len(mesh.cavities.get(name, ())):
            yield f"'{name}' has no faces in `mesh.cavities`"
            return
    parts = sorted(key for name in pressures for key in map(tuple, face_keys(mesh.cavities[name]).tolist()))
    if parts != sorted(map(tuple, face_keys(mesh.cavity).tolist())):
        yield "`cavities` together are not the faces of `cavity`"


def _faces_found(mesh: ModuleMesh) -> Iterator[str]:
    """Yield cavity faces that are not outer faces of the solid, or point into it."""
    faces = boundary_faces(mesh.cells)[0]
    outer, own = face_keys(faces), face_keys(mesh.cavity)
    unique, place = np.unique(np.concatenate([outer, own]), axis=0, return_inverse=True)
    place = place.reshape(-1)
    at = np.full(len(unique), -1)
    at[place[: len(outer)]] = np.arange(len(outer))
    found = at[place[len(outer) :]]
    if np.any(found < 0):
        yield f"cavity face {int(np.argmax(found < 0))} lies inside the solid or is no element's face"
        return
    along = np.einsum(
        "fi,fi->f", area_vectors(mesh.nodes_m, mesh.cavity), area_vectors(mesh.nodes_m, faces[found])
    )
    if np.any(along <= 0):
        yield f"the normal of cavity face {int(np.argmax(along <= 0))} points into the solid: swap its a and b"


def _hollow_found(
    mesh: ModuleMesh,
    faces: IntArray,
    planes: Sequence[Plane],
    linked: NDArray[np.bool_],
    name: str,
) -> Iterator[str]:
    """Yield an error unless faces and planes where the module continues enclose a hollow; `linked`: (n,) nodes."""
    for plane in planes:
        inside = np.flatnonzero(plane.nodes[faces].all(axis=1))
        if len(inside):
            at = f"the plane {plane}, where the module continues"
            yield f"{len(inside)} faces of {name} lie in {at}: they are no wall"
            return
    loose = loose_edges(faces)
    for on in (linked, *(plane.nodes for plane in planes)):
        loose = loose[~on[loose].all(axis=1)]
    if len(loose):
        at = "; ".join(_place(mesh.nodes_m[edge].mean(axis=0)) for edge in loose[:FEW])
        yield (
            f"{name} leaks: {len(loose)} of its edges belong to no second face of it and lie in no plane where the "
            f"module goes on ({', '.join(map(str, planes))}), the first at {at} m"
        )
        return
    y0 = next((plane.place_m for plane in planes if plane.axis == 1), 0.0)
    if hollow_volume(mesh.nodes_m, faces, y0) <= 0:
        yield f"{name} encloses no hollow: its faces go around the solid"


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane across an axis where the module continues beyond the piece, and which nodes (n,) are in it."""

    axis: int
    place_m: float
    nodes: NDArray[np.bool_]

    def __str__(self) -> str:
        return f"{'xyz'[self.axis]} = {self.place_m:.4g}"


def _planes(problem: ModuleProblem) -> list[Plane]:
    """Return the end sections and the symmetry planes, in which the nodes of a set are fixed."""
    x, near = problem.mesh.nodes_m, NEAR * problem.span_m
    places = [(0, 0.0), (0, problem.span_m)]
    for name, components in problem.fixed.items():
        nodes = x[problem.mesh.node_sets[name]] if name in problem.mesh.node_sets else x[:0]
        if len(nodes) > 1:
            flat = [c for c in (1, 2) if c in components and np.ptp(nodes[:, c]) < near]
            places += [(c, float(nodes[:, c].mean())) for c in flat]
    return [Plane(c, place, np.abs(x[:, c] - place) < near) for c, place in dict.fromkeys(places)]


def _linked(problem: ModuleProblem) -> NDArray[np.bool_]:
    """Return (n,) whether a node is linked to another one, where a piece meets its image."""
    found = np.zeros(len(problem.mesh.nodes_m), bool)
    for link in problem.links:
        found[link.first] = found[link.second] = True
    return found


def ends_found(problem: ModuleProblem) -> Iterator[str]:
    """Yield an error unless node sets `start` and `end` are exactly the nodes of the planes x = 0 and x = span."""
    x, span, near = problem.mesh.nodes_m[:, 0], problem.span_m, NEAR * problem.span_m
    if abs(x.min()) > near or abs(x.max() - span) > near:
        yield f"the mesh reaches from x = {x.min():.6g} to {x.max():.6g} m, the piece from 0 to {span:.6g} m"
    for name, place in (("start", 0.0), ("end", span)):
        if name not in problem.mesh.node_sets:
            yield f"there is no node set '{name}'"
            continue
        given, wanted = np.unique(problem.mesh.node_sets[name]), np.flatnonzero(np.abs(x - place) < near)
        if not len(wanted) or not np.array_equal(given, wanted):
            yield f"node set '{name}' has {len(given)} nodes, the plane x = {place:.6g} m has {len(wanted)}"


def supports_found(problem: ModuleProblem) -> Iterator[str]:
    """Yield errors unless `fixed`, `tied` and `links` name existing nodes, and fix end sections and rigid motions."""
    sets = problem.mesh.node_sets
    missing = [
        name
        for name in (*problem.fixed, *problem.tied, *problem.contact_planes)
        if not len(sets.get(name, ()))
    ]
    for name in missing:
        yield f"node set '{name}' is used but does not exist or is empty"
    for name, parts in (*problem.fixed.items(), *problem.tied.items()):
        if not set(parts) <= {0, 1, 2}:
            yield f"set '{name}' holds components {parts}, not some of 0, 1, 2"
    if missing:
        return
    held = [sets[name] for name, parts in problem.fixed.items() if 0 in parts]
    held += [nodes for link in problem.links if 0 in link.signs for nodes in (link.first, link.second)]
    ends = np.concatenate([sets["start"], sets["end"]])
    if not held or not np.isin(ends, np.concatenate(held)).all():
        fit = "the end sections would not fit their neighbours"
        yield f"not all nodes of 'start' and 'end' have x held or linked: {fit}"
    rank = int(np.linalg.matrix_rank(_held_motions(problem), tol=1e-6))
    if rank != 6:
        free = "rigid motions (three shifts, three turns): the stiffness would be singular"
        yield f"the supports hold {rank} of 6 {free}"


def _held_motions(problem: ModuleProblem) -> Array:
    """Return the constraints of the supports on a rigid motion (shift, rotation · size) of v, (rows, 6)."""
    mesh = problem.mesh
    x = mesh.nodes_m - mesh.nodes_m.mean(axis=0)
    x = x / np.ptp(mesh.nodes_m, axis=0).max()
    # v = a + b × x at every node, by component: (n, 3, 6)
    motion = np.zeros((len(x), 3, 6))
    motion[:, [0, 1, 2], [0, 1, 2]] = 1.0
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        motion[:, i, 3 + j], motion[:, i, 3 + k] = x[:, k], -x[:, j]
    rows = [np.zeros((1, 6))]
    for name, components in problem.fixed.items():
        rows += [motion[mesh.node_sets[name], c] for c in components]
    for name, components in problem.tied.items():
        nodes = mesh.node_sets[name]
        rows += [motion[nodes[1:], c] - motion[nodes[:1], c] for c in components]
    for link in problem.links:
        rows += [motion[link.second, c] - sign * motion[link.first, c] for c, sign in link.signs.items()]
    return np.concatenate(rows)


def links_found(problem: ModuleProblem) -> Iterator[str]:
    """Yield links that do not pair nodes one to one, and ribbons without width or stiffness."""
    n = len(problem.mesh.nodes_m)
    for number, link in enumerate(problem.links):
        first, second = np.asarray(link.first), np.asarray(link.second)
        if first.shape != second.shape or first.ndim != 1:
            yield f"link {number} pairs {first.shape} nodes with {second.shape}"
            return
        both = np.concatenate([first, second])
        if len(np.unique(second)) != len(second) or (len(both) and (both.min() < 0 or both.max() >= n)):
            yield f"link {number} names a node twice or one that does not exist"
        if np.any(first == second):
            yield f"link {number} pairs a node with itself"
        if not (set(link.signs) <= {0, 1, 2} and all(abs(sign) == 1.0 for sign in link.signs.values())):
            yield f"link {number} has the signs {dict(link.signs)}, not ±1 by component 0, 1, 2"
    for ribbon in problem.ribbons:
        if not (ribbon.width_m >= 0 and ribbon.stiffness_n > 0):
            yield f"a ribbon has the width {ribbon.width_m:g} m and the stiffness {ribbon.stiffness_n:g} N"


def _place(point: Array) -> str:
    return "({:.4g}, {:.4g}, {:.4g})".format(*(np.round(point, 12) + 0.0))  # without −0 and rounding
