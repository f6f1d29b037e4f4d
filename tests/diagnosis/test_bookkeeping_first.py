"""Mistakes of the record are printed before everything else, and effects of the bench advise to correct the file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.command import called
from tests.diagnosis.bench_files import STUDY, bench, csv, study
from tests.diagnosis.quick import REGISTRY, joint, make_history, make_predictor, measured, ramp
from tests.diagnosis.quick import effect as config_of

from pliant import api
from pliant.diagnosis.diagnosis import diagnose
from pliant.evidence.prediction import Predictor
from pliant.records.measurement import Measurement
from pliant.report.diagnosis import diagnosis_document

TRIALS = Path(__file__).parents[3] / "shared" / "trials"
LEVEL = "chain: {modules: 1, module_length: 80 mm, module_mass: 8 g, base: {direction: [1, 0, 0]}"
HANGING = "chain: {modules: 1, module_length: 80 mm, module_mass: 40 g}"


def level(gravity: str = "") -> str:
    """Return the study with a light joint that is held level."""
    assert HANGING in STUDY
    return STUDY.replace(HANGING, LEVEL + gravity + "}") + "measurements: {file: bench.csv}\n"


def forgotten_gravity(folder: Path) -> None:
    """Write a study without gravity and the recording of a joint that sags."""
    runs = [ramp(f"r{k}{again}", rate, 0.5) for k, rate in enumerate((1e3, 3e3)) for again in "ab"]
    (folder / "bench.csv").write_text(csv(bench(folder, text=level(), runs=runs)))
    study(folder, level(", gravity: [0, 0, 0]"))


def first_note(out: str) -> str:
    return next(line for line in out.splitlines() if line.strip())


@pytest.mark.parametrize("verb", ["compare", "diagnose"])
def test_forgotten_gravity_is_the_first_note(
    verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    forgotten_gravity(tmp_path)
    effects = ["--effect", "stiffness", "--effect", "self_contact"] if verb == "diagnose" else []
    call = called(verb, "joint.yaml", *effects, "--json", "out.json", "--out", "page").done()
    assert first_note(call.out).startswith("note: At rest the recording and the model disagree")
    assert "correct it before" in call.out
    (found,) = json.loads((tmp_path / "out.json").read_text())["bookkeeping"]
    assert found["kind"] == "gravity" and found["where"] == ["chain.gravity"]
    assert found["error_after"] < 0.4 * found["error_before"]
    assert "gravity acts along −z, and the study has none" in (tmp_path / "page" / "report.html").read_text()


def test_improve_says_so_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    forgotten_gravity(tmp_path)
    call = called("improve", "joint.yaml", "--effect", "stiffness").done()
    (noted, *_) = [line for line in call.out.splitlines() if line.startswith("note: ")]
    assert noted.startswith("note: At rest the recording and the model disagree")


def test_a_unit_that_the_model_settles_is_told_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pressures of 15 Pa are doubted when the file is read; the model determines their unit."""
    monkeypatch.chdir(tmp_path)
    written = bench(tmp_path, text=level())

    def in_kilopascals(measurement: Measurement) -> Measurement:
        runs = [
            replace(
                run,
                history=run.history.with_actuation(pressure_pa=1e-3 * run.history.actuation["pressure_pa"]),
            )
            for run in measurement.runs
        ]
        return replace(measurement, runs=tuple(runs))

    (tmp_path / "bench.csv").write_text(csv(in_kilopascals(written)))
    study(tmp_path, level())
    call = called("compare", "joint.yaml", "--json", "out.json").done()
    assert "pressure_pa is in kPa, not in Pa (a factor of 1000)" in call.out.replace("\n", " ")
    assert "Unit to check" not in call.out


def sweeps() -> Measurement:
    """Return pressure sweeps with 0 and 20 g, where the 20 g were in fact 28 g."""
    runs = [ramp(f"p{k}{mass}", 2e3, 0.5, payload_kg=mass) for k in range(2) for mass in (0.0, 0.028)]
    found = measured(joint(3), runs)
    relabelled = [
        replace(run, history=run.history.with_(payload_kg=run.history.payload_kg * 20 / 28))
        for run in found.runs
    ]
    return replace(found, runs=tuple(relabelled))


def test_a_wrong_payload_is_to_be_corrected_in_the_file() -> None:
    measurement = sweeps()
    found = diagnose(
        make_predictor(joint(3), measurement), kinds=["payload_error", "stiffness", "actuation_gain"]
    )
    assert found.selected == ("payload_error",)
    value = found.estimates[found.selected].estimates[0].value
    assert value == pytest.approx(1.4, abs=0.05)
    document = diagnosis_document("joint", measurement, found, REGISTRY)
    assert any("correct the file, not the physics" in point for point in document.points)
    assert dict(document.answers)["What next"].startswith("Correct the file, not the physics")


@pytest.mark.parametrize(
    ("kind", "why"),
    [
        ("payload_error", "no run states a payload"),
        ("load_error", "no run has a moment or a force"),
        ("clock_offset", "no run has a clock"),
        ("clock_drift", "no run has a clock"),
    ],
)
def test_mistakes_that_a_record_cannot_have_are_no_candidates(kind: str, why: str) -> None:
    """They are left out with their reason, so that they do not lower the probability of the others."""
    chain = joint(1).with_(payload_kg=0.0)
    runs = [make_history(f"r{k}", None, np.linspace(0.0, 15e3, 20)) for k in range(2)]
    found = diagnose(make_predictor(chain, measured(chain, runs)), kinds=[kind, "stiffness"])
    assert (kind,) not in found.fits
    assert any(kind in text and why in text for text in found.not_tried)


def test_a_clock_offset_is_told_from_a_supply() -> None:
    runs = [ramp(f"f{k}", 15e3, 0.1, (15e3, 0.0, 15e3, 0.0)) for k in range(2)]
    offset = config_of("clock_offset", late_s=-0.3)
    model: Predictor = make_predictor(joint(1), measured(joint(1), runs, offset))
    found = diagnose(model, kinds=["clock_offset", "supply_lag", "sensor_lag"])
    assert found.selected == ("clock_offset",)
    assert found.estimates[found.selected].estimates[0].value == pytest.approx(-0.3, abs=0.02)
    assert found.bookkeeping[0].kind == "clock"


@pytest.mark.slow
def test_the_trial_with_a_tilted_chain_and_a_wrong_payload(tmp_path: Path) -> None:
    """The base is tilted by 4° and 19 g are recorded as 13 g; all shipped effects are candidates."""
    path = TRIALS / "chain_payload_and_tilt" / "B.yaml"
    if not path.is_file():
        pytest.skip(f"{path} is not here")
    found = api.diagnose(api.open_study(path, store=tmp_path / "store"))
    assert found.verdict == "missing_effect"
    assert set(found.selected) == {"base_misalignment", "payload_error"}
    values = {one.name: one.value for one in found.estimates[found.selected].estimates}
    assert np.degrees(values["base_misalignment.pitch_rad"]) == pytest.approx(-3.92, abs=0.08)
    assert values["payload_error.factor"] == pytest.approx(19 / 13, abs=0.01)
    assert [one.kind for one in found.bookkeeping] == ["rest_pose", "payload"]
