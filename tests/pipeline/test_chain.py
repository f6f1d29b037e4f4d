"""Modules become a chain: frames, masses, segments, base poses (docs/conventions.md)."""

import numpy as np
import pytest

from pliant.config.chain import BaseConfig, ChainConfig
from pliant.errors import UserError
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.pipeline.chain import Module, Segment, base_rotation, build_chain, rod_module
from pliant.records.design import MassProperties, ModuleMass
from pliant.records.law import Domain, Effort, JointLaw, LawRecord
from pliant.records.rollout import Inputs

X, Y, Z = np.eye(3)


class Spring(JointLaw):
    joint, axes, actuation_name, domain = "revolute", ("y",), "pressure_pa", Domain.unbounded(1)

    def evaluate(self, actuation, deformation):
        n = len(actuation)
        return Effort(-deformation, np.zeros((n, 1)), -np.ones((n, 1, 1)))

    def record(self):
        return LawRecord("spring", {}, {})


def make_chain(modules=3, length=0.01, mass=0.002, **config):
    settings = ChainConfig.model_validate({"modules": modules, **config})
    return build_chain(settings, [Segment(rod_module(Spring(), length, mass), modules, 0.0)])


def test_masses_add_up_and_a_body_with_two_halves_is_a_rod():
    chain = make_chain(3)
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


class Tendon(Spring):
    actuation_name = "tendon_force_n"


def test_actuators_take_the_law_input():
    tendons = [{"input": "tendon_force_1_n"}, {"input": "tendon_force_2_n", "sign": -1}]
    with pytest.raises(UserError, match="'tendon_force_1_n', but the chain's law takes pressure_pa"):
        make_chain(actuators=tendons)
    config = ChainConfig.model_validate({"modules": 2, "actuators": tendons})
    chain = build_chain(config, [Segment(rod_module(Tendon(), 0.01, 0.002), 2, 0.0)])
    assert [a.input for a in chain.actuators] == ["tendon_force_1_n", "tendon_force_2_n"]


def test_a_pressure_law_and_a_tendon_law_do_not_share_a_chain():
    config = ChainConfig.model_validate({"segments": [{"modules": 1}, {"modules": 1}]})
    segments = [Segment(rod_module(law, 0.01, 0.002), 1, 0.0) for law in (Spring(), Tendon())]
    with pytest.raises(UserError, match="laws take pressure_pa and tendon_force_n"):
        build_chain(config, segments)


def about_x(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def about_y(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def test_turned_segments_against_a_chain_written_out_by_hand():
    """Module after module as in contracts.md: half, hinge, half; weights and tip force times heights."""
    half_axes = np.diag([1e-8, 2e-8, 3e-8])

    def module(length, mass, beside):
        def piece(x):
            return MassProperties(mass / 2, np.array([x, *beside]), half_axes)

        return Module(Spring(), length, ModuleMass(piece(-length / 4), piece(length / 3)))

    runs = [
        (module(0.011, 0.0016, (0.001, 0.010)), 3, 0.2),
        (module(0.013, 0.0020, (-0.002, 0.008)), 2, np.pi / 3),
        (module(0.009, 0.0012, (0.0, 0.009)), 2, -1.0),
    ]
    base = {"position_m": (0.1, 0.2, 0.3), "direction": (1.0, 0.0, 0.0), "roll_rad": 0.7}
    config = ChainConfig.model_validate(
        {"segments": [{"modules": n} for _, n, _ in runs], "base": base, "payload_kg": 0.013}
    )
    chain = build_chain(config, [Segment(*run) for run in runs])
    gravity, force = np.array([0.0, 0.0, -9.81]), np.array([0.01, -0.02, 0.03])

    def by_hand(q):
        angles = iter(q)
        # −Z goes to +X: the frame's x, y, z lie along world X, −Y, −Z; then the roll
        frame = np.column_stack([(1, 0, 0), (0, -1, 0), (0, 0, -1)]) @ about_x(0.7)
        place, rolled, markers, potential = np.array([0.1, 0.2, 0.3]), 0.0, [], 0.5 * np.sum(q**2)
        markers.append(place)
        for part, count, rotation in runs:
            frame, rolled = frame @ about_x(rotation - rolled), rotation
            for _ in range(count):
                joint = place + frame[:, 0] * part.length_m / 2
                markers.append(joint)
                start = joint + frame @ part.mass.start.com_m
                frame = frame @ about_y(next(angles))
                end = joint + frame @ part.mass.end.com_m
                potential -= part.mass.start.mass_kg * gravity @ start + part.mass.end.mass_kg * gravity @ end
                place = joint + frame[:, 0] * part.length_m / 2
        return np.array([*markers, place]), potential - (0.013 * gravity + force) @ place

    statics = ChainStatics(chain)
    loads = Loads.from_inputs(chain, Inputs({"pressure_pa": 0.0}, force))
    q = np.random.default_rng(0).normal(size=7) * 0.4
    markers, potential = by_hand(q)
    np.testing.assert_allclose(statics.geometry.markers(q[:, None]), markers, atol=1e-15)
    rise = potential - by_hand(np.zeros(7))[1]
    straight = statics.potential(np.zeros((7, 1)), loads)
    assert statics.potential(q[:, None], loads) - straight == pytest.approx(rise, rel=1e-12)


def test_mass_beside_the_hinge_line_swings_under_it():
    """With material at +z a hanging finger bends toward its bellow's far side, and a horizontal one sags, −u."""
    rod = rod_module(Spring(), 0.01, 0.002)
    halves = (m.shifted(np.array([0, 0, 0.003])) for m in (rod.mass.start, rod.mass.end))
    segments = [Segment(Module(Spring(), 0.01, ModuleMass(*halves)), 2, 0.0)]
    for direction, sign in (((0, 0, -1), 1), ((1, 0, 0), -1), ((-1, 0, 0), 1)):
        config = ChainConfig.model_validate({"modules": 2, "base": {"direction": direction}})
        chain = build_chain(config, segments)
        weight = ChainStatics(chain).residual(np.zeros((2, 1)), Loads.unactuated(chain))
        assert np.all(sign * weight > 0)


def test_roll_turns_about_the_chain_axis_and_a_quaternion_is_w_x_y_z():
    plain = base_rotation(BaseConfig(direction=(1, 0, 0)))
    rolled = base_rotation(BaseConfig.model_validate({"direction": (1, 0, 0), "roll": "90 deg"}))
    assert rolled[:, :2] == pytest.approx(plain[:, [0, 2]])
    up = base_rotation(BaseConfig(direction=(0, 0, 1)))  # a half turn about world y
    assert up[:, 1:] == pytest.approx(np.column_stack([-Y, X]))
    assert base_rotation(BaseConfig(quaternion=(0, 0, 0, 2))) == pytest.approx(np.diag([-1.0, -1.0, 1.0]))
