"""The task `hold_and_turn`: laws of turning by friction, the energy balance, the engines' agreement, refusals."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from tests.tasks.conftest import built

from pliant.config.chain import ChainConfig
from pliant.errors import UserError
from pliant.interfaces.effect import Model
from pliant.mechanics.efforts import JointEfforts
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.rotations import exp_map
from pliant.pipeline.chain import Segment, build_chain, rod_module
from pliant.pipeline.simulate import scene_engine
from pliant.records.chain import Actuator, ChainModel
from pliant.records.rollout import TaskResult
from pliant.testing.samples import sample_chain
from pliant_plugins.tasks.hold_and_turn.config import HoldAndTurnConfig
from pliant_plugins.tasks.hold_and_turn.episode import cycle, play
from pliant_plugins.tasks.hold_and_turn.metrics import metrics, turns_rad
from pliant_plugins.tasks.hold_and_turn.task import HoldAndTurn

HARD = {"contact_stiffness": 1e5, "contact_damping": 700, "contact_timestep": "0.5 ms"}
ENGINES: dict[str, dict[str, Any]] = {
    "mujoco": {"joint_damping": 3e-3, **HARD},
    "pybullet": {"joint_damping": 3e-4},
}
LEFT = {"pressure_2_pa": "12 kPa", "pressure_3_pa": "0 kPa"}
RIGHT = {"pressure_2_pa": "0 kPa", "pressure_3_pa": "12 kPa"}
# MuJoCo kicks a cylinder when a contact leaves the exact symmetry of both bodies: hands begin a little aside.
GRIP = {"pressure_1_pa": "12 kPa", "pressure_3_pa": "1 kPa"}


@pytest.fixture(scope="module")
def finger() -> ChainModel:
    """Return a finger: two joints close it by `pressure_1_pa`, two swing it by 2, and by 3 to the other side."""
    coefficients = {"k_n": 1.6e-6, "m_a": 0, "b_a": 0, "m_e": 0, "b_e": 0.15}
    law = built("surrogate", "polynomial", form="study", axis="y", coefficients=coefficients).stated()
    module = rod_module(law, 0.025, 8e-3)
    segments = [Segment(module, 2), Segment(module, 2, np.pi / 2)]
    chain = build_chain(ChainConfig(modules=4), segments)
    joints = [replace(joint, drives=(0, 1) if k < 2 else (1, 3)) for k, joint in enumerate(chain.joints)]
    actuators = (Actuator("pressure_1_pa"), Actuator("pressure_2_pa"), Actuator("pressure_3_pa", -1.0))
    return chain.with_(joints=tuple(joints), actuators=actuators)


def turning(drives: list[dict[str, str]], **keys: object) -> HoldAndTurn:
    """Return a task of three fingers that take hold with `GRIP` and go on to these inputs."""
    block = {
        "object": {"shape": "cylinder", "radius": "25 mm", "height": "50 mm", "mass": "50 g"},
        "base_radius": "52 mm",
        "inclination": "-10 deg",
        "grasp_height": "15 mm",
        "radius": "8 mm",
        "table_friction": 0.0,
        "inputs": GRIP,
        "ramp_time": "0.4 s",
        "hold_time": "0.2 s",
        "final_time": "0.3 s",
        "turn": {"keyframes": [{"time": "0.5 s", "inputs": drives}]},
    }
    return HoldAndTurn(HoldAndTurnConfig.model_validate({**block, **keys}))


def run(task: HoldAndTurn, chain: ChainModel, kind: str = "mujoco") -> TaskResult:
    if kind == "pybullet":
        pytest.importorskip("pybullet")
    return task.run(chain, scene_engine(built("physics", kind, **ENGINES[kind]), Model(chain)))


def test_mirrored_pressures_turn_the_other_way(finger: ChainModel) -> None:
    left = run(turning([LEFT]), finger).metrics
    other = {"pressure_1_pa": "12 kPa", "pressure_2_pa": "1 kPa"}
    right = run(turning([RIGHT], inputs=other), finger).metrics
    assert abs(left["turn_rad"]) > 0.1 and left["held"] == right["held"] == 1.0
    assert left["turn_rad"] == pytest.approx(-right["turn_rad"], rel=0.02)


def test_nothing_turns_without_friction(finger: ChainModel) -> None:
    """But for the directions of the engine's normals, which are good to some mrad."""
    free, stuck = (run(turning([LEFT], friction=one), finger).metrics for one in (0.0, 0.8))
    assert abs(free["turn_rad"]) < 0.05 * abs(stuck["turn_rad"])
    assert free["slip_m"] > 1e-3 > 3.0 * stuck["slip_m"]


