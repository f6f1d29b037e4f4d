"""The reward of a grasp: the published sum, by hand, and its preferences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from pliant.interfaces.physics import PhysicsBackend
from pliant.records.chain import ChainModel
from pliant_plugins.tasks.grasp.config import GraspConfig
from pliant_plugins.tasks.grasp.metrics import MODES, TrialMetrics, reward
from pliant_plugins.tasks.grasp.scene import Draw, grasp_scene
from pliant_plugins.tasks.grasp.task import Grasp

# z_max, z_end, normal, friction, efficiency, slip, creep
HELD = TrialMetrics(0.045, 0.045, 2.0, 1.2, 0.3, 0.25, 0.0, "stable")
MISSED = TrialMetrics(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, "miss")


def config(**keys: Any) -> GraspConfig:
    return GraspConfig.model_validate({"pressure": "12 kPa", "object": "egg", **keys})


@pytest.fixture
def rewarded(finger: ChainModel) -> Callable[..., float]:
    """Return the reward of a trial under a config of these keys."""

    def inner(trial: TrialMetrics = HELD, **keys: Any) -> float:
        given = config(**keys)
        return reward(trial, grasp_scene(finger, given, Grasp(given).target, Draw.none()), given)

    return inner


def test_the_sum_by_hand_and_what_it_prefers(rewarded: Callable[..., float]) -> None:
    # 2 + 2 · 45/60 + 0.5 · 0.6 + 0.2 · 0.3 − 0.1 · 0.25 − 0.5 · 12/15 − 0.005 · 3 · 6
    held = rewarded()
    assert held == pytest.approx(3.345)
    assert rewarded(MISSED) == pytest.approx(-1.59)  # −1 − 0.1 − 0.4 − 0.09
    # a cylinder is grasped by few modules: 0.2 · 0.7 in the place of 0.2 · 0.3
    assert rewarded(object="cylinder") == pytest.approx(3.345 + 0.08)
    assert rewarded(extra_weights=6) / held == pytest.approx(1.3)
    assert held - rewarded(fingers=4) == pytest.approx(0.005 * 6)
    assert held - rewarded(pressure="15 kPa") == pytest.approx(0.5 * 3 / 15)
    # a lift beyond the carriage's counts as one
    full, over = (rewarded(replace(HELD, z_max_m=z)) for z in (0.06, 0.09))
    assert full == over > held
    assert [replace(HELD, mode=mode).mode_score for mode in MODES] == [-1.0, 0.5, 1.0, 2.0]


def test_a_task_measures_it_as_the_mean_over_its_trials(
    finger: ChainModel, grasp: Callable[..., Grasp], mujoco: PhysicsBackend
) -> None:
    times = {"lower_height": 0, "lower_time": 0.02, "ramp_time": 0.3, "hold_time": 0, "lift_time": 0.3}
    task = grasp(trials=2, noise={"pressure": "1 kPa"}, lift_height="10 mm", final_time=0.1, **times)
    metrics = task.run(finger, mujoco.build_scene).metrics
    names = ("z_max_m", "z_end_m", "normal_force_n", "friction_force_n", "contact_efficiency_share")
    each = metrics["trials"]
    scene = task.scene(finger)
    for k, found in enumerate(each["reward"]):
        numbers = [each[name][k] for name in (*names, "slip_ratio", "creep_m_s")]
        trial = TrialMetrics(*numbers, each["mode"][k])
        assert found == pytest.approx(reward(trial, scene, task.config))
    assert each["mode"][0] != "miss"
    assert metrics["reward"] == pytest.approx(sum(each["reward"]) / 2)
