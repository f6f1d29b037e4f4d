"""Checks of a `PhysicsBackend`: equilibrium under every kind of load, forces and cords at points of bodies too."""

from __future__ import annotations

import numpy as np

from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import Actuator, ChainModel
from pliant.records.rollout import Cord, Inputs, PointForce
from pliant.testing.physics_bench import (
    ANGLE_RAD,
    NO_GRAVITY,
    POSITION_M,
    RESIDUAL_SHARE,
    bent_chain,
    needs_joint,
    pressed,
    settled_under,
    unbalanced,
)
from pliant.testing.samples import (
    MODULE_LENGTH_M,
    MODULE_MASS_KG,
    PRESSURE_PA,
    linear_law,
    linear_prismatic_law,
    linear_spherical_law,
    sample_chain,
    softening_law,
)
from pliant.testing.suite import Subject, Suite, require, require_close

suite = Suite("physics")
WORKED_ANGLE_RAD = 0.359718
WORKED_TIP_M = (0.059451, 0.0, -0.007889)
AT = np.array([0.004, 0.001, 0.003])
FORCE = PointForce(2, AT, np.array([0.05, 0.02, -0.04]))
CORD = Cord(4, AT, np.array([0.03, -0.02, 0.01]), 0.08)
LAW_EFFORT_N_M = 0.012


@suite.check(
    "docs/conventions.md, worked number: 8 modules at 15 kPa, u = 0.359718 rad, tip (0.059451, 0, −0.007889) m."
)
def gives_the_worked_number(subject: Subject) -> None:
    settled = settled_under(subject, sample_chain(gravity=NO_GRAVITY), pressed())
    require(settled.converged, "the worked example did not converge")
    require_close(
        settled.joint_angles,
        np.full((8, 1), WORKED_ANGLE_RAD),
        "joint angles (rad): the law is evaluated in other units, or at another angle",
        atol=ANGLE_RAD,
    )
    require_close(
        settled.tip_m, WORKED_TIP_M, "tip (m): positive bending must turn it toward world +x", atol=POSITION_M
    )


@suite.check("one joint under its own weight: k u = m g a cos u about a horizontal base.")
def balances_a_weight(subject: Subject) -> None:
    stiffness = 5e-4
    chain = sample_chain(linear_law(stiffness=stiffness), modules=1, base={"direction": [1, 0, 0]})
    settled = settled_under(subject, chain, pressed(0.0))
    arm = MODULE_MASS_KG / 2 * 9.81 * MODULE_LENGTH_M / 4
    low, high = 0.0, 1.5
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if stiffness * middle < arm * np.cos(middle) else (low, middle)
    drop = float(-settled.tip_m[2])
    require_close(
        drop,
        MODULE_LENGTH_M / 2 * np.sin(low),
        "the tip's drop (m) under the module's own weight: gravity, masses or their place",
        atol=POSITION_M / 10,
    )


@suite.check(
    "a settled chain is an equilibrium of the common statics; `residual` is its largest unbalanced effort."
)
def settles_in_equilibrium(subject: Subject) -> None:
    chain = bent_chain(payload=0.004)
    inputs = pressed(tip_force_n=np.array([0.01, 0.02, 0.0]))
    settled = settled_under(subject, chain, inputs)
    require(settled.converged, "a plain chain with a small load did not converge")
    residual = unbalanced(chain, inputs, settled)
    scale = softening_law().k_n * PRESSURE_PA
    require(
        residual <= RESIDUAL_SHARE * scale,
        f"the unbalanced effort is {residual:.3g} N·m, {residual / scale:.1%} of the law's: a load is "
        "missing, or "
        "efforts are not mapped by the joints' Jacobians, or it stopped early",
    )
    require_close(
        settled.residual, residual, "`residual` (N·m) is not the largest unbalanced effort", atol=1e-3 * scale
    )


