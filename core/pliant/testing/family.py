"""Checks of an `ActuatorFamily`: a valid mesh, consistent masses, refusal of invalid designs."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from functools import partial

import numpy as np
from pydantic import ValidationError

from pliant.errors import InvalidDesignError, UserError
from pliant.families import design_lengths
from pliant.interfaces.family import ActuatorFamily
from pliant.interfaces.material import Material
from pliant.meshing.cells import cell_volumes
from pliant.meshing.soundness import (
    body_found,
    cavities_found,
    cells_found,
    ends_found,
    hollows_found,
    links_found,
    nodes_found,
    supports_found,
)
from pliant.records.actuation import expected, is_known
from pliant.records.design import Array, MassProperties, ModuleMass
from pliant.records.fem import ModuleProblem
from pliant.records.law import EXTENSIBLE_AXES, N_AXES
from pliant.registry.discovery import discover
from pliant.testing import CheckSkipped, Finding, Subject, agree, declared, once, require, require_refused
from pliant.testing.joint_laws import (
    require_exact_slopes,
    require_joints_apart,
    require_potential,
    require_same_compiled,
)
from pliant.units import quantities_in

# Meshes approximate curved walls by quadratic faces; allowed error of the volume.
VOLUME_TOLERANCE = 0.02
DENSITY = 1000.0
DENSER = 3.0  # ratio of densities, for comparison


@once
def _problem(subject: Subject) -> ModuleProblem:
    return _require_problem(subject, subject.build())


def _require_problem(subject: Subject, family: ActuatorFamily) -> ModuleProblem:
    """Return the family's problem; skip the check for a family that has a law in closed form and no problem."""
    if not family.has_mesh and family.closed_form(_rubber()) is not None:
        raise CheckSkipped(f"{subject.component.label} has no mesh: its law is a closed form")
    return family.problem()


def _rubber() -> Material:
    """Return the material for closed forms."""
    component = discover().get("material", "neo_hookean")
    block = {
        "kind": "neo_hookean",
        "shear_modulus": "200 kPa",
        "poisson_ratio": 0.49,
        "density": "1100 kg/m^3",
    }
    made: Material = component.build(component.config_model().model_validate(block))
    return made


@once
def _mass(subject: Subject, factor: float = 1.0) -> ModuleMass:
    mass: ModuleMass = subject.build().mass(factor * DENSITY)
    return mass


def _volume(problem: ModuleProblem) -> float:
    return float(cell_volumes(problem.mesh.nodes_m, problem.mesh.cells).sum())


def _has_rigid_ends(subject: Subject) -> bool:
    """Return whether the module is longer than its solved pieces."""
    problem, length = _problem(subject), float(subject.build().module_length_m)
    return problem.deformation_scale * problem.span_m < (1 - 1e-9) * length


def _require_none(findings: Iterator[str], where: str = "") -> None:
    """Raise `Finding` with the first of the findings, if there is one."""
    for finding in findings:
        raise Finding(f"{where}{finding}")


@declared
def elements_are_valid(subject: Subject) -> None:
    """cells are 27-node hexahedra, local node i + 3j + 9k, or 10-node tetrahedra, with positive Jacobian everywhere."""
    _require_none(cells_found(_problem(subject).mesh))


def mesh_is_one_closed_body(subject: Subject) -> None:
    """elements share the nodes of their common faces; the mesh is one closed body."""
    mesh = _problem(subject).mesh
    _require_none(nodes_found(mesh))
    _require_none(body_found(mesh))


def cavity_faces_point_into_the_cavity(subject: Subject) -> None:
    """`cavity`: wetted faces, ∂x/∂a × ∂x/∂b out of the solid; `cavities`: the part of each of several pressures."""
    _require_none(cavities_found(_problem(subject)))


def cavity_is_closed(subject: Subject) -> None:
    """a cavity's faces enclose a hollow with the end sections and mirror planes; none of them is in such a plane."""
    _require_none(hollows_found(_problem(subject)))


def end_sections_are_plane(subject: Subject) -> None:
    """node sets `start` (x = 0) and `end` (x = span) hold exactly the nodes of these planes."""
    _require_none(ends_found(_problem(subject)))


def supports_hold_the_body(subject: Subject) -> None:
    """`fixed`, `tied` and `links` name existing nodes and leave no rigid motion free."""
    _require_none(supports_found(_problem(subject)))


def couplings_are_possible(subject: Subject) -> None:
    """`links` pair different nodes one to one, with signs of ±1; ribbons have a width and stiffness."""
    _require_none(links_found(_problem(subject)))


