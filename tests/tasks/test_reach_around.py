"""The task `reach_around`: inverse statics keeps clear, contact is carried, and the engines agree."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from tests.tasks.conftest import built

from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.pipeline.simulate import scene_engine
from pliant.records.chain import Actuator, ChainModel
from pliant.records.rollout import TaskResult
from pliant.records.scene import Arm, Obstacle, Scene
from pliant.records.shape import Shape
from pliant.testing.samples import lopsided_box
from pliant_plugins.tasks.reach_around.config import ReachAroundConfig
from pliant_plugins.tasks.reach_around.task import ReachAround

SHELF = {"box": ["50 mm", "40 mm", "8 mm"], "position": ["42 mm", "0 mm", "-50 mm"]}
BOUNDS = {"pressure_1_pa": ["0 kPa", "15 kPa"], "pressure_2_pa": ["0 kPa", "15 kPa"]}
STIFF = {
    "joint_damping": 3e-3,
    "contact_stiffness": 1e6,
    "contact_damping": 2e3,
    "contact_timestep": "0.5 ms",
}
ENGINES: dict[str, dict[str, Any]] = {
    "quasistatic": {},
    "mujoco": STIFF,
    "pybullet": {"joint_damping": 1e-3, "contact_memory": 1e-5},
}


def reach_around(**keys: object) -> ReachAround:
    block = {
        "arms": [{"tip": ["50 mm", "0 mm", "-78 mm"]}],
        "obstacles": [SHELF],
        "radius": "7 mm",
        "bounds": BOUNDS,
        "samples": 32,
    }
    return ReachAround(ReachAroundConfig.model_validate({**block, **keys}))


@pytest.fixture(scope="module")
def arm(finger: ChainModel) -> ChainModel:
    """Return the finger with an input for each half of its modules."""
    joints = finger.joints
    half = len(joints) // 2
    drives = [(0, 1) if k < half else (1, 2) for k in range(len(joints))]
    own = tuple(
        type(joint)(joint.law, joint.offset_m, joint.rest_rotation, given)
        for joint, given in zip(joints, drives, strict=True)
    )
    return finger.with_(joints=own, actuators=(Actuator("pressure_1_pa"), Actuator("pressure_2_pa")))


def run(task: ReachAround, chain: ChainModel, kind: str) -> TaskResult:
    if kind == "pybullet":
        pytest.importorskip("pybullet")
    return task.run(chain, scene_engine(built("physics", kind, **ENGINES[kind]), Model(chain)))


def test_inverse_statics_keeps_the_clearance(arm: ChainModel) -> None:
    """Without regard for the shelf the arm would cut through it; with it, the arm stays a millimetre away."""
    result = run(reach_around(clearance="1 mm"), arm, "quasistatic")
    assert result.metrics["least_clearance_m"] > 0.5e-3
    far = [{"sphere": "1 mm", "position": ["500 mm", "0 mm", "0 mm"]}]
    free = reach_around(obstacles=far)
    inputs = free.actuation(free.scene(arm).arms[0].chain, free.config.arms[0])
    through = run(
        reach_around(arms=[{"tip": ["50 mm", "0 mm", "-78 mm"], "inputs": dict(inputs)}]), arm, "quasistatic"
    )
    assert through.metrics["press_n"] > 0.0


def test_a_chain_that_may_press_comes_no_less_close(arm: ChainModel) -> None:
    clear, pressing = (
        run(reach_around(contact=how), arm, "quasistatic").metrics for how in ("avoid", "allow")
    )
    assert pressing["distance_m"] <= clear["distance_m"] + 1e-6
    assert pressing["clearance_m"] > -1e-4


@pytest.mark.parametrize("kind", ["mujoco", "pybullet"])
def test_engines_agree_on_a_pressed_arm(arm: ChainModel, kind: str) -> None:
    """Force within 1 %, tip within half a millimetre; MuJoCo's tip within 0.1 mm."""
    inputs = [
        {"tip": ["60 mm", "0 mm", "-70 mm"], "inputs": {"pressure_1_pa": "9 kPa", "pressure_2_pa": "6 kPa"}}
    ]
    task = reach_around(arms=inputs, hold_time="3 s")
    still, moved = (run(task, arm, name) for name in ("quasistatic", kind))
    assert still.metrics["press_n"] > 0.05
    assert moved.metrics["press_n"] == pytest.approx(still.metrics["press_n"], rel=0.01)
    near = 1e-4 if kind == "mujoco" else 5e-4
    np.testing.assert_allclose(moved.final.tip_m, still.final.tip_m, atol=near)
    assert moved.metrics["tip_speed_m_s"] < 1e-3


