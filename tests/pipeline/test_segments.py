"""Chains of every kind from a YAML study to settled chains: joints, segments, rigid parts, laws per segment."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pliant.config.loading import load_study
from pliant.errors import UserError
from pliant.execution.progress import Silent
from pliant.mechanics.kinematics import ChainGeometry
from pliant.mechanics.statics import ChainStatics, Loads
from pliant.pipeline.run_folder import finished, read_folder, write_folder
from pliant.pipeline.study import StudyRun, build_study_chain, simulate_study
from pliant.pipeline.workbench import RunContext
from pliant.records.chain import ChainModel
from pliant.records.rollout import Inputs
from pliant.registry.discovery import discover
from pliant.store.store import ArtifactStore

REGISTRY = discover()
TASKS_PAGE = Path(__file__).parents[2] / "docs/tasks.md"
ENGINES = ["mujoco", *(["pybullet"] if importlib.util.find_spec("pybullet") else [])]


def stated(k_n: float = 1.6e-6, m_e: float = 0.1, b_e: float = 0.03, **more: Any) -> dict[str, Any]:
    numbers = {"k_n": k_n, "m_a": -1e-6 if k_n else 0.0, "m_e": m_e, "b_e": b_e}
    return {"kind": "polynomial", "form": "study", "odd": True, "coefficients": numbers, **more}


def axis(**numbers: float) -> dict[str, Any]:
    return {key: value for key, value in stated(**numbers).items() if key != "kind"}


SPHERICAL = {
    "kind": "polynomial",
    "axes": {"x": axis(k_n=0.0, b_e=0.04), "y": axis(), "z": axis(k_n=3e-7, b_e=0.05)},
}
PRISMATIC = {
    "kind": "polynomial",
    "form": "study",
    "joint": "prismatic",
    "coefficients": {"k_n": 1e-4, "m_a": 0, "m_e": 2e4, "b_e": 300},
}
ROD = {"module_length": "11 mm", "module_mass": "1.6 g"}
TURNED = [{"modules": 2}, {"modules": 2, "rotation": "70 deg"}]
WITH_RIGID = [
    {"rigid": {"length": "20 mm", "mass": "5 g", "radius": "4 mm"}},
    {"modules": 2},
    {"rigid": {"length": "8 mm", "mass": "3 g"}},
    {"modules": 2, "rotation": "-40 deg"},
    {"rigid": {"length": "6 mm", "mass": "2 g", "radius": "4 mm"}},
]
OWN_LAWS = [{"modules": 2}, {"modules": 2, "surrogate": stated(k_n=8e-7), "module_length": "9 mm"}]
OPPOSED = [{"input": "pressure_1_pa", "sign": 1}, {"input": "pressure_2_pa", "sign": -1}]

STUDIES: dict[str, dict[str, Any]] = {
    "revolute": {"surrogate": stated(), "chain": {"modules": 4, **ROD}},
    "spherical": {"surrogate": SPHERICAL, "chain": {"segments": TURNED, "payload": "5 g", **ROD}},
    "prismatic": {
        "surrogate": PRISMATIC,
        "chain": {"modules": 3, "base": {"direction": [0.3, 0, -1]}, **ROD},
    },
    "opposed chambers": {"surrogate": stated(), "chain": {"modules": 3, "actuators": OPPOSED, **ROD}},
    "turned hinges": {"surrogate": stated(), "chain": {"segments": TURNED, **ROD}},
    "rigid parts": {"surrogate": stated(), "chain": {"segments": WITH_RIGID, **ROD}},
    "own laws": {"surrogate": stated(), "chain": {"segments": OWN_LAWS, **ROD}},
    "beside the axis": {
        "surrogate": SPHERICAL,
        "chain": {"segments": TURNED, "module_offset": "3 mm", **ROD},
    },
}


def study_file(folder: Path, **study: Any) -> Path:
    """Write a study file; JSON is YAML."""
    task = {"kind": "free_bending", "pressure": "12 kPa", "steps": 1}
    path = folder / "study.yaml"
    path.write_text(json.dumps({"name": "chain", "task": task, **study}))
    return path


def run(folder: Path, **study: Any) -> StudyRun:
    context = RunContext(REGISTRY, ArtifactStore(folder / "store"), Silent())
    return simulate_study(context, load_study(study_file(folder, **study), REGISTRY))


def make_chain(folder: Path, **study: Any) -> ChainModel:
    context = RunContext(REGISTRY, ArtifactStore(folder / "store"), Silent())
    return build_study_chain(context, load_study(study_file(folder, **study), REGISTRY)).chain


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_settles_alike_in_all_engines(tmp_path: Path, name: str) -> None:
    done = run(tmp_path, **STUDIES[name], cross_check=ENGINES)
    first, *others = [engine.result.final for engine in done.engines if engine.result is not None]
    assert len(others) == len(ENGINES) and done.chain is not None
    actuation = {a.input: 12e3 if "2" not in a.input else 0.0 for a in done.chain.actuators}
    loads = Loads.from_inputs(done.chain, Inputs(actuation))
    assert np.abs(ChainStatics(done.chain).residual(first.joint_angles, loads)).max() < 1e-9
    assert np.abs(first.joint_angles).max() > 1e-3
    for other in others:
        assert other.converged
        assert np.linalg.norm(other.markers_m - first.markers_m, axis=1).max() < 1e-5


def test_opposed_chambers_at_one_pressure_cancel(tmp_path: Path) -> None:
    chain = make_chain(tmp_path, **STUDIES["opposed chambers"]).with_(gravity_m_s2=np.zeros(3))
    both = Loads.from_inputs(chain, Inputs({"pressure_1_pa": 1e4, "pressure_2_pa": 1e4}))
    np.testing.assert_allclose(ChainStatics(chain).residual(np.zeros((3, 1)), both), 0.0, atol=1e-15)


def test_rigid_parts_lengthen_the_bodies_they_stand_in(tmp_path: Path) -> None:
    chain = make_chain(tmp_path, **STUDIES["rigid parts"])
    markers = ChainGeometry.from_chain(chain).markers(np.zeros((4, 1)))[:, 2]
    np.testing.assert_allclose(-1e3 * np.diff(markers), [25.5, 11, 19, 11, 11.5], atol=1e-9)
    grams = [1e3 * body.mass_kg for body in chain.bodies]
    np.testing.assert_allclose(grams, [5 + 0.8, 1.6, 1.6 + 3, 1.6, 0.8 + 2])
    # The coupling hangs 5.5 to 13.5 mm beyond joint 2, between two halves of a module.
    centre = (0.8 * 2.75 + 3 * 9.5 + 0.8 * 16.25) / 4.6
    np.testing.assert_allclose(1e3 * chain.bodies[2].com_m, [centre, 0, 0], atol=1e-9)
    assert [len(shapes) for shapes in chain.shapes] == [1, 0, 0, 0, 1]
    pose = ChainGeometry.from_chain(chain).forward(np.zeros((4, 1)))  # rings are the ends of the segments
    heights = [pose.origins[r.body] + pose.rotations[r.body] @ r.point_m for r in chain.rings]
    np.testing.assert_allclose(-1e3 * np.array(heights)[:, 2], [0, 20, 42, 50, 72, 78], atol=1e-9)
    cap = chain.shapes[-1][0]
    np.testing.assert_allclose(cap.position_m, [8.5e-3, 0, 0])
    np.testing.assert_allclose(cap.size_m, (4e-3, 3e-3))
    np.testing.assert_allclose(np.abs(cap.rotation[:, 2]), [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(cap.rotation.T @ cap.rotation, np.eye(3), atol=1e-15)


def test_joints_beside_the_axis_turn_with_their_segment(tmp_path: Path) -> None:
    """The centre line stays straight at rest; each hinge is 3 mm from it, on its own segment's −z side."""
    chain = make_chain(tmp_path, **STUDIES["beside the axis"])
    pose = ChainGeometry.from_chain(chain).forward(np.zeros((4, 3)))
    line = np.array([pose.origins[r.body] + pose.rotations[r.body] @ r.point_m for r in chain.centre_line])
    np.testing.assert_allclose(line[:, :2], 0.0, atol=1e-15)
    np.testing.assert_allclose(line[1:-1:2], line[2:-1:2], atol=1e-15)
    aside = pose.origins[1:] - line[1:-1:2]
    np.testing.assert_allclose(aside, -3e-3 * pose.rotations[1:, :, 2], atol=1e-15)
    turn = np.degrees(np.arccos(aside[0] @ aside[3] / 9e-6))
    assert turn == pytest.approx(70.0)
    # A module's mass is on the centre line.
    assert chain.bodies[1].com_m[2] == pytest.approx(3e-3)
    bent = ChainGeometry.from_chain(chain).forward(np.tile([0.0, 0.3, 0.0], (4, 1)))
    both = [bent.origins[r.body] + bent.rotations[r.body] @ r.point_m for r in chain.centre_line[1:3]]
    assert np.linalg.norm(both[1] - both[0]) == pytest.approx(2 * 3e-3 * np.sin(0.15))


