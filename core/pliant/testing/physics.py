"""Checks of a `PhysicsBackend`: conventions, correct reports, life cycle, equilibrium under every kind of load.

Swings are in `physics_motion`, scenes with contact in `physics_scene`, other capabilities in `physics_runs`.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from scipy.optimize import brentq

from pliant.interfaces.physics import Capabilities, PhysicsBackend
from pliant.interfaces.simulation import Simulation
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import Actuator, ChainModel
from pliant.records.law import N_AXES, Domain
from pliant.records.rollout import Cord, Equilibrium, Inputs, PointForce
from pliant.testing import CheckSkipped, Subject, agree, declared, once, require, require_refused
from pliant.testing.samples import (
    MODULE_LENGTH_M,
    MODULE_MASS_KG,
    PRESSURE_PA,
    chain_numbers,
    linear_extensible_law,
    linear_law,
    linear_prismatic_law,
    linear_spherical_law,
    sample_chain,
    softening_law,
)

KINDS = tuple(N_AXES)
# Tolerance of every engine: engines agree within 0.01 mm.
POSITION_M = 1e-5
ANGLE_RAD = 3e-4
# Largest unbalanced effort of a converged equilibrium, as a share of the law's effort at full pressure.
RESIDUAL_SHARE = 1e-3
NO_GRAVITY = (0.0, 0.0, 0.0)
PAYLOAD_KG = 0.004
WORKED_ANGLE_RAD = 0.359718
WORKED_TIP_M = (0.059451, 0.0, -0.007889)
TIP_FORCE_N = np.array([0.01, 0.02, 0.0])
AT = np.array([0.004, 0.001, 0.003])
FORCE = PointForce(2, AT, np.array([0.05, 0.02, -0.04]))
CORD = Cord(4, AT, np.array([0.03, -0.02, 0.01]), 0.08)
LAW_EFFORT_N_M = 0.012
# A load of a chain that bends out of the plane, and the likely error if it is not in balance.
LOADS: tuple[tuple[str, dict[str, Any], str], ...] = (
    ("a tip force", {"tip_force_n": TIP_FORCE_N}, "gravity, the payload or the force is missing or turned"),
    ("a moment", {"moment_n_m": 0.004}, "its sign or size: it opposes the actuation at the last joint"),
    ("a point force", {"forces": (FORCE,)}, "it acts on another body, at another point, or turns with it"),
    ("a cord", {"cords": (CORD,)}, "it keeps its first direction, its tension changes, or it acts elsewhere"),
)


def pressed(pressure: float = PRESSURE_PA, **loads: object) -> Inputs:
    """Return inputs with a pressure and further loads."""
    return Inputs({"pressure_pa": pressure}, **loads)  # type: ignore[arg-type]


def settled_under(subject: Subject, chain: ChainModel, inputs: Inputs) -> Equilibrium:
    """Return the equilibrium of a new simulation of this chain."""
    backend: PhysicsBackend = subject.build()
    with backend.build(chain) as simulation:
        simulation.apply(inputs)
        return simulation.settle()


def needs(subject: Subject, capability: str) -> PhysicsBackend:
    """Return the engine; skip the check if its `Capabilities` lack this one."""
    engine: PhysicsBackend = subject.build()
    if not getattr(engine.capabilities, capability):
        raise CheckSkipped(f"{subject.component.label} has no {capability.replace('_', ' ')}")
    return engine


Capability = TypeVar("Capability")


def capable(subject: Subject, protocol: type[Capability]) -> Capability:
    """Return the engine; skip the check if it lacks a method of this protocol."""
    engine = subject.build()
    if not isinstance(engine, protocol):
        raise CheckSkipped(f"{subject.component.label} is no {protocol.__name__}")
    return engine


def bent_chain(**chain: object) -> ChainModel:
    """Return two segments, the second rotated about the chain axis, which bend out of the plane."""
    return sample_chain(softening_law(), modules=3, turns_rad=(0.0, 1.2), **chain)


@once
def _loaded(subject: Subject, number: int = 0) -> Equilibrium:
    """Return the bent chain under pressure, with a payload and one of `LOADS`."""
    return settled_under(subject, bent_chain(payload=PAYLOAD_KG), pressed(**LOADS[number][1]))


def _needs_joint(subject: Subject, kind: str) -> None:
    """Skip the check for an engine without joints of this kind."""
    if kind not in type(subject.build()).capabilities.joints:
        raise CheckSkipped(f"{subject.component.label} has no {kind} joints")


def _unbalanced(chain: ChainModel, inputs: Inputs, settled: Equilibrium) -> float:
    """Return the largest unbalanced effort of a settled chain by the common statics."""
    efforts = ChainStatics(chain).residual(settled.joint_angles, Loads.from_inputs(chain, inputs))
    return float(np.abs(efforts).max())


def _require_balance(chain: ChainModel, inputs: Inputs, settled: Equilibrium, load: str, cause: str) -> None:
    """Check convergence, balance of the law's effort by the common statics, and a consistent `residual`."""
    require(settled.converged, f"a plain chain under {load} did not converge")
    residual = _unbalanced(chain, inputs, settled)
    of_the_law = f"{residual / LAW_EFFORT_N_M:.1%} of the law's"
    finding = f"the unbalanced effort under {load} is {residual:.3g} N·m, {of_the_law}: {cause}"
    require(residual <= RESIDUAL_SHARE * LAW_EFFORT_N_M, finding)
    finding = f"`residual` (N·m) under {load} is not the largest unbalanced effort"
    agree(settled.residual, residual, finding, atol=2 * RESIDUAL_SHARE * LAW_EFFORT_N_M)


