"""Statics in contact: residual and stiffness are the slopes of the potential, and a pressed lever is a known one."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.mechanics.contact_statics import ContactStatics, with_capsules
from pliant.mechanics.signed_distance import solid_from_shape
from pliant.mechanics.statics import Loads
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs
from pliant.records.shape import Shape
from pliant.testing.samples import (
    linear_extensible_law,
    linear_law,
    linear_prismatic_law,
    linear_spherical_law,
    sample_chain,
)
from pliant_plugins.physics.quasistatic.among_obstacles import CONTACT_N_M, ChainAmongObstacles
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

RADIUS_M = 5e-3
BALL = solid_from_shape(Shape("sphere", (8e-3,), np.array([0.019, 0.0, -0.03]), np.eye(3)))
BLOCK = solid_from_shape(Shape("box", (8e-3, 20e-3, 4e-3), np.array([0.019, 0.0, -0.03]), np.eye(3)))


def finger(modules: int = 5) -> ChainModel:
    return with_capsules(sample_chain(linear_law(stiffness=0.04), modules=modules), RADIUS_M)


def pressed(chain: ChainModel, solid, pressure_pa: float = 9e3):
    simulation = ChainAmongObstacles(chain, [solid], QuasistaticConfig())
    for share in np.linspace(0.1, 1.0, 10):
        simulation.apply(Inputs({"pressure_pa": pressure_pa * share}))
        settled = simulation.settle()
    assert settled.converged
    return simulation, settled


@pytest.mark.parametrize("solid", [BALL, BLOCK], ids=["ball", "block"])
def test_residual_and_stiffness_are_slopes_of_the_potential(solid) -> None:
    chain = finger()
    statics = ContactStatics(chain, [solid], 2e3)
    loads = Loads.from_inputs(chain, Inputs({"pressure_pa": 6e3}))
    q = np.full((5, 1), 0.16)
    assert statics.presses(statics.geometry.forward(q)), "the pose does not touch"
    balance, step = statics.balance(q, loads), 1e-6
    for k in range(5):
        move = step * np.eye(5)[k][:, None]
        up, down = (statics.potential(q + sign * move, loads) for sign in (1.0, -1.0))
        assert balance.residual[k, 0] == pytest.approx(-(up - down) / (2 * step), abs=1e-7)
        over, under = (statics.residual(q + sign * move, loads) for sign in (1.0, -1.0))
        slope = -(over - under).ravel() / (2 * step)
        np.testing.assert_allclose(balance.stiffness[:, k], slope, rtol=1e-4, atol=1e-4)


def test_a_lever_presses_with_its_moment_over_its_arm() -> None:
    """One joint without weight: the force times the lever is the effort of the law at the angle where it stops."""
    chain = finger(1).with_(gravity_m_s2=np.zeros(3))
    wall = solid_from_shape(
        Shape("box", (1.0, 1.0, 1.0), np.array([1.0 + RADIUS_M + 2e-4, 0.0, 0.0]), np.eye(3))
    )
    simulation, settled = pressed(chain, wall)
    contacts = simulation.contacts(0, ["wall"])
    joint, tip = settled.markers_m[1], settled.markers_m[-1]
    force = sum(c.normal_n for c in contacts)
    assert force > 0.01
    moment = float(linear_law(stiffness=0.04).evaluate(np.array([9e3]), settled.joint_angles).tau[0, 0])
    place = sum(c.normal_n * (c.position_m[2] - joint[2]) for c in contacts) / force
    assert force * abs(place) == pytest.approx(moment, rel=1e-3)
    assert tip[0] == pytest.approx(2e-4, abs=2 * force / CONTACT_N_M)


@pytest.mark.parametrize("solid", [BALL, BLOCK], ids=["ball", "block"])
def test_slopes_in_contact_are_those_of_settled_chains(solid) -> None:
    chain = finger()
    simulation, _ = pressed(chain, solid)
    slopes = simulation.respond(Inputs({"pressure_pa": 9e3}), simulation.snapshot().position).by_input[0]
    sides = []
    for pressure_pa in (9e3 + 0.5, 9e3 - 0.5):
        simulation.apply(Inputs({"pressure_pa": pressure_pa}))
        sides.append(simulation.settle().markers_m)
    np.testing.assert_allclose(slopes, sides[0] - sides[1], atol=2e-3 * np.abs(slopes).max())


def test_a_mesh_on_the_chain_is_refused() -> None:
    chain = finger(1)
    box = Shape("box", (1e-3, 1e-3, 1e-3), np.zeros(3), np.eye(3))
    with pytest.raises(UserError, match="needs capsules or spheres on the chain, not 'box'"):
        ContactStatics(chain.with_(shapes=((), (box,))), [BALL], 1e3)


@pytest.mark.parametrize(
    "law",
    [linear_law(), linear_spherical_law(), linear_prismatic_law(), linear_extensible_law()],
    ids=lambda x: x.joint,
)
def test_jacobians_at_once_are_those_one_by_one(law) -> None:
    chain = with_capsules(sample_chain(law, modules=4), RADIUS_M)
    statics = ContactStatics(chain, [BALL], 1e3)
    pose = statics.geometry.forward(np.random.default_rng(1).uniform(-0.3, 0.3, (4, len(law.axes))))
    points, bodies = statics.points.placed(pose), statics.points.body
    together = statics._point_jacobians(pose, bodies, points)
    for k in range(0, len(points), 7):
        np.testing.assert_allclose(
            together[k], statics.point_jacobian(pose, int(bodies[k]), points[k]), atol=1e-15
        )
