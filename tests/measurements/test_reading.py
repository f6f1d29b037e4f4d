"""A measurement file is read in SI; conversions, ignored columns and omissions are reported in words."""

from pathlib import Path

import numpy as np
import pytest

from pliant.config.loading import load_study
from pliant.config.measurements import ExcludedSpan, MeasurementsConfig
from pliant.measurements.reading import read_measurement
from pliant.records.history import REFERENCE_TEMPERATURE_C
from pliant.records.measurement import Measurement
from pliant.registry.discovery import discover

REAL = Path(__file__).parents[3] / "shared/data/measured/two_bellow_bending.csv"
PLAIN = "run,time_s,pressure_pa,angle_rad\nA,0,0,0.01\nA,1,5e3,0.2\nA,2,1e4,0.4\nB,0,0,0.0\nB,1,1e4,0.41\n"


def said(measurement: Measurement) -> str:
    return "\n".join(measurement.remarks)


def test_a_plain_file(read):
    found = read(PLAIN)
    assert [run.name for run in found.runs] == ["A", "B"]
    assert found.outputs == ("angle_rad",)
    np.testing.assert_array_equal(found.runs[0].history.time_s, [0, 1, 2])
    np.testing.assert_array_equal(found.runs[0].history.actuation["pressure_pa"], [0, 5e3, 1e4])
    np.testing.assert_array_equal(found.runs[1].outputs["angle_rad"], [0.0, 0.41])
    np.testing.assert_array_equal(found.runs[1].lines, [5, 6])
    assert (found.runs[0].history.temperature_c == REFERENCE_TEMPERATURE_C).all()
    assert found.runs[0].history.payload_kg is None
    assert found.remarks == ()


@pytest.mark.parametrize("change", ["\ufeff{}", "# a comment\n\n{}", "{}\n\n#end"])
def test_byte_order_mark_comments_and_windows_line_ends(read, change):
    found = read(change.format(PLAIN.replace("\n", "\r\n")))
    np.testing.assert_array_equal(found.runs[1].outputs["angle_rad"], [0.0, 0.41])
    assert found.runs[0].lines[0] == (4 if change.startswith("#") else 2)


def test_every_load_and_condition(read):
    found = read(
        "run,specimen,cycle,tendon_force_n,tendon_travel_m,moment_nm,tip_force_x_n,tip_force_y_n,tip_force_z_n,payload_kg,"
        "temperature_c,base_roll_rad,base_pitch_rad,base_yaw_rad,joint_2_angle_rad,marker_1_x_m,sigma_marker_1_x_m\n"
        "A,s1,3,2,0.01,0.5,1,2,3,0.1,30,0.1,0.2,0.3,0.4,0.05,0.001\n"
    )
    run, history = found.runs[0], found.runs[0].history
    assert history.specimen == "s1" and history.time_s is None
    assert run.cycle[0] == 3 and history.moment_n_m[0] == 0.5 and history.payload_kg[0] == 0.1
    np.testing.assert_array_equal(history.tip_force_n, [[1, 2, 3]])
    np.testing.assert_array_equal(history.base_angles_rad, [[0.1, 0.2, 0.3]])
    assert history.temperature_c[0] == 30
    assert found.outputs == ("tendon_travel_m", "joint_2_angle_rad", "marker_1_x_m")
    assert run.sigma["marker_1_x_m"][0] == 0.001


def test_tendon_travel_is_an_input_where_the_chain_says_so(read):
    found = read("run,tendon_travel_m,angle_rad\nA,0.01,0.1\nA,0.02,0.2\n", actuation=["tendon_travel_m"])
    assert found.outputs == ("angle_rad",)
    assert list(found.runs[0].history.actuation) == ["tendon_travel_m"]


