"""Documents that the engines read, and what happens where an engine is missing."""

from __future__ import annotations

import sys
from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.physics import PhysicsBackend, SimulationState
from pliant.mechanics.inertia import mass_matrix
from pliant.mechanics.kinematics import ChainGeometry
from pliant.records.chain import ChainModel
from pliant_plugins.physics.mujoco.mjcf import chain_mjcf
from pliant_plugins.physics.pybullet.backend import Pybullet
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.urdf import roll_pitch_yaw


def turn(axis: int, angle: float) -> np.ndarray:
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = np.cos(angle)
    matrix[second, first], matrix[first, second] = np.sin(angle), -np.sin(angle)
    return matrix


@given(
    st.floats(-4, 4), st.one_of(st.floats(-2, 2), st.sampled_from([np.pi / 2, -np.pi / 2])), st.floats(-4, 4)
)
def test_roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> None:
    rotation = turn(2, yaw) @ turn(1, pitch) @ turn(0, roll)
    back = roll_pitch_yaw(rotation)
    np.testing.assert_allclose(turn(2, back[2]) @ turn(1, back[1]) @ turn(0, back[0]), rotation, atol=1e-14)


def test_mujoco_has_the_same_mass_matrix(heavy_chain: ChainModel) -> None:
    """Masses, inertias, offsets and payload arrive in MuJoCo as they were given."""
    model = mujoco.MjModel.from_xml_string(chain_mjcf(heavy_chain))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    theirs = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, theirs)
    ours = mass_matrix(heavy_chain, np.zeros((heavy_chain.n_joints, len(heavy_chain.axes))))
    np.testing.assert_allclose(theirs, ours, rtol=1e-6, atol=1e-11)


def test_pybullet_missing_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, massless_finger: ChainModel
) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'pliant\[pybullet\]'"):
        Pybullet(PybulletConfig()).build(massless_finger)


def test_the_longest_chain_of_every_kind(
    dynamic_engine: PhysicsBackend, finger_of: Callable[..., ChainModel]
) -> None:
    """The last joint of a long chain moves; PyBullet refuses longer ones instead of losing joints."""
    for kind, most in (("revolute", 121), ("spherical", 30), ("prismatic", 121)):
        chain = finger_of(kind, most)
        q = np.full((most, len(chain.axes)), 1e-3)
        with dynamic_engine.build(chain) as simulation:
            simulation.restore(SimulationState(0.0, q, 2 * q))
            state = simulation.snapshot()
            np.testing.assert_allclose(state.position, q, atol=1e-12)
            np.testing.assert_allclose(state.velocity, 2 * q, atol=1e-12)
            np.testing.assert_allclose(simulation.markers(), ChainGeometry.of(chain).markers(q), atol=1e-6)
        longer = finger_of(kind, most + 1)
        if isinstance(dynamic_engine, Pybullet):
            with pytest.raises(UserError, match=f"at most {most} {kind} joints and the chain has {most + 1}"):
                dynamic_engine.build(longer)
        else:
            dynamic_engine.build(longer).close()
