"""Scenes in PyBullet: shapes, the hidden scale, exact snapshots, arms of every kind of joint."""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import ContractError, UserError
from pliant.records.design import Array
from pliant.records.rollout import Inputs
from pliant.records.scene import Arm, Scene
from pliant.records.shape import Shape, TriangleMesh
from pliant.testing.samples import (
    NO_GRAVITY_M_S2,
    OBJECT_KG,
    lopsided_box,
    pinch_scene,
    pinching,
    sample_box,
    sample_finger,
)
from pliant_plugins.physics.pybullet.arm import WorldScale
from pliant_plugins.physics.pybullet.backend import Pybullet
from pliant_plugins.physics.pybullet.config import PybulletConfig

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("pybullet") is None,
    reason="pybullet is not installed (it has wheels for Python up to 3.11 only)",
)
UPRIGHT = np.eye(3)


def engine(**config: object) -> Pybullet:
    return Pybullet(PybulletConfig(**config))  # type: ignore[arg-type]


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
    """The fall, push and bending do not depend on Bullet's own unit of length."""
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
    # The lower bound of inertia is the same outside, and Bullet's rounding differs.
    np.testing.assert_allclose(markers, wanted_markers, atol=1e-6)
    np.testing.assert_allclose(velocities, wanted_velocities, atol=1e-4)


def test_scaling_keeps_densities_and_turns() -> None:
    scale, box = WorldScale(10.0), lopsided_box()
    piece = scale.piece(box.mass)
    assert piece.mass_kg == pytest.approx(1e3 * box.mass.mass_kg)
    np.testing.assert_allclose(piece.inertia_kg_m2, 1e5 * box.mass.inertia_kg_m2)
    assert scale.force / scale.mass == pytest.approx(scale.length)
    np.testing.assert_allclose(scale.shape(box.shapes[0]).size_m, [0.15, 0.15, 0.15])


def test_nothing_holds_the_carriage_back() -> None:
    """A finger pressed on a block of ten kilograms rises all the same."""
    heavy = sample_box((0.015, 0.015, 0.02), position_m=np.array([0.0, 0.0, 0.02]))
    heavy = replace(heavy, mass=replace(heavy.mass, mass_kg=10.0, inertia_kg_m2=np.eye(3)))
    scene = replace(pinch_scene(), objects=(heavy,))
    velocity = np.array([0.0, 0.01, 0.03])
    with engine().build_scene(scene) as simulation:
        simulation.apply(pinching())
        simulation.step(0.2)
        simulation.carry(velocity)
        for _ in range(5):
            simulation.step(0.02)
        base = simulation.markers(0)[0] - scene.arms[0].chain.base_position_m
        np.testing.assert_allclose(base, 0.1 * velocity, atol=1e-8)


def test_friction_reaches_bullet() -> None:
    """Friction given together with other settings would stay at 0.5."""
    scene = pinch_scene()
    scene = replace(scene, arms=tuple(replace(arm, friction=0.37) for arm in scene.arms), floor_friction=0.2)
    with engine().build_scene(scene) as simulation:
        told = [simulation.client.getDynamicsInfo(arm.body, 1)[1] for arm in simulation.joints]
        assert told == pytest.approx([0.37, 0.37])


@pytest.mark.parametrize(
    ("press", "distance", "counted"),
    [(0.0, 1e-3, False), (0.0, 0.0, True), (0.0, -1e-3, True), (2.0, 1e-3, True), (2.0, -1e-3, True)],
)
def test_points_are_contacts_where_they_press_or_touch(
    monkeypatch: pytest.MonkeyPatch, press: float, distance: float, counted: bool
) -> None:
    """Bullet also lists pairs that are near each other without contact."""
    with engine().build_scene(pinch_scene()) as simulation:
        simulation.apply(pinching())
        simulation.step(0.2)
        points = [(*p[:8], distance, press, *p[10:]) for p in simulation.client.getContactPoints()]
        assert points
        monkeypatch.setattr(simulation.client, "getContactPoints", lambda: points)
        assert len(simulation.contacts()) == (len(points) if counted else 0)


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


def test_bullet_s_own_contact_memory_is_no_part_of_a_study_s_key() -> None:
    assert PybulletConfig().canonical() == PybulletConfig(contact_memory=0.02).canonical()
    assert "contact_memory" not in PybulletConfig().canonical()
    assert PybulletConfig(contact_memory=1e-5).canonical()["contact_memory"] == 1e-5


def test_every_simulation_of_a_process_steps_with_its_own_contact_memory(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Bullet has one number for all clients; the last one built must not have the say."""
    told: list[float] = []
    with (
        engine(contact_memory=1e-5).build_scene(pinch_scene()) as first,
        engine().build_scene(pinch_scene()) as second,
    ):
        for one in (first, second):
            original = one.client.setPhysicsEngineParameter

            def noted(original=original, **given: object) -> None:  # type: ignore[no-untyped-def]
                if "contactBreakingThreshold" in given:
                    told.append(given["contactBreakingThreshold"])  # type: ignore[arg-type]
                original(**given)

            monkeypatch.setattr(one.client, "setPhysicsEngineParameter", noted)
        for one in (first, second, first):
            one.step(1e-3)
    assert told == [1e-5, 0.02, 1e-5]
