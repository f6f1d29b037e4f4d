"""`cross_axis`: joints bend about axes that are turned about the chain axis."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.effects.bench import NO_GRAVITY, chain_with, settled

from pliant.config.chain import ChainConfig
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import exp_map, log_map
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.testing.samples import (
    linear_spherical_law,
    sample_chain,
    softening_law,
)

TURN = 0.2
ABOUT_X = exp_map(np.array([TURN, 0.0, 0.0]))


def turned(chain: ChainModel, turn: float = TURN) -> ChainModel:
    return chain_with(chain, "cross_axis", turn_rad=turn)


def in_base(chain: ChainModel, points: Array) -> Array:
    geometry = ChainGeometry.from_chain(chain)
    return (points - geometry.base_position) @ geometry.base_rotation


@pytest.mark.parametrize("law", [softening_law(), linear_spherical_law()], ids=["hinge", "ball"])
def test_without_gravity_equal_joints_are_turned_as_a_whole(law: Any) -> None:
    """The closed form: all points of the bent chain turned by α about the chain axis at the base."""
    chain = sample_chain(law, modules=5, gravity=NO_GRAVITY)
    plain, crossed = settled(chain), settled(turned(chain))
    np.testing.assert_allclose(crossed.joint_angles, plain.joint_angles, atol=1e-10)
    wanted = in_base(chain, plain.markers_m) @ ABOUT_X.T
    np.testing.assert_allclose(in_base(chain, crossed.markers_m), wanted, atol=1e-10)


def test_out_from_the_plane_goes_with_the_sine_and_shortening_with_the_square() -> None:
    chain = sample_chain(modules=5, gravity=NO_GRAVITY)
    bend = in_base(chain, settled(chain).markers_m)[-1, 2]
    for turn in (0.05, 0.1, -0.2):
        tip = in_base(chain, settled(turned(chain, turn)).markers_m)[-1]
        assert tip[1] == pytest.approx(-bend * np.sin(turn), rel=1e-8)
        assert tip[2] == pytest.approx(bend * np.cos(turn), rel=1e-8)


def test_any_pose_equals_that_from_joints_about_turned_axes() -> None:
    """Compared with the definition, body by body, in a chain with turned segments and a joint off the centre line."""
    chain = sample_chain(modules=3, turns_rad=(0.0, 0.7))
    q = np.random.default_rng(1).normal(size=(chain.n_joints, 1)) / 2
    rotation, position = chain.base_rotation, np.array(chain.base_position_m, float)
    axis = ABOUT_X @ [0.0, 1.0, 0.0]
    markers = [position]
    for joint, angle in zip(chain.joints, q[:, 0], strict=True):
        position = position + rotation @ joint.offset_m
        rotation = rotation @ joint.rest_rotation @ exp_map(angle * axis)
        markers.append(position)
    markers.append(position + rotation @ chain.tip_offset_m)
    crossed = turned(chain)
    pose = ChainGeometry.from_chain(crossed).forward(q)
    np.testing.assert_allclose(ChainGeometry.from_chain(crossed).markers(q), markers, atol=1e-15)
    np.testing.assert_allclose(log_map(rotation.T @ pose.rotations[-1] @ ABOUT_X.T), 0.0, atol=1e-14)


def test_masses_shapes_and_centre_line_stay_where_they_are() -> None:
    module = rod_module(softening_law(), 0.011, 2e-3, radius_m=4e-3, offset_m=1e-3)
    segments = [Segment(module, 2), Segment(module, 2, 0.7)]
    chain = build_chain(ChainConfig(modules=4), segments)
    crossed = turned(chain)
    still = np.zeros((chain.n_joints, 1))
    assert len(chain.shapes) == 5
    here, there = (
        ChainGeometry.from_chain(chain).forward(still),
        ChainGeometry.from_chain(crossed).forward(still),
    )
    for i, (a, b) in enumerate(zip(chain.bodies, crossed.bodies, strict=True)):
        at, now = here.rotations[i], there.rotations[i]
        np.testing.assert_allclose(now @ b.com_m, at @ a.com_m, atol=1e-16)
        np.testing.assert_allclose(
            now @ b.inertia_kg_m2 @ now.T, at @ a.inertia_kg_m2 @ at.T, atol=1e-20, rtol=1e-12
        )
    for a, b in zip((*chain.rings, *chain.centre_line), (*crossed.rings, *crossed.centre_line), strict=True):
        np.testing.assert_allclose(
            there.rotations[b.body] @ b.point_m, here.rotations[a.body] @ a.point_m, atol=1e-16
        )
    for i, (before, after) in enumerate(zip(chain.shapes, crossed.shapes, strict=True)):
        for a, b in zip(before, after, strict=True):
            here_at, there_at = here.rotations[i], there.rotations[i]
            np.testing.assert_allclose(there_at @ b.rotation, here_at @ a.rotation, atol=1e-15)
            np.testing.assert_allclose(there_at @ b.position_m, here_at @ a.position_m, atol=1e-16)


def test_turns_do_not_add_up_and_go_back_again() -> None:
    chain = sample_chain(modules=4)
    there_and_back = turned(turned(chain, 0.3), -0.3)
    for a, b in zip(chain.joints, there_and_back.joints, strict=True):
        np.testing.assert_allclose(b.rest_rotation, a.rest_rotation, atol=1e-15)
        np.testing.assert_allclose(b.offset_m, a.offset_m, atol=1e-17)
    for joint in turned(chain).joints[1:]:
        np.testing.assert_allclose(joint.rest_rotation, np.eye(3), atol=1e-15)


def test_hanging_angles_do_not_show_it_and_lying_on_the_side_they_do() -> None:
    hanging = sample_chain(modules=4, payload=0.003)
    lying = sample_chain(modules=4, payload=0.003, base={"direction": [0.0, 1.0, 0.0]})
    offs = []
    for chain in (hanging, lying):
        plain, crossed = (settled(c, pressure=5e3).joint_angles for c in (chain, turned(chain)))
        offs.append(float(np.abs(crossed - plain).max()))
    assert offs[0] < 1e-9
    assert offs[1] > 1e-3
