"""Snapshots, and the motion of the dynamic engines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.physics.conftest import StudyLaw, finger, settle

from pliant.interfaces.physics import PhysicsBackend
from pliant.interfaces.simulation import SimulationState
from pliant.mechanics.inertia import mass_matrix
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs
from pliant.testing.samples import linear_law
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.pybullet.backend import Pybullet
from pliant_plugins.physics.pybullet.config import PybulletConfig

LINEAR = linear_law(gain=1e-6, stiffness=0.02)
PUSH = Inputs({"pressure_pa": 10e3}, tip_force_n=np.array([0.02, 0.01, 0.0]))


def test_restore_brings_the_state_back(engine: PhysicsBackend, heavy_chain: ChainModel) -> None:
    exact = not engine.capabilities.dynamic
    with engine.build(heavy_chain) as simulation:
        simulation.apply(PUSH)
        simulation.step(0.01)
        before = simulation.snapshot()
        simulation.step(0.005)
        after = simulation.snapshot()
        simulation.restore(before)
        back = simulation.snapshot()
        simulation.step(0.005)
        again = simulation.snapshot()
    assert back.time_s == before.time_s
    for one, other in ((before, back), (after, again)):
        np.testing.assert_allclose(one.position, other.position, rtol=0, atol=0 if exact else 1e-12)
        scale = max(1.0, float(np.abs(one.velocity).max()))
        np.testing.assert_allclose(one.velocity, other.velocity, rtol=0, atol=1e-12 * scale)


def test_advance_is_a_step_in_time_and_settles_where_it_takes_for_ever(
    engine: PhysicsBackend, loaded_finger: ChainModel
) -> None:
    with engine.build(loaded_finger) as simulation, engine.build(loaded_finger) as other:
        for one in (simulation, other):
            one.apply(Inputs({"pressure_pa": 5e3}))
        assert simulation.advance(0.002)
        other.step(0.002)
        assert simulation.snapshot().time_s == other.snapshot().time_s == 0.002
        np.testing.assert_allclose(simulation.markers(), other.markers(), rtol=0, atol=1e-9)
        assert simulation.advance(np.inf)
        assert simulation.snapshot().time_s == 0.002
        np.testing.assert_allclose(simulation.markers(), other.settle().markers_m, rtol=0, atol=1e-5)


def test_engines_move_alike(heavy_chain: ChainModel, dynamic_engine: PhysicsBackend) -> None:
    """PyBullet follows MuJoCo over 10 ms of free motion at small steps within 1 % of the distance moved."""
    step, damping = 2e-5, 1e-5
    fine: PhysicsBackend = Mujoco(MujocoConfig(timestep_s=step, joint_damping=damping, drag_1_s=0.0))
    other: PhysicsBackend = (
        Mujoco(MujocoConfig(timestep_s=2.5e-4, joint_damping=damping, drag_1_s=0.0))
        if isinstance(dynamic_engine, Mujoco)
        else Pybullet(PybulletConfig(timestep_s=step, joint_damping=damping))
    )
    paths = []
    for backend in (fine, other):
        with backend.build(heavy_chain) as simulation:
            simulation.apply(PUSH)
            start = simulation.markers()
            simulation.step(0.01)
            paths.append(simulation.markers() - start)
    moved = np.linalg.norm(paths[0], axis=1).max()
    tolerance = 0.01 if isinstance(dynamic_engine, Pybullet) else 0.2
    assert moved > 1e-4
    assert np.linalg.norm(paths[0] - paths[1], axis=1).max() < tolerance * moved


def test_damped_motion_ends_in_the_equilibrium(dynamic_engine: PhysicsBackend) -> None:
    config, short = type(dynamic_engine.config)(joint_damping=3e-3), finger(StudyLaw(), 3, 0.02, 0.01)
    with type(dynamic_engine)(config).build(short) as simulation:
        simulation.apply(Inputs({"pressure_pa": 15e3}))
        settled = simulation.settle().markers_m
        simulation.apply(Inputs({"pressure_pa": 14.5e3}))
        simulation.step(0.05)
        simulation.apply(Inputs({"pressure_pa": 15e3}))
        simulation.step(0.6)
        np.testing.assert_allclose(simulation.markers(), settled, atol=2e-4)


def test_a_step_shorter_than_any_clock_is_a_step(engine: PhysicsBackend, massless_finger: ChainModel) -> None:
    with engine.build(massless_finger) as simulation:
        simulation.apply(Inputs({"pressure_pa": 1e3}))
        simulation.step(1e-16)
        assert simulation.snapshot().time_s == 1e-16


@pytest.mark.parametrize("steps", [1, 2, 5])
def test_a_settling_that_is_cut_short_reports_the_state_it_leaves(
    dynamic_engine: PhysicsBackend, loaded_finger: ChainModel, steps: int
) -> None:
    config = type(dynamic_engine.config)(max_settle_steps=steps)
    inputs = Inputs({"pressure_pa": 15e3})
    settled = settle(type(dynamic_engine)(config), loaded_finger, inputs)
    assert not settled.converged and not settled.stable
    assert settled.iterations == steps
    left = ChainStatics(loaded_finger).residual(
        settled.joint_angles, Loads.from_inputs(loaded_finger, inputs)
    )
    assert settled.residual == pytest.approx(np.abs(left).max(), rel=1e-9)


def test_a_settling_that_is_given_up_says_so_and_leaves_no_trace(
    dynamic_engine: PhysicsBackend,
    loaded_finger: ChainModel,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """No step is short enough for this pressure: the count is of steps taken, MuJoCo's log stays unwritten."""
    monkeypatch.chdir(tmp_path)
    with dynamic_engine.build(loaded_finger.with_(laws=(LINEAR,))) as simulation:
        simulation.apply(Inputs({"pressure_pa": 1e300}))
        settled = simulation.settle()
        assert not settled.converged
        assert settled.iterations < 100
        simulation.apply(Inputs({"pressure_pa": 1e3}))
        assert simulation.settle().converged
    assert not list(tmp_path.iterdir())
    assert "WARNING" not in "".join(capfd.readouterr())


