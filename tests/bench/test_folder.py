"""The folder of an experiment: what is written is read again, and nothing is lost when a program is killed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from tests.bench.plain_bench import PlainBench

from pliant.errors import UserError
from pliant_bench.bench import BenchProtocol, BenchSample
from pliant_bench.loop.folder import ExperimentFolder, GrowingColumns, RoundFolder, SampleLog, read_columns
from pliant_bench.loop.live import LiveState, press_stop
from pliant_bench.loop.perform import STOP_BUTTON, perform, record_from_samples
from pliant_bench.watchdog import Expectation

PLAN = {
    "kind": "repeat",
    "why": "noise",
    "expected_nats": None,
    "minutes": 1.0,
    "specimen": "1",
    "setting": {},
}

ZEROS = {"angle_rad": np.zeros(40)}
EXPECTED = Expectation(
    ZEROS, {"angle_rad": np.ones(40)}, ZEROS, {"angle_rad": np.full(40, 0.1)}, "with backlash"
)


def protocol(n: int = 40) -> BenchProtocol:
    clock = 0.1 * np.arange(n)
    return BenchProtocol("01 ramp", "a ramp", clock, {"pressure_pa": 1e3 * clock}, {"payload_kg": 0.02})


def begun(path: Path) -> tuple[ExperimentFolder, RoundFolder]:
    folder = ExperimentFolder(path)
    folder.begin({"study": "finger"})
    one = folder.next_round()
    one.write_plan(protocol(), PLAN)
    return folder, one


def test_plan_is_read_as_it_was_written(tmp_path: Path) -> None:
    _, one = begun(tmp_path)
    read, asked = one.read_protocol(), protocol()
    np.testing.assert_array_equal(read.time_s, asked.time_s)
    np.testing.assert_array_equal(read.commands["pressure_pa"], asked.commands["pressure_pa"])
    assert (read.name, read.words, read.conditions) == (asked.name, asked.words, asked.conditions)


def test_a_run_is_a_measurement_file(tmp_path: Path) -> None:
    folder, one = begun(tmp_path)
    recording = perform(PlainBench(), one.read_protocol(), folder, one, [])
    assert recording.ending == "complete" and one.is_recorded
    head, first, *rows = one.recording.read_text().splitlines()
    assert head == "run,specimen,time_s,pressure_pa,payload_kg,angle_rad"
    assert first.startswith("01 ramp,1,0.000000,0.0,0.02,")
    assert len(rows) == 39


@pytest.mark.parametrize("killed_at", [0, 1, 7, 39])
def test_every_sample_before_a_kill_is_recorded(tmp_path: Path, killed_at: int) -> None:
    folder, one = begun(tmp_path)

    def kill(index: int) -> None:
        if index == killed_at:
            raise KeyboardInterrupt

    bench = PlainBench(before=kill)
    with pytest.raises(KeyboardInterrupt):
        perform(bench, one.read_protocol(), folder, one, [])
    assert bench.vented == ["01 ramp"]
    recording = one.read("recording") or {}
    assert (recording["ending"], recording["samples"]) == ("lost", killed_at)
    assert recording["is_data"] == (killed_at >= 5) == one.recording.exists()


def test_a_line_that_was_cut_off_is_left_out(tmp_path: Path) -> None:
    _, one = begun(tmp_path)
    log = SampleLog(one.samples, protocol(), ("angle_rad",))
    for k in range(6):
        log.write(
            BenchSample(
                k, 0.1 * k, 0.1 * k, {"pressure_pa": 10.0}, {"angle_rad": math.nan if k == 2 else 0.5}
            )
        )
    log.close()
    whole = one.samples.read_bytes()
    one.samples.write_bytes(whole[:-4])
    record_from_samples(one)
    assert (one.read("recording") or {})["samples"] == 5
    cells = [line.split(",")[-1] for line in one.recording.read_text().splitlines()[1:]]
    assert cells == ["0.5", "0.5", "", "0.5", "0.5"]


def test_the_stop_button_ends_the_run(tmp_path: Path) -> None:
    folder, one = begun(tmp_path)

    def press(index: int) -> None:
        if index == 10:
            press_stop(folder)

    recording = perform(PlainBench(before=press), one.read_protocol(), folder, one, [])
    assert (recording.ending, recording.reason, len(recording)) == ("stopped", STOP_BUTTON, 11)


def test_another_study_does_not_continue_the_experiment(tmp_path: Path) -> None:
    folder, _ = begun(tmp_path)
    assert folder.begin({"study": "finger"})
    with pytest.raises(UserError, match="another study"):
        folder.begin({"study": "arm"})


def test_live_state_sends_only_new_samples(tmp_path: Path) -> None:
    folder, one = begun(tmp_path)
    one.write_expected(EXPECTED, protocol().time_s)
    perform(PlainBench(), one.read_protocol(), folder, one, [])
    first = LiveState(folder).read()["run"]
    assert first["count"] == 40 and len(first["series"]["angle_rad"]) == 40
    plain, explained = first["models"]["outputs"]["angle_rad"]
    assert (plain["name"], explained["name"]) == ("the study's model", "with backlash")
    assert explained["sd"][0] == pytest.approx(math.degrees(0.1)) and np.isnan(plain["sd"]).all()
    later = LiveState(folder).read(run=1, since=30, models=0)["run"]
    assert len(later["series"]["angle_rad"]) == 10 and "models" not in later


def test_growing_columns_are_those_of_the_whole_file(tmp_path: Path) -> None:
    path, text = tmp_path / "samples.csv", "index,angle_rad\n0,0.5\n1,\n2,-1e-3\n3,2\n"
    growing = GrowingColumns(path)
    assert growing.read() == {}
    for end in (9, 18, 25, len(text)):  # within the head, a line, between two lines, all
        path.write_text(text[:end])
        np.testing.assert_equal(
            {name: list(values) for name, values in growing.read().items()},
            {name: values.tolist() for name, values in read_columns(path).items()},
        )
    np.testing.assert_equal(
        dict(growing.read()), {"index": [0, 1, 2, 3], "angle_rad": [0.5, np.nan, -1e-3, 2]}
    )
    path.write_text("index,angle_rad\n7,8\n")
    assert growing.read() == {"index": [7], "angle_rad": [8]}


def test_a_viewer_that_stays_gets_each_sample_once(tmp_path: Path) -> None:
    folder, one = begun(tmp_path)
    live, have, run, series = LiveState(folder), 0, 0, []

    def look(index: int) -> None:
        nonlocal have, run
        if index % 7 == 0:
            now = live.read(run=run, since=have)["run"]
            series.extend(now["series"].get("angle_rad", ()))
            have, run = now["count"], now["number"]
            assert have == index

    recording = perform(PlainBench(before=look), one.read_protocol(), folder, one, [])
    look_last = live.read(run=run, since=have)["run"]
    series.extend(look_last["series"]["angle_rad"])
    np.testing.assert_allclose(np.radians(series), recording.readings["angle_rad"])
