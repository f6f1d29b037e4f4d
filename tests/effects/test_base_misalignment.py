"""`base_misalignment`: the base is tilted between the bench's turn and its nominal pose."""

from __future__ import annotations

import numpy as np
import pytest
from tests.effects.bench import chain_with, followed

from pliant.mechanics.kinematics import ChainGeometry, base_rotations, trajectory
from pliant.mechanics.rotations import exp_map
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import History
from pliant.testing.samples import linear_law, sample_chain

PITCH, ROLL = 0.05, -0.03
N, STIFFNESS = 4, 0.04


def tilted(chain: ChainModel, pitch: float = PITCH, roll: float = ROLL) -> ChainModel:
    return chain_with(chain, "base_misalignment", pitch_rad=pitch, roll_rad=roll)


def test_a_straight_chain_tip_moves_by_its_length_times_the_tilt() -> None:
    chain = sample_chain(modules=N)
    length, straight = chain.length_m, np.zeros((N, 1))
    moved = ChainGeometry.from_chain(tilted(chain, roll=0.0)).markers(straight)[-1]
    np.testing.assert_allclose(moved, length * np.array([-np.sin(PITCH), 0.0, -np.cos(PITCH)]), atol=1e-15)
    moved = ChainGeometry.from_chain(tilted(chain, pitch=0.0)).markers(straight)[-1]
    np.testing.assert_allclose(moved, length * np.array([0.0, np.sin(ROLL), -np.cos(ROLL)]), atol=1e-15)


def test_all_positions_turn_about_the_base_and_the_bench_turns_them_on() -> None:
    chain = sample_chain(modules=N, base={"position": [0.1, 0.2, 0.3]})
    q = np.random.default_rng(2).normal(size=(5, N, 1)) / 3
    turns = np.random.default_rng(3).normal(size=(5, 3))

    def markers(body: ChainModel, angles: Array) -> Array:
        geometry = ChainGeometry.from_chain(body)
        return trajectory(geometry, q, base_rotations(geometry.base_rotation, angles)) - [0.1, 0.2, 0.3]

    tilt = exp_map(np.array([ROLL, PITCH, 0.0]))
    still = np.zeros((5, 3))
    np.testing.assert_allclose(markers(tilted(chain), still), markers(chain, still) @ tilt.T, atol=1e-14)
    bench = base_rotations(np.eye(3), turns)
    wanted = np.einsum("tij,tmj->tmi", bench, markers(tilted(chain), still))
    np.testing.assert_allclose(markers(tilted(chain), turns), wanted, atol=1e-14)


def test_without_gravity_angles_do_not_know_about_it() -> None:
    chain = sample_chain(linear_law(), modules=N, gravity=(0, 0, 0))
    history = History.from_arrays({"pressure_pa": np.linspace(0.0, 9e3, 6)})
    np.testing.assert_array_equal(followed(tilted(chain), history), followed(chain, history))


def test_under_gravity_a_tilt_is_a_bench_pitch() -> None:
    """The two turns about one axis add; a hanging chain has the angles of the other pitch."""
    chain = sample_chain(linear_law(8e-7, 2e-3), modules=N, payload=0.003)
    pitches = np.linspace(-1.0, 1.0, 9)

    def run(offset: float) -> History:
        turns = np.zeros((9, 3))
        turns[:, 1] = pitches + offset
        return History.from_arrays({"pressure_pa": np.full(9, 4e3)}, base_angles_rad=turns)

    (with_tilt,) = followed(tilted(chain, roll=0.0), run(0.0))
    np.testing.assert_allclose(with_tilt, followed(chain, run(PITCH))[0], atol=1e-10)
    assert float(np.abs(with_tilt - followed(chain, run(0.0))[0]).max()) > 1e-3


def test_one_hanging_joint_bends_by_its_weight_times_the_tilt() -> None:
    """k u = m g a sin(θ − u) for a mass m at a beyond the joint, to the engine's tolerance."""
    chain = sample_chain(linear_law(0.0, STIFFNESS), modules=1, payload=0.05)
    angle = float(followed(tilted(chain, roll=0.0), History.from_arrays({"pressure_pa": 0.0}))[0][0, 0])
    body = chain.bodies[1]
    lever = 9.81 * (body.mass_kg * body.com_m[0] + 0.05 * chain.tip_offset_m[0])
    # A positive pitch tilts the chain away from the side to which it bends.
    assert STIFFNESS * angle == pytest.approx(lever * np.sin(PITCH - angle), rel=1e-4)