@declared
def declares_its_capabilities(subject: Subject) -> None:
    """`capabilities` states which joints the engine supports, before it is built."""
    given = type(subject.build()).capabilities
    require(isinstance(given, Capabilities), f"capabilities is {given!r}")
    known = given.joints and set(given.joints) <= set(KINDS)
    require(known, f"joints {given.joints} are not some of {KINDS}")


def starts_straight(subject: Subject) -> None:
    """a built simulation is at rest: straight along the base's x axis, markers base, joints 1…n, tip."""
    with subject.build().build(sample_chain(modules=4)) as simulation:
        wanted = -MODULE_LENGTH_M * np.outer([0.0, 0.5, 1.5, 2.5, 3.5, 4.0], [0, 0, 1])
        finding = "markers (m) of the straight chain: default base, order or unit"
        agree(simulation.markers(), wanted, finding, atol=POSITION_M)
        position = simulation.snapshot().position
        agree(position, np.zeros((4, 1)), "joint coordinates (rad) at rest", atol=1e-9)


def stays_at_rest_without_loads(subject: Subject) -> None:
    """without loads an equilibrium is the straight chain."""
    settled = settled_under(subject, sample_chain(modules=4, gravity=NO_GRAVITY), pressed(0.0))
    agree(settled.joint_angles, np.zeros((4, 1)), "joint angles (rad) without any load", atol=1e-6)


def markers_follow_the_kinematics(subject: Subject) -> None:
    """markers follow from the joint angles: rest frames rotated between segments, rotations about y."""
    chain = bent_chain()
    with subject.build().build(chain) as simulation:
        simulation.apply(pressed())
        settled = simulation.settle()
        wanted = ChainGeometry.from_chain(chain).markers(settled.joint_angles)
        agree(settled.markers_m, wanted, "markers_m (m) do not belong to joint_angles", atol=POSITION_M)
        finding = "markers() differs from the settled markers_m"
        agree(simulation.markers(), settled.markers_m, finding, atol=POSITION_M)


def refuses_missing_inputs(subject: Subject) -> None:
    """an input without a value raises `UserError` that names it."""
    accepted = "a chain driven by pressure_pa settled without a value for it"
    chain, pulled = sample_chain(modules=2), Inputs({"tendon_force_n": 1.0})
    require_refused(lambda: settled_under(subject, chain, pulled), accepted, "pressure_pa", "missing input")


