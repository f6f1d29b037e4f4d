"""Checks of an `FEMBackend` on modules of several axes, prismatic ones and those pulled by a tendon.

A backend that has no such modules raises `UserError` from `solver`; the checks are then skipped with its message.
"""

from __future__ import annotations

import numpy as np

from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.fem import FEMBackend, ModuleSolver
from pliant.interfaces.material import Material
from pliant.records.fem import FemState, ModuleProblem
from pliant.registry.discovery import discover
from pliant.testing.box import BoxModule, prismatic_box_problem, spatial_box_problem, tendon_box_problem
from pliant.testing.stand_ins import sample_material
from pliant.testing.suite import CheckSkipped, Subject, Suite, require, require_close, require_refused

suite = Suite("fem")
AXES = ("x", "y", "z")
PRESSURE_PA = 8e3
MIXED_RAD = {"x": 0.1, "y": 0.15, "z": -0.12}
TENSION_N, PULLED_RAD = 0.2, 0.1
# Relative; meshes that are not mirror-symmetric leave this much.
SYMMETRY = 2e-3


def sample_solver(subject: Subject, problem: ModuleProblem) -> ModuleSolver:
    """A new solver of this problem.

    A backend that hands the law to another program by its name may refuse the sample solid, whose name nobody
    knows; it is then given `neo_hookean` with the same moduli at small strain.
    """
    backend: FEMBackend = subject.build()
    try:
        return backend.solver(problem, sample_material())
    except MissingDependencyError:
        raise
    except UserError:
        return backend.solver(problem, _named_material())


def _named_material() -> Material:
    sample = sample_material()
    registry = discover()
    moduli = {"shear_modulus_pa": sample.shear_modulus_pa, "poisson_ratio": sample.poisson}
    model = registry.get("material", "neo_hookean").config_model()
    named: Material = registry.build("material", model.model_validate({"kind": "neo_hookean", **moduli}))
    return named


def _solver(subject: Subject, name: str, problem: ModuleProblem) -> ModuleSolver:
    try:
        return subject.once(name, lambda: sample_solver(subject, problem))
    except UserError as error:
        raise CheckSkipped(f"{subject.component.label} has no such module: {error}") from error


def _spatial(subject: Subject) -> ModuleSolver:
    return _solver(subject, "spatial", spatial_box_problem())


def _tendon(subject: Subject) -> ModuleSolver:
    return _solver(subject, "tendon", tendon_box_problem())


def _mixed(subject: Subject) -> FemState:
    solver = _spatial(subject)
    return subject.once("mixed", lambda: solver.constrained(PRESSURE_PA, MIXED_RAD, solver.rest()))


def _box() -> BoxModule:
    material = sample_material()
    return BoxModule(material.young_pa, material.poisson)


@suite.check(
    "states of k axes have u and τ (k,), ∂τ/∂p (k,) and ∂τ/∂u (k, k); `held` names what was prescribed."
)
def states_have_all_axes(subject: Subject) -> None:
    state = _mixed(subject)
    wanted = [MIXED_RAD[axis] for axis in AXES]
    require_close(state.deformation, wanted, "u (rad) is not what was held by axis", atol=1e-10)
    for name, shape in (("tau", (3,)), ("dtau_dp", (3,)), ("dtau_du", (3, 3))):
        got = getattr(state, name).shape
        require(got == shape, f"{name} has shape {got}, three axes need {shape}")
    require(set(state.held) == set(AXES), f"`held` is {state.held}, all three axes were held")
    require(state.main == 1, f"`main` is {state.main}, actuation drives y, the second axis")


@suite.check("small bends about z and small twists are those of a uniform tube.")
def small_bends_about_all_axes_follow_beam_theory(subject: Subject) -> None:
    rest, box = _spatial(subject).rest(), _box()
    stiffness = -np.diag(rest.dtau_du)
    require_close(
        stiffness[1:],
        [box.stiffness_n_m, box.side_stiffness_n_m],
        "−∂τ/∂u (N·m/rad) about y and z is not E I / l: sections that cannot warp, or a wrong curvature",
        rtol=1e-5,
    )
    low, high = box.twist_bounds_n_m
    require(
        low < stiffness[0] < high,
        f"the stiffness in twist, {stiffness[0]:.4g} N·m/rad, is not between Bredt's thin tube, {low:.4g}, and "
        f"that of sections that cannot warp, {high:.4g}",
    )


