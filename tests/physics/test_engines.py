"""Common properties of engines: equilibria, documents that they read, sizes; Newton without an equilibrium."""

from __future__ import annotations

import sys
from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq
from tests.physics.conftest import settle

from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.physics import PhysicsBackend
from pliant.interfaces.simulation import SimulationState
from pliant.mechanics.inertia import mass_matrix
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel, Joint, default_base_rotation
from pliant.records.design import MassProperties
from pliant.records.law import JointLaw
from pliant.records.rollout import Inputs
from pliant_plugins.physics.mujoco.mjcf import chain_mjcf
from pliant_plugins.physics.pybullet.backend import Pybullet
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.urdf import roll_pitch_yaw

AGREEMENT_M = 1e-6


def test_weights_and_payload(
    engine: PhysicsBackend, quasistatic: PhysicsBackend, heavy_chain: ChainModel
) -> None:
    """For all kinds of joints with own weight and 13 g every engine is within 1 µm of the quasi-static one."""
    inputs = Inputs({"pressure_pa": 12e3}, tip_force_n=np.array([0.02, 0.01, -0.03]))
    end, wanted = (settle(backend, heavy_chain, inputs) for backend in (engine, quasistatic))
    assert end.converged and end.residual <= 1e-8
    np.testing.assert_allclose(end.markers_m, wanted.markers_m, atol=AGREEMENT_M)
    np.testing.assert_allclose(end.joint_angles, wanted.joint_angles, atol=1e-5)


def test_large_force_on_a_chain_without_mass(
    engine: PhysicsBackend, quasistatic: PhysicsBackend, massless_finger: ChainModel
) -> None:
    """The load stiffens the chain but adds no inertia: relaxation must not overshoot."""
    inputs = Inputs({"pressure_pa": 15e3}, tip_force_n=np.array([0.5, 0.0, -1.0]))
    tips = [settle(backend, massless_finger, inputs).tip_m for backend in (engine, quasistatic)]
    np.testing.assert_allclose(tips[0], tips[1], atol=AGREEMENT_M)


def test_a_floor_on_inertia_weighs_nothing(engine: PhysicsBackend, massless_finger: ChainModel) -> None:
    """Without mass, gravity changes nothing."""
    chain = massless_finger.with_(gravity_m_s2=np.array([0.0, 3.0, -9.81]))
    end = settle(engine, chain, Inputs({"pressure_pa": 15e3}))
    assert end.converged
    np.testing.assert_allclose(end.tip_m, [0.059451, 0.0, -0.007889], atol=1e-6)


def test_settle_leaves_an_unstable_equilibrium(engine: PhysicsBackend, massless_finger: ChainModel) -> None:
    """An upright chain under a load beyond buckling is in balance, but must not stay there."""
    upright = massless_finger.with_(base_rotation=massless_finger.base_rotation @ np.diag([-1.0, 1.0, -1.0]))
    end = settle(engine, upright, Inputs({"pressure_pa": 0.0}, tip_force_n=np.array([0.0, 0.0, -1.0])))
    assert end.converged and end.stable
    assert np.abs(end.joint_angles).max() > 0.1


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
    """Masses, inertias, offsets and payload arrive in MuJoCo as given."""
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


def test_the_longest_chain_in_every_kind(
    dynamic_engine: PhysicsBackend, make_finger: Callable[..., ChainModel]
) -> None:
    """The last joint of a long chain moves; PyBullet refuses longer ones instead of losing joints."""
    for kind, most in (("revolute", 121), ("spherical", 30), ("prismatic", 121)):
        chain = make_finger(kind, most)
        q = np.full((most, len(chain.axes)), 1e-3)
        with dynamic_engine.build(chain) as simulation:
            simulation.restore(SimulationState(0.0, q, 2 * q))
            state = simulation.snapshot()
            np.testing.assert_allclose(state.position, q, atol=1e-12)
            np.testing.assert_allclose(state.velocity, 2 * q, atol=1e-12)
            np.testing.assert_allclose(
                simulation.markers(), ChainGeometry.from_chain(chain).markers(q), atol=1e-6
            )
        longer = make_finger(kind, most + 1)
        if isinstance(dynamic_engine, Pybullet):
            with pytest.raises(UserError, match=f"at most {most} {kind} joints and the chain has {most + 1}"):
                dynamic_engine.build(longer)
        else:
            dynamic_engine.build(longer).close()


LawType = Callable[..., JointLaw]


def pendulum(law: JointLaw, payload_kg: float = 0.0, base_rotation: np.ndarray | None = None) -> ChainModel:
    """Return one joint with 50 mm to the tip."""
    return ChainModel(
        joints=(Joint(0, np.zeros(3), np.eye(3)),),
        bodies=(MassProperties.none(), MassProperties.none()),
        laws=(law,),
        tip_offset_m=np.array([0.05, 0.0, 0.0]),
        base_position_m=np.zeros(3),
        base_rotation=default_base_rotation() if base_rotation is None else base_rotation,
        payload_kg=payload_kg,
    )


def test_buckled_pendulum_is_a_minimum(quasistatic: PhysicsBackend, study_law: LawType) -> None:
    """Upright with m g l = 2 k: u = 0 is an equilibrium; the minima are at u / sin u = 2."""
    stiffness = 0.02
    upright = default_base_rotation() @ np.diag([-1.0, 1.0, -1.0])
    law = study_law(m_e=0.0, b_e=stiffness, k_n=0.0, m_a=0.0)
    chain = pendulum(law, 2 * stiffness / (9.81 * 0.05), upright)
    settled = settle(quasistatic, chain, Inputs({"pressure_pa": 0.0}))
    angle = brentq(lambda u: u - 2 * np.sin(u), 1.0, 3.0)
    assert settled.converged and settled.stable
    assert abs(settled.joint_angles[0, 0]) == pytest.approx(angle, abs=1e-7)


def test_residual_is_below_the_tolerance_on_hard_cases(
    quasistatic: PhysicsBackend, heavy_chain: ChainModel
) -> None:
    """Loads up to forty times the design load are applied at once."""
    for payload in (0.0, 0.1, 0.5):
        settled = settle(quasistatic, heavy_chain.with_(payload_kg=payload), Inputs({"pressure_pa": 15e3}))
        assert settled.converged and settled.stable
        assert settled.residual <= 1e-9
        statics = ChainStatics(heavy_chain.with_(payload_kg=payload))
        loads = Loads.from_inputs(heavy_chain, Inputs({"pressure_pa": 15e3}))
        assert np.abs(statics.residual(settled.joint_angles, loads)).max() == settled.residual


def test_path_independence(quasistatic: PhysicsBackend, heavy_chain: ChainModel) -> None:
    """Loads applied at once or in ten levels give the same equilibrium."""
    tips = []
    for levels in (1, 10):
        with quasistatic.build(heavy_chain) as simulation:
            for share in np.linspace(0, 1, levels + 1)[1:]:
                simulation.apply(Inputs({"pressure_pa": share * 15e3}))
                settled = simulation.settle()
            tips.append(settled.tip_m)
    np.testing.assert_allclose(tips[0], tips[1], atol=1e-8)
