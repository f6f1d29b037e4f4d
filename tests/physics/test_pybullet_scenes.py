"""Scenes in PyBullet: shapes, the hidden scale, exact snapshots, arms of every kind of joint."""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import ContractError, UserError
from pliant.mechanics.rotations import exp_map
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.records.chain import Actuator
from pliant.records.design import Array
from pliant.records.rollout import Inputs
from pliant.records.scene import Arm, Part, Scene
from pliant.records.shape import Shape, TriangleMesh
from pliant.testing.samples import (
    NO_GRAVITY_M_S2,
    OBJECT_KG,
    PRESSURE_PA,
    linear_law,
    linear_prismatic_law,
    linear_spherical_law,
    lopsided_box,
    pinch_scene,
    pinching,
    sample_box,
    sample_finger,
    softening_law,
)
from pliant_plugins.physics.pybullet.backend import Pybullet
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.pybullet.scaling import WorldScale
from pliant_plugins.physics.pybullet.scene import SceneEfforts
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("pybullet") is None,
    reason="pybullet is not installed (it has wheels for Python up to 3.11 only)",
)
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
}


def engine(**config: object) -> Pybullet:
    return Pybullet(PybulletConfig(**config))  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", RESTING)
def test_every_shape_rests_at_its_own_height(kind: str) -> None:
    shape, height = RESTING[kind]
    box = sample_box(shapes=(shape,), position_m=np.array([0.0, 0.0, height]))
    with engine().build_scene(Scene((), (box,), floor_m=0.0)) as simulation:
        simulation.step(0.5)
        state, contacts = simulation.snapshot(), simulation.contacts()
    assert state.positions_m[0, 2] == pytest.approx(height, abs=1.5e-4)
    assert contacts and all(c.first == Part("object") and c.second == Part("floor") for c in contacts)


def test_shapes_stand_where_the_body_has_them() -> None:
    """A box of two shapes off its origin rests on the lower one."""
    low = Shape("box", (0.01, 0.01, 0.005), np.array([0.0, 0.0, -0.02]), UPRIGHT)
    high = Shape("sphere", (0.004,), np.array([0.0, 0.0, 0.02]), UPRIGHT)
    box = sample_box(shapes=(low, high), position_m=np.array([0.0, 0.0, 0.026]))
    with engine().build_scene(Scene((), (box,), floor_m=0.0)) as simulation:
        simulation.step(0.5)
        assert simulation.snapshot().positions_m[0, 2] == pytest.approx(0.025, abs=1e-4)


@pytest.mark.parametrize(
    ("mesh", "says"),
    [
        (TriangleMesh(np.eye(4, 3) * [1, 1, 0], np.array([[0, 1, 2]])), "no volume"),
        (None, "has no mesh"),
    ],
)
def test_meshes_without_volume_are_refused(mesh: TriangleMesh | None, says: str) -> None:
    box = sample_box(shapes=(Shape("mesh", (), np.zeros(3), UPRIGHT, mesh),))
    with pytest.raises(UserError, match=says):
        engine().build_scene(Scene((), (box,)))


@pytest.mark.parametrize("scale", [1.0, 3.0, 25.0])
def test_the_scale_is_not_seen_outside(scale: float) -> None:
    """The same fall, push and bending, whatever Bullet's own unit of length is."""
    finger = sample_finger((0.2, 0.0, 0.3))
    scene = Scene((Arm(finger),), (lopsided_box(),), gravity_m_s2=np.array([0.0, 1.0, -5.0]))

    def run(world_scale: float) -> tuple[Array, Array]:
        with engine(world_scale=world_scale).build_scene(scene) as simulation:
            simulation.apply([Inputs({"pressure_pa": 8e3}, tip_force_n=np.array([0.0, 0.1, 0.0]))])
            simulation.push(0, np.array([0.03, 0.0, 0.0]), np.array([0.0, 0.0, 1e-5]))
            simulation.step(0.05)
            return simulation.markers(0), simulation.snapshot().velocities

    markers, velocities = run(scale)
    wanted_markers, wanted_velocities = run(10.0)
    # The floor of inertia is the same outside, and Bullet's rounding differs.
    np.testing.assert_allclose(markers, wanted_markers, atol=1e-6)
    np.testing.assert_allclose(velocities, wanted_velocities, atol=1e-4)


