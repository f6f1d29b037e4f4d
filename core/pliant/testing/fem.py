"""Checks of an `FEMBackend`, on a coarse box whose small deformations are known in closed form (`box`).

A backend without modules of several axes, prismatic ones or tendons raises `UserError` from `solver`; their checks are
then skipped with its message.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.fem import FEMBackend, ModuleSolver, StateNotConvergedError
from pliant.interfaces.material import Material
from pliant.records.fem import FemState, ModuleProblem
from pliant.registry.discovery import discover
from pliant.testing import CheckSkipped, Subject, agree, once, require, require_refused
from pliant.testing.box import (
    BoxModule,
    box_problem,
    layered_box_problem,
    prismatic_box_problem,
    spatial_box_problem,
    tendon_box_problem,
)
from pliant.testing.joint_laws import stored
from pliant.testing.stand_ins import sample_material, scaled_sample

MATERIAL = sample_material()
BOX = BoxModule(MATERIAL.young_pa, MATERIAL.poisson)
# A pressure that bends the box by about 0.1 rad, and the angles that go with it.
PRESSURE_PA = 8e3
ANGLE_RAD = 0.15
MOMENT_N_M = BOX.stiffness_n_m * ANGLE_RAD
AXES = ("x", "y", "z")
MIXED_RAD = {"x": 0.1, "y": 0.15, "z": -0.12}
TENSION_N, PULLED_RAD = 0.2, 0.1
# Relative; Newton's tolerance is smaller.
SOLVED = 1e-6
# Relative; error of meshes that are not mirror-symmetric.
SYMMETRY = 2e-3
STIFFER = 10.0  # a region's modulus / the body's
RESULTS = ("moment_n_m", "energy_j", "dmoment_dp", "dmoment_du")


def _new_solver(subject: Subject, problem: ModuleProblem) -> ModuleSolver:
    """Return a new solver of this problem, its regions `STIFFER` times as stiff as the rest.

    A backend that passes the law to another program by name may refuse the sample solid, whose name is unknown; it
    then gets `neo_hookean` with the same moduli at small strain.
    """
    backend: FEMBackend = subject.build()
    if not isinstance(problem, backend.problem_class):
        raise CheckSkipped(
            f"{subject.component.label} solves problems of class {backend.problem_class.__name__} alone: test it on one"
        )
    try:
        return backend.solver(problem, _sample(problem, MATERIAL, scaled_sample(STIFFER)))
    except MissingDependencyError:
        raise
    except UserError:
        return backend.solver(problem, _sample(problem, _named(1.0), _named(STIFFER)))


def _sample(problem: ModuleProblem, body: Material, other: Material) -> Material:
    return body.with_regions(dict.fromkeys(problem.mesh.regions, other))


def _named(factor: float) -> Material:
    moduli = {"shear_modulus_pa": factor * MATERIAL.shear_modulus_pa, "poisson_ratio": MATERIAL.poisson}
    component = discover().get("material", "neo_hookean")
    made: Material = component.build(
        component.config_model().model_validate({"kind": "neo_hookean", **moduli})
    )
    return made


@once
def _solver(subject: Subject) -> ModuleSolver:
    return _new_solver(subject, box_problem())


@once
def _rest(subject: Subject) -> FemState:
    return _solver(subject).rest()


@once
def _free(subject: Subject) -> FemState:
    return _solver(subject).free(PRESSURE_PA, _rest(subject))


@once
def _held(subject: Subject, pressure: float = PRESSURE_PA, angle: float = ANGLE_RAD) -> FemState:
    """Return the constrained state, reached from rest."""
    return _solver(subject).constrained(pressure, angle, _rest(subject))


@once
def _special(subject: Subject, problem: Callable[[], ModuleProblem]) -> ModuleSolver:
    try:
        return _new_solver(subject, problem())
    except UserError as error:
        raise CheckSkipped(f"{subject.component.label} has no such module: {error}") from error


def _spatial(subject: Subject) -> ModuleSolver:
    return _special(subject, spatial_box_problem)


@once
def _mixed(subject: Subject) -> FemState:
    return _spatial(subject).constrained(PRESSURE_PA, MIXED_RAD, _spatial(subject).rest())


def _around(solver: ModuleSolver, at: float, held: Any, step: float, state: FemState) -> Sequence[FemState]:
    """Return the states one step of the prescribed angle ahead and behind; for `held` by axis, of its first axis."""
    if not isinstance(held, Mapping):
        return [solver.constrained(at, held + s, state) for s in (step, -step)]
    axis = next(iter(held))
    return [solver.constrained(at, {**held, axis: held[axis] + s}, state) for s in (step, -step)]


def rest_state_is_zero(subject: Subject) -> None:
    """`rest` is the undeformed state: angle, moment and energy zero, slopes included."""
    rest = _rest(subject)
    for name in ("actuation", "angle_rad", "moment_n_m", "energy_j", "axial_strain"):
        scale = MOMENT_N_M if name in ("moment_n_m", "energy_j") else 1.0
        agree(getattr(rest, name), 0.0, f"{name} of the rest state is not zero", atol=1e-9 * scale)
    require(rest.dmoment_dp > 0 and rest.dmoment_du < 0, "the rest state has no slopes")
    require(rest.status == "ok", f"the rest state's status is '{rest.status}'")


def small_bends_follow_beam_theory(subject: Subject) -> None:
    """τ is that of the whole module: small bends of a uniform tube follow beam theory, ∂τ/∂u = −E I / l."""
    cause = "a wrong deformation_scale or energy_scale, or end sections that are not free in their plane"
    finding = f"∂τ/∂u (N·m/rad) at rest is not −E I / l: {cause}"
    agree(_rest(subject).dmoment_du, -BOX.stiffness_n_m, finding, rtol=1e-5)


def small_pressures_follow_beam_theory(subject: Subject) -> None:
    """pressure acts through the cavity's volume, thrust on the ends included: ∂τ/∂p = (1 − 2ν) A (z_c − z_e)."""
    cause = "the thrust on the end sections is missing or the pressure has the wrong side"
    finding = f"∂τ/∂p (N·m/Pa) at rest is not (1 − 2ν) A_c (z_c − z_e): {cause}"
    agree(_rest(subject).dmoment_dp, BOX.gain_m3, finding, rtol=1e-5)


