"""Scenes in both engines beyond the conformance suite: every shape, exact snapshots, motion of single arms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend
from pliant.interfaces.simulation import SceneSimulation
from pliant.mechanics.rotations import exp_map
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.rollout import Inputs
from pliant.records.scene import Arm, Part, Scene
from pliant.records.shape import Shape, TriangleMesh
from pliant.testing.samples import (
    OBJECT_KG,
    PRESSURE_PA,
    linear_law,
    pinch_scene,
    pinching,
    sample_box,
    sample_finger,
)
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig

UPRIGHT = np.eye(3)
TETRAHEDRON = TriangleMesh(
    0.02 * np.array([[1.0, 0, 0], [-0.5, 0.9, 0], [-0.5, -0.9, 0], [0, 0, 1.2]]) - [0, 0, 0.006],
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
)
# Shapes with the height of their origin above the floor at rest.
RESTING = {
    "box": (Shape("box", (0.02, 0.015, 0.01), np.zeros(3), UPRIGHT), 0.01),
    "sphere": (Shape("sphere", (0.02,), np.zeros(3), UPRIGHT), 0.02),
    "cylinder": (Shape("cylinder", (0.015, 0.012), np.zeros(3), UPRIGHT), 0.012),
    "capsule": (Shape("capsule", (0.01, 0.02), np.zeros(3), exp_map(np.array([np.pi / 2, 0, 0]))), 0.01),
    "ellipsoid": (Shape("ellipsoid", (0.03, 0.03, 0.02), np.zeros(3), UPRIGHT), 0.02),
    "mesh": (Shape("mesh", (), np.zeros(3), UPRIGHT, TETRAHEDRON), 0.006),
    "off the origin": (Shape("box", (0.01, 0.01, 0.005), np.array([0.0, 0.0, -0.02]), UPRIGHT), 0.025),
}
CLOSE_M = {"mujoco": 5e-5, "pybullet": 1.5e-4}


@pytest.mark.parametrize("kind", RESTING)
def test_every_shape_rests_at_its_own_height(kind: str, dynamic_engine: PhysicsBackend) -> None:
    shape, height = RESTING[kind]
    box = sample_box(shapes=(shape,), position_m=np.array([0.0, 0.0, height]))
    with dynamic_engine.build_scene(Scene((), (box,), floor_m=0.0)) as simulation:
        simulation.step(0.5)
        state, contacts = simulation.snapshot(), simulation.contacts()
    assert state.positions_m[0, 2] == pytest.approx(height, abs=CLOSE_M[dynamic_engine.config.kind])
    assert contacts and all({c.first, c.second} == {Part("object"), Part("floor")} for c in contacts)
    if dynamic_engine.config.kind == "mujoco":  # in PyBullet some still rock
        assert sum(c.normal_n for c in contacts) == pytest.approx(9.81 * OBJECT_KG, rel=1e-3)


def test_a_contact_says_how_deep_it_is() -> None:
    """A ball sinks into the floor by g (1 − d) / k, with the stiffness k per mass and the impedance d of the config."""
    config = MujocoConfig(contact_stiffness=1e3)
    shape, height = RESTING["sphere"]
    ball = sample_box(shapes=(shape,), position_m=np.array([0.0, 0.0, height]))
    with Mujoco(config).build_scene(Scene((), (ball,), floor_m=0.0)) as simulation:
        simulation.step(3.0)
        (contact,) = simulation.contacts()
        sunk_m = height - simulation.snapshot().positions_m[0, 2]
    d = config.contact_impedance
    assert contact.depth_m == pytest.approx(9.81 * (1 - d) / config.contact_stiffness, rel=0.01)
    assert contact.depth_m == pytest.approx(sunk_m, abs=1e-7)


def on(simulation: SceneSimulation, steps: int = 5) -> tuple[Array, ...]:
    """Return everything that moves, some steps later."""
    for _ in range(steps):
        simulation.step(0.02)
    state = simulation.snapshot()
    return (*state.coordinates, *state.rates, state.positions_m, state.rotations, state.velocities)


def test_snapshots_are_exact_and_move_to_another_simulation(dynamic_engine: PhysicsBackend) -> None:
    """The snapshot includes the engine's own part, so even contact impulses are those of the first simulation."""
    scene, lift = pinch_scene(), np.array([0.0, 0.0, 0.03])
    with dynamic_engine.build_scene(scene) as first, dynamic_engine.build_scene(scene) as second:
        first.apply(pinching())
        on(first, 10)
        first.carry(lift)
        on(first)
        kept, touching = first.snapshot(), {(c.first, c.second) for c in first.contacts()}
        wanted = on(first)
        second.apply(pinching())
        second.carry(lift)
        for simulation in (first, second):
            simulation.restore(kept)
            assert {(c.first, c.second) for c in simulation.contacts()} == touching
            for a, b in zip(on(simulation), wanted, strict=True):
                np.testing.assert_array_equal(a, b)
        # Coordinates alone, as another engine would give them: contacts start from zero.
        first.restore(replace(kept, private={}))
        np.testing.assert_allclose(first.snapshot().positions_m, kept.positions_m, atol=1e-12)
        np.testing.assert_allclose(first.snapshot().coordinates, kept.coordinates, atol=1e-12)
        if dynamic_engine.config.kind == "pybullet":
            np.testing.assert_allclose(on(first)[4], wanted[4], atol=1e-5)


def test_arms_move_alike_alone_and_in_a_scene(loaded_finger: ChainModel) -> None:
    """Loads, efforts and bases of two arms arrive at the right joints."""
    other = loaded_finger.with_(base_position_m=np.array([0.1, 0.0, 0.0]), payload_kg=0.0)
    inputs = [
        Inputs({"pressure_pa": 9e3}, tip_force_n=np.array([0.01, 0.02, 0.0])),
        Inputs({"pressure_pa": 5e3}, moment_n_m=1e-3),
    ]
    backend = Mujoco(MujocoConfig(timestep_s=1e-3, joint_damping=1e-4, drag_1_s=0.0))
    with backend.build_scene(Scene((Arm(loaded_finger), Arm(other)))) as scene:
        scene.apply(inputs)
        scene.step(0.05)
        together = [scene.markers(k) for k in range(2)]
        angles = scene.snapshot().coordinates
    for k, chain in enumerate((loaded_finger, other)):
        with backend.build(chain) as alone:
            alone.apply(inputs[k])
            alone.step(0.05)
            np.testing.assert_allclose(together[k], alone.markers(), atol=1e-7)
            np.testing.assert_allclose(angles[k], alone.snapshot().position, atol=1e-5)


def test_unbounded_motion_is_an_error_that_says_what_to_change(dynamic_engine: PhysicsBackend) -> None:
    finger = sample_finger(law=linear_law(stiffness=-0.4))
    with dynamic_engine.build_scene(Scene((Arm(finger),), (sample_box(),))) as simulation:
        simulation.apply([Inputs({"pressure_pa": PRESSURE_PA})])
        simulation.push(0, np.array([1e300, 0.0, 0.0]))
        with pytest.raises(UserError, match="bound.*timestep"):
            simulation.step(5.0)
