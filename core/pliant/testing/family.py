"""Checks of an `ActuatorFamily`: the mesh is a body with a cavity, masses fit it, bad designs are refused."""

from __future__ import annotations

import numpy as np
from pydantic import ValidationError

from pliant.errors import InvalidDesignError
from pliant.interfaces.family import ActuatorFamily
from pliant.records.design import Array, MassProperties, ModuleMass
from pliant.records.fem import IntArray, ModuleProblem
from pliant.testing.common import quantity_of
from pliant.testing.hexahedra import boundary_faces, cell_volumes, face_integrals, jacobians, sample_points
from pliant.testing.suite import Finding, Subject, Suite, require, require_close

suite = Suite("family")
DENSITY = 1000.0
AXES = {"revolute": 1, "prismatic": 1, "spherical": 3}
ACTUATIONS = ("pressure_pa", "tendon_force_n")
# Meshes follow curved walls by quadratic faces; this share of the volume may be lost.
VOLUME_TOLERANCE = 0.02


def _problem(subject: Subject) -> ModuleProblem:
    problem: ModuleProblem = subject.once("problem", lambda: subject.build().problem())
    return problem


def _mass(subject: Subject) -> ModuleMass:
    mass: ModuleMass = subject.once("mass", lambda: subject.build().mass(DENSITY))
    return mass


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
    finding = mesh_finding(_problem(subject))
    require(finding is None, str(finding))


@suite.check("elements share the nodes of their common faces; the mesh is one closed body.")
def mesh_is_one_closed_body(subject: Subject) -> None:
    mesh = _problem(subject).mesh
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
    area, enclosed = face_integrals(mesh.nodes_m, mesh.skin)
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
    problem = _problem(subject)
    mesh = problem.mesh
    if problem.actuation != "pressure_pa":
        require(len(mesh.cavity) == 0, f"a cavity has no meaning under {problem.actuation}")
        return
    require(len(mesh.cavity) > 0, "the cavity has no faces: pressure would do nothing")
    outward, _ = boundary_faces(mesh.cells)
    skin = {int(face[4]): face for face in outward}

    def area(face: IntArray) -> Array:
        return face_integrals(mesh.nodes_m, face[None])[0]

    for number, face in enumerate(mesh.cavity):
        own = skin.get(int(face[4]))
        if own is None:
            raise Finding(f"cavity face {number} lies inside the solid or is no element's face")
        require(
            area(face) @ area(own) > 0,
            f"the normal of cavity face {number} points into the solid: swap its a and b",
        )


@suite.check("node sets `start` (x = 0) and `end` (x = span) hold exactly the nodes of these planes.")
def end_sections_are_plane(subject: Subject) -> None:
    problem = _problem(subject)
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
    problem = _problem(subject)
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
    coarse, fine = _problem(subject), subject.build().problem(refinement=2)
    n, m = len(coarse.mesh.cells), len(fine.mesh.cells)
    require(m >= 4 * n, f"refinement 2 has {m} elements, refinement 1 has {n}: the argument is not used")
    finding = mesh_finding(fine)
    require(finding is None, f"at refinement 2, {finding}")
    volumes = [cell_volumes(p.mesh.nodes_m, p.mesh.cells).sum() for p in (coarse, fine)]
    require_close(volumes[1], volumes[0], "refinement changes the body's volume (m³)", rtol=VOLUME_TOLERANCE)
    require(fine.span_m == coarse.span_m, "refinement changes span_m")


@suite.check("u = angle_scale · θ is the module's angle: angle_scale · span = module length > 0.")
def piece_fits_the_module(subject: Subject) -> None:
    family: ActuatorFamily = subject.build()
    problem = _problem(subject)
    require(family.module_length_m > 0, f"module_length_m is {family.module_length_m}")
    require_close(
        problem.angle_scale * problem.span_m,
        family.module_length_m,
        "angle_scale times the solved piece's span is not the module's length",
        rtol=1e-9,
    )
    require(
        problem.energy_scale >= problem.angle_scale,
        f"energy_scale {problem.energy_scale:g} is smaller than angle_scale {problem.angle_scale:g}: "
        "the module holds at least as many pieces as lie along it",
    )


@suite.check("`joint`, `axes` and the problem's axis and actuation fit together.")
def axes_fit_the_joint(subject: Subject) -> None:
    family: ActuatorFamily = subject.build()
    require(family.joint in AXES, f"joint is '{family.joint}'; known: {', '.join(AXES)}")
    require(
        len(set(family.axes)) == AXES[family.joint] and set(family.axes) <= {"x", "y", "z"},
        f"a {family.joint} joint has {AXES[family.joint]} of the axes x, y, z, not {family.axes}",
    )
    problem = _problem(subject)
    require(problem.axis in family.axes, f"the problem's axis '{problem.axis}' is none of {family.axes}")
    require(
        problem.actuation in ACTUATIONS,
        f"the actuation '{problem.actuation}' is none of {', '.join(ACTUATIONS)}",
    )