def scales_with_the_module(subject: Subject) -> None:
    """energies and moments are those of the module: energy_scale times the solved piece."""
    doubled = _new_solver(subject, box_problem(energy_scale=8.0))
    half = _held(subject)
    state = doubled.constrained(PRESSURE_PA, ANGLE_RAD, half)
    for name in RESULTS:
        finding = f"twice the energy_scale does not give twice the {name}"
        agree(getattr(state, name), 2 * getattr(half, name), finding, rtol=1e-5)


def free_state_has_no_moment(subject: Subject) -> None:
    """`free` is equilibrium without external moment, at the requested actuation; actuation bends u > 0."""
    free = _free(subject)
    asked = (free.branch, free.actuation) == ("free", PRESSURE_PA)
    require(asked, "branch or actuation is not what was asked for")
    require(free.angle_rad > 0, f"positive pressure bends the box by {free.angle_rad:.3g} rad: a wrong sign")
    agree(free.moment_n_m, 0.0, "the free state's moment (N·m) is not zero", atol=SOLVED * MOMENT_N_M)


def constrained_state_holds_the_angle(subject: Subject) -> None:
    """`constrained` prescribes the requested module angle u = deformation_scale · θ."""
    held = _held(subject)
    require(held.branch == "constrained", f"branch is '{held.branch}'")
    agree(held.angle_rad, ANGLE_RAD, "the state's angle (rad) is not the one asked for", atol=1e-10)
    require(held.actuation == PRESSURE_PA, f"the actuation is {held.actuation}, asked for {PRESSURE_PA}")


def branches_agree(subject: Subject) -> None:
    """both branches are one equilibrium: at the prescribed free angle the moment is zero."""
    held = _solver(subject).constrained(PRESSURE_PA, _free(subject).angle_rad, _rest(subject))
    finding = "held at its free angle the module needs a moment (N·m): the branches solve different equations"
    agree(held.moment_n_m, 0.0, finding, atol=10 * SOLVED * MOMENT_N_M)


def slope_in_pressure_is_exact(subject: Subject) -> None:
    """`dmoment_dp` is the exact slope with all other unknowns at equilibrium."""
    state, step, solver = _held(subject), 0.02 * PRESSURE_PA, _solver(subject)
    after, before = (solver.constrained(PRESSURE_PA + s, ANGLE_RAD, state).moment_n_m for s in (step, -step))
    cause = "unknowns were held fixed, or the pressure's own stiffness is missing"
    finding = f"dmoment_dp (N·m/Pa) differs from the finite difference: {cause}"
    # of the slope at rest: here the slope may pass through zero
    agree(
        state.dmoment_dp, (after - before) / (2 * step), finding, atol=1e-4 * abs(_rest(subject).dmoment_dp)
    )