def refinement_refines(subject: Subject) -> None:
    """`refinement` multiplies the elements along each edge of the same body, or the family says `refines = False`."""
    _problem(subject)
    if not subject.build().refines:
        require_refused(
            lambda: subject.build().problem(refinement=2),
            "a family that declares `refines = False` accepted refinement 2",
            "refine",
            "word 'refine'",
            UserError,
        )
        return
    coarse, fine = _problem(subject), subject.build().problem(refinement=2)
    n, m = len(coarse.mesh.cells), len(fine.mesh.cells)
    require(m >= 4 * n, f"refinement 2 has {m} elements, refinement 1 has {n}: the argument is not used")
    _require_none(cells_found(fine.mesh), "at refinement 2, ")
    agree(_volume(fine), _volume(coarse), "refinement changes the body's volume (m³)", rtol=VOLUME_TOLERANCE)
    require(fine.span_m == coarse.span_m, "refinement changes span_m")


def piece_fits_the_module(subject: Subject) -> None:
    """the module is as long as deformation_scale solved pieces, plus rigid ends: scale · span ≤ module length."""
    family: ActuatorFamily = subject.build()
    problem = _problem(subject)
    require(family.module_length_m > 0, f"module_length_m is {family.module_length_m}")
    long = problem.deformation_scale * problem.span_m
    require(
        0 < long <= (1 + 1e-9) * family.module_length_m,
        f"deformation_scale times the solved piece's span, {long:g} m, is more than the module's length",
    )
    require(
        problem.energy_scale >= problem.deformation_scale,
        f"energy_scale {problem.energy_scale:g} is smaller than deformation_scale {problem.deformation_scale:g}: "
        "the module holds at least as many pieces as lie along it",
    )


def axes_fit_the_joint(subject: Subject) -> None:
    """`joint`, `axes` and the problem's axis and actuation fit together."""
    family: ActuatorFamily = subject.build()
    problem, joint, axes = _problem(subject), family.joint, family.axes
    require(joint in N_AXES, f"joint is '{joint}'; known: {', '.join(N_AXES)}")
    known = EXTENSIBLE_AXES if joint == "extensible" else EXTENSIBLE_AXES[:3]
    own = len(set(axes)) == N_AXES[joint] and set(axes) <= set(known)
    require(own, f"a {joint} joint has {N_AXES[joint]} of the axes {', '.join(known)}, not {axes}")
    require(
        problem.main_axis in problem.axes and set(problem.axes) <= set(axes),
        f"the problem's axes {problem.axes} with main axis '{problem.main_axis}' are not among {axes}",
    )
    require(problem.joint == joint, f"the problem's joint is '{problem.joint}', not '{joint}'")
    for name in problem.actuations:
        require(is_known(name), f"'{name}' of the actuation '{problem.actuation}' is none of {expected()}")
    same = subject.build().actuation
    require(same == problem.actuation, f"the family says '{same}' and its problem '{problem.actuation}'")
    twice = len(set(problem.actuations)) == len(problem.actuations)
    require(twice, f"the actuation '{problem.actuation}' names an input twice")
    same = f"the family's actuation is '{family.actuation}', the problem's '{problem.actuation}'"
    require(family.actuation == problem.actuation, same)


def mass_matches_the_mesh(subject: Subject) -> None:
    """the module's mass is density · (energy_scale · volume of the solved piece + unmeshed_volume_m3); rigid ends
    add their own."""
    problem, unmeshed = _problem(subject), float(subject.build().unmeshed_volume_m3)
    require(unmeshed >= 0, f"unmeshed_volume_m3 is {unmeshed:g}")
    solid = DENSITY * (problem.energy_scale * _volume(problem) + unmeshed)
    light, heavy = (m.start.mass_kg + m.end.mass_kg for m in (_mass(subject), _mass(subject, DENSER)))
    soft = (heavy - light) / (DENSER - 1)
    finding = "the mass (kg) is not that of the meshed body: a forgotten mirror half or end"
    agree(soft, solid, finding, rtol=VOLUME_TOLERANCE)
    if not _has_rigid_ends(subject):
        agree(light, soft, "the mass (kg) is not proportional to the density", rtol=1e-9)
    require(light > soft * (1 - 1e-9), f"the rigid ends' mass is {light - soft:.3g} kg")


