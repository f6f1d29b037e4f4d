"""Checks of an `ActuatorFamily`: masses fit the mesh, bad designs are refused; the mesh in `family_mesh`."""

from __future__ import annotations

import contextlib
from functools import partial

import numpy as np
from pydantic import ValidationError

from pliant.errors import InvalidDesignError
from pliant.interfaces.family import ActuatorFamily
from pliant.meshing.hexahedra import cell_volumes
from pliant.records.design import Array, MassProperties, ModuleMass
from pliant.records.fem import ModuleProblem
from pliant.testing.common import quantity_of
from pliant.testing.family_mesh import VOLUME_TOLERANCE, mesh_finding, problem_of
from pliant.testing.family_mesh import suite as mesh_suite
from pliant.testing.suite import Subject, Suite, require, require_close, require_refused

suite = Suite("family")
suite.checks.extend(mesh_suite.checks)
DENSITY = 1000.0
DENSER = 3.0  # times as dense, for comparison
AXES = {"revolute": 1, "prismatic": 1, "spherical": 3}
ACTUATIONS = ("pressure_pa", "tendon_force_n")


def _mass(subject: Subject) -> ModuleMass:
    mass: ModuleMass = subject.once("mass", lambda: subject.build().mass(DENSITY))
    return mass


@suite.check(
    "the module is deformation_scale solved pieces long, rigid ends aside: scale · span ≤ module length."
)
def piece_fits_the_module(subject: Subject) -> None:
    family: ActuatorFamily = subject.build()
    problem = problem_of(subject)
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


@suite.check("`joint`, `axes` and the problem's axis and actuation fit together.")
def axes_fit_the_joint(subject: Subject) -> None:
    family: ActuatorFamily = subject.build()
    require(family.joint in AXES, f"joint is '{family.joint}'; known: {', '.join(AXES)}")
    require(
        len(set(family.axes)) == AXES[family.joint] and set(family.axes) <= {"x", "y", "z"},
        f"a {family.joint} joint has {AXES[family.joint]} of the axes x, y, z, not {family.axes}",
    )
    problem = problem_of(subject)
    require(
        problem.main_axis in problem.axes and set(problem.axes) <= set(family.axes),
        f"the problem's axes {problem.axes} with main axis '{problem.main_axis}' are not among {family.axes}",
    )
    require(problem.joint == family.joint, f"the problem's joint is '{problem.joint}', not '{family.joint}'")
    require(
        problem.actuation in ACTUATIONS,
        f"the actuation '{problem.actuation}' is none of {', '.join(ACTUATIONS)}",
    )
    require(
        family.actuation == problem.actuation,
        f"the family's actuation is '{family.actuation}', the problem's '{problem.actuation}'",
    )


@suite.check(
    "the module's mass is density · (energy_scale · volume of the solved piece + unmeshed_volume_m3); rigid ends add "
    "their own."
)
def mass_is_that_of_the_mesh(subject: Subject) -> None:
    problem = problem_of(subject)
    unmeshed = float(subject.build().unmeshed_volume_m3)
    require(unmeshed >= 0, f"unmeshed_volume_m3 is {unmeshed:g}")
    solid = problem.energy_scale * _volume(problem) + unmeshed
    light, heavy = (_total_kg(mass) for mass in (_mass(subject), _denser(subject)))
    soft = (heavy - light) / (DENSER - 1)
    require_close(
        soft,
        DENSITY * solid,
        "the mass (kg) is not that of the meshed body: a forgotten mirror half or end",
        rtol=VOLUME_TOLERANCE,
    )
    if not _has_rigid_ends(subject):
        require_close(light, soft, "the mass (kg) is not proportional to the density", rtol=1e-9)
    require(light > soft * (1 - 1e-9), f"the rigid ends' mass is {light - soft:.3g} kg")