def slope_in_angle_is_exact(subject: Subject) -> None:
    """`dmoment_du` is the exact slope with all other unknowns at equilibrium."""
    state, step = _held(subject), 4e-3
    after, before = _around(_solver(subject), PRESSURE_PA, ANGLE_RAD, step, state)
    cause = "unknowns were held fixed, or the angle is θ and not u"
    finding = f"dmoment_du (N·m/rad) differs from the finite difference: {cause}"
    agree(state.dmoment_du, (after.moment_n_m - before.moment_n_m) / (2 * step), finding, rtol=1e-4)


def energy_is_the_work_done(subject: Subject) -> None:
    """without pressure the stored energy is the work of the moment: dE = −τ du."""
    start, work = _rest(subject), 0.0
    for node, weight in zip(*np.polynomial.legendre.leggauss(3), strict=True):
        start = _solver(subject).constrained(0.0, ANGLE_RAD * (node + 1) / 2, start)
        work -= start.moment_n_m * weight * ANGLE_RAD / 2
    finding = (
        "energy_j (J) at zero pressure is not the work −∫τ du: energy and moment belong to different pieces"
    )
    agree(_held(subject, 0.0, ANGLE_RAD).energy_j, work, finding, rtol=1e-4)


def continues_from_a_saved_state(subject: Subject) -> None:
    """a state is self-contained: a new solver continues from one that another process saved."""
    solver = _new_solver(subject, box_problem())
    state = solver.constrained(PRESSURE_PA, ANGLE_RAD, stored(_free(subject)))
    _require_held(
        subject, state, "differs when the solver starts from a saved state: it remembers more than it"
    )


def path_does_not_matter(subject: Subject) -> None:
    """a state does not depend on the path to it."""
    solver = _solver(subject)
    detour = solver.constrained(0.0, -ANGLE_RAD, _rest(subject))
    state = solver.constrained(PRESSURE_PA, ANGLE_RAD, detour)
    _require_held(subject, state, "depends on the start: not converged, or state left over in the solver")


def _require_held(subject: Subject, state: FemState, finding: str) -> None:
    """Check that the state is the one that was prescribed from rest."""
    for name in RESULTS:
        agree(getattr(state, name), getattr(_held(subject), name), f"{name} {finding}", rtol=1e-5)


def deformed_nodes_follow_the_bend(subject: Subject) -> None:
    """`deformed_nodes` are (n, 3) in the module frame; at rest they are the mesh, the start section stays in x = 0."""
    solver, problem = _solver(subject), box_problem()
    nodes, sets = problem.mesh.nodes_m, problem.mesh.node_sets
    size = float(np.ptp(nodes))
    rest, bent = (solver.deformed_nodes(state) for state in (_rest(subject), _held(subject)))
    agree(rest, nodes, "at rest the deformed nodes are not the mesh's", atol=1e-9 * size)
    require(bent.shape == nodes.shape, f"deformed_nodes has shape {bent.shape}, the mesh {nodes.shape}")
    agree(bent[sets["start"], 0], 0.0, "the start section (m) left its plane x = 0", atol=1e-8 * size)
    theta = ANGLE_RAD / problem.deformation_scale
    heights = bent[sets["end"]] @ np.array([np.cos(theta), 0.0, -np.sin(theta)])
    plane = "the end section is not a plane turned by θ = u / deformation_scale about y (positive toward −z)"
    agree(heights, heights.mean(), plane, atol=1e-8 * size)