def smaller_pieces_share_the_module(subject: Subject) -> None:
    """`problem(axes=(main,))` is a piece of the same module: equal length and volume in all, one axis."""
    whole = _problem(subject)
    main = whole.main_axis
    piece = subject.build().problem(axes=(main,))
    alone = piece.axes == (main,) and piece.main_axis == main
    require(alone, f"the piece for axis '{main}' alone has the axes {piece.axes}")
    is_not = "is not that of the whole problem"
    own, all_of = (one.deformation_scale * one.span_m for one in (piece, whole))
    agree(own, all_of, f"deformation_scale · span_m {is_not}", rtol=1e-9)
    own, all_of = (one.energy_scale * _volume(one) for one in (piece, whole))
    agree(own, all_of, f"energy_scale · volume (m³) {is_not}: a forgotten mirror half", rtol=VOLUME_TOLERANCE)
    require(
        (piece.joint, piece.actuation) == (whole.joint, whole.actuation),
        f"the piece is a {piece.joint} joint under {piece.actuation}, the whole a {whole.joint} one under "
        f"{whole.actuation}",
    )
    _require_none(cells_found(piece.mesh), "in the piece for the main axis alone, ")


def regions_are_mesh_cells(subject: Subject) -> None:
    """`mesh.regions` are the family's `regions`: cells of the mesh, none in two."""
    family: ActuatorFamily = subject.build()
    mesh = _problem(subject).mesh
    names = f"the family's regions are {list(family.regions)}, the mesh's {list(mesh.regions)}"
    require(set(family.regions) == set(mesh.regions), names)
    for name, cells in mesh.regions.items():
        inside = len(cells) and np.min(cells) >= 0 and np.max(cells) < len(mesh.cells)
        require(inside, f"region '{name}' is empty or names a cell that does not exist")
    every = np.concatenate([np.zeros(0, np.int64), *mesh.regions.values()])
    require(len(np.unique(every)) == len(every), "a cell is in two regions, or twice in one")


def mass_counts_regions_with_their_density(subject: Subject) -> None:
    """`mass(density, regions)` gives each region's cells their own density."""
    family: ActuatorFamily = subject.build()
    problem = _problem(subject)
    volumes = cell_volumes(problem.mesh.nodes_m, problem.mesh.cells)
    for name, cells in problem.mesh.regions.items():
        even = dict.fromkeys(family.regions, DENSITY)
        masses = (family.mass(DENSITY, own) for own in (even, {**even, name: DENSER * DENSITY}))
        light, heavy = (mass.start.mass_kg + mass.end.mass_kg for mass in masses)
        more = (DENSER - 1) * DENSITY * problem.energy_scale * float(volumes[cells].sum())
        finding = f"the mass (kg) that a denser region '{name}' adds is not that of its cells"
        agree(heavy - light, more, finding, rtol=VOLUME_TOLERANCE)


def mass_scales_with_density(subject: Subject) -> None:
    """masses and inertias are positive and proportional to the density, except for rigid ends."""
    masses = [_mass(subject, factor) for factor in (1.0, DENSER, 2 * DENSER - 1)]
    for name in ("start", "end"):
        pieces: list[MassProperties] = [getattr(mass, name) for mass in masses]
        require(pieces[0].mass_kg > 0, f"the {name} half's mass is {pieces[0].mass_kg} kg")
        require(pieces[1].mass_kg > pieces[0].mass_kg, f"the {name} half's mass ignores the density")
        for what, (one, two, three) in (
            ("mass", [np.array([p.mass_kg]) for p in pieces]),
            ("mass times centre", [p.mass_kg * p.com_m for p in pieces]),
            ("inertia about the joint", [_about_joint(p) for p in pieces]),
        ):
            whose, small = f"the {name} half's {what}", 1e-9 * float(np.abs(three).max())
            agree(three - two, two - one, f"{whose} does not grow linearly with the density", atol=small)
            if not _has_rigid_ends(subject):
                agree(two, DENSER * one, f"{whose} is not proportional to the density", rtol=1e-9)


def _about_joint(piece: MassProperties) -> Array:
    """Return the inertia about the module frame's origin (parallel axes)."""
    com = piece.com_m
    return piece.inertia_kg_m2 + piece.mass_kg * (com @ com * np.eye(3) - np.outer(com, com))


def inertia_is_physical(subject: Subject) -> None:
    """inertias are about the centre of mass and physically possible."""
    length = subject.build().module_length_m
    size = float(np.ptp(_problem(subject).mesh.nodes_m, axis=0).max())
    for name in ("start", "end"):
        piece: MassProperties = getattr(_mass(subject), name)
        inertia, whose = piece.inertia_kg_m2, f"the {name} half's"
        agree(inertia, inertia.T, f"{whose} inertia is not symmetric", rtol=1e-9)
        least, middle, most = moments = np.linalg.eigvalsh(inertia)
        require(least > 0, f"{whose} principal moments {moments} are not all positive")
        triangle = f"{whose} principal moments {moments} break the triangle inequality: inertia of no body"
        require(least + middle >= most * (1 - 1e-9), triangle)
        large = f"{whose} inertia {most:.3g} kg·m² is larger than its size allows: wrong units"
        require(most < piece.mass_kg * (length**2 + (2 * size) ** 2), large)


