"""Real episodes: an egg is lifted, fingers too far away miss it, a heavy one stays; seeds reproduce; effects matter."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend
from pliant.meshing.surfaces import support
from pliant.pipeline.simulate import run_task
from pliant.records.chain import ChainModel
from pliant.registry.discovery import discover
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig
from pliant_plugins.tasks.grasp.task import Grasp

Tasks = Callable[..., Grasp]
QUICK = {"lower_height": "5 mm", "lower_time": "0.2 s", "lift_height": "20 mm", "lift_time": "0.7 s"}


def test_an_egg_is_lifted(grasp: Tasks, finger: ChainModel, mujoco: PhysicsBackend) -> None:
    result = grasp().run(finger, mujoco.build_scene)
    found = result.metrics
    assert found["mode"] == "stable"
    assert found["z_end_m"] == pytest.approx(0.06, abs=0.003)
    assert abs(found["creep_m_s"]) < 1e-4
    # friction and normal forces carry the weight: neither alone may be less than a third of it
    weight = 0.05 * 9.81
    assert found["normal_force_n"] + found["friction_force_n"] > weight
    assert found["friction_force_n"] <= 0.8 * found["normal_force_n"] * (1 + 1e-6)
    assert result.frames is not None
    assert result.frames.time_s[-1] == pytest.approx(6.0)
    assert [still.label for still in result.stills] == ["lowered", "actuated", "lifted"]
    assert np.isnan(result.final.residual)
    # the tips bend down to the floor, which stops them
    down = np.array([0.0, 0.0, -1.0])
    lowest = [min(-support(s, down) for arm in still.arms for s in arm) for still in result.stills]
    assert min(lowest) > -1e-3
    assert lowest[1] < 1e-3


@pytest.mark.slow
def test_an_egg_is_lifted_in_bullet(grasp: Tasks, finger: ChainModel, pybullet: PhysicsBackend) -> None:
    found = grasp(**QUICK).run(finger, pybullet.build_scene).metrics
    assert found["mode"] == "stable"
    assert 0.012 < found["z_end_m"] < 0.0205  # it settles into the fingers as they leave the floor


def test_fingers_too_far_away_miss(grasp: Tasks, finger: ChainModel, mujoco: PhysicsBackend) -> None:
    found = grasp(base_radius="120 mm", **QUICK).run(finger, mujoco.build_scene).metrics
    assert found["mode"] == "miss"
    assert found["normal_force_n"] == 0.0
    assert found["z_max_m"] < 1e-4


def test_what_is_too_heavy_stays_on_the_floor(
    grasp: Tasks, finger: ChainModel, mujoco: PhysicsBackend
) -> None:
    found = grasp(extra_weights=50, **QUICK).run(finger, mujoco.build_scene).metrics
    assert found["mode"] == "touch"
    assert found["slip_ratio"] == pytest.approx(1.0, abs=0.05)


def test_seeds_reproduce(grasp: Tasks, finger: ChainModel, mujoco: PhysicsBackend) -> None:
    noise = {"friction": "5 %", "pressure": "0.5 kPa", "placement": "5 %"}

    def rises(**keys: object) -> list[float]:
        task = grasp(noise=noise, trials=2, extra_weights=4, **QUICK, **keys)
        lists = task.run(finger, mujoco.build_scene).metrics["trials"]
        assert len(lists["mode"]) == 2
        return list(lists["z_end_m"])

    first = rises(seed=3)
    assert rises(seed=3) == first
    assert first[0] != first[1]
    assert rises(seed=4) != first


def test_effects_on_the_input_reach_the_fingers(
    grasp: Tasks, finger: ChainModel, mujoco: PhysicsBackend
) -> None:
    component = discover().get("effect", "supply_lag")
    late = component.build(component.config_model().model_validate({"kind": "supply_lag", "time": "20 s"}))
    task = grasp(**QUICK)
    angle = {
        name: float(run_task(mujoco, task, effects, finger).final.joint_angles[-1, 0])
        for name, effects in (("none", []), ("late", [late]))
    }
    assert angle["late"] < angle["none"] - 0.05


def test_engines_without_contact_are_refused(grasp: Tasks, finger: ChainModel) -> None:
    with pytest.raises(UserError, match="no contacts.*'mujoco' or 'pybullet'"):
        run_task(Quasistatic(QuasistaticConfig()), grasp(), [], finger)
