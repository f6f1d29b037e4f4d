"""Arms on free objects: momentum and energy are conserved, MuJoCo and PyBullet agree, snapshots restore."""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from tests.tasks.conftest import built

from pliant.config.chain import BaseConfig
from pliant.errors import UserError
from pliant.mechanics.contact_statics import with_capsules
from pliant.mechanics.kinematics import ChainGeometry
from pliant.pipeline.chain import base_rotation
from pliant.records.chain import ChainModel
from pliant.records.design import Array, MassProperties
from pliant.records.rollout import Inputs
from pliant.records.scene import Arm, FreeBody, Scene, SceneState

ENGINES = ["mujoco", "pybullet"] if importlib.util.find_spec("pybullet") else ["mujoco"]
# Internal damping changes no momentum; without it engines need shorter steps to agree on the chains' vibrations.
FINE = {
    "mujoco": {"joint_damping": 1e-3, "timestep": "0.1 ms", "contact_timestep": "0.1 ms"},
    "pybullet": {"joint_damping": 1e-3, "timestep": "0.1 ms"},
}
STEP_S, STEPS, PRESSURE = 0.01, 12, 8e3


def crawler(chain: ChainModel, arms: int = 2, **scene: object) -> Scene:
    """Return a body that is turned in space, lopsided, with arms at odd places and attitudes."""
    turn = base_rotation(BaseConfig(direction=(0.3, -0.5, 0.4), roll_rad=0.7))
    mass = MassProperties(0.02, np.array([3e-3, -2e-3, 1e-3]), 1e-6 * np.diag([3.0, 4.0, 5.0]))
    body = FreeBody("body", mass, (), 0.5, np.array([0.1, 0.2, 0.3]), turn)
    bases = [((1.0, 0.2, 0.0), 0.3, (0.12, 0.2, 0.3)), ((-1.0, 0.1, 0.4), -1.0, (0.09, 0.21, 0.3))][:arms]
    own = [
        chain.with_(
            base_position_m=np.array(place),
            base_rotation=base_rotation(BaseConfig(direction=way, roll_rad=roll)),
        )
        for way, roll, place in bases
    ]
    given = {"gravity_m_s2": np.zeros(3), **scene}
    return Scene(tuple(Arm(one, 0.5, 0) for one in own), (body,), **given)  # type: ignore[arg-type]


def momenta(scene: Scene, before: SceneState, after: SceneState) -> tuple[Array, Array]:
    """Return total momentum (N·s) and angular momentum about the origin (N·m·s) between two near states."""
    dt = after.time_s - before.time_s
    linear, angular = np.zeros(3), np.zeros(3)
    for one, other in zip(pieces(scene, before), pieces(scene, after), strict=True):
        mass, place, turn, inertia = one
        middle, velocity = 0.5 * (place + other[1]), (other[1] - place) / dt
        change = other[2] @ turn.T
        spin = np.array([change[2, 1], change[0, 2], change[1, 0]]) - np.array(
            [change[1, 2], change[2, 0], change[0, 1]]
        )
        linear += mass * velocity
        angular += mass * np.cross(middle, velocity) + turn @ inertia @ turn.T @ spin / (2 * dt)
    return linear, angular


def pieces(scene: Scene, state: SceneState) -> list[tuple[float, Array, Array, Array]]:
    """Return mass, centre, attitude and inertia of every rigid piece."""
    found = []
    for body, place, turn in zip(scene.objects, state.positions_m, state.rotations, strict=True):
        found.append((body.mass.mass_kg, place + turn @ body.mass.com_m, turn, body.mass.inertia_kg_m2))
    for number, (arm, q) in enumerate(zip(scene.arms, state.coordinates, strict=True)):
        moved = scene.base_motion(number, state.carriage_m, state.positions_m, state.rotations)
        pose = ChainGeometry.from_chain(arm.chain).forward(q).moved(*moved)
        for piece, origin, turn in zip(arm.chain.bodies, pose.origins, pose.rotations, strict=True):
            found.append((piece.mass_kg, origin + turn @ piece.com_m, turn, piece.inertia_kg_m2))
    return found


def states(kind: str, scene: Scene, share: tuple[float, ...] = (1.0, 0.4)) -> list[SceneState]:
    with built("physics", kind, **FINE[kind]).build_scene(scene) as simulation:
        simulation.apply([Inputs({"pressure_pa": one * PRESSURE}) for one in share[: len(scene.arms)]])
        found = [simulation.snapshot()]
        for _ in range(STEPS):
            simulation.step(STEP_S)
            found.append(simulation.snapshot())
        return found