def test_segments_with_one_law_share_it_and_only_laws_in_use_are_made(tmp_path: Path) -> None:
    """The study's own surrogate would need data, but no module uses it."""
    own = make_chain(tmp_path, **STUDIES["own laws"])
    assert [joint.law for joint in own.joints] == [0, 0, 1, 1]
    at = np.array([1e4]), np.zeros((1, 1))
    assert [float(law.evaluate(*at).tau[0, 0]) for law in own.laws] == pytest.approx([1.6e-2, 8e-3])
    same = [{"modules": 1, "surrogate": stated()}, {"modules": 1, "surrogate": stated(), "rotation": 1}]
    chain = make_chain(tmp_path, chain={"segments": same, **ROD})
    assert len(chain.laws) == 1
    with pytest.raises(UserError, match="needs data"):
        make_chain(tmp_path, chain={"segments": [*same, {"modules": 1}], **ROD})


def test_a_finished_run_reads_its_segment_laws(tmp_path: Path) -> None:
    done = run(tmp_path, **STUDIES["own laws"])
    write_folder(tmp_path / "out", done, {})
    read, here = read_folder(tmp_path / "out", REGISTRY), finished(done, {})
    assert read.segment_designs == here.segment_designs == (0, 1)
    at = np.array([1e4]), np.zeros((1, 1))
    for one, other in zip(read.designs, here.designs, strict=True):
        assert one.law.evaluate(*at).tau == other.law.evaluate(*at).tau