def reports_extrapolation(subject: Subject) -> None:
    """use of a law outside its domain is reported: joint from 1, variable, excess."""
    box = Domain(np.array([0.0, 1e4]), np.array([[-1.0, 1.0]]))
    chain = sample_chain(linear_law(domain=box), modules=3, gravity=NO_GRAVITY)
    inside, outside = (settled_under(subject, chain, pressed(p)).outside_domain for p in (9e3, 12e3))
    require(not inside, f"a state inside the domain is reported: {inside}")
    found = {o.module: o.excess for o in outside if o.variable == "pressure_pa"}
    above = f"joints 1, 2, 3 are used 2 kPa above their domain; reported were {sorted(found)}"
    require(set(found) == {1, 2, 3}, above)
    agree(list(found.values()), 2e3, "the excess (Pa) reported", rtol=1e-6)


def restores_a_snapshot(subject: Subject) -> None:
    """`restore` reproduces a snapshot exactly."""
    with subject.build().build(bent_chain()) as simulation:
        simulation.apply(pressed())
        simulation.settle()
        kept, markers = simulation.snapshot(), simulation.markers()
        position, velocity = kept.position.copy(), kept.velocity.copy()
        simulation.apply(pressed(0.0))
        simulation.settle()
        moved = np.abs(simulation.markers() - markers).max()
        require(moved > 1e-3, "the chain does not move when the pressure is released")
        same = np.array_equal(kept.position, position)
        require(same, "the snapshot changed while the simulation went on: copy it")
        simulation.restore(kept)
        again = simulation.snapshot()
        agree(again.position, position, "joint coordinates after restore", atol=1e-12)
        agree(again.velocity, velocity, "joint rates after restore", atol=1e-12)
        agree(again.time_s, kept.time_s, "time (s) after restore", atol=1e-12)
        agree(simulation.markers(), markers, "markers (m) after restore", atol=1e-9)


def steps_forward_in_time(subject: Subject) -> None:
    """`step` advances time by the requested duration, toward the equilibrium."""
    with subject.build().build(sample_chain(modules=2)) as simulation:
        start = simulation.snapshot().time_s
        simulation.apply(pressed())
        simulation.step(0.05)
        simulation.step(0.013)
        passed, position = simulation.snapshot().time_s - start, simulation.snapshot().position
    finding = "time (s) passed in two steps of 0.05 s and 0.013 s: round up the last internal step"
    agree(passed, 0.063, finding, atol=2e-3)
    require(np.all(np.isfinite(position)), "joint coordinates are not finite after 0.063 s")
    require(position.sum() > 1e-4, "the chain does not move under pressure")


def dynamic_is_what_it_says(subject: Subject) -> None:
    """`dynamic` states whether `step` advances inertia; in other engines each step ends in equilibrium."""
    engine: PhysicsBackend = subject.build()
    # Some grams at the tip: a joint with inertia moves less than a third of its way within two milliseconds.
    chain = sample_chain(modules=4, gravity=NO_GRAVITY, payload=0.05)
    with engine.build(chain) as simulation:
        start = simulation.markers()[-1]
        simulation.apply(pressed())
        simulation.step(0.002)
        moved = float(np.linalg.norm(simulation.markers()[-1] - start))
    whole = float(np.linalg.norm(settled_under(subject, chain, pressed()).tip_m - start))
    if engine.capabilities.dynamic:
        require(
            moved < 0.5 * whole,
            "capabilities.dynamic is True, and 2 ms after a step of pressure a tip with 50 g has gone "
            f"{moved:.3g} m of {whole:.3g} m: no inertia holds it back",
        )
    else:
        way = "the way (m) of the tip after a step is not that to its equilibrium"
        agree(moved, whole, f"capabilities.dynamic is False, and {way}", atol=20 * POSITION_M)


def simulations_are_independent(subject: Subject) -> None:
    """two simulations of one engine are independent."""
    backend: PhysicsBackend = subject.build()
    with backend.build(sample_chain(modules=3)) as first:
        first.apply(pressed())
        alone = first.settle().markers_m
        with backend.build(sample_chain(modules=5)) as second:
            second.apply(pressed(5e3))
            second.settle()
            finding = "markers (m) moved when another simulation ran: shared state"
            agree(first.markers(), alone, finding, atol=1e-12)
            again = first.settle().markers_m
            agree(again, alone, "settled markers (m) changed beside another one", atol=POSITION_M)
        agree(first.markers(), alone, "markers (m) changed when another one closed", atol=POSITION_M)


