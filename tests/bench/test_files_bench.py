"""The bench that other software runs: protocol out, recording in."""

import threading
import time

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.measurements.reading import read_measurement
from pliant_bench.bench import RunStoppedError
from pliant_bench.drivers.files import FilesBench, FilesConfig


@pytest.fixture
def bench(tmp_path):
    config = FilesConfig.model_validate(
        {
            "kind": "files",
            "folder": str(tmp_path / "bench"),
            "inputs": {"pressure_pa": {"high": "15 kPa"}},
            "outputs": {"angle_rad": {"low": "-60 deg", "high": "60 deg"}},
            "stable": "0.3 s",
            "poll": "0.02 s",
            "wait": "20 s",
        }
    )
    bench = FilesBench(config)
    bench.said = []
    bench.say = bench.said.append
    bench.connect()
    return bench


def laboratory(folder, parts=1, done=False, name="hill"):
    """Wait for the protocol, fill in an angle, and write the recording in parts."""
    protocol = folder / f"{name}.csv"
    while not protocol.exists():
        time.sleep(0.01)
    header, *rows = [line for line in protocol.read_text().splitlines() if line[0] != "#"]
    columns = header.split(",")
    place = [columns.index(key) for key in ("pressure_pa", "angle_rad")]
    for k, row in enumerate(rows):
        cells = row.split(",")
        cells[place[1]] = repr(40e-6 * float(cells[place[0]]))
        rows[k] = ",".join(cells)
    table = [header, *rows]
    target = folder / f"{name}.recorded.csv"
    for part in np.array_split(np.arange(len(table)), parts):
        with target.open("a") as file:
            file.write("".join(table[k] + "\n" for k in part))
        time.sleep(0.1 if parts > 1 else 0)
    if done:
        target.with_name(target.name + ".done").touch()


def performed(bench, protocol, watch=lambda sample: None, **laboratory_options):
    thread = threading.Thread(target=laboratory, args=(bench.config.folder,), kwargs=laboratory_options)
    thread.start()
    try:
        return bench.run(protocol, watch)
    finally:
        thread.join()


@pytest.mark.parametrize("options", [{"parts": 5}, {"done": True}])
def test_a_run_is_the_recording_that_the_software_writes(bench, hill, options):
    protocol, seen = hill(8e3, 2.0), []
    done = performed(bench, protocol, seen.append, **options)
    assert done.ending == "complete" and len(done) == len(protocol) == len(seen)
    assert done.readings["angle_rad"] == pytest.approx(40e-6 * protocol.commands["pressure_pa"], abs=1e-6)
    assert [sample.index for sample in seen] == list(range(len(protocol)))
    assert bench.said[0].startswith("Run 'hill' is in hill.csv. Waiting for hill.recorded.csv in ")


def test_the_protocol_is_a_measurement_file_to_fill_in(bench, hill):
    performed(bench, hill(8e3, 2.0), done=True)
    text = (bench.config.folder / "hill.csv").read_text()
    assert text.startswith("# Run 'hill': up and down.")
    assert read_measurement(bench.config.folder / "hill.recorded.csv").runs[0].name == "hill"


def test_the_watch_judges_the_recording(bench, hill):
    def watch(sample):
        if sample.readings["angle_rad"] > 0.2:
            raise RunStoppedError("The angle is too large.")

    done = performed(bench, hill(8e3, 2.0), watch, done=True)
    assert (done.ending, done.reason) == ("stopped", "The angle is too large.") and len(done) == 201


def test_stop_ends_the_wait_and_asks_the_software_to_vent(bench, hill):
    threading.Timer(0.2, bench.stop).start()
    done = bench.run(hill(8e3, 2.0), lambda sample: None)
    assert done.ending == "stopped" and len(done) == 0
    assert (bench.config.folder / "STOP").exists()
    bench.connect()
    assert not (bench.config.folder / "STOP").exists()


def test_a_recording_that_does_not_come_ends_the_run(bench, hill):
    bench.config = bench.config.model_copy(update={"wait_s": 0.1})
    done = bench.run(hill(2e3, 0.6), lambda sample: None)
    assert done.ending == "stopped" and done.reason == "No recording hill.recorded.csv came within 0.1 s."


def test_what_cannot_be_a_recording_is_refused(bench, hill):
    (bench.config.folder / "hill.recorded.csv").write_text("time_s,pressure_pa,tip_x_m\n0,0,0\n1,0,0\n")
    with pytest.raises(UserError, match="is there before the run"):
        bench.run(hill(2e3, 0.6), lambda sample: None)
    with pytest.raises(UserError, match="has no column angle_rad"):
        bench._read(bench.config.folder / "hill.recorded.csv", hill())
    with pytest.raises(UserError, match="above its limit"):
        bench.run(hill(16e3), lambda sample: None)


def test_a_folder_that_cannot_be_used_is_a_sentence(bench, tmp_path):
    (tmp_path / "file").write_text("")
    bench.config = bench.config.model_copy(update={"folder": tmp_path / "file"})
    with pytest.raises(UserError, match="cannot be used"):
        bench.connect()
