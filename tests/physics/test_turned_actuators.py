"""Chambers and tendons around the chain axis: the effect of turning them on a pose, in every engine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.physics.conftest import settle

from pliant.config.chain import ChainConfig
from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend
from pliant.mechanics.rotations import exp_map
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.records.chain import Actuator
from pliant.records.rollout import Inputs
from pliant.testing.samples import linear_law, linear_spherical_law, sample_chain

STILL = (0, 0, 0)


def test_the_pose_is_turned_as_a_whole(engine: PhysicsBackend) -> None:
    """The joints are equal and there is no other load."""
    angle = 0.7
    straight = sample_chain(linear_spherical_law(), modules=4, gravity=STILL)
    turned = straight.with_(actuators=(Actuator("pressure_pa", 1.0, angle),))
    inputs = Inputs({"pressure_pa": 2e4})
    one, other = (settle(engine, chain, inputs).markers_m for chain in (straight, turned))
    about = straight.base_rotation @ exp_map(np.array([angle, 0.0, 0.0])) @ straight.base_rotation.T
    np.testing.assert_allclose(other, one @ about.T, atol=2e-6)
    assert np.ptp(one[:, 0]) > 1e-3


def test_three_equal_chambers_leave_the_chain_straight(engine: PhysicsBackend) -> None:
    ring = tuple(Actuator(f"pressure_{k}_pa", 1.0, 2 * np.pi * k / 3) for k in range(3))
    stiffness, gain = np.diag([0.05, 0.04, 0.04]), np.array([0.0, 8e-7, -3e-7])
    law = replace(linear_spherical_law(), stiffness=stiffness, gain=gain)
    chain = sample_chain(law, modules=3, gravity=STILL).with_(actuators=ring)
    found = settle(engine, chain, Inputs({actuator.input: 2e4 for actuator in ring}))
    np.testing.assert_allclose(found.joint_angles, 0.0, atol=1e-6)


def test_a_hinge_has_no_room_for_it() -> None:
    config = ChainConfig.model_validate(
        {"modules": 1, "actuators": [{"input": "pressure_1_pa", "rotation": "120 deg"}]}
    )
    with pytest.raises(UserError, match="one axis: give the law 'axes'"):
        build_chain(config, [Segment(rod_module(linear_law(), 0.01, 0.001))])