BLOCKS = re.findall(r"```yaml\n(.*?)```", TASKS_PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_blocks_on_the_task_page_are_accepted(tmp_path: Path, number: int) -> None:
    (tmp_path / "study.yaml").write_text(f"pliant: 1\nname: page\n{BLOCKS[number]}", encoding="utf-8")
    study = load_study(tmp_path / "study.yaml", REGISTRY)
    assert study.task or study.chain or study.surrogate


SEGMENTS = {
    "another rigid length": ({"rigid": {"length": "6 mm"}}, {"rigid": {"length": "7 mm"}}),
    "a rigid mass": ({"rigid": {"length": "6 mm"}}, {"rigid": {"length": "6 mm", "mass": "2 g"}}),
    "another law": ({"modules": 1, "surrogate": stated()}, {"modules": 1, "surrogate": stated(b_e=0.04)}),
    "offset": ({"modules": 1, "module_offset": "1 mm"}, {"modules": 1, "module_offset": "2 mm"}),
}


def test_segment_contents_are_in_the_key_and_a_table_counts_by_its_content(tmp_path: Path) -> None:
    def key(segment: Any) -> str:
        done = run(tmp_path, surrogate=stated(), chain={"segments": [{"modules": 1}, segment], **ROD})
        assert done.engines[0].artifact is not None
        return done.engines[0].artifact.key

    for name, (old, new) in SEGMENTS.items():
        assert key(old) != key(new), name
    own, keys = {"modules": 1, "surrogate": {"kind": "polynomial", "data": "own.csv"}}, []
    for stiffness in (0.03, 0.03, 0.04):
        states = [(p, u) for p in range(0, 15001, 3000) for u in (0, 0.2, 0.4)]
        rows = [f"{p},{u},{1.6e-6 * p - stiffness * u - 1e-6 * p * u}" for p, u in states]
        (tmp_path / "own.csv").write_text("\n".join(["pressure_pa,angle_rad,moment_n_m", *rows]))
        keys.append(key(own))
    assert keys[0] == keys[1] != keys[2]


TWO_KINDS = r"revolute \(y\)"


@pytest.mark.parametrize(
    ("segment", "says"),
    [
        ({"modules": 1, "rigid": {"length": "1 mm"}}, "either 'modules' or 'rigid'"),
        ({"rotation": 1}, "either 'modules' or 'rigid'"),
        ({"modules": 2, "turn": 0.1, "rotation": 0.2}, "either 'rotation'"),
        ({"modules": 2, "actuation_share": 0}, "greater than 0"),
        ({"rigid": {"length": 0}}, "'chain.segments.1.rigid': a rigid piece needs a 'length' above 0"),
        ({"rigid": {"section": "module"}}, "needs a 'length' above 0"),
        ({"rigid": {"length": "1 mm"}, "rotation": 1}, "nothing of modules"),
        ({"rigid": {"length": "1 mm"}, "turn": 0.1}, "nothing of modules"),
        ({"rigid": {"length": "1 mm"}, "actuation_share": 0.5}, "nothing of modules"),
        ({"rigid": {"length": "1 mm"}, "surrogate": stated()}, "nothing of modules"),
        ({"modules": 1, "surrogate": {"kind": "polynomail"}}, "polynomail"),
        ({"modules": 1, "surrogate": {"kind": "polynomial", "degree": 3}}, "'degree' is not a key"),
        ({"modules": 1, "surrogate": {"form": "study"}}, "kind"),
        ({"modules": 1, "surrogate": PRISMATIC}, rf"prismatic \(x\) and {TWO_KINDS}"),
        ({"modules": 1, "surrogate": SPHERICAL}, rf"{TWO_KINDS} and spherical \(x, y, z\)"),
    ],
)
def test_wrong_segments_are_refused(tmp_path: Path, segment: Any, says: str) -> None:
    with pytest.raises(UserError, match=says):
        make_chain(tmp_path, surrogate=stated(), chain={"segments": [{"modules": 1}, segment], **ROD})
    with pytest.raises(UserError, match="all its segments are rigid"):
        make_chain(tmp_path, surrogate=stated(), chain={"segments": [{"rigid": {"length": "1 mm"}}], **ROD})
