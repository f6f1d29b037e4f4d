"""Scenes in MuJoCo by law: free fall, rest, friction cone, holding on a moving carriage, exact snapshots."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.interfaces.physics import SceneSimulation
from pliant.mechanics.rotations import exp_map
from pliant.records.chain import ChainModel
from pliant.records.design import MassProperties
from pliant.records.rollout import Inputs
from pliant.records.scene import Arm, FreeBody, Scene, SceneState
from pliant.records.shape import Shape, TriangleMesh
from pliant.testing.samples import linear_law, sample_chain
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig

G = 9.81
SIDE_M, MASS_KG = 0.02, 0.03
FINGER = {"law": linear_law(gain=2e-6, stiffness=0.04), "modules": 4}


def block(z_m: float, friction: float = 1.0, mass_kg: float = MASS_KG, x_m: float = 0.0) -> FreeBody:
    """A cube of 20 mm."""
    mass = MassProperties(mass_kg, np.zeros(3), mass_kg * SIDE_M**2 / 6 * np.eye(3))
    shape = Shape("box", (SIDE_M / 2,) * 3, np.zeros(3), np.eye(3))
    return FreeBody("block", mass, (shape,), friction, np.array([x_m, 0.0, z_m]), np.eye(3))


def pincers(friction: float = 0.8) -> Scene:
    """Two fingers that close on a block on the floor; positive bending turns each toward the middle."""
    arms = []
    for side, yaw in ((-1.0, 0.0), (1.0, np.pi)):
        base = {"position": [side * 0.019, 0.0, 0.058]}
        chain = sample_chain(**FINGER, base=base)  # type: ignore[arg-type]
        pads = [()] * chain.n_joints + [(Shape("sphere", (0.006,), np.array([0.005, 0, 0]), np.eye(3)),)]
        turned = exp_map(np.array([0.0, 0.0, yaw])) @ chain.base_rotation
        arms.append(Arm(chain.with_(base_rotation=turned, shapes=tuple(pads)), friction))
    return Scene(tuple(arms), (block(SIDE_M / 2),), floor_m=0.0)


def build(scene: Scene, **config: object) -> SceneSimulation:
    return Mujoco(MujocoConfig(joint_damping=1e-3, **config)).build_scene(scene)  # type: ignore[arg-type]


def pinch(simulation: SceneSimulation, pressure: float = 15e3) -> None:
    simulation.apply([Inputs({"pressure_pa": pressure})] * 2)


def test_after_restore_the_same_steps_give_the_same_bits() -> None:
    def motion(simulation: SceneSimulation) -> SceneState:
        simulation.step(0.011)
        simulation.step(0.1)
        return simulation.snapshot()

    with build(pincers()) as simulation:
        pinch(simulation)
        simulation.carry(np.array([0.0, 0.0, 0.02]))
        simulation.step(0.23)
        kept, seen = simulation.snapshot(), simulation.contacts()
        first = motion(simulation)
        simulation.restore(kept)
        assert {(c.first, c.second) for c in simulation.contacts()} == {(c.first, c.second) for c in seen}
        again = motion(simulation)
    np.testing.assert_array_equal(first.positions_m, again.positions_m)
    np.testing.assert_array_equal(first.velocities, again.velocities)
    np.testing.assert_array_equal(first.coordinates, again.coordinates)
    np.testing.assert_array_equal(first.rates, again.rates)


def test_a_state_without_the_engine_s_own_part_is_taken_up() -> None:
    """What another engine left is a place to go on from."""
    with build(pincers()) as simulation:
        pinch(simulation)
        simulation.step(0.3)
        kept = simulation.snapshot()
        bare = SceneState(
            kept.time_s, kept.carriage_m, kept.coordinates, kept.rates, kept.positions_m, kept.rotations,
            kept.velocities,
        )  # fmt: skip
        simulation.step(0.1)
        simulation.restore(bare)
        back = simulation.snapshot()
    np.testing.assert_allclose(back.coordinates, kept.coordinates, atol=1e-15)
    np.testing.assert_allclose(back.positions_m, kept.positions_m, atol=1e-15)
    np.testing.assert_allclose(back.velocities, kept.velocities, atol=1e-15)


SHAPES: dict[str, tuple[Shape, float]] = {
    "sphere": (Shape("sphere", (0.01,), np.zeros(3), np.eye(3)), 0.01),
    "capsule": (Shape("capsule", (0.004, 0.006), np.zeros(3), np.eye(3)), 0.01),
    "cylinder": (Shape("cylinder", (0.01, 0.007), np.zeros(3), np.eye(3)), 0.007),
    "ellipsoid": (Shape("ellipsoid", (0.012, 0.012, 0.009), np.zeros(3), np.eye(3)), 0.009),
    "box": (Shape("box", (0.01, 0.01, 0.004), np.zeros(3), np.eye(3)), 0.004),
    "mesh": (
        Shape(
            "mesh",
            (),
            np.zeros(3),
            np.eye(3),
            TriangleMesh(
                0.01 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1], [0, 0, -1], [1, 1, -1.0],
                                 [-1, -1, -1]]),
                np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]),
            ),
        ),
        0.01,
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", SHAPES)
def test_every_shape_rests_on_the_floor_at_its_height(kind: str) -> None:
    shape, height = SHAPES[kind]
    mass = MassProperties(0.02, np.zeros(3), 1e-6 * np.eye(3))
    free = FreeBody(kind, mass, (shape,), 1.0, np.array([0, 0, height + 1e-4]), np.eye(3))
    with build(Scene((), (free,), floor_m=0.0)) as simulation:
        simulation.step(0.5)
        assert simulation.snapshot().positions_m[0, 2] == pytest.approx(height, abs=5e-5)
        total = sum(c.normal_n for c in simulation.contacts())
    assert total == pytest.approx(0.02 * G, rel=1e-3)


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


def test_unbounded_motion_is_an_error_that_says_what_to_change() -> None:
    with build(pincers()) as simulation:
        simulation.push(0, np.array([1e300, 0.0, 0.0]))
        with pytest.raises(UserError, match="unbounded before 0.01 s .*contact_timestep"):
            simulation.step(0.01)
