"""The task `push`: forces on a wall by hand, the map's order, and the engines' agreement."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from tests.tasks.conftest import built
from tests.tasks.test_reach_around import ENGINES

from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.pipeline.simulate import scene_engine
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs, TaskResult
from pliant.testing.samples import linear_law, sample_chain
from pliant_plugins.tasks.push.config import PushConfig
from pliant_plugins.tasks.push.task import Push

WALL = {"position": ["25 mm", "0 mm", "0 mm"], "normal": [-1, 0, 0]}


def push(**keys: object) -> Push:
    return Push(PushConfig.model_validate({"pressure": "15 kPa", "wall": WALL, "radius": "7 mm", **keys}))


def run(task: Push, chain: ChainModel, kind: str = "quasistatic") -> TaskResult:
    if kind == "pybullet":
        pytest.importorskip("pybullet")
    return task.run(chain, scene_engine(built("physics", kind, **ENGINES[kind]), Model(chain)))


def test_the_force_of_one_joint_is_its_moment_over_its_lever() -> None:
    """F = τ(p, u) / (height of the tip below the joint), but for the length on which the capsule lies at the wall."""
    chain = sample_chain(linear_law(stiffness=0.04), modules=1).with_(gravity_m_s2=np.zeros(3))
    wall = {"position": ["5.2 mm", "0 mm", "0 mm"], "normal": [-1, 0, 0]}
    result = run(push(pressure="9 kPa", wall=wall, radius="5 mm", distances=["0 mm"]), chain)
    joint, tip = result.final.markers_m[1:]
    moment = float(linear_law(stiffness=0.04).evaluate(np.array([9e3]), result.final.joint_angles).tau[0, 0])
    assert result.metrics["holding_force_n"] > 0.01
    assert result.metrics["holding_force_n"] * abs(tip[2] - joint[2]) == pytest.approx(moment, rel=0.03)
    assert "stiffness_n_per_m" not in result.metrics


def test_the_map_has_distances_in_rows_and_levels_in_columns(finger: ChainModel) -> None:
    table = run(push(levels=3, distances=["0 mm", "2 mm"]), finger).metrics["map"]
    force = np.array(table["force_n"])
    assert force.shape == (2, 3) and table["level_ratio"] == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert np.all(np.diff(force, axis=1) > 0)  # more pressure, more force
    assert np.all(force[1, 1:] < force[0, 1:])  # a wall further away feels less
    slope = (force[0] - force[1]) / 2e-3
    np.testing.assert_allclose(table["stiffness_n_per_m"], [slope, slope])


def test_the_force_blocks_the_tip(finger: ChainModel) -> None:
    """The dead force that the wall's reaction is brings the free chain to the same pose."""
    result = run(push(distances=["0 mm"]), finger)
    free = built("physics", "quasistatic", max_iterations=60).build(finger)
    last = result.frames.coordinates[0][-1]
    with built("physics", "quasistatic", max_iterations=60).build_static_scene(push().scene(finger)) as scene:
        scene.apply([Inputs({"pressure_pa": 15e3})])
        for share in (0.25, 0.5, 0.75, 1.0):
            scene.apply([Inputs({"pressure_pa": 15e3 * share})])
            scene.step(1.0)
        forces = scene.contacts()
    free.apply(Inputs({"pressure_pa": 15e3}, tip_force_n=-sum(c.normal_n * c.normal for c in forces)))
    settled = free.settle()
    # the contact is a little above the tip, and off the axis by the radius
    np.testing.assert_allclose(settled.joint_angles, last, atol=0.06)
    free.apply(Inputs({"pressure_pa": 15e3}))
    assert np.abs(free.settle().joint_angles - last).max() > 0.1


@pytest.mark.parametrize("kind", ["mujoco", "pybullet"])
def test_engines_agree_on_the_holding_force(finger: ChainModel, kind: str) -> None:
    task = push(levels=1, ramp_time="1 s", hold_time="3 s", distances=["0 mm", "2 mm"])
    still, moved = (run(task, finger, name).metrics for name in ("quasistatic", kind))
    assert moved["holding_force_n"] == pytest.approx(still["holding_force_n"], rel=0.01)
    assert moved["stiffness_n_per_m"] == pytest.approx(still["stiffness_n_per_m"], rel=0.02)


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"distances": ["1 mm", "0 mm"]}, "'distances' rise, each above the one before"),
        ({"wall": {"position": ["1 mm"] * 3, "normal": [0, 0, 0]}}, "'normal' has no length"),
    ],
)
def test_wrong_blocks_are_refused(keys: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        push(**keys)


def test_a_chain_without_shapes_needs_a_radius() -> None:
    bare = sample_chain(modules=2)
    with pytest.raises(UserError, match="task 'push': the chain has no collision shapes"):
        Push(PushConfig.model_validate({"pressure": "15 kPa", "wall": WALL})).scene(bare)
