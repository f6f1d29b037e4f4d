"""The driver `simulated`: readings of the truth, noise, memory of the specimen, ends of a run."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from tests.bench.joint_study import STUDY, cycles, write_study

from pliant import api
from pliant.errors import UserError
from pliant.evidence.measured_model import MeasuredModel
from pliant.measurements.writing import write_measurement
from pliant_bench.bench import BenchProtocol, BenchRecording, BenchSample, RunStoppedError
from pliant_bench.drivers.simulated import SimulatedBench, SimulatedBenchConfig
from pliant_bench.plans import measured_run, measurement

MULLINS = "effects: [{kind: mullins, softening: 0.3}]\n"


def bench(truth: Path, **settings: object) -> SimulatedBench:
    found = SimulatedBench(SimulatedBenchConfig.model_validate({"truth": truth, **settings}))
    found.connect()
    return found


def performed(one: SimulatedBench, *protocols: BenchProtocol) -> list[BenchRecording]:
    return [one.run(protocol, lambda sample: None) for protocol in protocols]


def predicted(truth: Path, *recordings: BenchRecording) -> list[np.ndarray]:
    """Return what the study predicts for the recordings, as `pliant compare` would."""
    runs = [measured_run(one, ["pressure_pa"], "specimen 1") for one in recordings]
    model: MeasuredModel = api.predictor(api.open_study(truth), measurement(runs))
    return [run["angle_rad"] for run in model.predict()]


def test_readings_without_noise_are_the_predictions_of_the_truth_with_its_memory(tmp_path: Path) -> None:
    truth = write_study(tmp_path, MULLINS)
    recordings = performed(bench(truth), cycles("a", 9e3), cycles("b", 15e3), cycles("c", 9e3))
    for recording, values in zip(recordings, predicted(truth, *recordings), strict=True):
        np.testing.assert_allclose(recording.readings["angle_rad"], values, atol=1e-9)
    first, _, third = (one.readings["angle_rad"] for one in recordings)
    assert np.abs(third - first).max() > 0.005  # softened by the run between them


def test_a_new_specimen_has_no_memory(tmp_path: Path) -> None:
    one = bench(write_study(tmp_path, MULLINS))
    virgin = cycles("virgin", 9e3, new_specimen=True)
    first, _, third = performed(one, cycles("a", 9e3), cycles("b", 15e3), virgin)
    np.testing.assert_allclose(third.readings["angle_rad"], first.readings["angle_rad"], atol=1e-12)


@pytest.mark.parametrize(
    ("column", "value"), [("payload_kg", 0.05), ("base_pitch_rad", np.pi / 2), ("moment_n_m", 2e-3)]
)
def test_conditions_that_a_person_sets_act(tmp_path: Path, column: str, value: float) -> None:
    one = bench(write_study(tmp_path))
    plain, changed = performed(one, cycles("a", 9e3), cycles("b", 9e3, conditions={column: value}))
    assert np.abs(changed.readings["angle_rad"] - plain.readings["angle_rad"]).max() > 0.01


def test_noise_has_the_stated_size_correlation_and_offsets(tmp_path: Path) -> None:
    truth = write_study(tmp_path)
    still = BenchProtocol("still", "", 0.5 * np.arange(4000), {"pressure_pa": np.zeros(4000)})
    settings = {"noise": {"angle_rad": "1 deg"}, "correlated_share": 0.5, "correlation_s": 2.0}
    (recording,) = performed(bench(truth, **settings), still)
    noise = recording.readings["angle_rad"]
    assert np.std(noise) == pytest.approx(np.deg2rad(1.0), rel=0.1)
    lag = np.corrcoef(noise[:-4], noise[4:])[0, 1]  # 2 s: half of the variance, correlated by 1/e
    assert lag == pytest.approx(0.5 * np.exp(-1.0), abs=0.06)
    offset = bench(truth, noise={"angle_rad": "1 deg"}, run_offset=1.0)
    means = [np.mean(one.readings["angle_rad"]) for one in performed(offset, *[still] * 8)]
    assert 0.3 < np.std(means) / np.deg2rad(1.0) < 2.0


def test_the_same_seed_gives_the_same_readings_also_when_an_experiment_is_resumed(tmp_path: Path) -> None:
    truth = write_study(tmp_path, MULLINS)
    settings = {"noise": {"angle_rad": "0.3 deg"}, "seed": 4}
    whole = performed(bench(truth, **settings), cycles("a", 15e3), cycles("b", 9e3))
    resumed = bench(truth, **settings)
    resumed.resume(whole[:1])
    (second,) = performed(resumed, cycles("b", 9e3))
    np.testing.assert_array_equal(second.readings["angle_rad"], whole[1].readings["angle_rad"])


def test_a_run_that_the_watch_stops_has_its_samples_and_softens_only_so_far(tmp_path: Path) -> None:
    one = bench(write_study(tmp_path, MULLINS))
    plain = cycles("plain", 6e3)
    (first,) = performed(one, plain)

    def watch(sample: BenchSample) -> None:
        if sample.index == 3:
            raise RunStoppedError("The reading left its range.")

    stopped = one.run(cycles("stopped", 15e3), watch)
    assert (stopped.ending, stopped.reason, len(stopped)) == ("stopped", "The reading left its range.", 4)
    assert stopped.commands["pressure_pa"].max() < 6e3  # below what the first run had reached
    (third,) = performed(one, plain)
    after = performed(bench(write_study(tmp_path, MULLINS)), plain, plain)[1]
    np.testing.assert_allclose(third.readings["angle_rad"], after.readings["angle_rad"], atol=1e-4)
    assert third.ending == "complete" and first.ending == "complete"


def test_stop_ends_a_run_from_another_place(tmp_path: Path) -> None:
    one = bench(write_study(tmp_path))
    stopped = one.run(cycles("a", 9e3), lambda sample: one.stop() if sample.index == 5 else None)
    assert stopped.ending == "stopped" and len(stopped) == 6


def test_the_pace_changes_when_samples_come_and_not_what_they_say(tmp_path: Path) -> None:
    truth = write_study(tmp_path)
    slow, quick = bench(truth, speed=50.0), bench(truth)
    started = time.perf_counter()
    recording = slow.run(cycles("a", 9e3), lambda sample: time.sleep(0.03) if sample.index == 20 else None)
    assert time.perf_counter() - started >= recording.protocol.duration_s / 50.0
    (other,) = performed(quick, cycles("a", 9e3))
    np.testing.assert_array_equal(recording.read_s, recording.protocol.time_s)
    np.testing.assert_array_equal(recording.readings["angle_rad"], other.readings["angle_rad"])
    assert not recording.late.any()


def test_a_truth_with_a_model_of_its_own(tmp_path: Path) -> None:
    from pliant_systems.manifest import EXAMPLE

    truth = tmp_path / "truth.yaml"
    truth.write_text(f"pliant: 1\nname: own\nmodel: {{kind: python, file: {EXAMPLE}}}\n")
    one = bench(truth)
    clock = 0.05 * np.arange(200)
    inputs = {channel.name: np.sin(clock) for channel in one.inputs}
    (recording,) = performed(one, BenchProtocol("a", "", clock, inputs))
    run = measured_run(recording, list(inputs))
    model = api.predictor(api.open_study(truth), measurement([run]))
    for name, values in model.predict()[0].items():
        np.testing.assert_allclose(recording.readings[name], values, atol=1e-9)
        assert np.ptp(values) > 0.0


def test_a_recording_is_a_measurement_file(tmp_path: Path) -> None:
    study = write_study(tmp_path, MULLINS)
    one = bench(study, noise={"angle_rad": "0.3 deg"})
    recordings = performed(one, cycles("a", 9e3), cycles("b", 9e3, conditions={"payload_kg": 0.02}))
    runs = [measured_run(recording, ["pressure_pa"], "specimen 1") for recording in recordings]
    file = tmp_path / "bench.csv"
    write_measurement(measurement(runs), file)
    read = api.read_measurement(api.open_study(study), file)
    for before, after in zip(runs, read.runs, strict=True):
        np.testing.assert_allclose(after.outputs["angle_rad"], before.outputs["angle_rad"])
        np.testing.assert_allclose(
            after.history.actuation["pressure_pa"], before.history.actuation["pressure_pa"]
        )
    assert read.runs[1].history.payload_kg is not None
    assert read.runs[1].history.payload_kg[0] == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"outputs": ["angel_rad"]}, "angel_rad"),
        ({"noise": {"angle_rad": "1 deg"}, "outputs": ["tip_x_m"]}, "noise"),
        ({"rig": ["presure"]}, "rig"),
        ({"truth": "missing.yaml"}, "missing.yaml"),
    ],
)
def test_wrong_settings_are_user_errors(tmp_path: Path, settings: dict[str, object], word: str) -> None:
    with pytest.raises(UserError, match=word):
        bench(**{"truth": write_study(tmp_path), **settings})  # type: ignore[arg-type]


def test_a_protocol_with_an_unknown_input_is_refused(tmp_path: Path) -> None:
    one = bench(write_study(tmp_path))
    wrong = BenchProtocol("a", "", np.array([0.0, 1.0]), {"presure_pa": np.zeros(2)})
    with pytest.raises(UserError, match="pressure_pa"):
        performed(one, wrong)


def test_the_check_reads_every_channel_at_rest(tmp_path: Path) -> None:
    one = bench(write_study(tmp_path), rig=["valve_open"])
    values = {check.name: check.value for check in one.check()}
    assert values["pressure_pa"] == 0.0 and values["valve_open"] == 1.0
    assert values["angle_rad"] == pytest.approx(0.0, abs=1e-9)
    assert "truth" not in STUDY and all(not check.problem for check in one.check())
