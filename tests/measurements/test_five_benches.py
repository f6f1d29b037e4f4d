"""Causes of the refusal of five benches: idle gauges, row counters, motor steps, travels, curvatures, data per run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pliant.config.measurements import MeasurementsConfig
from pliant.errors import UserError
from pliant.measurements.files import read_measurements
from pliant.measurements.floors import noise_floors
from pliant.records.history import LetGo

TRIALS = Path(__file__).parents[3] / "shared/trials"


def chamber_1_steps(idle: bool) -> str:
    """Return six steps of one chamber, and two idle chambers with 0.1 psi of noise at 1.5 psi."""
    rng = np.random.default_rng(0)
    first = np.tile(np.repeat([1.5, 5.0], 70), 6) + 0.1 * rng.standard_normal(840)
    others = [1.5 + 0.1 * rng.standard_normal(840) for _ in range(2 * idle)]
    columns = [0.1 * np.arange(840), first, *others, 2.0 * first]
    names = [f"pressure_{k}_psi" for k in range(1, 4 if idle else 2)]
    rows = "\n".join(",".join(f"{value:.4f}" for value in row) for row in zip(*columns, strict=True))
    return f"time_s,{','.join(names)},angle_deg\n{rows}\n"


@pytest.mark.parametrize("idle", [False, True])
def test_idle_gauge_noise_makes_no_cycles(read, idle):
    assert read(chamber_1_steps(idle)).runs[0].cycle.max() == 6


@pytest.mark.skipif(not TRIALS.exists(), reason=f"{TRIALS} is not on this machine")
def test_the_trial_with_idle_gauges_has_six_cycles_with_one_chamber_and_with_three():
    for name in ("one_chamber.csv", "three_chambers.csv"):
        assert read_measurements(TRIALS / "idle_gauges_make_cycles" / name).runs[0].cycle.max() == 6


def test_an_input_that_moves_little_beside_a_high_base_pressure_makes_its_cycles(read):
    """The excursions of a chamber with a base pressure count from there, not from zero."""
    rows = "".join(f"{k},{100 + 2 * (k % 10 > 4)},{1e-3 * k % 2},1\n" for k in range(40))
    assert read(f"time_s,pressure_1_kpa,pressure_2_kpa,angle_deg\n{rows}").runs[0].cycle.max() == 4


def test_a_row_counter_is_never_proposed_and_motor_steps_are_tendons(read):
    with pytest.raises(UserError) as error:
        read("sample,motor_1_steps,motor_2_steps,tip_x_mm\n0,0,0,0\n1,1,-1,0.2\n")
    text = str(error.value)
    assert '"motor_1_steps": tendon_travel_1_m' in text and '"motor_2_steps": tendon_travel_2_m' in text
    assert '"motor_1_steps": 1 mm  # <- what one step pulls in' in text
    assert '"sample"' not in text
    for name in ("sample", "row", "Index", "nr"):
        with pytest.raises(UserError) as error:
            read(f"{name},tip_x_mm\n0,0\n1,0.2\n")
        assert f'"{name}"' not in str(error.value)


def test_motor_steps_with_a_stated_scale(read):
    notes = "rename: {motor_1_steps: tendon_travel_1_m}\nunits: {motor_1_steps: 0.01 mm}\n"
    found = read("sample,motor_1_steps,tip_x_mm\n0,0,0\n1,30,0.2\n2,-10,0.1\n", notes)
    np.testing.assert_allclose(found.runs[0].input("tendon_travel_1_m"), [0.0, 3e-4, -1e-4])
    assert found.runs[0].history.time_s is None
    np.testing.assert_allclose(found.runs[0].outputs["tip_x_m"], [0.0, 2e-4, 1e-4])


def test_a_travel_drives_where_nothing_else_does(read):
    found = read("time_s,tendon_travel_mm,angle_deg\n0,0,0\n1,1,5\n")
    assert list(found.runs[0].history.actuation) == ["tendon_travel_m"] and found.outputs == ("angle_rad",)
    assert any("actuation_name: tendon_travel_m" in remark for remark in found.remarks)
    beside = read("time_s,tendon_force_n,tendon_travel_mm,angle_deg\n0,0,0,0\n1,1,1,5\n")
    assert beside.outputs == ("tendon_travel_m", "angle_rad")
    with pytest.raises(UserError, match="no column drives the chain"):
        read("time_s,tendon_travel_mm\n0,0\n1,1\n")


def test_curvatures_are_no_positions(read):
    in_mm = read("time_s,pressure_pa,curvature [1/mm]\n0,0,0.001\n1,9e3,0.002\n")
    np.testing.assert_allclose(in_mm.runs[0].outputs["curvature_1_per_m"], [1.0, 2.0])
    text = "time_s,pressure_pa,curvature_x_1_per_m,curvature_y_1_per_m\n0,0,0.1,0\n1,9e3,0.7,-0.1\n"
    with pytest.raises(UserError) as error:
        read(text)
    assert '"curvature_x_1_per_m": curvature_y_1_per_m' in str(error.value)
    assert '"curvature_y_1_per_m": curvature_z_1_per_m' in str(error.value) and "tip_x" not in str(
        error.value
    )
    renamed = "{curvature_x_1_per_m: curvature_y_1_per_m, curvature_y_1_per_m: curvature_z_1_per_m}"
    found = read(text, f"rename: {renamed}\n")
    assert found.outputs == ("curvature_y_1_per_m", "curvature_z_1_per_m")
    np.testing.assert_array_equal(found.runs[0].outputs["curvature_z_1_per_m"], [0.0, -0.1])


def test_a_laser_reads_how_far_the_chain_has_grown(read):
    found = read(
        "time_s,pressure_psi,displacement_mm\n0,0,0\n1,10,-2.5\n", "rename: {displacement_mm: extension_mm}\n"
    )
    np.testing.assert_allclose(found.runs[0].outputs["extension_m"], [0.0, -2.5e-3])
    np.testing.assert_allclose(found.runs[0].input("pressure_pa"), [0.0, 68947.57], rtol=1e-6)


RUNS = "run,time_s,pressure_pa,angle_rad\nA,0,0,0.5\nA,1,1e4,0.9\nB,0,0,0.1\nB,1,1e4,0.5\n"


def test_what_a_file_does_not_say_about_its_runs(read):
    notes = "runs:\n  A: {payload: 200 g, specimen: s7}\n  B: {payload_g: 50, moment: 2 mN*m}\n"
    first, second = read(RUNS, notes).runs
    np.testing.assert_allclose(first.history.payload_kg, 0.2)
    np.testing.assert_allclose(second.history.payload_kg, 0.05)
    np.testing.assert_allclose(second.history.moment_n_m, 2e-3)
    np.testing.assert_allclose(first.history.moment_n_m, 0.0)
    assert first.history.specimen == "s7" and second.history.specimen != "s7"
    with pytest.raises(UserError, match="'angle', which is no input, load or condition"):
        read(RUNS, "runs: {A: {angle: 3 deg}}\n")
    with pytest.raises(UserError, match="'payload', which is no input"):
        read(RUNS, "runs: {A: {payload: 3 mm, payload_kg: 2}}\n")


def test_inputs_for_a_file_without_any_come_from_the_notes_on_its_run(tmp_path):
    (tmp_path / "swing.csv").write_text("time_s,bend_deg\n0,17\n0.1,12\n")
    (tmp_path / "driven.csv").write_text("time_s,pressure_pa,bend_deg\n0,0,0\n1,9e3,12\n")
    notes = {"runs": {"swing": {"pressure_pa": 0}}, "rename": {"bend_deg": "angle_deg"}, "let_go": "swing"}
    found = read_measurements([tmp_path / "driven.csv", tmp_path / "swing.csv"], notes)
    np.testing.assert_array_equal(found.runs[1].input("pressure_pa"), [0, 0])
    assert [run.history.let_go for run in found.runs] == [None, LetGo(None, np.deg2rad(17))]
    later = {**notes, "let_go": {"swing": {"at": "0.1 s", "bend": "17 deg"}}}
    held = read_measurements(tmp_path / "swing.csv", later).runs[0].history.let_go
    assert held.until_s == 0.1 and held.bend_rad == pytest.approx(np.deg2rad(17))
    with pytest.raises(
        UserError, match="'let_go' names run 'swong', which is not there; did you mean 'swing'"
    ):
        read_measurements([tmp_path / "driven.csv", tmp_path / "swing.csv"], {**notes, "let_go": ["swong"]})


def test_each_cycle_may_be_a_run_so_that_steps_are_repeats(read):
    found = read(chamber_1_steps(True), "cycles: new run\n")
    assert [run.name for run in found.runs] == [f"bench cycle {k}" for k in range(1, 7)]
    assert sum(map(len, found.runs)) == 840
    assert {run.history.specimen for run in found.runs} == {found.runs[0].history.specimen}
    assert max(np.ptp(run.history.time_s) for run in found.runs[1:-1]) < 14.3  # 140 samples, to two of them


def test_steps_between_two_levels_above_the_first_value(read):
    """Steps of 5 and 10 psi from a start at 1.5: the return to 5 does not end a cycle below a quarter of the range."""
    levels = [1.5, *[5.0, 10.0] * 4, 5.0]
    rows = "".join(f"{k},{levels[k // 20]},{levels[k // 20]}\n" for k in range(20 * len(levels)))
    text = f"time_s,pressure_psi,angle_deg\n{rows}"
    assert len(read(text, "cycles: new run\n").runs) == 1
    found = read(text, "cycles: {of: pressure_psi, low: 6 psi, high: 9 psi}\n")
    assert [len(run) for run in found.runs] == [60 - 1 + 20, 40, 40, 41]
    with pytest.raises(UserError, match="'cycles' are of 'pressur_psi', which is no input; did you mean"):
        read(text, "cycles: {of: pressur_psi, low: 6 psi, high: 9 psi}\n")
    with pytest.raises(UserError, match="'low' should be below 'high'"):
        read(text, "cycles: {of: pressure_pa, low: 9 psi, high: 6 psi}\n")


def test_a_zero_in_each_run_is_no_noise_between_repeats(read):
    text = "run,time_s,pressure_pa,angle_rad\n"
    rng = np.random.default_rng(1)
    for k, name in enumerate("ABC"):
        text += "".join(f"{name},{t},{t},{0.2 * k + 0.01 * rng.standard_normal():.5f}\n" for t in range(60))
    assert noise_floors(read(text))["angle_rad"].value > 0.1
    found = read(text, "zero: {angle_rad: per run}\n")
    assert found.free_zeros == {"angle_rad": "per run"}
    assert noise_floors(found)["angle_rad"].value == pytest.approx(0.01, rel=0.25)
    with pytest.raises(UserError, match="said of readings alone"):
        read(text, "zero: {pressure_pa: unknown}\n")


@pytest.mark.parametrize(
    ("notes", "quaternion", "angle"),
    [
        ("frame: {turn: unknown}", None, None),
        ("frame: {turn: [0.5, 0.5, -0.5, 0.5]}", (0.5, 0.5, -0.5, 0.5), None),
        ("frame: {turn: 30 deg}", None, np.pi / 6),
    ],
)
def test_the_camera_frame(read, notes, quaternion, angle):
    frame = read("time_s,pressure_pa,tip_x_mm\n0,0,0\n1,9e3,1\n", notes + "\n").frames["*"]
    assert frame.quaternion == quaternion
    assert frame.angle_rad == (None if angle is None else pytest.approx(angle))


def test_a_file_that_is_left_out_as_a_whole_leaves_the_others(tmp_path):
    for name in "ab":
        (tmp_path / f"{name}.csv").write_text(f"time_s,pressure_pa,angle_rad\n0,0,0\n1,{ord(name)},0.1\n")
    both = [tmp_path / "a.csv", tmp_path / "b.csv"]
    found = read_measurements(both, {"exclude": [{"run": "a", "why": "the camera stood"}]})
    assert [run.name for run in found.runs] == ["b"]
    assert any("Run 'a' is left out (the camera stood)" in said for said in found.remarks)
    with pytest.raises(UserError, match="no run is left of any of the files"):
        read_measurements(both, {"exclude": [{"run": "a"}, {"run": "b"}]})


def test_an_output_is_called_as_in_the_file(tmp_path):
    (tmp_path / "a.csv").write_text("time_s,pressure_kpa,tip angle [deg],tip_x_mm\n0,0,0,0\n1,5,10,3\n")
    for name in ("tip angle", "tip angle [deg]", "angle_rad"):
        settings = MeasurementsConfig(file="a.csv", rename={"tip angle": "angle_rad"}, outputs=(name,))
        assert read_measurements(tmp_path / "a.csv", settings).outputs == ("angle_rad",)


def test_a_sigma_is_called_as_in_the_file(read):
    found = read(
        "time_s,pressure_pa,tip angle [deg]\n0,0,0\n1,1,5\n",
        "rename: {tip angle: angle_deg}\nsigma: {tip angle: 1 deg}\n",
    )
    np.testing.assert_allclose(found.runs[0].sigma["angle_rad"], np.deg2rad(1.0))


def test_notes_on_several_files_may_name_columns_that_only_some_have(tmp_path):
    (tmp_path / "a.csv").write_text("time_s,pressure_pa,bend\n0,0,0\n1,9,4\n")
    (tmp_path / "b.csv").write_text("time_s,pressure_pa,grown_mm\n0,0,0\n1,9,4\n")
    notes = {"rename": {"bend": "angle_deg", "grown_mm": "extension_mm"}, "zero": {"bend": "1 deg"}}
    found = read_measurements([tmp_path / "a.csv", tmp_path / "b.csv"], notes)
    assert found.outputs == ("angle_rad", "extension_m")
    with pytest.raises(UserError, match="'units' has 'bent', which is not a column of any of the files"):
        read_measurements([tmp_path / "a.csv", tmp_path / "b.csv"], {**notes, "units": {"bent": "deg"}})
