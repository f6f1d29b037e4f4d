"""Contact of fingers with fingers and with themselves, forces at contacts, hollow objects in convex parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydantic import ValidationError
from scipy.spatial import ConvexHull

import pliant_plugins.solids as solids
from pliant.errors import MissingDependencyError, UserError
from pliant.interfaces.physics import PhysicsBackend
from pliant.interfaces.simulation import SceneSimulation
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs
from pliant.records.scene import Arm, Scene
from pliant.testing.samples import linear_law, sample_finger
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.mujoco.mjcf import parts_apart, scene_mjcf
from pliant_plugins.physics.pybullet.backend import Pybullet
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.tasks.grasp.task import Grasp

Tasks = Callable[..., Grasp]


def closed(simulation: SceneSimulation, pressure_pa: float, seconds: float = 1.5) -> None:
    """Actuate within half a second, then wait."""
    parts = 25
    for k in range(parts):
        share = min(1.0, 3.0 * (k + 1) / parts)
        simulation.apply([Inputs({"pressure_pa": share * pressure_pa})] * len(simulation.scene.arms))
        simulation.step(seconds / parts)


def facing(grasp: Tasks, finger: ChainModel, touch: bool) -> Scene:
    """Return two fingers that bend toward each other, high above the floor and with nothing between them."""
    task = grasp(fingers=2, base_radius="15 mm", inclination="0 deg", finger_contact=touch)
    return replace(task.scene(finger), objects=(), floor_m=None)


def test_two_fingers_stop_each_other(grasp: Tasks, finger: ChainModel, mujoco: PhysicsBackend) -> None:
    """The first hangs on the +x side and stays there; without contact the fingers pass through each other."""
    across = {}
    for touch in (False, True):
        with mujoco.build_scene(facing(grasp, finger, touch)) as simulation:
            closed(simulation, 4e3)
            across[touch] = [float(simulation.markers(k)[-1, 0]) for k in (0, 1)]
            contacts = simulation.contacts()
        if not touch:
            assert not contacts
    assert across[False][0] < -0.01 < 0.01 < across[False][1]
    assert across[True][0] > across[True][1]
    pressing = [c for c in contacts if c.normal_n > 0.0]
    assert pressing and all((c.first.number, c.second.number) == (0, 1) for c in pressing)
    force = sum(c.normal_n * c.normal + c.friction_n for c in pressing)
    assert force[0] < -1e-3  # on the second finger, away from the first, which is on the +x side
    assert abs(force[1]) < 0.05 * abs(force[0])


def test_a_finger_that_curls_up_meets_itself(mujoco: PhysicsBackend) -> None:
    """Sixteen modules bend by more than a whole turn, so that the tip touches the chain or enters it."""
    law = linear_law(gain=2.0e-6, stiffness=0.05)
    curling = sample_finger(law=law, modules=16)
    depths = {}
    for touch in (False, True):
        scene = Scene((Arm(curling, friction=0.0),), gravity_m_s2=np.zeros(3), arms_touch=touch)
        with mujoco.build_scene(scene) as simulation:
            closed(simulation, 15e3, 3.0)
            places = simulation.markers(0)
            contacts = [c for c in simulation.contacts() if c.normal_n > 0.0]
        assert bool(contacts) == touch
        gaps = np.linalg.norm(places[:, None] - places[None], axis=2)
        depths[touch] = float(gaps[np.triu_indices(len(places), parts_apart(curling) + 1)].min())
    assert depths[False] < 0.8 * depths[True]


def test_near_bodies_in_a_finger_are_no_pair(grasp: Tasks, finger: ChainModel) -> None:
    scene = grasp(finger_contact=True).scene(finger)
    text, geoms = scene_mjcf(scene, MujocoConfig())
    parts = {geom.name: geom.part for geom in geoms}
    apart = parts_apart(finger)
    assert 2 <= apart <= finger.n_joints
    words = [line.split('"') for line in text.split("<pair")[1:]]
    pairs = [(parts[w[w.index(" geom1=") + 1]], parts[w[w.index(" geom2=") + 1]]) for w in words]
    own = [(a, b) for a, b in pairs if a.kind == b.kind == "arm" and a.number == b.number]
    others = {(a.number, b.number) for a, b in pairs if a.kind == b.kind == "arm" and a.number != b.number}
    assert others == {(0, 1), (0, 2), (1, 2)}
    assert own and min(abs(a.body - b.body) for a, b in own) == apart
    usual, _ = scene_mjcf(replace(scene, arms_touch=False), MujocoConfig())
    assert usual.count("<pair") == len(pairs) - sum(a.kind == b.kind == "arm" for a, b in pairs)


def test_bullet_says_that_its_fingers_do_not_touch(grasp: Tasks, finger: ChainModel) -> None:
    with pytest.raises(UserError, match="need physics 'mujoco'"):
        Pybullet(PybulletConfig()).build_scene(grasp(finger_contact=True).scene(finger))


def test_forces_at_contacts_carry_what_is_lifted(
    grasp: Tasks, finger: ChainModel, mujoco: PhysicsBackend
) -> None:
    quick = {"lower_height": "5 mm", "lower_time": "0.2 s", "lift_height": "20 mm", "lift_time": "0.7 s"}
    found = grasp(finger_contact=True, **quick).run(finger, mujoco.build_scene).metrics
    on_object = [row for row in found["contacts"] if row["second"] == "object"]
    assert {row["first"].partition(",")[0] for row in on_object} == {"finger 1", "finger 2", "finger 3"}
    held = np.sum([row["force_n"] for row in on_object], axis=0)
    np.testing.assert_allclose(held, [0.0, 0.0, 0.05 * 9.81], atol=0.02)
    for row in on_object:
        assert np.hypot(row["normal_n"], row["friction_n"]) == pytest.approx(np.linalg.norm(row["force_n"]))


def ring(folder: Path) -> Path:
    path = folder / "ring.stl"
    trimesh.creation.annulus(r_min=12.0, r_max=20.0, height=30.0).export(path)
    return path


def test_a_ring_in_convex_parts_has_a_hole(grasp: Tasks, tmp_path: Path) -> None:
    pytest.importorskip("vhacdx")
    whole, cut = (
        grasp(object={"mesh": ring(tmp_path), "scale": 0.001, "mass": "30 g", "convex_parts": n}).target
        for n in (1, 16)
    )
    assert len(whole.body.shapes) == 1
    assert "'convex_parts: 16'" in whole.note
    assert 4 <= len(cut.body.shapes) <= 16
    np.testing.assert_allclose(cut.body.mass.inertia_kg_m2, whole.body.mass.inertia_kg_m2)
    assert cut.body.position_m == pytest.approx(whole.body.position_m, abs=1e-3)
    hulls = [trimesh.Trimesh(s.mesh.vertices_m, s.mesh.faces) for s in cut.body.shapes if s.mesh is not None]
    volume = np.pi * (0.02**2 - 0.012**2) * 0.03
    assert sum(hull.volume for hull in hulls) == pytest.approx(volume, rel=0.1)
    angles = np.linspace(0.0, 2 * np.pi, 13)
    round_it = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    walls = [ConvexHull(hull.vertices).equations for hull in hulls]
    inside = [
        np.any([(r * round_it @ w[:, :3].T + w[:, 3] < 0.0).all(axis=1) for w in walls], axis=0)
        for r in (0.008, 0.016)
    ]
    assert not inside[0].any()
    assert inside[1].mean() > 0.8  # parts may leave slits where they meet


def test_convex_parts_say_what_they_need(
    grasp: Tasks, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(solids, "find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError, match=r"pliant\[concave\]"):
        _ = grasp(object={"mesh": ring(tmp_path), "scale": 0.001, "mass": "30 g", "convex_parts": 8}).target
    with pytest.raises(ValidationError, match="egg and cylinder are convex"):
        grasp(object={"shape": "egg", "convex_parts": 8})
