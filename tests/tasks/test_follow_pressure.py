"""Motion in time against closed forms: an oscillator, a dashpot, a beam; the metrics of a motion against known ones."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.motion import BEAM_HZ, beam, frequencies_hz

from pliant.interfaces.effect import Model
from pliant.interfaces.physics import PhysicsBackend
from pliant.pipeline.simulate import run_task
from pliant.records.chain import ChainModel
from pliant.records.history import History
from pliant.records.rollout import TaskResult
from pliant_plugins.effects.viscous_damping import ViscousDamping, ViscousDampingConfig
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.tasks.follow_pressure import FollowPressure, FollowPressureConfig
from pliant_plugins.tasks.responses import step_response, swings

STILL = Quasistatic(QuasistaticConfig())


def perform(
    chain: ChainModel, engine: PhysicsBackend, *effects: ViscousDamping, **task: object
) -> TaskResult:
    config = FollowPressureConfig.model_validate({"pressure": "1 kPa", **task})
    return run_task(engine, FollowPressure(config), effects, chain)


def own_dynamics(timestep_s: float) -> Mujoco:
    return Mujoco(MujocoConfig(timestep_s=timestep_s, joint_damping=0.0, drag_1_s=0.0))


def test_frequencies_converge_to_the_beam_in_second_order() -> None:
    missed = np.array([frequencies_hz(n) / BEAM_HZ - 1.0 for n in (8, 16, 32)])
    order = np.log2(missed[:-1] / missed[1:])
    print(f"32 modules miss the beam's frequencies by {100 * missed[-1]} %, order of convergence {order[-1]}")
    assert np.abs(missed[-1]).max() < 0.01
    np.testing.assert_allclose(order, 2.0, atol=0.2)


@pytest.mark.slow
def test_a_released_chain_swings_with_the_beam_s_frequencies() -> None:
    """MuJoCo releases the chain from the bend of a pressure; both modes are within 1 % of the beam."""
    released = perform(
        beam(32), own_dynamics(5e-4), pressure="100 Pa", waveform="release", duration="4 s", record="4 ms"
    ).metrics
    found = np.array([released[f"mode_{k}_frequency_hz"] for k in (1, 2)])
    print(f"beam {BEAM_HZ} Hz, released chain {found} Hz")
    np.testing.assert_allclose(found, BEAM_HZ, rtol=0.01)


def test_a_dashpot_answers_a_step_as_an_exponential() -> None:
    """Without inertia the bend is 1 − exp(−t/T), so it takes T ln 9 from 10 to 90 % and T ln 20 to 95 %."""
    damper = ViscousDamping(ViscousDampingConfig(time_s=0.2))
    numbers = perform(beam(3), STILL, damper, duration="2 s", record="5 ms").metrics
    assert numbers["rise_time_s"] == pytest.approx(0.2 * np.log(9), rel=0.03)
    assert numbers["settling_time_s"] == pytest.approx(0.2 * np.log(20), rel=0.03)
    assert numbers["overshoot_share"] < 1e-3 and "mode_1_frequency_hz" not in numbers


def test_a_dashpot_lags_a_sine_as_a_first_order_filter() -> None:
    damper = ViscousDamping(ViscousDampingConfig(time_s=0.2))
    sine = {"waveform": "sine", "period": "1 s", "duration": "4 s", "record": "10 ms"}
    numbers = perform(beam(3), STILL, damper, **sine).metrics
    answer = 1 / (1 + 2j * np.pi * 0.2)
    assert numbers["gain_share"] == pytest.approx(abs(answer), rel=0.03)
    assert numbers["phase_rad"] == pytest.approx(np.angle(answer), abs=0.04)


def test_a_chain_without_memory_follows_at_once() -> None:
    table = {"waveform": "table", "times": ["0 s", "1 s", "2 s"], "shares": [0, 1, 0.5], "record": "100 ms"}
    result = perform(beam(3), STILL, **table)
    assert result.rollout is not None
    shares = np.interp(result.rollout.time_s, [0, 1, 2], [0, 1, 0.5])
    bend = result.rollout.joint_angles.sum(axis=(1, 2))
    np.testing.assert_allclose(bend, shares * bend.max(), atol=1e-9)


@pytest.mark.slow
def test_the_task_moves_as_the_evidence_loop_s_histories_do() -> None:
    """Pressures with a dashpot are followed by the task's simulation and by `follow`, used for comparisons."""
    damper = ViscousDamping(ViscousDampingConfig(time_s=0.2))
    rise = {
        "waveform": "table",
        "times": ["0 s", "0.5 s"],
        "shares": [0.2, 1],
        "duration": "1 s",
        "record": "20 ms",
    }
    result = perform(beam(3), STILL, damper, **rise)
    assert result.rollout is not None
    history = History.from_arrays({"pressure_pa": result.rollout.actuation[:, 0]}, result.rollout.time_s)
    ((followed,), _) = STILL.follow(damper.apply(Model(beam(3))).chain, [history])
    moved = np.ptp(followed.joint_angles)
    np.testing.assert_allclose(result.rollout.joint_angles, followed.joint_angles, atol=1e-6 * moved)


def test_numbers_for_known_motions() -> None:
    time_s = np.linspace(0.0, 2.0, 1001)
    known, motion = [(3.0, 0.05), (11.0, 0.02)], 0.3 * np.ones(1001)
    for frequency, ratio in known:
        decay = 2 * np.pi * frequency * ratio / np.sqrt(1 - ratio**2)
        motion += np.exp(-decay * time_s) * np.cos(2 * np.pi * frequency * time_s) / frequency
    np.testing.assert_allclose(swings(0.002, motion), known, rtol=1e-6)
    assert swings(0.002, np.exp(-time_s)) == [] and swings(0.002, np.ones(1001)) == []
    # second order: overshoot exp(−πζ/√(1 − ζ²))
    ratio, rate = 0.3, 20.0
    damped = rate * np.sqrt(1 - ratio**2)
    envelope = np.exp(-ratio * rate * time_s)
    way = 1 - envelope * (np.cos(damped * time_s) + ratio * rate / damped * np.sin(damped * time_s))
    expected = np.exp(-np.pi * ratio / np.sqrt(1 - ratio**2))
    assert step_response(time_s, way)["overshoot_share"] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"waveform": "table"}, "give 'times' and 'shares' with"),
        ({"times": ["0 s"], "shares": [0]}, "give 'times' and 'shares' with"),
        ({"waveform": "table", "times": ["0 s", "1 s"], "shares": [1]}, "2 'times' have 1 'shares'"),
        ({"waveform": "table", "times": ["1 s", "1 s"], "shares": [0, 1]}, "should increase"),
        ({"duration": "1 h", "record": "1 ms"}, "are more than"),
    ],
)
def test_what_is_no_motion_is_refused(given: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        FollowPressureConfig.model_validate({"pressure": "1 kPa", **given})