@suite.check(
    "physics does not depend on the base's pose: base, gravity and forces turned together turn the chain."
)
def turns_with_its_base(subject: Subject) -> None:
    turn = np.array([[0.0, -0.6, 0.8], [1.0, 0.0, 0.0], [0.0, 0.8, 0.6]])
    shift = np.array([0.3, -0.2, 0.1])
    chain = bent_chain(payload=0.004)
    moved = chain.with_(
        base_position_m=turn @ chain.base_position_m + shift,
        base_rotation=turn @ chain.base_rotation,
        gravity_m_s2=turn @ chain.gravity_m_s2,
    )
    force = np.array([0.01, 0.02, 0.0])
    here = settled_under(subject, chain, pressed(tip_force_n=force))
    there = settled_under(subject, moved, pressed(tip_force_n=turn @ force))
    require_close(
        there.markers_m,
        here.markers_m @ turn.T + shift,
        "markers (m) of the moved chain: the base's pose or the frame of gravity or of the tip force",
        atol=POSITION_M,
    )


@suite.check("a payload hangs at the tip as a dead weight: the same as the tip force m g down.")
def payload_is_a_weight_at_the_tip(subject: Subject) -> None:
    chain = bent_chain()
    hung = settled_under(subject, chain.with_(payload_kg=0.005), pressed())
    pulled = settled_under(subject, chain, pressed(tip_force_n=np.array([0.0, 0.0, -0.005 * 9.81])))
    bare = settled_under(subject, chain, pressed())
    require(
        float(np.abs(hung.tip_m - bare.tip_m).max()) > 10 * POSITION_M,
        "the payload does not move the tip at all",
    )
    require_close(
        hung.markers_m,
        pulled.markers_m,
        "markers (m) with a payload and with its weight as tip force: place of the payload, or the force's "
        "frame",
        atol=POSITION_M,
    )


@suite.check("`moment_n_m` opposes the actuation at the last joint: τ(p, u) = M.")
def moment_opposes_actuation(subject: Subject) -> None:
    law = linear_law()
    chain = sample_chain(law, modules=1, gravity=NO_GRAVITY)
    moment = 0.004
    settled = settled_under(subject, chain, pressed(moment_n_m=moment))
    wanted = (law.gain[0] * PRESSURE_PA - moment) / law.stiffness[0, 0]
    require_close(
        settled.joint_angles,
        [[wanted]],
        "u (rad) under an opposing moment: its sign or size",
        atol=ANGLE_RAD / 3,
    )


@suite.check("each actuator adds sign · law(p, sign · u): equal opposed pressures leave the chain straight.")
def opposed_actuators_cancel(subject: Subject) -> None:
    pair = (Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0))
    chain = sample_chain(modules=3, gravity=NO_GRAVITY).with_(actuators=pair)
    equal = settled_under(
        subject, chain, Inputs({"pressure_1_pa": PRESSURE_PA, "pressure_2_pa": PRESSURE_PA})
    )
    require_close(
        equal.joint_angles, np.zeros((3, 1)), "u (rad) under equal opposed pressures", atol=ANGLE_RAD
    )
    second = settled_under(subject, chain, Inputs({"pressure_1_pa": 0.0, "pressure_2_pa": PRESSURE_PA}))
    require(second.joint_angles.max() < 0, "the opposed chamber does not bend the chain to the other side")


@suite.check(
    "`settle` never raises for lack of convergence: `converged` is False and `residual` tells how far it is."
)
def admits_that_it_did_not_converge(subject: Subject) -> None:
    # ∂τ/∂u > 0 and constant: no equilibrium but u = −g p / k, which no engine reaches by relaxing.
    runaway = linear_law(stiffness=-0.002)
    chain = sample_chain(runaway, modules=1, gravity=NO_GRAVITY)
    inputs = pressed()
    settled = settled_under(subject, chain, inputs)
    residual = unbalanced(chain, inputs, settled)
    scale = runaway.gain[0] * PRESSURE_PA
    require(
        not settled.converged or residual <= RESIDUAL_SHARE * scale or not np.isfinite(residual),
        f"converged is True with an unbalanced effort of {residual:.3g} N·m",
    )
    require(
        not (settled.converged and settled.stable),
        "an unstable joint (∂τ/∂u > 0) was called converged and stable",
    )


