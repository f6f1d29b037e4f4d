"""Several tables as one measurement: lists, patterns, frames, other loggers, conditions from a file's name."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pliant.config.measurements import MeasurementsConfig
from pliant.errors import UserError
from pliant.measurements.files import expand_sources, natural, read_measurements

ROWS = "time_s,pressure_pa,angle_rad\n0,0,0\n1,5e3,{}\n2,1e4,0.4\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for number in (1, 2, 10):
        (tmp_path / f"run_{number}.csv").write_text(ROWS.format(0.1 * number))
    return tmp_path


def refusal(*arguments, **named) -> str:
    with pytest.raises(UserError) as caught:
        read_measurements(*arguments, **named)
    return str(caught.value)


def test_a_pattern_gives_runs_in_natural_order_and_a_list_its_own(folder):
    found = read_measurements(str(folder / "run_*.csv"))
    assert [run.name for run in found.runs] == ["run_1", "run_2", "run_10"]
    assert [run.outputs["angle_rad"][1] for run in found.runs] == pytest.approx([0.1, 0.2, 1.0])
    said = [remark for remark in found.remarks if "no column 'run'" in remark]
    assert len(said) == 1 and said[0].startswith("run_1.csv and 2 more files: ")
    listed = read_measurements([folder / "run_10.csv", str(folder / "run_[12].csv")])
    assert [run.name for run in listed.runs] == ["run_10", "run_1", "run_2"]
    assert "no file fits" in refusal(folder / "test_*.csv")
    assert "no file is given" in refusal([])
    assert "no such file" in refusal(folder / "gone.csv")
    assert sorted(["b10", "b9", "a"], key=natural) == ["a", "b9", "b10"]


def test_notes_in_the_call_apply_to_all_files_and_spans_to_the_run_that_they_name(folder):
    notes = {
        "units": {"pressure_pa": "kPa"},
        "exclude": [{"run": "run_2", "end": "0.5 s"}],
        "sigma": {"angle_rad": 0.1},
    }
    found = read_measurements(folder / "run_*.csv", notes)
    assert all(run.history.actuation["pressure_pa"][2] == 1e7 for run in found.runs)
    assert [int(np.isnan(run.outputs["angle_rad"]).sum()) for run in found.runs] == [0, 1, 0]
    unknown = refusal(folder / "run_*.csv", {"exclude": [{"run": "run_3"}]})
    assert "run 'run_3', which is not there; did you mean" in unknown
    assert "'unit' is not a key" in refusal(folder / "run_1.csv", {"unit": {}})


def test_a_frame_is_read_as_a_file(folder):
    frame = pd.read_csv(folder / "run_1.csv")
    frame["specimen"] = ["a", None, "a"]
    found = read_measurements(frame)
    np.testing.assert_array_equal(found.runs[0].outputs["angle_rad"], [0, 0.1, 0.4])
    assert found.runs[0].history.specimen == "a" and found.sha256 == "" and len(expand_sources(frame)) == 1
    stamped = frame.assign(time_s=pd.to_datetime("2026-08-02") + pd.to_timedelta(frame["time_s"], "s"))
    both = read_measurements(
        [stamped.rename(columns={"time_s": "time"}).set_index("time"), folder / "run_2.csv"]
    )
    np.testing.assert_array_equal(both.runs[0].history.time_s, [0, 1, 2])
    assert [run.name for run in both.runs] == ["DataFrame", "run_2"]
    missing = frame.astype({"angle_rad": "Float64"})
    missing.loc[1, "angle_rad"] = pd.NA
    assert np.isnan(read_measurements(missing).runs[0].outputs["angle_rad"][1])
    assert "no column drives" in refusal(frame[["time_s", "angle_rad"]])


def test_a_files_name_says_its_conditions(folder):
    (folder / "finger_s1_12,5g_slow_b.csv").write_text(ROWS.format(0.2))
    file = folder / "finger_s1_12,5g_slow_b.csv"
    (run,) = read_measurements(file, {"name_pattern": "finger_{specimen}_{payload_g}g_{run}"}).runs
    assert (run.name, run.history.specimen) == ("slow_b", "s1")
    np.testing.assert_allclose(run.history.payload_kg, 0.0125)
    (run,) = read_measurements(file, {"name_pattern": "*_{payload_g}g_*"}).runs
    assert run.name == file.stem
    assert "its name does not fit" in refusal(file, {"name_pattern": "arm_{run}"})
    assert "'{colour}'" in refusal(file, {"name_pattern": "finger_{specimen}_{colour}_{run}"})
    assert "its name does not fit" in refusal(file, {"name_pattern": "finger_{payload_g}_{run}"})
    assert "names in braces" in refusal(file, {"name_pattern": "finger"})


def test_another_loggers_inputs_are_straight_lines_at_this_files_times(folder):
    (folder / "camera.csv").write_text("time_s,angle_rad\n0,0.1\n0.5,0.2\n1.5,0.3\n9,0.4\n")
    (folder / "valve.csv").write_text("Zeit [ms];Druck [kPa];Nutzlast [g]\n1000;0;20\n3000;20;20\n")
    (folder / "camera.yaml").write_text("join: {file: valve.csv, shift: -1 s}\n")
    found = read_measurements(folder / "camera.csv", actuation=["pressure_pa"])
    (run,) = found.runs
    np.testing.assert_allclose(run.history.time_s, [0, 0.5, 1.5])
    np.testing.assert_allclose(run.history.actuation["pressure_pa"], [0, 5e3, 15e3])
    np.testing.assert_allclose(run.history.payload_kg, 0.02)
    assert found.written["pressure_pa"] == "kPa" and found.written["time_s"] == "s"
    assert "pressure_pa is blank in 1 row (line 5)" in "\n".join(found.remarks)
    both = read_measurements([folder / "valve.csv", folder / "camera.csv"])
    assert [r.name for r in both.runs] == ["camera"]
    (folder / "valve.csv").write_text("time_s,pressure_pa\n0,0\n2,1\n1,2\n")
    assert "goes back" in refusal(folder / "camera.csv")
    (folder / "valve.csv").write_text("time_s,angle_rad\n0,0\n")
    assert "inputs or conditions that camera.csv lacks; it has none" in refusal(folder / "camera.csv")


def test_a_joined_file_may_have_the_same_runs(folder):
    (folder / "camera.csv").write_text("run,time_s,angle_rad\nA,0,0.1\nA,1,0.2\nB,0,0.3\nC,0,0.3\n")
    (folder / "valve.csv").write_text("run,time_s,pressure_pa\nA,0,1e3\nA,2,3e3\nB,0,4e3\n")
    first, second = read_measurements(folder / "camera.csv", {"join": "valve.csv"}).runs
    np.testing.assert_allclose(first.history.actuation["pressure_pa"], [1e3, 2e3])
    np.testing.assert_allclose(second.history.actuation["pressure_pa"], [4e3])


def test_the_study_names_several_files_and_patterns(folder):
    block = MeasurementsConfig.model_validate(
        {"file": [str(folder / "run_2.csv"), str(folder / "run_1*.csv")]}
    )
    assert [run.name for run in read_measurements(block.file, block).runs] == ["run_2", "run_1", "run_10"]


@pytest.mark.parametrize(
    ("notes", "words"),
    [
        ({"rate": 0}, "greater than 0"),
        ({"restarts": "yes"}, "new run"),
        ({"decimal": ";"}, "decimal"),
        (
            {"zero": {"angel_rad": "1 deg"}},
            "'zero' has 'angel_rad', which is not a column.*did you mean 'angle_rad'",
        ),
        ({"zero": {"angle_rad": "1 mm"}}, "needs an angle"),
        ({"zero": {"angle_rad": "one"}}, "is not a quantity"),
        ({"join": "gone.csv"}, "gone.csv.*no such file"),
    ],
)
def test_notes_that_cannot_be(folder, notes, words):
    assert re.search(words, refusal(folder / "run_1.csv", notes), re.DOTALL)


def test_zeros_are_subtracted_in_the_unit_that_they_say(folder):
    (folder / "a.csv").write_text("time_s,pressure_kpa,angle_deg\n0,101.3,12\n1,111.3,42\n")
    found = read_measurements(folder / "a.csv", {"zero": {"pressure_kpa": "1013 mbar", "angle_rad": "12 °"}})
    np.testing.assert_allclose(found.runs[0].history.actuation["pressure_pa"], [0, 1e4], atol=1e-9)
    np.testing.assert_allclose(found.runs[0].outputs["angle_rad"], np.radians([0, 30]), atol=1e-12)
    assert "Its zero, 101300 Pa, was subtracted" in "\n".join(found.remarks)


def test_restarts_number_the_runs_that_they_cut(folder):
    clocks = {"A": (0, 1, 2, 0, 1, 0), "B": (0, 1)}
    rows = [f"{run},s,{t},{1e3 * t},0.1\n" for run, times in clocks.items() for t in times]
    text = "run,specimen,time_s,pressure_pa,angle_rad\n" + "".join(rows)
    (folder / "a.csv").write_text(text)
    found = read_measurements(folder / "a.csv", {"restarts": "new run"})
    assert [(run.name, len(run)) for run in found.runs] == [("A 1", 3), ("A 2", 2), ("A 3", 1), ("B", 2)]
    assert all(run.history.specimen == "s" for run in found.runs)
    assert "restarts: new run" in refusal(folder / "a.csv")


@pytest.mark.parametrize("seed", range(3))
def test_shuffled_rows_are_sorted_and_pieces_are_not(folder, seed):
    rng = np.random.default_rng(seed)
    time = np.arange(40)

    def written(order) -> Path:
        rows = "".join(f"{t},{t * 250},{t * 0.01}\n" for t in order)
        (folder / "a.csv").write_text("time_s,pressure_pa,angle_rad\n" + rows)
        return folder / "a.csv"

    for order in (rng.permutation(time), np.r_[0:10, 11, 10, 12:40]):
        found = read_measurements(written(order))
        np.testing.assert_array_equal(found.runs[0].history.time_s, time)
        np.testing.assert_array_equal(found.runs[0].lines, 2 + np.argsort(order))
        assert [doubt.kind for doubt in found.doubts] == ["order"]
    for order in (np.r_[20:40, 0:20], np.r_[0:20, 0.5:20.5]):
        message = refusal(written(order))
        assert "goes back" in message and message.count("\n") == 1