def fields_stand_at_the_nodes(subject: Subject) -> None:
    """`fields`, if a backend has them, are at the mesh's nodes; a body at rest has no stress."""
    solver, nodes = _solver(subject), box_problem().mesh.nodes_m
    try:
        fields = solver.fields(_held(subject))
    except UserError as error:
        raise CheckSkipped(str(error)) from error
    size = float(np.ptp(nodes))
    agree(fields.points_m, nodes, "the points (m) are not the mesh's nodes", atol=1e-9 * size)
    moved = solver.deformed_nodes(_held(subject)) - nodes
    agree(
        fields.displacement_m, moved, "the displacement (m) is not that of `deformed_nodes`", atol=1e-8 * size
    )
    rest = solver.fields(_rest(subject)).point_data
    stresses = dict.fromkeys(("von_mises_pa", "hydrostatic_pa", "energy_j_m3"), 0.0)
    for name, value in {**stresses, "volume_ratio": 1.0, "largest_stretch": 1.0}.items():
        require(name in fields.point_data, f"the field '{name}' is missing")
        scale = MATERIAL.young_pa if name in stresses else 1.0
        agree(rest[name], np.full(len(nodes), value), f"{name} of the rest state", atol=1e-6 * scale)


def says_when_it_does_not_converge(subject: Subject) -> None:
    """a state that does not converge raises `StateNotConvergedError`; the pipeline records it and continues."""
    require_refused(
        lambda: _solver(subject).free(1e4 * PRESSURE_PA, _rest(subject)),
        "a pressure far beyond any equilibrium gave a state",
        r"\S",
        error=StateNotConvergedError,
    )


def refuses_unknown_problems(subject: Subject) -> None:
    """`solver` raises `UserError` for a problem that it does not support, and names the requirement."""
    strange = replace(box_problem(), frame="no_such_frame")  # type: ignore[arg-type]
    accepted = "a problem with frame 'no_such_frame' was accepted"
    require_refused(lambda: _new_solver(subject, strange), accepted, "frame", "frame")
    strange = replace(box_problem(), requires=frozenset({"no_such_thing"}))
    accepted = "a problem that requires 'no_such_thing' was accepted: call `self.check(problem, material)` in `solver`"
    require_refused(lambda: _new_solver(subject, strange), accepted, "no_such_thing", "requirement")


def states_have_all_axes(subject: Subject) -> None:
    """states of k axes have u and τ (k,), ∂τ/∂p (k,) and ∂τ/∂u (k, k); `held` names the prescribed axes."""
    state = _mixed(subject)
    agree(state.deformation, list(MIXED_RAD.values()), "u (rad) is not what was held by axis", atol=1e-10)
    for name, shape in (("tau", (3,)), ("dtau_dp", (3,)), ("dtau_du", (3, 3))):
        got = getattr(state, name).shape
        require(got == shape, f"{name} has shape {got}, three axes need {shape}")
    require(set(state.held) == set(AXES), f"`held` is {state.held}, all three axes were held")
    require(state.main == 1, f"`main` is {state.main}, actuation drives y, the second axis")


def small_bends_about_all_axes_follow_beam_theory(subject: Subject) -> None:
    """small bends about z and small twists are those of a uniform tube."""
    twist, *bends = -np.diag(_spatial(subject).rest().dtau_du)
    cause = "sections that cannot warp, or a wrong curvature"
    wanted = [BOX.stiffness_n_m, BOX.side_stiffness_n_m]
    agree(bends, wanted, f"−∂τ/∂u (N·m/rad) about y and z is not E I / l: {cause}", rtol=1e-5)
    low, high = BOX.twist_bounds_n_m
    require(
        low < twist < high,
        f"the stiffness in twist, {twist:.4g} N·m/rad, is not between Bredt's thin tube, {low:.4g}, and that of "
        f"sections that cannot warp, {high:.4g}",
    )


def slopes_in_all_axes_are_exact(subject: Subject) -> None:
    """`dtau_du` is symmetric, and the exact slope of τ in every axis, all axes independent."""
    state, step = _mixed(subject), 2e-3
    slopes, scale = state.dtau_du, float(np.abs(state.dtau_du).max())
    cause = "τ is not conjugate to the rotation vector, or pressure is not a potential"
    agree(
        slopes - slopes.T,
        0.0,
        f"dtau_du (N·m/rad) is not symmetric under pressure: {cause}",
        atol=1e-6 * scale,
    )
    for i, axis in enumerate(AXES):
        first = {axis: MIXED_RAD[axis], **MIXED_RAD}
        ahead, behind = _around(_spatial(subject), PRESSURE_PA, first, step, state)
        finding = f"∂τ/∂u_{axis} (N·m/rad) differs from the finite difference"
        agree(slopes[:, i], (ahead.tau - behind.tau) / (2 * step), finding, atol=2e-4 * scale)