@suite.check(
    "spherical joints: u is the rotation vector, τ the effort conjugate to it, mapped by the inverse "
    "Jacobian."
)
def spherical_efforts_are_energy_consistent(subject: Subject) -> None:
    needs_joint(subject, "spherical")
    chain = sample_chain(linear_spherical_law(), modules=4, base={"direction": [1, 0, 0.3]}, payload=0.02)
    inputs = pressed(2 * PRESSURE_PA)
    settled = settled_under(subject, chain, inputs)
    residual = unbalanced(chain, inputs, settled)
    scale = 8e-7 * 2 * PRESSURE_PA
    require(
        settled.converged and residual <= RESIDUAL_SHARE * scale,
        f"the unbalanced effort is {residual:.3g} N·m, {residual / scale:.1%} of the law's: τ was applied "
        "as a torque "
        "in the parent's or the child's frame",
    )
    wanted = ChainGeometry.of(chain).markers(settled.joint_angles)
    require_close(
        settled.markers_m, wanted, "markers (m): u is not the joint's rotation vector", atol=POSITION_M
    )


@suite.check("prismatic joints: u is an extension in metres along the joint's axis, τ a force.")
def prismatic_joints_extend(subject: Subject) -> None:
    needs_joint(subject, "prismatic")
    law = linear_prismatic_law()
    chain = sample_chain(law, modules=2, gravity=NO_GRAVITY)
    settled = settled_under(subject, chain, pressed())
    each = law.gain[0] * PRESSURE_PA / law.stiffness[0, 0]
    require_close(
        settled.joint_angles, np.full((2, 1), each), "extension (m) g p / k of each joint", atol=POSITION_M
    )
    require_close(
        settled.tip_m,
        [0.0, 0.0, -(chain.length_m + 2 * each)],
        "tip (m) of the extended chain",
        atol=2 * POSITION_M,
    )


def balances(subject: Subject, chain: ChainModel, inputs: Inputs, cause: str) -> None:
    """The chain settles where the common statics balances, and away from where it does without these loads."""
    settled = settled_under(subject, chain, inputs)
    require(settled.converged, "a plain chain with small loads at points did not converge")
    residual = unbalanced(chain, inputs, settled)
    require(
        residual <= RESIDUAL_SHARE * LAW_EFFORT_N_M,
        f"the unbalanced effort is {residual:.3g} N·m, {residual / LAW_EFFORT_N_M:.1%} of the law's: {cause}",
    )


@suite.check("a point force is a dead force in the world at a point of its body's frame.")
def point_forces_act_where_they_say(subject: Subject) -> None:
    balances(
        subject,
        bent_chain(payload=0.004),
        pressed(forces=(FORCE,)),
        "the force acts on another body, at another point, or turns with the body",
    )


@suite.check("a cord pulls its point toward the pulley with its tension, wherever the chain goes.")
def cords_pull_toward_their_pulleys(subject: Subject) -> None:
    balances(
        subject,
        bent_chain(payload=0.004),
        pressed(cords=(CORD,)),
        "the cord keeps its first direction, its tension changes, or it acts at another point",
    )


@suite.check("a cord from the tip to a pulley far below is the tip force of its tension.")
def long_cords_are_dead_forces(subject: Subject) -> None:
    chain, far = bent_chain(), 1e4
    cord = Cord(chain.n_joints, chain.tip_offset_m, np.array([0.0, 0.0, -far]), 0.05)
    pulled = settled_under(subject, chain, pressed(cords=(cord,)))
    pushed = settled_under(subject, chain, pressed(tip_force_n=np.array([0.0, 0.0, -0.05])))
    require_close(
        pulled.markers_m,
        pushed.markers_m,
        "markers (m) under a long cord and under its force",
        atol=POSITION_M,
    )


@suite.check("spherical joints take point forces and cords about all three axes.")
def points_load_spherical_joints(subject: Subject) -> None:
    needs_joint(subject, "spherical")
    chain = sample_chain(linear_spherical_law(), modules=4)
    inputs = Inputs({"pressure_pa": PRESSURE_PA}, forces=(FORCE,), cords=(CORD,))
    balances(subject, chain, inputs, "loads at points are not mapped by the joints' Jacobians")