@suite.check(
    "the module's mass is that of the solid that is solved: density · energy_scale · volume of the piece."
)
def mass_is_that_of_the_mesh(subject: Subject) -> None:
    problem, mass = _problem(subject), _mass(subject)
    solid = problem.energy_scale * float(cell_volumes(problem.mesh.nodes_m, problem.mesh.cells).sum())
    require_close(
        mass.start.mass_kg + mass.end.mass_kg,
        DENSITY * solid,
        "the mass (kg) is not that of the meshed body: a forgotten mirror half or end",
        rtol=VOLUME_TOLERANCE,
    )


@suite.check("masses and inertias are positive and proportional to the density.")
def mass_scales_with_density(subject: Subject) -> None:
    light, heavy = _mass(subject), subject.build().mass(3 * DENSITY)
    for name in ("start", "end"):
        one, three = getattr(light, name), getattr(heavy, name)
        require(one.mass_kg > 0, f"the {name} half's mass is {one.mass_kg} kg")
        require_close(
            three.mass_kg, 3 * one.mass_kg, f"the {name} half's mass ignores the density", rtol=1e-9
        )
        require_close(
            three.inertia_kg_m2,
            3 * one.inertia_kg_m2,
            f"the {name} half's inertia ignores the density",
            rtol=1e-9,
        )
        require_close(three.com_m, one.com_m, "the centre of mass depends on the density", rtol=1e-9)


@suite.check("inertias are about the centre of mass and those of a real body.")
def inertia_is_physical(subject: Subject) -> None:
    for name in ("start", "end"):
        piece: MassProperties = getattr(_mass(subject), name)
        inertia = piece.inertia_kg_m2
        require_close(
            inertia,
            inertia.T,
            f"the {name} half's inertia is not symmetric",
            atol=1e-9 * np.abs(inertia).max(),
        )
        moments = np.linalg.eigvalsh(inertia)
        require(moments[0] > 0, f"the {name} half's principal moments {moments} are not all positive")
        require(
            moments[0] + moments[1] >= moments[2] * (1 - 1e-9),
            f"the {name} half's principal moments {moments} break the triangle inequality: inertia of no "
            "body",
        )
        length = subject.build().module_length_m
        size = float(np.ptp(_problem(subject).mesh.nodes_m, axis=0).max())
        reach = piece.mass_kg * (length**2 + (2 * size) ** 2)
        require(
            moments[2] < reach,
            f"the {name} half's inertia {moments[2]:.3g} kg·m² is larger than its size allows: wrong units",
        )


@suite.check("`start` lies at x in [−l/2, 0] and `end` at x in [0, l/2], in the module frame.")
def halves_are_in_their_places(subject: Subject) -> None:
    half = subject.build().module_length_m / 2
    mass = _mass(subject)
    for name, low, high in (("start", -half, 0.0), ("end", 0.0, half)):
        x = float(getattr(mass, name).com_m[0])
        require(
            low <= x <= high,
            f"the {name} half's centre of mass is at x = {x:.6g} m, not in [{low:.6g}, {high:.6g}]",
        )


@suite.check("every number of a design is a quantity with its unit (`Length`, `Ratio`, …).")
def parameters_have_units(subject: Subject) -> None:
    for name, field in subject.model.model_fields.items():
        if field.annotation is float:
            require(
                quantity_of(subject.model, name) is not None,
                f"parameter '{name}' is a plain float: write Length, Angle, Ratio … so that '2 mm' is "
                "understood",
            )


@suite.check(
    "an impossible design raises `InvalidDesignError` with the inequality and by how much it is broken."
)
def impossible_designs_are_refused(subject: Subject) -> None:
    for name in _lengths(subject):
        for value in (-1e-3, 0.0):
            try:
                family = subject.build(subject.configured({name: value}))
                family.problem()
            except ValidationError:
                continue
            except InvalidDesignError as error:
                require(
                    any(c.isdigit() for c in str(error)),
                    f"the message for {name} = {value:g} m gives no number: '{error}'",
                )
                continue
            require(False, f"the design with {name} = {value:g} m was accepted")


@suite.check("a design that is accepted has a valid mesh; what cannot be meshed is refused when it is built.")
def accepted_designs_have_meshes(subject: Subject) -> None:
    for name in _lengths(subject):
        value = float(getattr(subject.config, name))
        for factor in (0.05, 0.6, 1.4, 20.0):
            try:
                family = subject.build(subject.configured({name: factor * value}))
            except (ValidationError, InvalidDesignError):
                continue
            finding = mesh_finding(family.problem())
            require(
                finding is None,
                f"the design with {name} = {factor * value:.4g} m was accepted, but {finding}",
            )


@suite.check("the same design gives the same problem, bit by bit: results are stored under the design's key.")
def is_deterministic(subject: Subject) -> None:
    first, second = (subject.build().problem().mesh for _ in range(2))
    require(
        np.array_equal(first.nodes_m, second.nodes_m) and np.array_equal(first.cells, second.cells),
        "two meshes of one design differ: a random number or a set's order",
    )


def _lengths(subject: Subject) -> list[str]:
    """Names of the design's positive lengths."""
    config = subject.config
    names = []
    for name in subject.model.model_fields:
        quantity = quantity_of(subject.model, name)
        value = getattr(config, name)
        if quantity is not None and quantity.unit == "m" and isinstance(value, float) and value > 0:
            names.append(name)
    return names