def halves_are_in_their_places(subject: Subject) -> None:
    """`start` has x in [−l/2, 0] and `end` has x in [0, l/2], in the module frame."""
    half, mass = subject.build().module_length_m / 2, _mass(subject)
    for name, low, high in (("start", -half, 0.0), ("end", 0.0, half)):
        x = float(getattr(mass, name).com_m[0])
        place = f"the {name} half's centre of mass is at x = {x:.6g} m, not in [{low:.6g}, {high:.6g}]"
        require(low <= x <= high, place)


def closed_form_matches_the_module(subject: Subject) -> None:
    """a law in closed form has the family's joint, axes and actuation, a bounded domain, exact slopes and an energy."""
    family: ActuatorFamily = subject.build()
    law = family.closed_form(_rubber())
    if law is None:
        require(family.has_mesh, "the family has neither a problem nor a law in closed form")
        raise CheckSkipped(f"{subject.component.label} has no law in closed form")
    got, wanted = (
        (one.joint, tuple(one.axes), name)
        for one, name in ((law, law.actuation_name), (family, family.actuation))
    )
    require(got == wanted, f"joint, axes and actuation of the law are {got}, of the family {wanted}")
    box = law.domain.box
    require(np.all(np.isfinite(box)), "the law's domain has no limits: extrapolation would not be flagged")
    m = len(law.actuations)
    values = box[:, 0] + np.ptp(box, axis=1) * np.random.default_rng(11).uniform(0.05, 0.95, (20, len(box)))
    p, u = np.ascontiguousarray(values[:, 0 if m == 1 else slice(m)]), np.ascontiguousarray(values[:, m:])
    require_exact_slopes(law, p, u, rtol=1e-4)
    require_potential(law, p, u, rtol=1e-3)
    require_joints_apart(law, p, u)
    require_same_compiled(law)
    rest = law.evaluate(law.unactuated(1), np.zeros((1, len(law.axes))))
    agree(
        rest.tau,
        np.zeros_like(rest.tau),
        "τ at rest is not zero",
        atol=1e-9 * np.abs(law.evaluate(p, u).tau).max(),
    )
    softest = np.linalg.eigvalsh(-(rest.dtau_du[0] + rest.dtau_du[0].T) / 2).min()
    require(softest > 0, f"−∂τ/∂u at rest is {softest:.3g}: the module is unstable")


def parameters_have_units(subject: Subject) -> None:
    """every number of a design is a quantity with its unit (`Length`, `Ratio`, …)."""
    for name, field in subject.model.model_fields.items():
        bare = field.annotation is float and not any(quantities_in(*field.metadata))
        how = "write Length, Angle, Ratio … so that '2 mm' is understood"
        require(not bare, f"parameter '{name}' is a plain float: {how}")


def impossible_designs_are_refused(subject: Subject) -> None:
    """an impossible design (a length of 0, unless its field says `ge=0`) raises `InvalidDesignError` with the
    inequality and its violation."""

    def made(changes: dict[str, float]) -> None:
        with contextlib.suppress(ValidationError):
            family = subject.build(subject.configured(changes))
            if family.has_mesh:
                family.problem()
            return
        raise InvalidDesignError("0: the config refuses it")

    for name, may_be_0 in _lengths(subject).items():
        for value in (-1e-3,) if may_be_0 else (-1e-3, 0.0):
            accepted = f"the design with {name} = {value:g} m was accepted"
            require_refused(partial(made, {name: value}), accepted, r"\d", "number", InvalidDesignError)


def accepted_designs_have_meshes(subject: Subject) -> None:
    """an accepted design has a valid mesh; a design that cannot be meshed is refused when it is built."""
    _problem(subject)
    for name in _lengths(subject):
        for factor in (0.05, 0.6, 1.4, 20.0):
            value = factor * float(getattr(subject.config, name))
            try:
                family = subject.build(subject.configured({name: value}))
            except (ValidationError, InvalidDesignError):
                continue
            accepted = f"the design with {name} = {value:.4g} m was accepted, but "
            _require_none(cells_found(family.problem().mesh), accepted)


def is_deterministic(subject: Subject) -> None:
    """the same design gives the same problem, bit by bit: results are stored under the design's key."""
    first, second = (_require_problem(subject, subject.build()).mesh for _ in range(2))
    same = np.array_equal(first.nodes_m, second.nodes_m) and np.array_equal(first.cells, second.cells)
    require(same, "two meshes of one design differ: a random number or a set's order")


def _lengths(subject: Subject) -> dict[str, bool]:
    """Return the design's positive lengths by their fields, and whether each may be 0."""
    return {name: may_be_0 for name, (value, may_be_0) in design_lengths(subject.config).items() if value > 0}
