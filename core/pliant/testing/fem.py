"""Checks of an `FEMBackend`, on a coarse box whose small deformations are known in closed form (`box`).

Modules of several axes, prismatic ones and tendons are in `fem_axes`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.fem import ModuleSolver, StateNotConvergedError
from pliant.records.fem import FemState, ModuleProblem
from pliant.testing.box import BoxModule, box_problem
from pliant.testing.fem_axes import sample_solver
from pliant.testing.fem_axes import suite as axes
from pliant.testing.joint_laws import stored
from pliant.testing.stand_ins import sample_material
from pliant.testing.suite import CheckSkipped, Subject, Suite, require, require_close, require_refused

suite = Suite("fem")
suite.checks.extend(axes.checks)
# A pressure that bends the box by about 0.1 rad, and the angles that go with it.
PRESSURE_PA = 8e3
ANGLE_RAD = 0.15
# Relative; Newton's own tolerance lies below.
SOLVED = 1e-6


def _problem(subject: Subject) -> ModuleProblem:
    return subject.once("box", box_problem)


def _solver(subject: Subject) -> ModuleSolver:
    return subject.once("solver", lambda: _new_solver(subject))


def _new_solver(subject: Subject, problem: ModuleProblem | None = None) -> ModuleSolver:
    return sample_solver(subject, problem or _problem(subject))


def _rest(subject: Subject) -> FemState:
    return subject.once("rest", lambda: _solver(subject).rest())


def _free(subject: Subject) -> FemState:
    return subject.once("free", lambda: _solver(subject).free(PRESSURE_PA, _rest(subject)))


def _held(subject: Subject, pressure: float = PRESSURE_PA, angle: float = ANGLE_RAD) -> FemState:
    """The constrained state, reached from rest."""
    return subject.once(
        f"held {pressure} {angle}", lambda: _solver(subject).constrained(pressure, angle, _rest(subject))
    )


def _moment_scale() -> float:
    return _box().stiffness_n_m * ANGLE_RAD


def _box() -> BoxModule:
    material = sample_material()
    return BoxModule(material.young_pa, material.poisson)


@suite.check("`rest` is the undeformed state: angle, moment and energy zero, slopes included.")
def rest_state_is_zero(subject: Subject) -> None:
    rest = _rest(subject)
    for name in ("actuation", "angle_rad", "moment_n_m", "energy_j", "axial_strain"):
        scale = _moment_scale() if name in ("moment_n_m", "energy_j") else 1.0
        require_close(getattr(rest, name), 0.0, f"{name} of the rest state is not zero", atol=1e-9 * scale)
    require(rest.dmoment_dp > 0 and rest.dmoment_du < 0, "the rest state has no slopes")
    require(rest.status == "ok", f"the rest state's status is '{rest.status}'")


@suite.check(
    "τ is that of the whole module: small bends of a uniform tube follow beam theory, ∂τ/∂u = −E I / l."
)
def small_bends_follow_beam_theory(subject: Subject) -> None:
    require_close(
        _rest(subject).dmoment_du,
        -_box().stiffness_n_m,
        "∂τ/∂u (N·m/rad) at rest is not −E I / l: a wrong deformation_scale or energy_scale, or end sections "
        "that are not "
        "free in their plane",
        rtol=1e-5,
    )


@suite.check(
    "pressure acts through the cavity's volume, thrust on the ends included: ∂τ/∂p = (1 − 2ν) A (z_c − z_e)."
)
def small_pressures_follow_beam_theory(subject: Subject) -> None:
    require_close(
        _rest(subject).dmoment_dp,
        _box().gain_m3,
        "∂τ/∂p (N·m/Pa) at rest is not (1 − 2ν) A_c (z_c − z_e): the thrust on the end sections is missing "
        "or the "
        "pressure has the wrong side",
        rtol=1e-5,
    )


@suite.check("energies and moments are those of the module: energy_scale times the solved piece.")
def scales_with_the_module(subject: Subject) -> None:
    doubled = _new_solver(subject, box_problem(energy_scale=8.0))
    state, half = doubled.constrained(PRESSURE_PA, ANGLE_RAD, doubled.rest()), _held(subject)
    for name in ("moment_n_m", "energy_j", "dmoment_dp", "dmoment_du"):
        require_close(
            getattr(state, name),
            2 * getattr(half, name),
            f"twice the energy_scale does not give twice the {name}",
            rtol=1e-5,
        )


@suite.check(
    "`free` is equilibrium without external moment, at the actuation that was asked for; actuation bends u "
    "> 0."
)
def free_state_has_no_moment(subject: Subject) -> None:
    free = _free(subject)
    require(
        free.branch == "free" and free.actuation == PRESSURE_PA,
        "branch or actuation is not what was asked for",
    )
    require(free.angle_rad > 0, f"positive pressure bends the box by {free.angle_rad:.3g} rad: a wrong sign")
    require_close(
        free.moment_n_m, 0.0, "the free state's moment (N·m) is not zero", atol=SOLVED * _moment_scale()
    )


@suite.check("`constrained` holds the module angle u = deformation_scale · θ that was asked for.")
def constrained_state_holds_the_angle(subject: Subject) -> None:
    held = _held(subject)
    require(held.branch == "constrained", f"branch is '{held.branch}'")
    require_close(held.angle_rad, ANGLE_RAD, "the state's angle (rad) is not the one asked for", atol=1e-10)
    require(held.actuation == PRESSURE_PA, f"the actuation is {held.actuation}, asked for {PRESSURE_PA}")


@suite.check("both branches are one equilibrium: held at the free angle, the moment is zero.")
def branches_agree(subject: Subject) -> None:
    free = _free(subject)
    held = _solver(subject).constrained(PRESSURE_PA, free.angle_rad, _rest(subject))
    require_close(
        held.moment_n_m,
        0.0,
        "held at its free angle the module needs a moment (N·m): the branches solve different equations",
        atol=10 * SOLVED * _moment_scale(),
    )


@suite.check("τ(p, u) opposes further bending and grows with pressure.")
def moment_has_the_right_sign(subject: Subject) -> None:
    blocked = _held(subject, PRESSURE_PA, 0.0)
    require(
        blocked.moment_n_m > 0, f"blocked at u = 0 under pressure, the moment is {blocked.moment_n_m:.3g} N·m"
    )
    bent = _held(subject, 0.0, ANGLE_RAD)
    require(bent.moment_n_m < 0, f"bent by hand without pressure, the moment is {bent.moment_n_m:.3g} N·m")


@suite.check("`dmoment_dp` is the exact slope with all other unknowns at equilibrium.")
def slope_in_pressure_is_exact(subject: Subject) -> None:
    state, step = _held(subject), 0.02 * PRESSURE_PA
    solver = _solver(subject)
    after, before = (solver.constrained(PRESSURE_PA + s, ANGLE_RAD, state).moment_n_m for s in (step, -step))
    require_close(
        state.dmoment_dp,
        (after - before) / (2 * step),
        "dmoment_dp (N·m/Pa) differs from the finite difference: unknowns were held fixed, or the "
        "pressure's own "
        "stiffness is missing",
        # of the slope at rest: here the slope may pass through zero
        atol=1e-4 * abs(_rest(subject).dmoment_dp),
    )


@suite.check("`dmoment_du` is the exact slope with all other unknowns at equilibrium.")
def slope_in_angle_is_exact(subject: Subject) -> None:
    state, step = _held(subject), 4e-3
    solver = _solver(subject)
    after, before = (solver.constrained(PRESSURE_PA, ANGLE_RAD + s, state).moment_n_m for s in (step, -step))
    require_close(
        state.dmoment_du,
        (after - before) / (2 * step),
        "dmoment_du (N·m/rad) differs from the finite difference: unknowns were held fixed, or the angle "
        "is θ and "
        "not u",
        rtol=1e-4,
    )


@suite.check("without pressure the stored energy is the work of the moment: dE = −τ du.")
def energy_is_the_work_done(subject: Subject) -> None:
    solver = _solver(subject)
    node, weight = np.polynomial.legendre.leggauss(3)
    start, work = _rest(subject), 0.0
    for n, w in zip(node, weight, strict=True):
        start = solver.constrained(0.0, ANGLE_RAD * (n + 1) / 2, start)
        work -= start.moment_n_m * w * ANGLE_RAD / 2
    require_close(
        _held(subject, 0.0, ANGLE_RAD).energy_j,
        work,
        "energy_j (J) at zero pressure is not the work −∫τ du: energy and moment belong to different pieces",
        rtol=1e-4,
    )


@suite.check("a state is self-contained: a new solver continues from one that another process saved.")
def continues_from_a_saved_state(subject: Subject) -> None:
    state = _new_solver(subject).constrained(PRESSURE_PA, ANGLE_RAD, stored(_free(subject)))
    _require_held(
        subject, state, "differs when the solver starts from a saved state: it remembers more than it"
    )


@suite.check("a state does not depend on the way that led to it.")
def path_does_not_matter(subject: Subject) -> None:
    solver = _solver(subject)
    detour = solver.constrained(0.0, -ANGLE_RAD, _rest(subject))
    state = solver.constrained(PRESSURE_PA, ANGLE_RAD, detour)
    _require_held(subject, state, "depends on the start: not converged, or state left over in the solver")


def _require_held(subject: Subject, state: FemState, finding: str) -> None:
    """The state is the one that was held from rest."""
    for name in ("moment_n_m", "energy_j", "dmoment_dp", "dmoment_du"):
        require_close(getattr(state, name), getattr(_held(subject), name), f"{name} {finding}", rtol=1e-5)


@suite.check(
    "`deformed_nodes` are (n, 3) in the module frame; at rest they are the mesh, the start section stays "
    "in x = 0."
)
def deformed_nodes_follow_the_bend(subject: Subject) -> None:
    solver, problem = _solver(subject), _problem(subject)
    nodes = problem.mesh.nodes_m
    size = float(np.ptp(nodes))
    rest = solver.deformed_nodes(_rest(subject))
    require_close(rest, nodes, "at rest the deformed nodes are not the mesh's", atol=1e-9 * size)
    bent = solver.deformed_nodes(_held(subject))
    require(bent.shape == nodes.shape, f"deformed_nodes has shape {bent.shape}, the mesh {nodes.shape}")
    start = bent[problem.mesh.node_sets["start"]]
    require_close(
        start[:, 0], np.zeros(len(start)), "the start section (m) left its plane x = 0", atol=1e-8 * size
    )
    theta = ANGLE_RAD / problem.deformation_scale
    normal = np.array([np.cos(theta), 0.0, -np.sin(theta)])
    heights = bent[problem.mesh.node_sets["end"]] @ normal
    require_close(
        heights,
        np.full(len(heights), heights.mean()),
        "the end section is not a plane turned by θ = u / deformation_scale about y (positive toward −z)",
        atol=1e-8 * size,
    )


@suite.check("`fields`, where a backend has them, stand at the mesh's nodes; a body at rest has no stress.")
def fields_stand_at_the_nodes(subject: Subject) -> None:
    solver, problem = _solver(subject), _problem(subject)
    try:
        fields = solver.fields(_held(subject))
    except UserError as error:
        raise CheckSkipped(str(error)) from error
    nodes = problem.mesh.nodes_m
    size = float(np.ptp(nodes))
    require_close(fields.points_m, nodes, "the points (m) are not the mesh's nodes", atol=1e-9 * size)
    require_close(
        fields.displacement_m,
        solver.deformed_nodes(_held(subject)) - nodes,
        "the displacement (m) is not that of `deformed_nodes`",
        atol=1e-8 * size,
    )
    rest = solver.fields(_rest(subject)).point_data
    stress = 1e-6 * sample_material().young_pa
    for name, value, allowed in (
        ("von_mises_pa", 0.0, stress),
        ("hydrostatic_pa", 0.0, stress),
        ("energy_j_m3", 0.0, stress),
        ("volume_ratio", 1.0, 1e-6),
        ("largest_stretch", 1.0, 1e-6),
    ):
        require(name in fields.point_data, f"the field '{name}' is missing")
        require_close(rest[name], np.full(len(nodes), value), f"{name} of the rest state", atol=allowed)


@suite.check("what does not converge raises `StateNotConvergedError`; the pipeline records it and goes on.")
def says_when_it_does_not_converge(subject: Subject) -> None:
    require_refused(
        lambda: _solver(subject).free(1e4 * PRESSURE_PA, _rest(subject)),
        "a pressure far beyond any equilibrium gave a state",
        r"\S",
        error=StateNotConvergedError,
    )


@suite.check("`solver` raises `UserError` for a problem that it does not support.")
def refuses_unknown_problems(subject: Subject) -> None:
    strange = replace(_problem(subject), frame="no_such_frame")  # type: ignore[arg-type]
    require_refused(
        lambda: _new_solver(subject, strange),
        "a problem with frame 'no_such_frame' was accepted",
        "frame",
        "frame",
    )