def test_units_in_names_are_converted_and_said(read):
    found = read(
        "run,time_ms,pressure_kPa,angle_deg,base_roll_deg,payload_g,tip_x_mm,temperature_k,sigma_angle_deg\n"
        "A,0,15,90,180,20,30,300,0.1\nA,500,20,45,180,20,31,300,0.1\n"
    )
    history = found.runs[0].history
    np.testing.assert_allclose(history.time_s, [0, 0.5])
    np.testing.assert_allclose(history.actuation["pressure_pa"], [15e3, 20e3])
    np.testing.assert_allclose(found.runs[0].outputs["angle_rad"], [np.pi / 2, np.pi / 4])
    np.testing.assert_allclose(history.base_angles_rad[:, 0], np.pi)
    np.testing.assert_allclose(history.payload_kg, 0.02)
    np.testing.assert_allclose(found.runs[0].outputs["tip_x_m"], [0.03, 0.031])
    np.testing.assert_allclose(history.temperature_c, 26.85)
    np.testing.assert_allclose(found.runs[0].sigma["angle_rad"], np.deg2rad(0.1))
    assert "Column 'pressure_kPa' was converted: pressure_pa = 1000 × value." in found.remarks
    assert "angle_rad = 0.0174533 × value" in said(found)


def test_notes_rename_convert_state_sigmas_and_exclude(read):
    found = read(
        "trial,time_s,p,bend,tip_x_m\nA,0,0,0,0\nA,1,5,10,1e-2\nA,2,10,20,2e-2\nB,0,0,0,0\nB,1,10,20,2e-2\n",
        "rename: {trial: run, p: pressure_pa, bend: angle_rad}\n"
        "units: {p: kPa, angle_rad: deg}\n"
        "sigma: {angle_rad: 0.5 deg, tip_x_m: 1e-4}\n"
        "markers: [10 mm, 20 mm]\n"
        "exclude:\n  - {run: A, start: 0.5, end: 1500 ms, why: camera moved}\n  - {run: B}\n",
    )
    run = found.runs[0]
    np.testing.assert_allclose(run.history.actuation["pressure_pa"], [0, 5e3, 1e4])
    np.testing.assert_allclose(run.outputs["angle_rad"], np.deg2rad([0, np.nan, 20]))
    np.testing.assert_allclose(run.sigma["angle_rad"], np.deg2rad(0.5))
    np.testing.assert_allclose(run.sigma["tip_x_m"], 1e-4)
    assert found.marker_arms_m == (0.01, 0.02)
    assert [r.name for r in found.runs] == ["A"]
    assert "1 sample of run 'A' not compared (camera moved); inputs are kept." in found.remarks
    assert "Run 'B' is left out" in said(found)


def test_the_study_comes_before_the_notes_and_a_study_is_no_notes(read, tmp_path):
    settings = MeasurementsConfig(file="bench.csv", units={"pressure_pa": "bar"}, outputs=("angle_rad",))
    found = read(PLAIN, "units: {pressure_pa: kPa}\n", settings=settings)
    assert found.runs[0].history.actuation["pressure_pa"][-1] == pytest.approx(1e9)
    assert read(PLAIN, "pliant: 1\nname: bench\n").remarks == ()


def test_lines_may_be_excluded(read):
    span = ExcludedSpan(run="A", lines=(3, 3))
    found = read(PLAIN, settings=MeasurementsConfig(file="bench.csv", exclude=(span,)))
    assert np.isnan(found.runs[0].outputs["angle_rad"]).tolist() == [False, True, False]


HEAD = "run,time_s,pressure_pa,angle_rad\n"