def test_motion_that_mujoco_calls_unstable_is_a_warning(
    loaded_finger: ChainModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with Mujoco(MujocoConfig()).build(loaded_finger.with_(laws=(LINEAR,))) as simulation:
        simulation.apply(Inputs({"pressure_pa": 1e300}))
        with pytest.warns(RuntimeWarning, match="mujoco: .*unstable"):
            simulation.step(0.01)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("timestep_s", [1e-3, 2.5e-4])
def test_mujoco_damps_an_oscillation_as_its_config_says(timestep_s: float, loaded_finger: ChainModel) -> None:
    """One joint of stiffness k without weight: amplitude ∝ exp(−ω² h t / 2)."""
    one = loaded_finger.with_(
        joints=loaded_finger.joints[:1],
        bodies=(loaded_finger.bodies[0], loaded_finger.bodies[-1]),
        laws=(LINEAR,),
        gravity_m_s2=np.zeros(3),
    )
    inertia = float(mass_matrix(one, np.zeros((1, 1)))[0, 0])
    rate, duration = np.sqrt(0.02 / inertia), 0.02

    def energy(state: SimulationState) -> float:
        return float(0.5 * inertia * state.velocity[0, 0] ** 2 + 0.01 * state.position[0, 0] ** 2)

    config = MujocoConfig(timestep_s=timestep_s, joint_damping=0.0, drag_1_s=0.0)
    with Mujoco(config).build(one) as simulation:
        simulation.apply(Inputs({"pressure_pa": 0.0}))
        simulation.restore(SimulationState(0.0, np.array([[0.1]]), np.zeros((1, 1))))
        start = energy(simulation.snapshot())
        simulation.step(duration)
        lost = np.log(start / energy(simulation.snapshot())) / 2
    assert lost == pytest.approx(rate**2 * timestep_s / 2 * duration, rel=0.15)