@pytest.mark.parametrize("kind", ENGINES)
def test_momentum_of_a_floating_robot_stays_zero(finger: ChainModel, kind: str) -> None:
    """Two arms that are actuated in free space turn the body, and the sums of momenta stay zero."""
    scene = crawler(finger)
    path = states(kind, scene)
    moved = max(float(np.linalg.norm(s.positions_m[0] - path[0].positions_m[0])) for s in path)
    assert moved > 1e-3
    for k in range(1, len(path) - 1):
        linear, angular = momenta(scene, path[k - 1], path[k + 1])
        sizes = sum(p[0] for p in pieces(scene, path[k])) * moved / STEP_S
        assert np.linalg.norm(linear) < 0.01 * sizes
        about = angular - np.cross(path[k].positions_m[0], linear)
        assert np.linalg.norm(about) < 0.01 * sizes * finger.length_m


@pytest.mark.parametrize("kind", ENGINES)
def test_a_falling_robot_falls_as_a_stone(finger: ChainModel, kind: str) -> None:
    scene = crawler(finger, gravity_m_s2=np.array([0.0, 0.0, -9.81]))
    path = states(kind, scene)
    mass = np.array([p[0] for p in pieces(scene, path[0])])
    centres = [mass @ np.array([p[1] for p in pieces(scene, s)]) / mass.sum() for s in (path[0], path[-1])]
    fallen = 0.5 * 9.81 * (STEPS * STEP_S) ** 2
    np.testing.assert_allclose(centres[1] - centres[0], [0.0, 0.0, -fallen], atol=0.01 * fallen)


@pytest.mark.skipif(len(ENGINES) < 2, reason="pybullet is not installed")
def test_engines_agree_on_a_floating_robot(finger: ChainModel) -> None:
    one, other = (states(kind, crawler(finger)) for kind in ENGINES)
    far = float(np.linalg.norm(one[-1].positions_m - one[0].positions_m))
    np.testing.assert_allclose(one[-1].positions_m, other[-1].positions_m, atol=0.005 * far)
    np.testing.assert_allclose(one[-1].rotations, other[-1].rotations, atol=2e-3)
    for ours, theirs in zip(one[-1].coordinates, other[-1].coordinates, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=2e-3)


@pytest.mark.parametrize("kind", ENGINES)
def test_a_state_returns_and_crosses_engines(finger: ChainModel, kind: str) -> None:
    """Restored, a robot on a floor goes on exactly; another engine takes over its pose and velocity."""
    chain = with_capsules(finger, 5e-3)
    scene = crawler(chain, floor_m=0.22, gravity_m_s2=np.array([0.0, 0.0, -9.81]))
    engine = built("physics", kind, **FINE[kind])
    with engine.build_scene(scene) as simulation:
        simulation.apply([Inputs({"pressure_pa": PRESSURE})] * 2)
        simulation.step(0.05)
        middle = simulation.snapshot()
        simulation.step(0.05)
        end = simulation.snapshot()
        simulation.restore(middle)
        simulation.step(0.05)
        np.testing.assert_array_equal(simulation.snapshot().positions_m, end.positions_m)
        simulation.restore(replace(middle, private={}))
        again = simulation.snapshot()
        np.testing.assert_allclose(again.positions_m, middle.positions_m, atol=1e-9)
        np.testing.assert_allclose(again.velocities, middle.velocities, atol=1e-6)
        np.testing.assert_allclose(again.coordinates[1], middle.coordinates[1], atol=1e-9)
        markers = simulation.markers(1)
        motion = scene.base_motion(1, middle.carriage_m, middle.positions_m, middle.rotations)
        pose = ChainGeometry.from_chain(chain).forward(middle.coordinates[1])
        assert motion[1] is not None
        base = np.asarray(scene.arms[1].chain.base_position_m)
        np.testing.assert_allclose(markers[0], motion[0] + motion[1] @ base, atol=1e-9)
        assert pose.origins.shape[0] == markers.shape[0] - 1


def test_a_base_piece_of_an_arm_weighs_on_its_object(finger: ChainModel) -> None:
    """On the floor the contact forces of body and arms carry the weight of everything."""
    chain = with_capsules(finger, 5e-3)
    scene = crawler(chain, floor_m=0.0, gravity_m_s2=np.array([0.0, 0.0, -9.81]))
    for kind in ENGINES:
        with built("physics", kind, joint_damping=3e-3).build_scene(scene) as simulation:
            simulation.apply([Inputs({"pressure_pa": 0.0})] * 2)
            simulation.step(2.0)
            lifted = sum(c.normal_n * -c.normal[2] for c in simulation.contacts() if c.second.kind == "floor")
            lifted += sum(c.normal_n * c.normal[2] for c in simulation.contacts() if c.first.kind == "floor")
        weight = 9.81 * sum(p[0] for p in pieces(scene, states_at_rest(scene)))
        assert lifted == pytest.approx(weight, rel=0.03)


def states_at_rest(scene: Scene) -> SceneState:
    with built("physics", "mujoco").build_scene(scene) as simulation:
        return simulation.snapshot()


def test_too_many_joints_on_one_object_are_refused(finger: ChainModel) -> None:
    pytest.importorskip("pybullet")
    scene = crawler(finger)
    many = replace(scene, arms=scene.arms * 12)
    with pytest.raises(UserError, match="24 chains of one body have 144"):
        built("physics", "pybullet").build_scene(many)