@pytest.mark.parametrize(
    ("text", "lines", "remarks"),
    [
        (
            "run,pressure_pa,bend_angle_rad,tip_x_m,colour\nA,0,1,0.1,red\nA,9e3,1,0.1,red\n",
            [[2, 3]],
            ["'rename: {bend_angle_rad: angle_rad}' in bench.yaml", "Column 'colour' is not known"],
        ),
        (
            HEAD + "A,0,0,\nA,1,,0.2\nA,2,1e4,nan\nA,3,2e4,0.3\n,,,\nA,,1e4,0.1\nB,0,0,0\n",
            [[2, 4, 5], [8]],
            [
                "pressure_pa is blank in 1 row (line 3)",
                "time_s is blank in 1 row (line 7)",
                "1 row of nothing",
            ],
        ),
        (
            PLAIN.replace("A,1,5e3,0.2\n", "A,1,5e3,0.2\nA,1,5e3,0.2\n"),
            [[2, 3, 5], [6, 7]],
            ["1 row equal to the row before in every column (line 4)"],
        ),
        (
            HEAD + "A,0,0,0\nB,0,0,0\nA,1,1e4,1\nB,1,1e4,1\n",
            [[2, 4], [3, 5]],
            ["Rows of 2 of 2 runs are not consecutive"],
        ),
        (
            "pressure_pa,angle_rad,successes,trials\n0,0,1,2\n1e4,1,1,2\n",
            [[2, 3]],
            ["no column 'run'", "no column 'time_s'", "'successes' counts trials", "one run only"],
        ),
        (
            HEAD + "A,0,5e3,0\nA,1,5e3,0\nB,0,5e3,0\n",
            [[2, 3], [4]],
            ["Input 'pressure_pa' never changes"],
        ),
    ],
)
def test_rows_are_kept_or_it_is_said_why_not(read, text, lines, remarks):
    found = read(text)
    assert [run.lines.tolist() for run in found.runs] == lines
    assert [remark for remark in remarks if remark not in said(found)] == []


def test_blank_loads_are_the_default_throughout_a_run_only(read):
    found = read(
        "run,pressure_pa,tip_force_z_n,payload_kg,temperature_c,angle_rad\n"
        "A,0,,,,0\nA,9e3,,,,0.1\nB,0,0.5,0.1,25,0\nB,9e3,,0.1,25,0.1\n"
    )
    first, second = (run.history for run in found.runs)
    assert first.tip_force_n[:, 2].tolist() == [0, 0] and first.payload_kg is None
    assert first.temperature_c[0] == REFERENCE_TEMPERATURE_C
    assert len(second) == 1 and second.payload_kg.tolist() == [0.1]
    assert "tip_force_z_n is blank throughout 1 run: taken as 0 there." in said(found)
    assert "tip_force_z_n is blank in 1 row of runs that have it elsewhere" in said(found)


@pytest.mark.parametrize(
    ("column", "values", "expected", "unit"),
    [
        ("pressure_pa", (0, 15), None, "kPa"),
        ("angle_rad", (0, 40), None, "deg"),
        ("tip_x_m", (0, 80), None, "mm"),
        ("payload_kg", (50, 60), None, "g"),
        ("temperature_c", (295, 296), None, "K"),
        ("base_roll_rad", (0, 90), None, "deg"),
        ("time_s", (0, 20), None, "ms"),
        ("elongation_strain", (0, 30), None, "percent"),
        ("pressure_pa", (0, 400), 4e5, "kPa"),
        ("tip_x_m", (0, 9), 0.01, "mm"),
        ("angle_rad", (0, 12), 0.2, "deg"),
    ],
)
def test_wrong_units_are_noticed_and_what_the_model_expects_sharpens_the_check(
    read, column, values, expected, unit
):
    columns = {"time_s": (0, 1), "pressure_pa": (0, 2e4), "angle_rad": (0, 1), column: values}
    rows = "".join(f"A,{','.join(str(v[i]) for v in columns.values())}\n" for i in (0, 1))
    text = f"run,{','.join(columns)}\n{rows}"
    if expected is not None:
        assert "Unit to check" not in said(read(text))
    found = read(text, expected={} if expected is None else {column: (0.0, expected)})
    assert f"'units: {{{column}: {unit}}}' in bench.yaml" in said(found)
    assert len([r for r in found.remarks if r.startswith("Unit to check")]) == 1


def test_an_idle_chamber_and_small_readings_are_no_wrong_unit(read):
    found = read(
        "run,pressure_1_pa,pressure_2_pa,angle_rad,tip_x_m\nA,0,3,0,0\nA,2e4,-5,1e-4,1e-6\n",
        expected={"tip_x_m": (-0.1, 0.1), "angle_rad": (-1.0, 1.0)},
    )
    assert "Unit to check" not in said(found)


