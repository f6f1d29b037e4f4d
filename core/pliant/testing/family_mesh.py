"""Checks of an `ActuatorFamily`'s mesh: valid elements, one closed body, a cavity, plane ends, supports."""

from __future__ import annotations

import numpy as np

from pliant.meshing.hexahedra import (
    FACE_CENTRE,
    area_vector,
    boundary_faces,
    cell_volumes,
    enclosed_volume,
    jacobians,
    sample_points,
)
from pliant.records.design import Array
from pliant.records.fem import ModuleProblem
from pliant.testing.suite import Finding, Subject, Suite, require, require_close

suite = Suite("family")
# Meshes follow curved walls by quadratic faces; this share of the volume may be lost.
VOLUME_TOLERANCE = 0.02


def problem_of(subject: Subject) -> ModuleProblem:
    """The problem of the example's design, made once."""
    problem: ModuleProblem = subject.once("problem", lambda: subject.build().problem())
    return problem


def mesh_finding(problem: ModuleProblem) -> str | None:
    """What is wrong with a mesh's elements, or None."""
    mesh = problem.mesh
    if mesh.cells.ndim != 2 or mesh.cells.shape[1] != 27:
        return f"cells have shape {mesh.cells.shape}, not (m, 27)"
    if not np.all(np.isfinite(mesh.nodes_m)):
        return "a node's position is not finite"
    determinants = jacobians(mesh.nodes_m, mesh.cells, sample_points())
    bad = np.unique(np.argwhere(determinants <= 0)[:, 0])
    if len(bad):
        return (
            f"{len(bad)} of {len(mesh.cells)} elements are inverted or collapsed (first: {bad[0]}): "
            "a left-handed node order, or an edge of no length"
        )
    return None


@suite.check("cells are 27-node hexahedra, local node i + 3j + 9k, with positive Jacobian everywhere.")
def elements_are_valid(subject: Subject) -> None:
    finding = mesh_finding(problem_of(subject))
    require(finding is None, str(finding))


@suite.check("elements share the nodes of their common faces; the mesh is one closed body.")
def mesh_is_one_closed_body(subject: Subject) -> None:
    mesh = problem_of(subject).mesh
    used = np.unique(mesh.cells)
    require(
        len(used) == len(mesh.nodes_m) and used[0] == 0,
        f"{len(mesh.nodes_m) - len(used)} nodes belong to no element: the stiffness would be singular",
    )
    size = float(np.ptp(mesh.nodes_m, axis=0).max())
    rounded = np.round(mesh.nodes_m / (1e-7 * size)).astype(np.int64)
    double = len(rounded) - len(np.unique(rounded, axis=0))
    require(double == 0, f"{double} nodes coincide with others: the body has a crack there; merge them")
    volume = float(cell_volumes(mesh.nodes_m, mesh.cells).sum())
    area, enclosed = area_vector(mesh.nodes_m, mesh.skin), enclosed_volume(mesh.nodes_m, mesh.skin)
    require(
        np.abs(area).max() < 1e-6 * size**2 and abs(enclosed - volume) < 1e-6 * volume,
        f"the skin encloses {enclosed:.4g} m³ and the elements fill {volume:.4g} m³: the skin misses faces "
        "or "
        "some normals point inward",
    )


@suite.check(
    "`cavity` holds wetted faces whose normal ∂x/∂a × ∂x/∂b points out of the solid, into the cavity."
)
def cavity_faces_point_into_the_cavity(subject: Subject) -> None:
    problem = problem_of(subject)
    mesh = problem.mesh
    if problem.actuation != "pressure_pa":
        require(len(mesh.cavity) == 0, f"a cavity has no meaning under {problem.actuation}")
        return
    require(len(mesh.cavity) > 0, "the cavity has no faces: pressure would do nothing")
    outward, _ = boundary_faces(mesh.cells)
    skin = {int(face[FACE_CENTRE]): face for face in outward}
    for number, face in enumerate(mesh.cavity):
        own = skin.get(int(face[FACE_CENTRE]))
        if own is None:
            raise Finding(f"cavity face {number} lies inside the solid or is no element's face")
        require(
            area_vector(mesh.nodes_m, face[None]) @ area_vector(mesh.nodes_m, own[None]) > 0,
            f"the normal of cavity face {number} points into the solid: swap its a and b",
        )


