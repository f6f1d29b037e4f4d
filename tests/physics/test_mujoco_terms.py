"""Law terms with rate and memory in MuJoCo: closed forms, the quasi-static engine in slow motion, snapshots."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from tests.diagnosis.quick import BENCH, VALUES, P, effect

from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.interfaces.simulation import SimulationState
from pliant.mechanics.inertia import mass_matrix
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.records.rollout import Inputs
from pliant.records.scene import Arm, Scene
from pliant.records.term import LawTerm
from pliant.testing.physics import NO_GRAVITY
from pliant.testing.samples import dashpot, linear_law, linear_spherical_law, sample_chain
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

GAIN, STIFFNESS = 8e-7, 0.04
SLOW = Quasistatic(QuasistaticConfig(longest_step_s=0.1))
VENTED, HALF, PRESSED = (Inputs({"pressure_pa": pressure}) for pressure in (0.0, 7e3, 15e3))


def engine(step_s: float = 0.02, drag: float = 0.0) -> Mujoco:
    return Mujoco(MujocoConfig(timestep_s=step_s, joint_damping=0.0, drag_1_s=drag))


def with_effect(chain: ChainModel, kind: str, **values: Any) -> Model:
    return BENCH.build("effect", effect(kind, **values)).apply(Model(chain))


def hinge(kind: str, **values: Any) -> ChainModel:
    """Return one linear hinge without weight, with one effect."""
    bare = sample_chain(linear_law(GAIN, STIFFNESS), modules=1, gravity=NO_GRAVITY)
    return with_effect(bare, kind, **values).chain


def slow_history(step_s: float = 0.25) -> History:
    """Return a history up, down and up within 40 s, warm and under an end moment."""
    t = step_s * np.arange(round(40 / step_s) + 1)
    p = np.interp(t, [0.0, 12.0, 20.0, 40.0], [1e3, P, 2e3, 0.8 * P])
    return History.from_arrays({"pressure_pa": p}, t, temperature_c=30.0, moment_n_m=1e-3)


# -- closed forms -------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.2, 3.0])
def test_a_damped_hinge_swings_as_the_oscillator(ratio: float) -> None:
    """I u'' + c u' + k u = 0 from u₀ at rest, under- and overdamped; the error halves with the step."""
    plain = hinge("viscous_damping", time_s=1e-9)
    inertia = float(mass_matrix(plain, np.zeros((1, 1)))[0, 0])
    omega = np.sqrt(STIFFNESS / inertia)
    chain = hinge("viscous_damping", time_s=2.0 * ratio / omega)
    roots = omega * (-ratio + np.array([1, -1]) * np.sqrt(complex(ratio**2 - 1.0)))
    time_s = np.linspace(0.0, 6.0 / omega, 7)
    exact = (
        0.3
        * (
            (roots[0] * np.exp(roots[1] * time_s) - roots[1] * np.exp(roots[0] * time_s))
            / (roots[0] - roots[1])
        ).real
    )
    errors = []
    for step_s in (6e-3 / omega, 3e-3 / omega):
        with engine(step_s).build(chain) as simulation:
            simulation.apply(VENTED)
            simulation.restore(SimulationState(0.0, np.full((1, 1), 0.3), np.zeros((1, 1))))
            path = [0.3]
            for a, b in pairwise(time_s):
                simulation.step(float(b - a))
                path.append(simulation.snapshot().position[0, 0])
        errors.append(np.abs(np.array(path) - exact).max())
    assert errors[1] < 3e-3 * 0.3
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)


def test_a_maxwell_branch_relaxes_as_its_prony_term() -> None:
    """k u + g k h = m, h' = u' − h/T: after a step of the moment u = m/k (1 − g/(1 + g) e^(−t/((1 + g) T)))."""
    share, branch_s = 0.5, 2.0
    chain = hinge("viscoelastic", share=share, time_s=branch_s)
    time_s = 0.02 * np.arange(301)
    history = History.from_arrays({"pressure_pa": np.where(time_s > 0.0, P, 0.0)}, time_s)
    (path,), _ = engine().follow(chain, [history])
    end = GAIN * P / STIFFNESS
    exact = end * (1.0 - share / (1.0 + share) * np.exp(-time_s / ((1.0 + share) * branch_s)))
    late = time_s > 0.5  # inertia dominates before
    np.testing.assert_allclose(path.joint_angles[late, 0, 0], exact[late], atol=0.005 * end)


def test_a_large_step_with_a_stiff_dashpot_equals_backward_euler() -> None:
    """Rate forces are implicit: one step of 1 s against a dashpot of 0.5 s moves by h/(h + T) of the way."""
    chain = hinge("viscous_damping", time_s=0.5)
    with engine(step_s=1.0).build(chain) as simulation:
        simulation.apply(PRESSED)
        simulation.step(1.0)
        moved = simulation.snapshot().position[0, 0]
    assert moved == pytest.approx(GAIN * 15e3 / STIFFNESS / 1.5, rel=0.01)


# -- the quasi-static engine in slow motion -----------------------------------------------------------


