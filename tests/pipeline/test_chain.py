"""Modules become a chain: frames, masses, segments, base poses (contracts.md)."""

import numpy as np
import pytest

from pliant.config.chain import BaseConfig, ChainConfig
from pliant.mechanics.kinematics import ChainGeometry
from pliant.pipeline.chain import Segment, base_rotation, build_chain, rod_module
from pliant.records.law import Domain, Effort, JointLaw, LawRecord

X, Y, Z = np.eye(3)


class Spring(JointLaw):
    joint, axes, actuation_name, domain = "revolute", ("y",), "pressure_pa", Domain.unbounded(1)

    def evaluate(self, actuation, deformation):
        n = len(actuation)
        return Effort(-deformation, np.zeros((n, 1)), -np.ones((n, 1, 1)))

    def record(self):
        return LawRecord("spring", {}, {})


def chain_of(modules=3, length=0.01, mass=0.002, **config):
    settings = ChainConfig.model_validate({"modules": modules, **config})
    return build_chain(settings, [Segment(rod_module(Spring(), length, mass), modules, 0.0)])


def test_pieces_are_half_whole_whole_half():
    chain = chain_of(3)
    assert [j.offset_m[0] for j in chain.joints] == pytest.approx([0.005, 0.01, 0.01])
    assert chain.tip_offset_m == pytest.approx([0.005, 0, 0])
    assert chain.length_m == pytest.approx(0.03)
    assert len(chain.bodies) == 4


def test_masses_add_up_and_a_body_of_two_halves_is_a_rod():
    chain = chain_of(3)
    assert sum(b.mass_kg for b in chain.bodies) == pytest.approx(0.006)
    middle = chain.bodies[1]
    assert middle.com_m == pytest.approx([0.005, 0, 0])
    assert middle.inertia_kg_m2[1, 1] == pytest.approx(0.002 * 0.01**2 / 12)


def test_default_pose_hangs_and_bends_toward_world_x():
    rotation = base_rotation(BaseConfig())
    assert rotation @ X == pytest.approx(-Z)
    assert rotation @ Y == pytest.approx(-Y)
    assert rotation @ Z == pytest.approx(-X)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0.3, -0.4, 0.5), (0, 0, -1), (0, 0, 1)])
def test_direction_is_where_the_chain_points(direction):
    rotation = base_rotation(BaseConfig.model_validate({"direction": direction}))
    assert rotation @ X == pytest.approx(np.array(direction) / np.linalg.norm(direction))
    assert rotation.T @ rotation == pytest.approx(np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_up_is_a_half_turn_about_world_y():
    rotation = base_rotation(BaseConfig(direction=(0, 0, 1)))
    assert rotation @ Y == pytest.approx(-Y)
    assert rotation @ Z == pytest.approx(X)


def test_roll_turns_about_the_chain_axis():
    plain = base_rotation(BaseConfig(direction=(1, 0, 0)))
    rolled = base_rotation(BaseConfig.model_validate({"direction": (1, 0, 0), "roll": "90 deg"}))
    assert rolled @ X == pytest.approx(plain @ X)
    assert rolled @ Y == pytest.approx(plain @ Z)


def test_quaternion_is_w_x_y_z():
    half_turn_about_z = base_rotation(BaseConfig(quaternion=(0, 0, 0, 2)))
    assert half_turn_about_z == pytest.approx(np.diag([-1.0, -1.0, 1.0]))


def test_segment_rotations_are_relative_to_the_base():
    module = rod_module(Spring(), 0.01, 0.002)
    config = ChainConfig.model_validate({"segments": [{"modules": 2}, {"modules": 1}, {"modules": 1}]})
    chain = build_chain(config, [Segment(module, 2, 0.3), Segment(module, 1, 1.0), Segment(module, 1, 0.4)])
    turns = [np.arctan2(j.rest_rotation[2, 1], j.rest_rotation[1, 1]) for j in chain.joints]
    assert turns == pytest.approx([0.3, 0.0, 0.7, -0.6])


def test_a_rotated_segment_keeps_its_masses_in_its_own_frame():
    from dataclasses import replace

    from pliant.records.design import ModuleMass

    rod = rod_module(Spring(), 0.01, 0.002)
    heavy = replace(
        rod, mass=ModuleMass(*(m.shifted(np.array([0, 0, 0.003])) for m in (rod.mass.start, rod.mass.end)))
    )
    config = ChainConfig(modules=2)
    chain = build_chain(config, [Segment(heavy, 1, 0.0), Segment(heavy, 1, np.pi)])
    middle = chain.bodies[1]
    assert middle.com_m[2] == pytest.approx(0.0, abs=1e-12), "end half of one, turned start half of the other"
    assert chain.bodies[2].com_m[2] == pytest.approx(0.003)


def test_markers_at_rest_lie_on_the_chain():
    chain = chain_of(3, base={"position": [0, 0, 1]})
    markers = ChainGeometry.of(chain).markers(np.zeros((3, 1)))
    assert markers[:, 2] == pytest.approx(1 - np.array([0, 0.005, 0.015, 0.025, 0.03]))


@pytest.mark.parametrize(
    "block",
    [
        {},
        {"modules": 2, "segments": [{"modules": 1}]},
        {"modules": 2, "base": {"direction": [0, 0, 0]}},
        {"modules": 2, "base": {"direction": [1, 0, 0], "quaternion": [1, 0, 0, 0]}},
        {"modules": 2, "actuators": [{"input": "pressure_1_pa", "sign": 0.5}]},
        {"modules": 2, "actuators": [{"input": "voltage"}]},
    ],
)
def test_contradictory_chains_are_refused(block):
    with pytest.raises(ValueError, match="either|length|sign|input|pattern"):
        ChainConfig.model_validate(block)