@suite.check(
    "`problem(axes=(main,))` is a piece of the same module: equal length and volume in all, one axis."
)
def smaller_pieces_are_of_the_same_module(subject: Subject) -> None:
    whole = problem_of(subject)
    piece = subject.build().problem(axes=(whole.main_axis,))
    require(
        piece.axes == (whole.main_axis,) and piece.main_axis == whole.main_axis,
        f"the piece for axis '{whole.main_axis}' alone has the axes {piece.axes}",
    )
    require_close(
        piece.deformation_scale * piece.span_m,
        whole.deformation_scale * whole.span_m,
        "deformation_scale · span_m is not that of the whole problem",
        rtol=1e-9,
    )
    require_close(
        piece.energy_scale * _volume(piece),
        whole.energy_scale * _volume(whole),
        "energy_scale · volume (m³) is not that of the whole problem: a forgotten mirror half",
        rtol=VOLUME_TOLERANCE,
    )
    require(
        (piece.joint, piece.actuation) == (whole.joint, whole.actuation),
        f"the piece is a {piece.joint} joint under {piece.actuation}, the whole a {whole.joint} one under "
        f"{whole.actuation}",
    )
    finding = mesh_finding(piece)
    require(finding is None, f"in the piece for the main axis alone, {finding}")


def _volume(problem: ModuleProblem) -> float:
    return float(cell_volumes(problem.mesh.nodes_m, problem.mesh.cells).sum())


@suite.check(
    "masses are positive and proportional to the density, as are inertias, but for what rigid ends add."
)
def mass_scales_with_density(subject: Subject) -> None:
    masses = [subject.build().mass(factor * DENSITY) for factor in (1.0, DENSER, 2 * DENSER - 1)]
    for name in ("start", "end"):
        pieces: list[MassProperties] = [getattr(mass, name) for mass in masses]
        require(pieces[0].mass_kg > 0, f"the {name} half's mass is {pieces[0].mass_kg} kg")
        require(pieces[1].mass_kg > pieces[0].mass_kg, f"the {name} half's mass ignores the density")
        for what, values in (
            ("mass", [np.array([p.mass_kg]) for p in pieces]),
            ("mass times centre", [p.mass_kg * p.com_m for p in pieces]),
            ("inertia about the joint", [_about_joint(p) for p in pieces]),
        ):
            require_close(
                values[2] - values[1],
                values[1] - values[0],
                f"the {name} half's {what} does not grow linearly with the density",
                atol=1e-9 * float(np.abs(values[2]).max()),
            )
            if not _has_rigid_ends(subject):
                require_close(
                    values[1],
                    DENSER * values[0],
                    f"the {name} half's {what} is not proportional to the density",
                    atol=1e-9 * float(np.abs(values[1]).max()),
                )


def _denser(subject: Subject) -> ModuleMass:
    mass: ModuleMass = subject.build().mass(DENSER * DENSITY)
    return mass


def _total_kg(mass: ModuleMass) -> float:
    return mass.start.mass_kg + mass.end.mass_kg


def _about_joint(piece: MassProperties) -> Array:
    """Inertia about the module frame's origin (parallel axes)."""
    com = piece.com_m
    return piece.inertia_kg_m2 + piece.mass_kg * (com @ com * np.eye(3) - np.outer(com, com))


def _has_rigid_ends(subject: Subject) -> bool:
    """Whether the module is longer than its solved pieces."""
    problem = problem_of(subject)
    length = float(subject.build().module_length_m)
    return problem.deformation_scale * problem.span_m < (1 - 1e-9) * length


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
        size = float(np.ptp(problem_of(subject).mesh.nodes_m, axis=0).max())
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
    def made(changes: dict[str, float]) -> None:
        with contextlib.suppress(ValidationError):
            subject.build(subject.configured(changes)).problem()
            return
        raise InvalidDesignError("0: the config refuses it")

    for changes in ({name: value} for name in _lengths(subject) for value in (-1e-3, 0.0)):
        ((name, value),) = changes.items()
        accepted = f"the design with {name} = {value:g} m was accepted"
        require_refused(partial(made, changes), accepted, r"\d", "number", InvalidDesignError)


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
