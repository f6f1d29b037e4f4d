"""A grasp from a study file to its page, with the study's noise."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from tests.command import called

from pliant.config.loading import load_study
from pliant.config.study import Study, study_model
from pliant.errors import UserError
from pliant.registry.discovery import discover

STUDY = """
pliant: 1
name: quick-grasp
family: {kind: bellow_bending, inner_radius: 2 mm, average_radius: 6 mm, wall: 1.5 mm, module_length: 11 mm}
material: {kind: neo_hookean, shear_modulus: 249 kPa, density: 1150 kg/m^3}
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain:
  segments: [{rigid: {length: 6.5 mm}}, {modules: 6}, {rigid: {length: 14 mm, section: module}}]
physics: mujoco
task:
  kind: grasp
  object: egg
  pressure: 15 kPa
  lower_height: 5 mm
  lower_time: 0.2 s
  lift_height: 20 mm
  lift_time: 0.7 s
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = tmp_path / "grasp.yaml"
    path.write_text(STUDY)
    return path


@pytest.mark.pixels
def test_a_study_becomes_a_page(study: Path, tmp_path: Path) -> None:
    out, result = tmp_path / "run", tmp_path / "result.json"
    called("run", study, "--out", out, "--json", result, "--store", tmp_path / "store").done()
    found = json.loads(result.read_text())["simulate"]
    assert found["residual"] is None  # contact forces are not in it
    assert found["converged"] is True
    assert found["metrics"]["mode"] == "stable"
    assert found["metrics"]["z_end_m"] == pytest.approx(0.0165, abs=0.004)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "The grasp at 15" in page
    assert "is &#39;stable&#39;" in page
    assert (out / "pictures" / "stills.png").stat().st_size > 10_000


def read(study: Path, more: str = "", *overrides: str) -> Study:
    study.write_text(STUDY + more)
    return load_study(study, discover(), overrides)


def test_the_studys_noise_flows_into_the_task_and_reaches_a_worker(study: Path) -> None:
    found = read(study, "noise: {friction: 5 %, pressure: 0.5 kPa}\n")
    noise = found.noisy_task().noise  # type: ignore[attr-defined]
    assert (noise.friction, noise.pressure_pa, noise.placement) == (0.05, 500.0, 0.0)
    assert found.unused() == []
    raw = json.loads(json.dumps(found.canonical()))
    assert study_model(raw, discover()).model_validate(raw).noisy_task() == found.noisy_task()


def test_noise_stands_in_one_place_and_is_for_tasks_with_trials(study: Path) -> None:
    with pytest.raises(UserError, match="give it once"):
        read(study, "  noise: {friction: 5 %}\nnoise: {friction: 5 %}\n").noisy_task()
    other = read(study, "noise: {friction: 5 %}\n", "task={kind: free_bending, pressure: 15 kPa}")
    assert other.unused() == ["noise"]
    with pytest.raises(UserError, match="did you mean 'friction'"):
        read(study, "noise: {fricton: 5 %}\n")


def test_a_part_is_found_beside_the_study(study: Path, tmp_path: Path) -> None:
    study.write_text(STUDY.replace("object: egg", "object: {mesh: part.stl, mass: 30 g}"))
    task = load_study(study, discover()).task
    assert task.object.mesh == tmp_path / "part.stl"  # type: ignore[union-attr]