def axes_decouple_by_symmetry(subject: Subject) -> None:
    """bent only about y, a tube that is symmetric about y = 0 has no coupling to the other axes."""
    solver = _spatial(subject)
    state = solver.constrained(PRESSURE_PA, {"x": 0.0, "y": MIXED_RAD["y"], "z": 0.0}, solver.rest())
    diagonal = np.diag(np.diag(state.dtau_du))
    cause = "end sections that are held, or a wrong sign"
    finding = f"dtau_du (N·m/rad) couples axes that symmetry separates: {cause}"
    agree(state.dtau_du, diagonal, finding, atol=SYMMETRY * float(np.abs(np.diag(diagonal)).min()))
    finding = "pressure (∂τ/∂p, N·m/Pa) twists the tube or bends it sideways"
    agree(state.dtau_dp[[0, 2]], 0.0, finding, atol=SYMMETRY * abs(state.dtau_dp[1]))


def axes_that_are_not_held_are_free(subject: Subject) -> None:
    """axes that are not prescribed are free: τ = 0, and slopes are still those with all axes independent."""
    solver, mixed = _spatial(subject), _mixed(subject)
    partly = solver.constrained(PRESSURE_PA, {"x": MIXED_RAD["x"], "z": MIXED_RAD["z"]}, mixed)
    scale = float(np.abs(mixed.dtau_du).max())
    agree(partly.tau[1], 0.0, "τ (N·m) is not zero along the axis that is free", atol=1e-6 * scale)
    everything = dict(zip(AXES, partly.deformation.tolist(), strict=True))
    held = solver.constrained(PRESSURE_PA, everything, mixed)
    finding = "dtau_du (N·m/rad) of a partly free state differs from that of the same state held in all axes"
    agree(partly.dtau_du, held.dtau_du, finding, atol=1e-5 * scale)


def refuses_unknown_axes(subject: Subject) -> None:
    """`constrained` raises `UserError` for an axis that the joint does not have."""
    solver = _spatial(subject)
    refused = "the axis 'w' was held"
    require_refused(lambda: solver.constrained(0.0, {"w": 0.1}, solver.rest()), refused, "w", "axis")


def small_extensions_follow_rod_theory(subject: Subject) -> None:
    """a prismatic module's u is its extension in m: −∂F/∂u = E A / l, ∂F/∂p = (1 − 2ν) A_c."""
    solver = _special(subject, prismatic_box_problem)
    rest = solver.rest()
    agree(rest.dmoment_du, -BOX.axial_stiffness_n_m, "∂F/∂u (N/m) at rest is not −E A / l", rtol=1e-5)
    agree(rest.dmoment_dp, BOX.thrust_m2, "∂F/∂p (m²) at rest is not (1 − 2ν) A_c of the cavity", rtol=1e-5)
    held = solver.constrained(0.0, 1e-4, rest)
    agree(held.angle_rad, 1e-4, "the extension (m) is not the one that was held", atol=1e-12)


def tendon_works_on_its_travel(subject: Subject) -> None:
    """a tendon works on its travel: ∂τ/∂T at constant u is ∂(travel)/∂u at constant T."""
    solver, step = _special(subject, tendon_box_problem), 1e-3
    held = solver.constrained(TENSION_N, PULLED_RAD, solver.rest())
    require(held.dmoment_dp > 0, "a tendon below the module does not bend it toward −z")
    ahead, behind = _around(solver, TENSION_N, PULLED_RAD, step, held)
    slope = (ahead.travel - behind.travel) / (2 * step)
    cause = "tendon and travel belong to different pieces"
    finding = f"∂τ/∂T (N·m/N) is not the slope of the travel (m/rad): {cause}"
    agree(held.dmoment_dp, slope, finding, rtol=1e-5)
    power = TENSION_N * held.dmoment_dp - held.moment_n_m
    agree(
        (ahead.energy_j - behind.energy_j) / (2 * step),
        power,
        "dE (J/rad) is not −τ + T ∂(travel)/∂u",
        rtol=1e-4,
    )


def regions_have_their_own_material(subject: Subject) -> None:
    """cells of a region have its material: small bends of a layered tube follow the composite beam, Σ E I / l."""
    rest = _special(subject, layered_box_problem).rest()
    finding = (
        "∂τ/∂u (N·m/rad) of a tube with a stiffer floor is not −Σ E I / l: the region's material is not used"
    )
    agree(rest.dmoment_du, -BOX.layered_stiffness_n_m(STIFFER), finding, rtol=1e-5)