def test_several_arms_have_their_own_targets(arm: ChainModel) -> None:
    arms = [
        {"tip": ["50 mm", "0 mm", "-78 mm"]},
        {"tip": ["-250 mm", "0 mm", "-78 mm"], "base": {"position": ["-300 mm", "0 mm", "0 mm"]}},
    ]
    result = run(reach_around(arms=arms), arm, "quasistatic")
    one, other = result.metrics["inputs"]
    assert one != other  # the second one has no shelf
    assert len(result.frames.coordinates) == 2


def test_a_mesh_is_an_obstacle(arm: ChainModel, tmp_path) -> None:
    trimesh = pytest.importorskip("trimesh")
    part = tmp_path / "shelf.stl"
    trimesh.creation.box((50.0, 40.0, 8.0)).export(part)
    mesh = {"mesh": str(part), "scale": 1e-3, "position": SHELF["position"]}
    inputs = [
        {"tip": ["60 mm", "0 mm", "-70 mm"], "inputs": {"pressure_1_pa": "9 kPa", "pressure_2_pa": "6 kPa"}}
    ]
    box, part_of_file = (
        run(reach_around(arms=inputs, obstacles=[one]), arm, "quasistatic").metrics for one in (SHELF, mesh)
    )
    assert part_of_file["press_n"] == pytest.approx(box["press_n"], rel=1e-6)


def test_statics_refuses_what_it_does_not_have(arm: ChainModel) -> None:
    quasistatic = built("physics", "quasistatic", max_iterations=60)
    ball = Obstacle("ball", (Shape("sphere", (0.01,), np.ones(3), np.eye(3)),), 1.0)
    with pytest.raises(UserError, match="no friction"):
        quasistatic.build_static_scene(Scene((Arm(arm, 0.5),), obstacles=(ball,)))
    with pytest.raises(UserError, match="fixed obstacles only"):
        quasistatic.build_static_scene(Scene((Arm(arm),), (lopsided_box(),)))


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"obstacles": [{"sphere": "1 mm", "box": ["1 mm"] * 3}]}, "give one of 'box', 'sphere' and 'mesh'"),
        ({"obstacles": [{"box": ["1 mm", "0 mm", "1 mm"]}]}, "edges of a 'box' are above 0"),
        ({"obstacles": [{"sphere": "1 mm", "scale": 2}]}, "'scale' and 'convex_parts' are for a 'mesh'"),
        ({"arms": [{"tip": ["1 mm"] * 3, "direction": [0, 0, 0]}]}, "'direction' has no length"),
    ],
)
def test_wrong_blocks_are_refused(keys: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        reach_around(**keys)


def test_an_unknown_input_is_named(arm: ChainModel) -> None:
    task = reach_around(arms=[{"tip": ["50 mm", "0 mm", "-78 mm"], "inputs": {"pressure_pa": "9 kPa"}}])
    with pytest.raises(
        UserError, match="names pressure_pa, and the chain's inputs are pressure_1_pa, pressure_2_pa"
    ):
        run(task, arm, "quasistatic")


def test_a_target_beyond_the_longest_chain_is_refused() -> None:
    task = reach_around(
        arms=[{"tip": ["0 mm", "0 mm", "-300 mm"], "base": {"position": ["0 mm", "0 mm", "0 mm"]}}]
    )
    with pytest.raises(UserError, match=r"300 mm from its base, and the longest chain is 100 mm"):
        task.check_reach(0.1)