def test_scaling_keeps_densities_and_turns() -> None:
    scale, box = WorldScale(10.0), lopsided_box()
    piece = scale.piece(box.mass)
    assert piece.mass_kg == pytest.approx(1e3 * box.mass.mass_kg)
    np.testing.assert_allclose(piece.inertia_kg_m2, 1e5 * box.mass.inertia_kg_m2)
    assert scale.force / scale.mass == pytest.approx(scale.length)
    np.testing.assert_allclose(scale.shape(box.shapes[0]).size_m, [0.15, 0.15, 0.15])


@pytest.mark.parametrize("law", [linear_spherical_law(), linear_prismatic_law()], ids=["ball", "slide"])
def test_arms_of_other_joints_settle_in_a_scene(law) -> None:
    finger = sample_finger(law=law, modules=1)
    inputs = Inputs({"pressure_pa": PRESSURE_PA})
    with engine(joint_damping=1e-4 if law.joint == "spherical" else 2.0).build_scene(
        Scene((Arm(finger),))
    ) as simulation:
        simulation.apply([inputs])
        for _ in range(25):
            simulation.step(0.02)
        q = simulation.snapshot().coordinates[0]
    residual = np.abs(ChainStatics(finger).residual(q, Loads.of(finger, inputs))).max()
    assert residual < 1e-3 * np.abs(law.gain).max() * PRESSURE_PA
    assert np.abs(q).max() > 1e-4


def test_a_settled_arm_is_where_the_quasistatic_engine_puts_it() -> None:
    finger = sample_finger((0.0, 0.1, 0.2), softening_law(), modules=4, payload=0.003)
    inputs = Inputs({"pressure_pa": PRESSURE_PA})
    with Quasistatic(QuasistaticConfig()).build(finger) as chain:
        chain.apply(inputs)
        wanted = chain.settle().markers_m
    with engine(joint_damping=4e-4).build_scene(Scene((Arm(finger),))) as simulation:
        simulation.apply([inputs])
        for _ in range(75):
            simulation.step(0.02)
        np.testing.assert_allclose(simulation.markers(0), wanted, atol=1e-5)


def test_arms_under_different_pressures_share_no_effort() -> None:
    """Arms of one law are one call; other laws, pressures, signs and terms make groups of their own."""
    pair = (Actuator("pressure_1_pa", 1.0), Actuator("pressure_2_pa", -1.0))
    chains = [
        sample_finger(law=softening_law(), modules=2),
        sample_finger(law=softening_law(), modules=3),
        sample_finger(law=linear_law(), modules=4),
        sample_finger(law=linear_law(), modules=2).with_(actuators=pair),
    ]
    given = [{"pressure_pa": 5e3}, {"pressure_pa": 9e3}, {"pressure_pa": 9e3}]
    actuations = [*given, {"pressure_1_pa": 1e3, "pressure_2_pa": 4e3}]
    loads = [Loads.of(c, Inputs(a)) for c, a in zip(chains, actuations, strict=True)]
    efforts = SceneEfforts(chains)
    efforts.under(loads)
    random = np.random.default_rng(3)
    q = [random.uniform(-0.3, 0.3, (chain.n_joints, 1)) for chain in chains]
    for chain, load, at, got in zip(chains, loads, q, efforts.evaluate(q), strict=True):
        np.testing.assert_allclose(got, ChainStatics(chain).effort(at, load), rtol=1e-12)


