"""What the files of public reports ask of the notes `wrap`, `hold` and `join`; the files stand in from_reports.py."""

from pathlib import Path

import numpy as np
import pytest
from tests.lab_files.lab_file import rows, text
from tests.lab_files.written import DEG, KPA, T

from pliant.errors import UserError
from pliant.measurements.files import read_measurements
from pliant.measurements.wrapping import Unwrapper

STEPS = text("time_s,pressure_kpa", "0,0", "0.4,10", "2,0", "2.4,0")
CAMERA = text("time_s,angle_deg", *rows(T, DEG))


def read(folder: Path, notes: str = "", **files: bytes):
    for name, content in files.items():
        (folder / f"{name}.csv").write_bytes(content)
    if notes:
        (folder / "a.yaml").write_text(notes)
    return read_measurements(folder / "a.csv")


def test_changes_that_are_joined_by_straight_lines_are_doubted(tmp_path: Path):
    found = read(tmp_path, "join: valve.csv", a=CAMERA, valve=STEPS)
    assert found.runs[0].history.actuation["pressure_pa"][30] == pytest.approx(
        5e3
    )  # halfway from 10 kPa to 0
    assert [doubt.kind for doubt in found.doubts] == ["hold"]
    assert "from 10 kPa to 0 kPa in one straight line, from 0.4 to 2 s" in found.doubts[0].sentence
    line = found.doubts[0].sentence.split("'")[1]
    assert line == "join: {file: valve.csv, hold: true}"

    held = read(tmp_path, line, a=CAMERA)
    assert held.runs[0].history.actuation["pressure_pa"][[9, 10, 49, 50]].tolist() == [0.0, 1e4, 1e4, 0.0]
    assert not held.doubts
    assert not read(tmp_path, "join: {file: valve.csv, hold: false}", a=CAMERA).doubts


def test_the_last_change_holds_to_the_end(tmp_path: Path):
    found = read(
        tmp_path, "join: {file: valve.csv, hold: true}", a=CAMERA, valve=STEPS.replace(b"2.4,0\n", b"")
    )
    assert len(found.runs[0].history) == len(T)


def test_a_slow_logger_of_a_ramp_is_not_doubted(tmp_path: Path):
    ramp = text("time_s,pressure_kpa", *rows(np.arange(0.0, 2.6, 0.3), np.arange(9.0)))
    assert not read(tmp_path, "join: ramp.csv", a=CAMERA, ramp=ramp).doubts


def test_a_counter_in_a_joined_file_is_named_in_its_unit(tmp_path: Path):
    micros = (1e6 * T + 2**32 - 1e6) % 2**32
    logger = text("time_us,pressure_kpa", *rows(micros, KPA))
    with pytest.raises(UserError, match=r"wrap: \{time_us: 4294.967296 s\}' into logger.yaml"):
        read(tmp_path, "join: logger.csv", a=CAMERA, logger=logger)
    (tmp_path / "logger.yaml").write_text("wrap: {time_us: 4294.967296 s}")
    found = read(tmp_path, "join: {file: logger.csv, shift: -4293.967296 s}", a=CAMERA)
    assert found.runs[0].history.actuation["pressure_pa"] == pytest.approx(1000 * KPA, abs=0.1)


@pytest.mark.parametrize(
    ("notes", "words"),
    [
        ("wrap: {angle_deg: 1 h}", "'wrap' of 'angle_deg'"),
        ("wrap: {angle_deg: 0 deg}", "should be above 0"),
        ("wrap: {angel_deg: 360 deg}", "did you mean 'angle_deg'"),
        ("hold: {angle_deg: true}", "'angle_deg', which is no input"),
    ],
)
def test_notes_that_cannot_be_meant(tmp_path: Path, notes: str, words: str):
    with pytest.raises(UserError, match=words):
        read(tmp_path, notes, a=text("time_s,pressure_kpa,angle_deg", *rows(T, KPA, DEG)))


def test_an_angle_is_continued_over_blocks_and_both_ways():
    degrees = np.array([170.0, 300.0, 430.0, 370.0, 210.0, 60.0, -100.0, -250.0])
    within, spans = degrees % 360, {0: 360.0}
    whole = Unwrapper(spans).unwrap([within], ("a",) * 8)[0]
    assert whole == pytest.approx(degrees)
    unwrapper = Unwrapper(spans)
    parts = [unwrapper.unwrap([part], ("a",) * len(part))[0] for part in np.split(within, [3, 5])]
    assert np.concatenate(parts) == pytest.approx(degrees)


def test_a_clock_only_goes_forward():
    clock = Unwrapper({0: 100.0}, clock=0)
    assert clock.unwrap([np.array([10.0, 80.0, 99.0, 1.0, 70.0, 5.0])], ("a",) * 6)[0].tolist() == [
        10.0,
        80.0,
        99.0,
        101.0,
        170.0,
        205.0,
    ]


def test_large_steps_of_a_helix_are_no_turns(tmp_path: Path):
    jumps = np.where(np.arange(len(T)) % 20 < 10, 0.0, 200.0)
    doubts = read(tmp_path, a=text("time_s,pressure_kpa,angle_deg", *rows(T, KPA, jumps))).doubts
    assert all(doubt.kind != "turn" for doubt in doubts)


def test_a_vacuum_that_is_renamed_alone_is_doubted(tmp_path: Path):
    table = text("time_s,vacuum_kpa,angle_deg", *rows(T, KPA, DEG))
    found = read(tmp_path, "rename: {vacuum_kpa: pressure_kpa}", a=table)
    assert [doubt.kind for doubt in found.doubts] == ["sign"]
    assert "'units: {vacuum_kpa: -1 kPa}'" in found.doubts[0].sentence


def test_a_clock_that_is_set_forward_is_doubted(tmp_path: Path):
    stamps = [
        f"2026-03-29 {'01' if t < 1 else '03'}:{59 if t < 1 else 0:02}:{(59 + t) % 60:06.3f}" for t in T
    ]
    found = read(tmp_path, a=text("time,pressure_kpa,angle_deg", *rows(stamps, KPA, DEG)))
    assert [doubt.kind for doubt in found.doubts] == ["clock"]
    pause = [stamp.replace(" 03:00:", " 03:10:") for stamp in stamps]  # an hour and ten minutes: a pause
    assert not read(tmp_path, a=text("time,pressure_kpa,angle_deg", *rows(pause, KPA, DEG))).doubts


@pytest.mark.parametrize(
    ("mark", "cell"), [("-9999999", "-9999999.00"), ('"9.9E37"', "9.900000E+37"), ("-999", "-999")]
)
def test_a_number_that_stands_for_a_missing_value_is_one_in_any_notation(
    tmp_path: Path, mark: str, cell: str
):
    table = text("time_s,pressure_kpa,angle_deg", "0,0,0", f"1,1,{cell}", "2,2,2")
    found = read(tmp_path, f"missing: [{mark}]", a=table)
    assert np.degrees(found.runs[0].outputs["angle_rad"]) == pytest.approx([0, np.nan, 2], nan_ok=True)


def test_a_switch_of_a_joined_file_holds_its_state(tmp_path: Path):
    valve = text("time_s,pressure_kpa,valve_open", "0,0,1", "1,3,1", "1.5,3,0", "2.4,3,0")
    found = read(tmp_path, "join: {file: valve.csv, hold: false}", a=CAMERA, valve=valve)
    history = found.runs[0].history
    assert history.valve_open is not None and history.valve_open.tolist() == (T < 1.5).astype(float).tolist()
    assert history.actuation["pressure_pa"][20] == pytest.approx(2400)
