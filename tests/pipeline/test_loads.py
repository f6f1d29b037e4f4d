"""The frames of a load slider are those of the study with that load; without a load the list is empty."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pliant.config.loading import load_study
from pliant.pipeline.run_folder import finished, read_folder, write_folder
from pliant.pipeline.study import StudyRun, simulate_study
from pliant.pipeline.workbench import RunContext
from pliant.registry.discovery import discover
from pliant.store.store import ArtifactStore

STUDY = """\
pliant: 1
name: loaded
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.6e-6, m_a: -1.7e-6, m_e: 0.1, b_e: 0.0245}
chain: {modules: 3, module_length: 20 mm, module_mass: 4 g, base: {direction: [1, 0, 0]}}
effects: [{kind: stiffness, factor: 1.2}]
"""
REGISTRY = discover()


def run(folder: Path, task: str, physics: str = "quasistatic") -> StudyRun:
    (folder / "study.yaml").write_text(f"{STUDY}physics: {physics}\ntask: {task}\n")
    return simulate_study(
        RunContext(REGISTRY, ArtifactStore(folder / "store")),
        load_study(folder / "study.yaml", REGISTRY, ()),
    )


@pytest.mark.parametrize(
    ("whole", "half"),
    [
        ("payload: 8 g", "payload: 4 g"),
        ("tip_force: [0 N, 0 N, 0.04 N]", "tip_force: [0 N, 0 N, 0.02 N]"),
    ],
)
def test_a_frame_is_the_study_with_that_load(tmp_path: Path, whole: str, half: str) -> None:
    task = "{{kind: tip_load, pressure: 5 kPa, steps: 3, {}}}"
    made = run(tmp_path, task.format(whole))
    assert made.loads is not None
    frames, own = made.loads.value, made.engines[0].result
    assert frames.shares == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0]) and frames.own == 4
    assert frames.markers_m[4] == pytest.approx(own.rollout.markers_m)
    lighter = run(tmp_path, task.format(half)).engines[0].result.rollout
    assert frames.markers_m[2] == pytest.approx(lighter.markers_m, abs=1e-9)
    assert frames.joint_angles[2] == pytest.approx(lighter.joint_angles, abs=1e-9)
    assert np.abs(frames.markers_m[0] - frames.markers_m[4]).max() > 1e-3
    write_folder(tmp_path / "out", made, {})
    again = read_folder(tmp_path / "out", REGISTRY)
    assert again.loads is not None and again.loads.words == finished(made, {}).loads.words


@pytest.mark.parametrize(
    ("task", "physics"),
    [
        ("{kind: free_bending, pressure: 5 kPa, steps: 2}", "quasistatic"),
        ("{kind: tip_load, pressure: 5 kPa, steps: 2, payload: 8 g}", "mujoco"),
    ],
)
def test_without_a_load_and_in_a_dynamic_engine_there_are_none(
    tmp_path: Path, task: str, physics: str
) -> None:
    assert run(tmp_path, task, physics).loads is None
