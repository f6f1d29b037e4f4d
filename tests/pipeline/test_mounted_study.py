"""A study with a robot on another robot's arm: early refusals, its key, its pictures."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from pliant import api
from pliant.config.loading import load_study
from pliant.config.mjcf_files import referenced_files
from pliant.config.portable import write_portable
from pliant.errors import UserError
from pliant.mechanics.kinematics import ChainGeometry
from pliant.pipeline import study as stages
from pliant.pipeline.motion import run_motion
from pliant.pipeline.study import simulate_study
from pliant.pipeline.workbench import RunContext
from pliant.registry.discovery import discover
from pliant.store.store import ArtifactStore
from pliant_plugins.families.reference import FINGER

REGISTRY = discover()
EXAMPLE = Path(__file__).parents[2] / "examples" / "on_an_arm"
STUDY = {
    "family": {"kind": "bellow_bending", **FINGER},
    "material": {"kind": "neo_hookean", "shear_modulus": "240 kPa"},
    "fem": {"kind": "skfem", "pressure_max": "15 kPa"},
    "task": {"kind": "free_bending", "pressure": "2 kPa"},
    "physics": "mujoco",
}
MOUNT = {"base": {"mount": {"file": "arm.xml", "at": "attachment_site"}}}
MESHED = """<mujoco><compiler meshdir="assets"/><asset><mesh name="link" file="link.obj" inertia="shell"/></asset>
<worldbody><body name="link"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="mesh" mesh="link"/>
<site name="attachment_site"/></body></worldbody></mujoco>"""


@pytest.fixture
def folder(tmp_path):
    shutil.copy(EXAMPLE / "arm.xml", tmp_path)
    shutil.copy(EXAMPLE / "finger.yaml", tmp_path)
    return tmp_path


def run(folder, *overrides, study="finger.yaml"):
    context = RunContext(REGISTRY, ArtifactStore(folder / "store"))
    return context, simulate_study(context, load_study(folder / study, REGISTRY, overrides))


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"physics": "quasistatic"}, "physics 'quasistatic' cannot put a chain on an arm"),
        ({"cross_check": ["quasistatic"]}, "physics 'quasistatic' cannot put a chain on an arm"),
        (
            {"task": {"kind": "reach", "tip": ["1 mm", "1 mm", "1 mm"]}},
            "task 'reach' needs a base that stays",
        ),
        (
            {"chain": {"modules": 3, "base": {"mount": {"file": "arm.xml", "at": "flange"}}}},
            "no site or body",
        ),
        ({"task": {"kind": "grasp", "object": "egg", "pressure": "9 kPa"}}, "task 'grasp' needs a base"),
        (
            {
                "chain": {"modules": 3},
                "physics": "pybullet",
                "task": {"kind": "grasp", "object": "egg", "pressure": "9 kPa", "finger_contact": True},
            },
            "has no contact between fingers",
        ),
        (
            {
                "chain": {"modules": 3},
                "physics": "quasistatic",
                "task": {"kind": "grasp", "object": "egg", "pressure": "9 kPa"},
            },
            "has no contacts",
        ),
    ],
)
def test_an_engine_that_cannot_is_refused_before_fem(folder, monkeypatch, changes, word):
    if changes.get("physics") == "pybullet":
        pytest.importorskip("pybullet")
    monkeypatch.setattr(stages, "build_study_laws", lambda *_: pytest.fail("FEM had begun"))
    (folder / "fem.yaml").write_text(
        json.dumps({"pliant": 1, "name": "f", **STUDY, "chain": {"modules": 3, **MOUNT}, **changes})
    )
    with pytest.raises(UserError, match=word):
        run(folder, study="fem.yaml")


def test_what_needs_a_base_in_the_world_says_so(folder):
    opened = api.open_study(folder / "finger.yaml", store=folder / "store")
    with pytest.raises(UserError, match="A base that stays in the world"):
        api.inverse(opened, {"pressure_pa": (0.0, 15e3)})


def test_what_the_arm_reads_is_in_the_key(folder, tmp_path_factory):
    (folder / "arm.xml").write_text(MESHED)
    (folder / "assets").mkdir()

    def mesh(x: float) -> None:
        text = f"v 0 0 0\nv {x} 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
        (folder / "assets" / "link.obj").write_text(text)

    def key(folder, study="finger.yaml"):
        _, found = run(folder, "chain.base.mount.keyframe=null", "task.steps=1", study=study)
        return found.engines[0].artifact.key

    mesh(1.0)
    first = key(folder)
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    moved = write_portable(folder / "finger.yaml", elsewhere)
    assert key(elsewhere, moved.name) == first  # with its mesh
    mesh(2.0)
    assert key(folder) != first


def test_models_that_an_arm_attaches_are_its_files_with_their_meshes(tmp_path):
    (tmp_path / "hand" / "assets").mkdir(parents=True)
    attached = '<mujoco><compiler meshdir="assets"/><asset><mesh file="nail.obj"/><model file="{}"/></asset></mujoco>'
    whole, hand = tmp_path / "arm.xml", tmp_path / "hand" / "hand.xml"
    whole.write_text(attached.format("hand/hand.xml"))
    hand.write_text(attached.format("../arm.xml"))  # a circle, which MuJoCo refuses
    nail = hand.parent / "assets" / "nail.obj"
    nail.write_text("v 0 0 0\n")
    assert {one.resolve() for one in referenced_files(whole)} == {whole, hand, nail}


def test_pictures_show_the_arm_and_the_chain_where_it_is(folder):
    context, found = run(folder, "task.steps=3")
    result = found.engines[0].result
    motion = run_motion(context, found)
    scene, frames = motion.scene, motion.frames
    assert scene.carriers == len(scene.objects) == 4
    for k, markers in enumerate(result.rollout.markers_m):
        pose = ChainGeometry.from_chain(scene.arms[0].chain).forward(frames.coordinates[0][k])
        placed = pose.moved(frames.carriage_m[k], frames.carriage_turns[k])
        assert np.abs(placed.origins[1:] - markers[1:-1]).max() < 1e-9
    metrics = result.metrics
    assert metrics["mount_moved_m"] > 1e-4  # the servos deflect
    on_mount = [metrics[f"tip_on_mount_{axis}_m"] for axis in "xyz"]
    assert np.allclose(result.final.carrier.in_world(np.array(on_mount)), result.final.tip_m)


def test_the_arm_moves_in_time(folder):
    task = "task={kind: follow_pressure, pressure: 12 kPa, duration: 0.2 s, record: 20 ms}"
    _, found = run(folder, task)
    carrier = found.engines[0].result.rollout.carrier
    assert carrier.coordinates.shape == (11, 3)
    assert np.ptp(carrier.coordinates[:, 2]) > 1e-5
