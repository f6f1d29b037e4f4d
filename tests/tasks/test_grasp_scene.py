"""Positions of the fingers, effects of noise, commands of an episode and its judgement."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.mechanics.stills import still
from pliant.meshing.surfaces import support
from pliant.records.chain import ChainModel
from pliant.records.scene import Contact, Part
from pliant.testing.stand_ins import StandInScene
from pliant_plugins.tasks.grasp.config import GraspConfig
from pliant_plugins.tasks.grasp.episode import phases, play
from pliant_plugins.tasks.grasp.metrics import Grip, TrialMetrics, deepest_m, grasp_mode, summary, sunk_in
from pliant_plugins.tasks.grasp.scene import Draw
from pliant_plugins.tasks.grasp.task import Grasp

Tasks = Callable[..., Grasp]


def test_fingers_lean_outward_and_look_inward(grasp: Tasks, finger: ChainModel) -> None:
    scene = grasp(fingers=4, inclination="20 deg", base_radius="15 mm").scene(finger)
    assert len(scene.arms) == 4
    for k, arm in enumerate(scene.arms):
        outward = np.array([np.cos(k * np.pi / 2), np.sin(k * np.pi / 2), 0.0])
        base, turn = arm.chain.base_position_m, arm.chain.base_rotation
        assert base[:2] == pytest.approx(0.015 * outward[:2])
        assert turn[:, 0] == pytest.approx(np.sin(np.radians(20)) * outward - [0, 0, np.cos(np.radians(20))])
        assert turn[:, 2] @ outward == pytest.approx(np.cos(np.radians(20)))  # −z points at the vertical
        assert turn.T @ turn == pytest.approx(np.eye(3))
        assert np.linalg.det(turn) == pytest.approx(1.0)


def test_the_lowest_point_on_the_lowered_fingers_is_the_grasp_height(
    grasp: Tasks, finger: ChainModel
) -> None:
    scene = grasp(grasp_height="8 mm", lower_height="60 mm").scene(finger)
    with StandInScene(scene) as simulation:
        shown = still(scene, simulation.snapshot())
    down = np.array([0.0, 0.0, -1.0])
    for arm in shown.arms:
        assert -max(support(shape, down) for shape in arm) == pytest.approx(0.068)
    assert -support(shown.objects[0][0], down) == pytest.approx(0.0)


def test_inset_is_measured_from_the_objects_radius(grasp: Tasks, finger: ChainModel) -> None:
    def radius(**keys: object) -> float:
        return float(grasp(**keys).scene(finger).arms[0].chain.base_position_m[0])

    assert radius() == pytest.approx(0.014)  # 30 − 16 mm
    assert radius(object="cylinder") == pytest.approx(0.014)  # 16 − 2 mm
    assert radius(base_inset="-5 mm") == pytest.approx(0.035)
    with pytest.raises(UserError, match="base_inset 40 mm is larger"):
        radius(base_inset="40 mm")


def test_a_chain_without_shapes_is_refused(grasp: Tasks, finger: ChainModel) -> None:
    with pytest.raises(UserError, match="no collision shapes"):
        grasp().scene(finger.with_(shapes=()))


def test_noise_stays_within_its_widths_and_follows_the_seed() -> None:
    keys = {
        "pressure": 15e3,
        "object": "egg",
        "noise": {"friction": "5 %", "pressure": 500, "placement": 0.05},
    }
    config = GraspConfig.model_validate(keys)
    draws = [Draw.from_config(config, k, 0.03) for k in range(400)]
    friction = np.array([draw.friction for draw in draws])
    pressure = np.array([draw.pressure_pa for draw in draws])
    away = np.array([np.linalg.norm(draw.offset_m) for draw in draws])
    assert np.abs(friction - 1).max() <= 0.05
    assert np.abs(pressure).max() <= 500
    assert away.max() <= 0.0015
    assert friction.std() == pytest.approx(0.05 / np.sqrt(3), rel=0.1)
    assert (away**2).mean() == pytest.approx(0.0015**2 / 2, rel=0.1)  # uniform in the disc
    again = Draw.from_config(config, 7, 0.03)
    assert (again.friction, again.pressure_pa) == (draws[7].friction, draws[7].pressure_pa)
    other = Draw.from_config(config.model_copy(update={"seed": 1}), 7, 0.03)
    assert other.friction != draws[7].friction


def test_an_episode_is_lowered_actuated_and_lifted(grasp: Tasks, finger: ChainModel) -> None:
    task = grasp(pressure="10 kPa")
    assert sum(phase.duration_s for phase in phases(task.config)) == pytest.approx(6.0)
    simulation = StandInScene(task.scene(finger))
    episode = play(simulation, task.config, {"pressure_pa": 10e3})
    height = np.array([state.carriage_m[2] for state in episode.states])
    assert height.min() == pytest.approx(-0.06)
    assert height[-1] == pytest.approx(0.0, abs=1e-12)
    bend = np.array([float(state.coordinates[0].sum()) for state in episode.states])
    lowered, full = episode.last_frame("lower"), episode.last_frame("actuate")
    # the pressure grows on the ramp only
    assert np.ptp(bend[1 : lowered + 1]) < 1e-9
    assert np.all(np.diff(bend[lowered : full + 1]) > 0)
    assert np.ptp(bend[full:]) < 1e-9
    assert len(episode.outside) == 0


def test_grip_sums_what_fingers_do_to_the_object(grasp: Tasks, finger: ChainModel) -> None:
    scene = grasp().scene(finger)

    def touch(first: Part, second: Part, normal: float, friction: tuple[float, float, float]) -> Contact:
        return Contact(first, second, np.zeros(3), np.array([1.0, 0, 0]), normal, np.array(friction))

    egg, floor = Part("object", 0), Part("floor")
    contacts = [
        touch(Part("arm", 0, 6), egg, 1.0, (0.0, 0.3, 0.4)),
        touch(Part("arm", 0, 6), egg, 0.5, (0.0, 0.0, 0.0)),
        touch(Part("arm", 2, 5), egg, 0.25, (0.0, 0.0, 0.1)),
        touch(egg, floor, 9.0, (1.0, 1.0, 0.0)),
    ]
    grip = Grip.from_contacts(contacts, scene)
    assert grip.normal_n == pytest.approx(1.75)
    assert grip.friction_n == pytest.approx(0.6)
    assert grip.touching_share == pytest.approx(2 / 18)


@pytest.mark.parametrize(
    ("touched", "z_max", "z_end", "creep", "mode"),
    [
        (False, 0.0, 0.0, 0.0, "miss"),
        (True, 0.004, 0.0, 0.0, "touch"),
        (True, 0.055, 0.0, 0.0, "slip"),
        (True, 0.060, 0.058, 0.010, "slip"),
        (True, 0.060, 0.058, 0.0, "stable"),
    ],
)
def test_modes(touched: bool, z_max: float, z_end: float, creep: float, mode: str) -> None:
    assert grasp_mode(touched, z_max, z_end, creep, 0.06) == mode


def test_fingers_that_sink_in_are_named(grasp: Tasks, finger: ChainModel) -> None:
    task = grasp(pressure="10 kPa")
    episode = play(StandInScene(task.scene(finger)), task.config, {"pressure_pa": 10e3})
    egg, way = Part("object", 0), np.array([1.0, 0.0, 0.0])
    episode.contacts[-1] = tuple(
        Contact(first, egg, np.zeros(3), way, 1.0, np.zeros(3), depth)
        for first, depth in ((Part("arm", 0, 6), 1.9e-3), (Part("arm", 1, 6), 1e-3), (Part("floor"), 4e-3))
    )
    assert deepest_m(episode) == 1.9e-3
    assert sunk_in(0.7e-3, 0.025) == ""
    assert "sink up to 1.9 mm into the object, of 25 mm radius" in sunk_in(1.9e-3, 0.025)


def test_trials_are_summed_up() -> None:
    held = TrialMetrics(0.06, 0.06, 2.0, 1.0, 0.3, 0.0, 0.0, "stable")
    lost = TrialMetrics(0.03, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, "slip")
    metrics = summary([held, lost])
    assert metrics["success_share"] == 0.5
    assert metrics["mode"] == "slip"  # the worse of two equally frequent modes
    assert metrics["modes"] == {"miss": 0, "touch": 0, "slip": 1, "stable": 1}
    assert metrics["z_max_m"] == pytest.approx(0.045)
    assert metrics["friction_to_normal_ratio"] == pytest.approx(0.25)