def test_snapshots_are_exact_and_move_to_another_simulation() -> None:
    """Bullet's world goes with the snapshot, so even contact impulses are those of the first simulation."""

    def on(simulation, steps: int = 5) -> tuple[Array, ...]:
        for _ in range(steps):
            simulation.step(0.02)
        state = simulation.snapshot()
        return (*state.coordinates, *state.rates, state.positions_m, state.rotations, state.velocities)

    scene, lift = pinch_scene(), np.array([0.0, 0.0, 0.03])
    with engine().build_scene(scene) as first, engine().build_scene(scene) as second:
        first.apply(pinching())
        on(first, 25)
        first.carry(lift)
        on(first)
        kept = first.snapshot()
        wanted = on(first)
        second.apply(pinching())
        second.carry(lift)
        for simulation in (first, second):
            simulation.restore(kept)
            for a, b in zip(on(simulation), wanted, strict=True):
                np.testing.assert_array_equal(a, b)
        # Coordinates alone, as another engine would give them: contacts begin anew.
        first.restore(replace(kept, private={}))
        np.testing.assert_allclose(first.snapshot().positions_m, kept.positions_m, atol=1e-12)
        np.testing.assert_allclose(first.snapshot().coordinates, kept.coordinates, atol=1e-12)
        np.testing.assert_allclose(on(first)[4], wanted[4], atol=1e-5)


def test_nothing_holds_the_carriage_back() -> None:
    """A finger pressed on a block of ten kilograms rises all the same."""
    heavy = sample_box((0.015, 0.015, 0.02), position_m=np.array([0.0, 0.0, 0.02]))
    heavy = replace(heavy, mass=replace(heavy.mass, mass_kg=10.0, inertia_kg_m2=np.eye(3)))
    scene = replace(pinch_scene(), objects=(heavy,))
    velocity = np.array([0.0, 0.01, 0.03])
    with engine().build_scene(scene) as simulation:
        simulation.apply(pinching())
        simulation.step(0.4)
        simulation.carry(velocity)
        for _ in range(10):
            simulation.step(0.02)
        base = simulation.markers(0)[0] - scene.arms[0].chain.base_position_m
        np.testing.assert_allclose(base, 0.2 * velocity, atol=1e-8)


def test_friction_reaches_bullet() -> None:
    """Friction given together with other settings would stay at 0.5."""
    scene = pinch_scene()
    scene = replace(scene, arms=tuple(replace(arm, friction=0.37) for arm in scene.arms), floor_friction=0.2)
    with engine().build_scene(scene) as simulation:
        world = simulation._world
        bodies = [arm.body for arm in world.arms]
        told = [world.bullet.getDynamicsInfo(b, 1, physicsClientId=world.client)[1] for b in bodies]
        assert told == pytest.approx([0.37, 0.37])


def test_runaway_arms_are_an_error_with_advice() -> None:
    finger = sample_finger(law=linear_law(stiffness=-0.4))
    with engine().build_scene(Scene((Arm(finger),))) as simulation:
        simulation.apply([Inputs({"pressure_pa": PRESSURE_PA})])
        with pytest.raises(UserError, match="moves without bounds at 0.*joint_damping"):
            simulation.step(5.0)


def test_wrong_inputs_are_told() -> None:
    with engine().build_scene(pinch_scene()) as simulation:
        with pytest.raises(ContractError, match="2 arms and got inputs for 1"):
            simulation.apply(pinching()[:1])
        with pytest.raises(UserError, match="pressure_pa"):
            simulation.apply([Inputs({"tendon_force_n": 1.0})] * 2)
        with pytest.raises(IndexError):
            simulation.push(1, np.ones(3))


def test_a_failed_build_leaves_no_client() -> None:
    import pybullet

    flat = sample_box(shapes=(Shape("mesh", (), np.zeros(3), UPRIGHT),))
    for _ in range(3):
        with pytest.raises(UserError):
            engine().build_scene(Scene((), (flat,)))
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.disconnect(client)
    with engine().build_scene(Scene((), (sample_box(),), gravity_m_s2=NO_GRAVITY_M_S2)) as simulation:
        simulation.push(0, np.array([OBJECT_KG, 0.0, 0.0]))
        simulation.step(0.1)
        assert simulation.snapshot().velocities[0, 0] == pytest.approx(0.1, rel=1e-6)
