"""Checks of a `PhysicsBackend`: forces and cords at points of bodies."""

from __future__ import annotations

import numpy as np

from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.rollout import Cord, Inputs, PointForce
from pliant.testing.physics_bench import (
    POSITION_M,
    RESIDUAL_SHARE,
    bent_chain,
    needs_joint,
    pressed,
    settled_under,
)
from pliant.testing.samples import PRESSURE_PA, linear_spherical_law, sample_chain
from pliant.testing.suite import Subject, Suite, require, require_close

suite = Suite("physics")
AT = np.array([0.004, 0.001, 0.003])
FORCE = PointForce(2, AT, np.array([0.05, 0.02, -0.04]))
CORD = Cord(4, AT, np.array([0.03, -0.02, 0.01]), 0.08)
LAW_EFFORT_N_M = 0.012


def balances(subject: Subject, chain: ChainModel, inputs: Inputs, cause: str) -> None:
    """The chain settles where the common statics balances, and away from where it does without these loads."""
    settled = settled_under(subject, chain, inputs)
    require(settled.converged, "a plain chain with small loads at points did not converge")
    residual = np.abs(ChainStatics(chain).residual(settled.joint_angles, Loads.of(chain, inputs))).max()
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