def closes_cleanly(subject: Subject) -> None:
    """`close` frees the engine, twice is harmless, and a new simulation may follow."""
    backend: PhysicsBackend = subject.build()
    simulation: Simulation = backend.build(sample_chain(modules=2))
    simulation.close()
    simulation.close()
    for _ in range(3):
        with backend.build(sample_chain(modules=2)) as again:
            require(np.all(np.isfinite(again.markers())), "markers after an earlier simulation was closed")


def leaves_the_chain_alone(subject: Subject) -> None:
    """the chain belongs to the caller and is not changed."""
    chain = bent_chain(payload=PAYLOAD_KG)
    before = chain_numbers(chain)
    with subject.build().build(chain) as simulation:
        simulation.apply(pressed())
        simulation.step(0.01)
        simulation.settle()
    require(np.array_equal(before, chain_numbers(chain)), "an array of the chain was changed in place")


def gives_the_worked_number(subject: Subject) -> None:
    """docs/conventions.md, worked number: 8 modules at 15 kPa, u = 0.359718 rad, tip (0.059451, 0, −0.007889) m."""
    settled = settled_under(subject, sample_chain(gravity=NO_GRAVITY), pressed())
    require(settled.converged, "the worked example did not converge")
    finding = "joint angles (rad): the law is evaluated in other units, or at another angle"
    agree(settled.joint_angles, np.full((8, 1), WORKED_ANGLE_RAD), finding, atol=ANGLE_RAD)
    finding = "tip (m): positive bending must turn it toward world +x"
    agree(settled.tip_m, WORKED_TIP_M, finding, atol=POSITION_M)


def balances_a_weight(subject: Subject) -> None:
    """one joint under its own weight: k u = m g a cos u about a horizontal base."""
    stiffness = 5e-4
    chain = sample_chain(linear_law(stiffness=stiffness), modules=1, base={"direction": [1, 0, 0]})
    settled = settled_under(subject, chain, pressed(0.0))
    arm = MODULE_MASS_KG / 2 * 9.81 * MODULE_LENGTH_M / 4
    angle = float(brentq(lambda u: stiffness * u - arm * np.cos(u), 0.0, 1.5))
    finding = "the tip's drop (m) under the module's own weight: gravity, masses or their place"
    agree(-settled.tip_m[2], MODULE_LENGTH_M / 2 * np.sin(angle), finding, atol=POSITION_M / 10)


def turns_with_its_base(subject: Subject) -> None:
    """physics does not depend on the base's pose: rotating base, gravity and forces rotates the chain."""
    turn = np.array([[0.0, -0.6, 0.8], [1.0, 0.0, 0.0], [0.0, 0.8, 0.6]])
    shift = np.array([0.3, -0.2, 0.1])
    chain = bent_chain(payload=PAYLOAD_KG)
    moved = chain.with_(
        base_position_m=turn @ chain.base_position_m + shift,
        base_rotation=turn @ chain.base_rotation,
        gravity_m_s2=turn @ chain.gravity_m_s2,
    )
    there = settled_under(subject, moved, pressed(tip_force_n=turn @ TIP_FORCE_N))
    finding = "markers (m) of the moved chain: the base's pose or the frame of gravity or of the tip force"
    agree(there.markers_m, _loaded(subject).markers_m @ turn.T + shift, finding, atol=POSITION_M)


def settles_in_equilibrium(subject: Subject) -> None:
    """a settled chain is an equilibrium of the common statics under every load: tip force, moment, force, cord."""
    chain = bent_chain(payload=PAYLOAD_KG)
    for number, (load, fields, cause) in enumerate(LOADS):
        _require_balance(chain, pressed(**fields), _loaded(subject, number), load, cause)