def test_long_runs_are_thinned_by_powers_to_base_two_and_never_averaged(read):
    def rows(name: str, n: int) -> str:
        return "".join(f"{name},{i},{100 * i},{i}e-4\n" for i in range(n))

    settings = MeasurementsConfig(file="bench.csv", max_samples=1000)
    text = "run,time_s,pressure_pa,angle_rad\n" + rows("A", 3000) + rows("B", 3000) + rows("C", 50)
    found = read(text, settings=settings)
    kept = {run.name: run.history.time_s for run in found.runs}
    assert len(kept["A"]) + len(kept["B"]) + len(kept["C"]) <= 1000
    np.testing.assert_array_equal(kept["A"], np.arange(0, 3000, 8))
    np.testing.assert_array_equal(kept["A"], kept["B"])
    np.testing.assert_array_equal(kept["C"], np.arange(50))
    np.testing.assert_array_equal(found.runs[0].lines, 2 + np.arange(0, 3000, 8))
    assert "6050 rows are more than max_samples (1000)" in said(found)
    assert read(text).n_samples == 6050


def test_blocks_do_not_show(read, monkeypatch):
    text = "run,time_s,pressure_pa,angle_rad\n" + "".join(
        f"r {i // 40},{i % 40},{i},{'' if i % 7 else 0.1 * i}\n" + ("# note\n\n" if i % 11 == 0 else "")
        for i in range(300)
    )
    whole = read(text)
    monkeypatch.setattr("pliant_tables.text.BLOCK", 64)
    pieces = read(text)
    assert whole.remarks == pieces.remarks
    for a, b in zip(whole.runs, pieces.runs, strict=True):
        np.testing.assert_array_equal(a.lines, b.lines)
        np.testing.assert_array_equal(a.outputs["angle_rad"], b.outputs["angle_rad"])
    lines = text.splitlines()
    assert all(lines[n - 1].startswith(run.name) for run in pieces.runs for n in run.lines)


def test_progress_on_a_large_file(read, monkeypatch):
    class Watch:
        done = total = ended = 0

        def begin(self, title, total, done=0):
            self.total = total
            return self

        def advance(self, steps=1):
            self.done += steps

        def finish(self):
            self.ended += 1

    watch = Watch()
    monkeypatch.setattr("pliant.measurements.reading.LARGE_FILE", 10)
    read(PLAIN, progress=watch)
    assert (watch.done, watch.total, watch.ended) == (5, 6, 1)


def test_cycles_are_counted_from_the_actuation(read):
    pressures = [0, 1e4, 2e4, 1.2e4, 2e4, 1e4, 0, 0, 1e4, 2e4, 500, 1.9e4]
    text = "".join(f"A,{i},{p},0.1\n" for i, p in enumerate(pressures))
    found = read(f"run,time_s,pressure_pa,angle_rad\n{text}B,0,5,0\nB,1,0,0\nB,2,5,0\n")
    assert found.runs[0].cycle.tolist() == [1] * 7 + [2] * 3 + [3] * 2
    assert found.runs[1].cycle.tolist() == [1, 1, 1]


def test_a_study_names_its_measurement(tmp_path):
    (tmp_path / "study.yaml").write_text(
        "pliant: 1\nname: s\nmeasurements: {file: bench.csv, exclude: [{run: A, end: 2 s}]}\n"
    )
    block = load_study(tmp_path / "study.yaml", discover()).measurements
    assert Path(block.file) == tmp_path / "bench.csv"
    assert block.exclude[0].end_s == 2.0 and block.max_samples == 200_000


@pytest.mark.skipif(not REAL.exists(), reason=f"{REAL} is not on this machine")
def test_a_real_bench_file():
    found = read_measurement(REAL)
    assert [run.name for run in found.runs] == ["7V", "12V"] and [len(run) for run in found.runs] == [
        2276,
        2276,
    ]
    assert "'rename: {bend_angle_rad: angle_rad}'" in said(found)
    assert "'pump_1_command', 'pump_2_command' are not known" in said(found)
    settings = MeasurementsConfig(file=str(REAL), rename={"bend_angle_rad": "angle_rad"})
    named = read_measurement(REAL, settings=settings, actuation=["pressure_1_pa", "pressure_2_pa"])
    assert named.outputs == ("tip_x_m", "tip_y_m", "elongation_strain", "angle_rad")
    assert [int(run.cycle.max()) for run in named.runs] == [3, 3]
    assert not any("Unit to check" in remark for remark in named.remarks)