def test_a_symmetric_hand_with_equal_pressures_turns_nothing(finger: ChainModel) -> None:
    """Fingers that only close harder, all alike, have no side to which they could turn."""
    closed = run(turning([{"pressure_1_pa": "15 kPa"}], inputs={"pressure_1_pa": "12 kPa"}), finger).metrics
    assert abs(closed["turn_rad"]) < 1e-3
    assert closed["drift_m"] < 1e-4 and closed["tilt_rad"] < 1e-3


def test_the_turn_does_not_depend_on_the_axis_length_nor_on_the_way_it_points(finger: ChainModel) -> None:
    up, down = (run(turning([LEFT], axis=axis), finger).metrics for axis in ([0, 0, 2], [0, 0, -1]))
    assert up["turn_rad"] == pytest.approx(-down["turn_rad"])
    across = run(turning([LEFT], axis=[1, 0, 0]), finger).metrics
    assert abs(across["turn_rad"]) < 0.05 * abs(up["turn_rad"])


def test_an_object_is_carried_while_it_is_held_and_falls_when_it_is_let_go(finger: ChainModel) -> None:
    keys = {
        "support": "carried",
        "lift_height": "15 mm",
        "lift_time": "0.5 s",
        "inputs": {**GRIP, "pressure_1_pa": "16 kPa"},
    }
    held = run(turning([LEFT], **keys), finger).metrics
    assert held["held"] == 1.0 and held["drift_m"] < 5e-3
    let_go = run(turning([{"pressure_1_pa": "0 kPa"}], **keys), finger).metrics
    assert let_go["held"] == 0.0 and let_go["held_share"] < held["held_share"] == 1.0
    assert let_go["drift_m"] == pytest.approx(15e-3, abs=4e-3)


def test_the_work_of_the_pressures_is_the_energy_that_the_fingers_gain(finger: ChainModel) -> None:
    """Free fingers, bent slowly: work = change of elastic energy and of height, but for damping."""
    far = {"shape": "cylinder", "radius": "2 mm", "height": "4 mm", "mass": "1 g"}
    frames = [{"time": "3 s", "inputs": [{"pressure_2_pa": "4 kPa", "pressure_1_pa": "3 kPa"}]}]
    task = turning(
        [LEFT],
        object=far,
        inputs={"pressure_1_pa": "0 kPa"},
        turn={"keyframes": frames},
        base_radius="100 mm",
    )
    scene = task.scene(finger)
    with scene_engine(built("physics", "mujoco", joint_damping=3e-3), Model(finger))(scene) as simulation:
        episode = play(simulation, task.config, task.config.actuation(finger))
    record, (begin, end) = episode.record, episode.ends
    gained = 0.0
    for k, arm in enumerate(scene.arms):
        efforts, none = JointEfforts(arm.chain), dict.fromkeys(arm.chain.inputs, 0.0)
        elastic = [efforts.potential(record.states[n].coordinates[k], none) for n in (begin, end)]
        heights = [_height_kg_m(arm.chain, record.states[n].coordinates[k]) for n in (begin, end)]
        gained += elastic[1] - elastic[0] + 9.81 * (heights[1] - heights[0])
    assert gained > 1e-4
    assert metrics(episode, task.config)["work_j"] == pytest.approx(gained, rel=0.03)


def _height_kg_m(chain: ChainModel, q: Any) -> float:
    """Return Σ m z of the bodies."""
    pose = ChainGeometry.from_chain(chain).forward(q)
    bodies = zip(chain.bodies, pose.rotations, pose.origins, strict=True)
    return sum(body.mass_kg * float((place + turn @ body.com_m)[2]) for body, turn, place in bodies)