def opposed_actuators_cancel(subject: Subject) -> None:
    """each actuator adds sign · law(p, sign · u): equal opposed pressures leave the chain straight."""
    pair = (Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0))
    chain = sample_chain(modules=3, gravity=NO_GRAVITY).with_(actuators=pair)
    equal, second = (
        settled_under(subject, chain, Inputs({"pressure_1_pa": first, "pressure_2_pa": PRESSURE_PA}))
        for first in (PRESSURE_PA, 0.0)
    )
    agree(equal.joint_angles, np.zeros((3, 1)), "u (rad) under equal opposed pressures", atol=ANGLE_RAD)
    other = second.joint_angles.max() < 0
    require(other, "the opposed chamber does not bend the chain to the other side")


def admits_that_it_did_not_converge(subject: Subject) -> None:
    """`settle` never raises for lack of convergence: `converged` is False and `residual` is the unbalanced effort."""
    # ∂τ/∂u > 0 and constant: the only equilibrium u = −g p / k is not reached by relaxation.
    runaway = linear_law(stiffness=-0.002)
    chain, inputs = sample_chain(runaway, modules=1, gravity=NO_GRAVITY), pressed()
    settled = settled_under(subject, chain, inputs)
    residual = _unbalanced(chain, inputs, settled)
    balanced = residual <= RESIDUAL_SHARE * runaway.gain[0] * PRESSURE_PA or not np.isfinite(residual)
    false = f"converged is True with an unbalanced effort of {residual:.3g} N·m"
    require(not settled.converged or balanced, false)
    both = settled.converged and settled.stable
    require(not both, "an unstable joint (∂τ/∂u > 0) was called converged and stable")


def spherical_efforts_are_energy_consistent(subject: Subject) -> None:
    """spherical joints: u is the rotation vector, τ the effort conjugate to it; loads act by the inverse Jacobian."""
    _needs_joint(subject, "spherical")
    chain = sample_chain(linear_spherical_law(), modules=4, base={"direction": [1, 0, 0.3]}, payload=0.02)
    for load, inputs, cause in (
        (
            "gravity",
            pressed(2 * PRESSURE_PA),
            "τ was applied as a torque in the parent's or the child's frame",
        ),
        (
            "loads at points",
            pressed(forces=(FORCE,), cords=(CORD,)),
            "they are not mapped by the joints' Jacobians",
        ),
    ):
        settled = settled_under(subject, chain, inputs)
        _require_balance(chain, inputs, settled, load, cause)
        wanted = ChainGeometry.from_chain(chain).markers(settled.joint_angles)
        agree(settled.markers_m, wanted, "markers (m): u is not the joint's rotation vector", atol=POSITION_M)


def prismatic_joints_extend(subject: Subject) -> None:
    """prismatic joints: u is an extension in metres along the joint's axis, τ a force."""
    _needs_joint(subject, "prismatic")
    law = linear_prismatic_law()
    chain = sample_chain(law, modules=2, gravity=NO_GRAVITY)
    settled = settled_under(subject, chain, pressed())
    each = law.gain[0] * PRESSURE_PA / law.stiffness[0, 0]
    finding = "extension (m) g p / k of each joint"
    agree(settled.joint_angles, np.full((2, 1), each), finding, atol=POSITION_M)
    tip = [0.0, 0.0, -(chain.length_m + 2 * each)]
    agree(settled.tip_m, tip, "tip (m) of the extended chain", atol=2 * POSITION_M)


def extensible_joints_turn_and_then_extend(subject: Subject) -> None:
    """extensible joints: u is the child's rotation vector, then its travel e in metres along its rotated x axis."""
    _needs_joint(subject, "extensible")
    chain = sample_chain(linear_extensible_law(), modules=3, base={"direction": [1, 0, 0.3]}, payload=0.02)
    for load, inputs in (
        ("gravity", pressed(2 * PRESSURE_PA)),
        ("loads at points", pressed(forces=(FORCE,))),
    ):
        settled = settled_under(subject, chain, inputs)
        cause = "travels come behind turns, and their efforts are forces along the turned axis"
        _require_balance(chain, inputs, settled, load, cause)
        wanted = ChainGeometry.from_chain(chain).markers(settled.joint_angles)
        agree(
            settled.markers_m, wanted, "markers (m): the child is not moved along its own x", atol=POSITION_M
        )