@suite.check("node sets `start` (x = 0) and `end` (x = span) hold exactly the nodes of these planes.")
def end_sections_are_plane(subject: Subject) -> None:
    problem = problem_of(subject)
    x, near = problem.mesh.nodes_m[:, 0], 1e-7 * problem.span_m
    require(
        x.min() > -near and x.max() < problem.span_m + near,
        f"the mesh reaches from x = {x.min():.6g} to {x.max():.6g} m, the piece from 0 to "
        f"{problem.span_m:.6g} m",
    )
    for name, place in (("start", 0.0), ("end", problem.span_m)):
        require(name in problem.mesh.node_sets, f"there is no node set '{name}'")
        given = np.unique(problem.mesh.node_sets[name])
        wanted = np.flatnonzero(np.abs(x - place) < near)
        require(
            len(wanted) > 0 and np.array_equal(given, wanted),
            f"node set '{name}' has {len(given)} nodes, the plane x = {place:.6g} m has {len(wanted)}",
        )


@suite.check("`fixed`, `tied` and `links` name existing nodes and leave no rigid motion free.")
def supports_hold_the_body(subject: Subject) -> None:
    problem = problem_of(subject)
    sets = problem.mesh.node_sets
    for name in (*problem.fixed, *problem.tied, *problem.contact_planes):
        require(len(sets.get(name, ())) > 0, f"node set '{name}' is used but does not exist or is empty")
    for name, components in (*problem.fixed.items(), *problem.tied.items()):
        require(
            set(components) <= {0, 1, 2}, f"set '{name}' holds components {components}, not some of 0, 1, 2"
        )
    held = {int(node) for name, parts in problem.fixed.items() if 0 in parts for node in sets[name]}
    for link in problem.links:
        if 0 in link.signs:
            held |= {int(node) for node in (*link.first, *link.second)}
    ends = {int(n) for name in ("start", "end") for n in sets[name]}
    require(
        ends <= held,
        "not all nodes of 'start' and 'end' have x held or linked: the end sections would not fit their neighbours",
    )
    rank = int(np.linalg.matrix_rank(_held_motions(problem), tol=1e-6))
    require(
        rank == 6,
        f"the supports hold {rank} of 6 rigid motions (three shifts, three turns): the stiffness would be singular",
    )


def _held_motions(problem: ModuleProblem) -> Array:
    """What each support says of a rigid motion (shift, turn · size) of v, (rows, 6): zero for the motions it allows."""
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


@suite.check("`links` pair different nodes one to one, with signs of ±1; ribbons have a width and stiffness.")
def couplings_are_possible(subject: Subject) -> None:
    problem = problem_of(subject)
    n = len(problem.mesh.nodes_m)
    for number, link in enumerate(problem.links):
        first, second = np.asarray(link.first), np.asarray(link.second)
        require(
            first.shape == second.shape and first.ndim == 1,
            f"link {number} pairs {first.shape} nodes with {second.shape}",
        )
        both = np.concatenate([first, second])
        require(
            len(np.unique(second)) == len(second) and both.min() >= 0 and both.max() < n,
            f"link {number} names a node twice or one that does not exist",
        )
        require(not np.any(first == second), f"link {number} pairs a node with itself")
        require(
            set(link.signs) <= {0, 1, 2} and all(abs(sign) == 1.0 for sign in link.signs.values()),
            f"link {number} has the signs {dict(link.signs)}, not ±1 by component 0, 1, 2",
        )
    for ribbon in problem.ribbons:
        require(
            ribbon.width_m >= 0 and ribbon.stiffness_n > 0,
            f"a ribbon has the width {ribbon.width_m:g} m and the stiffness {ribbon.stiffness_n:g} N",
        )


@suite.check("`refinement` multiplies the elements along each edge of the same body.")
def refinement_refines(subject: Subject) -> None:
    coarse, fine = problem_of(subject), subject.build().problem(refinement=2)
    n, m = len(coarse.mesh.cells), len(fine.mesh.cells)
    require(m >= 4 * n, f"refinement 2 has {m} elements, refinement 1 has {n}: the argument is not used")
    finding = mesh_finding(fine)
    require(finding is None, f"at refinement 2, {finding}")
    volumes = [cell_volumes(p.mesh.nodes_m, p.mesh.cells).sum() for p in (coarse, fine)]
    require_close(volumes[1], volumes[0], "refinement changes the body's volume (m³)", rtol=VOLUME_TOLERANCE)
    require(fine.span_m == coarse.span_m, "refinement changes span_m")