def test_strokes_of_a_hand_are_alike_and_add_up(finger: ChainModel) -> None:
    frames = [
        {"time": "0.5 s", "inputs": [{"pressure_2_pa": "0 kPa", "pressure_3_pa": "10 kPa"}]},
        {"time": "0.7 s", "inputs": [{"pressure_1_pa": "0 kPa"}]},
        {"time": "1.1 s", "inputs": [{"pressure_2_pa": "10 kPa", "pressure_3_pa": "0 kPa"}]},
        {"time": "1.4 s", "inputs": [{"pressure_1_pa": "12 kPa"}]},
    ]
    task = turning(
        [LEFT],
        turn={"cycles": 2, "keyframes": frames},
        inputs={"pressure_1_pa": "12 kPa", "pressure_2_pa": "10 kPa"},
        table_friction=0.2,
    )
    found = run(task, finger).metrics
    one, two = found["cycle_turns_rad"]
    assert abs(one) > 0.2 and two == pytest.approx(one, rel=0.1)
    assert found["turn_rad"] == pytest.approx(one + two, abs=0.02)
    assert found["repeatability_rad"] == pytest.approx(abs(one - two) / np.sqrt(2))
    assert 0.2 < found["held_share"] < 0.9


@pytest.mark.slow
def test_engines_agree_on_the_turn(finger: ChainModel) -> None:
    """On a table without friction, whose patch of contact engines model differently."""
    task = turning([LEFT])
    turns = [run(task, finger, kind).metrics["turn_rad"] for kind in ("mujoco", "pybullet")]
    assert turns[1] == pytest.approx(turns[0], rel=0.02)


def test_turns_are_counted_beyond_half_a_turn_and_apart_from_a_tilt() -> None:
    axis = np.array([0.0, 0.6, 0.8])
    angles = np.linspace(0.0, -9.0, 40)
    tilted = exp_map(np.array([0.3, 0.0, 0.0]))
    rotations = np.array([exp_map(angle * axis) for angle in angles])
    np.testing.assert_allclose(turns_rad(rotations, axis), angles, atol=1e-12)
    assert turns_rad(np.array([np.eye(3), tilted]), np.array([0.0, 0.0, 1.0]))[1] == pytest.approx(0.0)


def test_waves_have_their_phase_in_each_finger(finger: ChainModel) -> None:
    wave = {"input": "pressure_2_pa", "mean": "6 kPa", "amplitude": "4 kPa", "phases": ["0 deg", "180 deg"]}
    task = turning([LEFT], fingers=4, turn={"waves": [wave], "period": "1 s"})
    commands = cycle(task.config, task.config.actuation(finger))
    assert commands[0].name == "start" and sum(c.duration_s for c in commands[1:]) == pytest.approx(1.0)
    quarter = commands[len(commands) // 4].levels
    assert [one["pressure_2_pa"] for one in quarter] == pytest.approx([10e3, 2e3, 10e3, 2e3])
    assert quarter[0]["pressure_1_pa"] == 12e3


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"turn": {}}, "give either 'keyframes' or 'waves'"),
        (
            {"turn": {"period": "3 s", "keyframes": [{"time": "1 s", "inputs": [LEFT]}]}},
            "'period' is of 'waves'",
        ),
        ({"axis": [0, 0, 0]}, "'axis' has no length"),
        (
            {"turn": {"keyframes": [{"time": "1 s", "inputs": [LEFT]}, {"time": "1 s", "inputs": [RIGHT]}]}},
            "the times of 'keyframes' rise",
        ),
        ({"turn": {"keyframes": [{"time": "1 s", "inputs": []}]}}, "at least 1 item"),
    ],
)
def test_wrong_blocks_are_refused(keys: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence):
        turning([LEFT], **keys)


def test_an_unknown_input_is_named(finger: ChainModel) -> None:
    task = turning([{"pressure_7_pa": "1 kPa"}])
    with pytest.raises(
        UserError, match="task.turn drives pressure_7_pa, and the chain's inputs are pressure_1_pa"
    ):
        run(task, finger)


def test_a_chain_without_shapes_is_refused_by_this_tasks_name() -> None:
    config = {
        "object": "egg",
        "pressure": "9 kPa",
        "turn": {"keyframes": [{"time": "1 s", "inputs": [LEFT]}]},
    }
    with pytest.raises(UserError, match="task 'hold_and_turn': the chain has no collision shapes"):
        HoldAndTurn(HoldAndTurnConfig.model_validate(config)).scene(sample_chain(modules=2))
