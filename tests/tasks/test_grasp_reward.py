"""The reward of a grasp: the published sum, by hand, and what it prefers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from pliant.interfaces.physics import PhysicsBackend
from pliant.records.chain import ChainModel
from pliant.records.scene import Scene
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
def scene_of(finger: ChainModel) -> Callable[[GraspConfig], Scene]:
    return lambda given: grasp_scene(finger, given, Grasp(given).target, Draw.none())


def test_the_sum_by_hand(scene_of: Callable[[GraspConfig], Scene]) -> None:
    given = config()
    # 2 + 2 · 45/60 + 0.5 · 0.6 + 0.2 · 0.3 − 0.1 · 0.25 − 0.5 · 12/15 − 0.005 · 3 · 6
    assert reward(HELD, scene_of(given), given) == pytest.approx(3.345)
    # −1 − 0.1 − 0.4 − 0.09
    assert reward(MISSED, scene_of(given), given) == pytest.approx(-1.59)


def test_a_cylinder_is_held_by_few_modules(scene_of: Callable[[GraspConfig], Scene]) -> None:
    given = config(object="cylinder")
    # 0.2 · 0.7 in the place of 0.2 · 0.3
    assert reward(HELD, scene_of(given), given) == pytest.approx(3.345 + 0.08)


def test_heavy_objects_count_mildly_more(scene_of: Callable[[GraspConfig], Scene]) -> None:
    light, heavy = config(), config(extra_weights=6)
    ratio = reward(HELD, scene_of(heavy), heavy) / reward(HELD, scene_of(light), light)
    assert ratio == pytest.approx(1.3)


def test_a_lift_beyond_the_carriages_counts_as_one(scene_of: Callable[[GraspConfig], Scene]) -> None:
    given = config()
    scene = scene_of(given)
    full, over = (reward(replace(HELD, z_max_m=z), scene, given) for z in (0.06, 0.09))
    assert full == over > reward(HELD, scene, given)


def test_more_fingers_and_more_pressure_cost(scene_of: Callable[[GraspConfig], Scene]) -> None:
    plain, more, harder = config(), config(fingers=4), config(pressure="15 kPa")
    first, second, third = (reward(HELD, scene_of(given), given) for given in (plain, more, harder))
    assert first - second == pytest.approx(0.005 * 6)
    assert first - third == pytest.approx(0.5 * 3 / 15)


def test_modes_are_ranked() -> None:
    scores = [replace(HELD, mode=mode).mode_score for mode in MODES]
    assert scores == [-1.0, 0.5, 1.0, 2.0]


def test_a_task_measures_it_as_the_mean_of_its_trials(
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
