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


@suite.check("`fixed` names existing node sets and removes every rigid motion that the bend frame leaves.")
def supports_hold_the_body(subject: Subject) -> None:
    problem = problem_of(subject)
    mesh = problem.mesh
    for name in (*problem.fixed, *problem.contact_planes):
        require(
            len(mesh.node_sets.get(name, ())) > 0, f"node set '{name}' is used but does not exist or is empty"
        )
    held: dict[int, set[int]] = {0: set(), 1: set(), 2: set()}
    for name, components in problem.fixed.items():
        require(
            set(components) <= {0, 1, 2}, f"set '{name}' fixes components {components}, not some of 0, 1, 2"
        )
        for component in components:
            held[component] |= {int(node) for node in mesh.node_sets[name]}
    ends = {int(n) for name in ("start", "end") for n in mesh.node_sets[name]}
    require(
        ends <= held[0],
        "not all nodes of 'start' and 'end' have x held: the end sections would not stay plane",
    )
    centre = mesh.nodes_m.mean(axis=0)
    size = float(np.ptp(mesh.nodes_m, axis=0).max())
    rows = [(1.0, 0.0, -(mesh.nodes_m[n, 2] - centre[2]) / size) for n in held[1]]
    rows += [(0.0, 1.0, (mesh.nodes_m[n, 1] - centre[1]) / size) for n in held[2]]
    rank = np.linalg.matrix_rank(np.array(rows), tol=1e-6) if rows else 0
    require(
        rank == 3,
        f"the supports hold {rank} of 3 rigid motions (along y, along z, about x): the stiffness would be "
        "singular",
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