@pytest.mark.parametrize("modules", [1, 3])
@pytest.mark.parametrize("kind", VALUES)
def test_slow_histories_equal_equilibria(kind: str, modules: int) -> None:
    """The tolerance for shipped effects is 0.5 % of the range."""
    model = with_effect(sample_chain(modules=modules, payload=0.004), kind)
    history = slow_history(1.0)
    for reaching in model.inputs:
        history = reaching(history)
    (slow,), _ = SLOW.follow(model.chain, [history])
    (path,), _ = engine(step_s=0.1, drag=7.0).follow(model.chain, [history])
    assert path.converged.all()
    span = float(np.ptp(slow.joint_angles, axis=0).max())
    np.testing.assert_allclose(path.joint_angles, slow.joint_angles, atol=0.005 * span)


def test_the_friction_loop_equals_the_quasi_static_engine() -> None:
    chain = hinge("friction_hysteresis", half_width_rad=0.03, break_away_rad=0.01)
    t = np.linspace(0.0, 40.0, 161)
    history = History.from_arrays({"pressure_pa": np.interp(t, [0, 10, 20, 30, 40], [0, P, 4e3, 12e3, 0])}, t)
    (slow,), _ = SLOW.follow(chain, [history])
    (path,), _ = engine(step_s=0.05, drag=7.0).follow(chain, [history])
    u = path.joint_angles[:, 0, 0]
    assert u[60] - u[20] > 0.03  # 8.5 kPa going down against the same going up
    np.testing.assert_allclose(u, slow.joint_angles[:, 0, 0], atol=0.01 * float(np.ptp(u)))


def test_ball_joints_have_their_rates_in_all_axes() -> None:
    chain = sample_chain(linear_spherical_law(), modules=2)
    chain = chain.with_(terms=(LawTerm("moment", dashpot, (0.02,), needs_time=True),))
    t = np.linspace(0.0, 20.0, 41)
    force = np.stack([0.02 * np.sin(0.3 * t), 0.05 * np.sin(0.2 * t), 0 * t], axis=1)
    history = History.from_arrays({"pressure_pa": 5e3 * np.sin(0.2 * t) ** 2}, t, tip_force_n=force)
    (slow,), _ = SLOW.follow(chain, [history])
    (path,), _ = engine(step_s=0.05, drag=7.0).follow(chain, [history])
    span = float(np.ptp(slow.joint_angles, axis=0).max())
    assert np.ptp(slow.joint_angles, axis=(0, 1)).min() > 0.01 * span
    np.testing.assert_allclose(path.joint_angles, slow.joint_angles, atol=0.01 * span)


# -- memory goes with the state -----------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["viscoelastic", "friction_hysteresis", "mullins"])
def test_a_snapshot_carries_memory(kind: str) -> None:
    chain = with_effect(sample_chain(modules=2), kind).chain
    with engine(drag=7.0).build(chain) as simulation:
        simulation.apply(PRESSED)
        simulation.step(0.5)
        kept = simulation.snapshot()
        assert kept.memory is not None and np.abs(kept.memory).max() > 0.0
        ends = []
        for _ in range(2):
            simulation.restore(kept)
            simulation.apply(HALF)
            simulation.step(0.5)
            ends.append(simulation.snapshot())
        np.testing.assert_array_equal(ends[0].position, ends[1].position)
        np.testing.assert_array_equal(ends[0].memory, ends[1].memory)
        simulation.restore(SimulationState(kept.time_s, kept.position, kept.velocity))
        simulation.step(0.5)
        assert np.abs(simulation.snapshot().position - ends[0].position).max() > 1e-5


def test_arms_in_a_scene_remember_as_they_do_alone() -> None:
    """One arm has memory and another has none; the memory is in the scene's snapshot."""
    chain = with_effect(sample_chain(modules=2), "viscoelastic").chain
    bare = sample_chain(modules=2).with_(base_position_m=np.array([0.2, 0.0, 0.0]))
    backend = engine(step_s=0.005)
    with backend.build_scene(Scene((Arm(chain), Arm(bare)))) as scene, backend.build(chain) as alone:
        scene.apply([PRESSED, PRESSED])
        alone.apply(PRESSED)
        for simulation in (scene, alone):
            simulation.step(0.4)
        kept = scene.snapshot()
        assert kept.memories[1] is None
        np.testing.assert_allclose(kept.coordinates[0], alone.snapshot().position, atol=1e-5)
        np.testing.assert_allclose(kept.memories[0], alone.snapshot().memory, atol=1e-4)
        ends = []
        for _ in range(2):
            scene.restore(kept)
            scene.step(0.1)
            ends.append(scene.snapshot().coordinates[0])
        np.testing.assert_array_equal(ends[0], ends[1])


# -- refusals -----------------------------------------------------------------------------------------


def test_an_old_mujoco_has_no_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    import mujoco

    monkeypatch.setattr(mujoco, "mjtIntegrator", object())
    with pytest.raises(UserError, match=r"3\.13 or later.*pip install"):
        engine().build_scene(Scene(()))