@suite.check("`dtau_du` is symmetric, and the exact slope of τ in every axis, all axes independent.")
def slopes_in_all_axes_are_exact(subject: Subject) -> None:
    solver, state, step = _spatial(subject), _mixed(subject), 2e-3
    scale = float(np.abs(state.dtau_du).max())
    require_close(
        state.dtau_du - state.dtau_du.T,
        np.zeros((3, 3)),
        "dtau_du (N·m/rad) is not symmetric under pressure: τ is not conjugate to the rotation vector, or "
        "pressure is not a potential",
        atol=1e-6 * scale,
    )
    for i, axis in enumerate(AXES):
        ahead, behind = (
            solver.constrained(PRESSURE_PA, {**MIXED_RAD, axis: MIXED_RAD[axis] + s}, state)
            for s in (step, -step)
        )
        require_close(
            state.dtau_du[:, i],
            (ahead.tau - behind.tau) / (2 * step),
            f"∂τ/∂u_{axis} (N·m/rad) differs from the finite difference",
            atol=2e-4 * scale,
        )


@suite.check("bent about y alone, a tube that is symmetric about y = 0 has no coupling to the other axes.")
def axes_decouple_by_symmetry(subject: Subject) -> None:
    solver = _spatial(subject)
    state = solver.constrained(PRESSURE_PA, {"x": 0.0, "y": MIXED_RAD["y"], "z": 0.0}, solver.rest())
    diagonal = np.diag(state.dtau_du)
    require_close(
        state.dtau_du - np.diag(diagonal),
        np.zeros((3, 3)),
        "dtau_du (N·m/rad) couples axes that symmetry separates: end sections that are held, or a wrong sign",
        atol=SYMMETRY * float(np.abs(diagonal).min()),
    )
    require_close(
        state.dtau_dp[[0, 2]],
        np.zeros(2),
        "pressure (∂τ/∂p, N·m/Pa) twists the tube or bends it sideways",
        atol=SYMMETRY * abs(state.dtau_dp[1]),
    )


@suite.check("axes that are not held are free: τ = 0, and slopes are still those with all axes independent.")
def axes_that_are_not_held_are_free(subject: Subject) -> None:
    solver, mixed = _spatial(subject), _mixed(subject)
    partly = solver.constrained(PRESSURE_PA, {"x": MIXED_RAD["x"], "z": MIXED_RAD["z"]}, mixed)
    scale = float(np.abs(mixed.dtau_du).max())
    require_close(partly.tau[1], 0.0, "τ (N·m) is not zero along the axis that is free", atol=1e-6 * scale)
    everything = dict(zip(AXES, partly.deformation.tolist(), strict=True))
    held = solver.constrained(PRESSURE_PA, everything, mixed)
    require_close(
        partly.dtau_du,
        held.dtau_du,
        "dtau_du (N·m/rad) of a partly free state differs from that of the same state held in all axes",
        atol=1e-5 * scale,
    )


@suite.check("`constrained` raises `UserError` for an axis that the joint does not have.")
def refuses_unknown_axes(subject: Subject) -> None:
    solver = _spatial(subject)
    require_refused(
        lambda: solver.constrained(0.0, {"w": 0.1}, solver.rest()), "the axis 'w' was held", "w", "axis"
    )


@suite.check("a prismatic module's u is its extension in m: −∂F/∂u = E A / l, ∂F/∂p = (1 − 2ν) A_c.")
def small_extensions_follow_rod_theory(subject: Subject) -> None:
    solver = _solver(subject, "prismatic", prismatic_box_problem())
    rest, box = solver.rest(), _box()
    require_close(rest.dmoment_du, -box.axial_stiffness_n_m, "∂F/∂u (N/m) at rest is not −E A / l", rtol=1e-5)
    require_close(
        rest.dmoment_dp, box.thrust_m2, "∂F/∂p (m²) at rest is not (1 − 2ν) A_c of the cavity", rtol=1e-5
    )
    held = solver.constrained(0.0, 1e-4, rest)
    require_close(held.angle_rad, 1e-4, "the extension (m) is not the one that was held", atol=1e-12)


@suite.check("a tendon works on its travel: ∂τ/∂T at constant u is ∂(travel)/∂u at constant T.")
def tendon_works_on_its_travel(subject: Subject) -> None:
    solver, step = _tendon(subject), 1e-3
    held = subject.once("pulled", lambda: solver.constrained(TENSION_N, PULLED_RAD, solver.rest()))
    require(held.dmoment_dp > 0, "a tendon below the module does not bend it toward −z")
    ahead, behind = (solver.constrained(TENSION_N, PULLED_RAD + s, held) for s in (step, -step))
    require_close(
        held.dmoment_dp,
        (ahead.travel - behind.travel) / (2 * step),
        "∂τ/∂T (N·m/N) is not the slope of the travel (m/rad): tendon and travel belong to different pieces",
        rtol=1e-5,
    )
    require_close(
        (ahead.energy_j - behind.energy_j) / (2 * step),
        TENSION_N * held.dmoment_dp - held.moment_n_m,
        "dE (J/rad) is not −τ + T ∂(travel)/∂u",
        rtol=1e-4,
    )
