"""The choice of held-out runs, and that nothing reads them before the final score."""

import numpy as np
from tests.diagnosis.bench_files import histories
from tests.diagnosis.quick import blank, make_measurement

from pliant.diagnosis.data_split import split_runs
from pliant.measurements.floors import noise_floors
from pliant.measurements.repeats import repeat_groups
from pliant.records.history import History


def zeros(repeats=2):
    return blank(histories(repeats))


def test_about_a_quarter_in_all_runs():
    for repeats in (1, 2, 3):
        measurement = zeros(repeats)
        assert 0.15 <= len(split_runs(measurement).runs) / len(measurement.runs) <= 0.34


def test_readings_are_hidden_inputs_are_kept_and_one_condition_is_unseen():
    measurement = zeros()
    found = split_runs(measurement)
    for k, (run, hidden) in enumerate(zip(measurement.runs, found.training.runs, strict=True)):
        assert hidden.history is run.history
        assert np.isnan(hidden.outputs["angle_rad"]).all() == (k in found.runs)
    groups = [set(group.runs) for group in repeat_groups(measurement)]
    whole = [group for group in groups if group <= set(found.runs)]
    assert len(whole) == 1 and set(found.unseen) == whole[0]
    assert any(len(group & set(found.runs)) == 1 for group in groups)
    # the only orientation, the only load and a new specimen stay in training
    names = [measurement.runs[k].name for k in found.unseen]
    assert not any(name.startswith(("level", "pressed", "virgin")) for name in names)
    assert not set(found.runs) & set(
        split_runs(found.training).runs
    )  # runs without readings are not held out


def test_training_keeps_repeats_to_see_its_noise_by():
    measurement = zeros()
    rng = np.random.default_rng(0)
    noisy = make_measurement(
        [run.history for run in measurement.runs],
        [{"angle_rad": rng.normal(0, 0.01, len(run))} for run in measurement.runs],
    )
    floor = noise_floors(split_runs(noisy).training)["angle_rad"]
    assert floor.source == "repeats" and floor.n_groups >= 2
    assert abs(floor.value / 0.01 - 1) < 0.1


def test_the_only_repeated_condition_stays_in_training():
    ramps = [np.linspace(0, top, 7) for top in (15e3, 14e3, 9e3, 8e3, 4e3)]
    runs = [History.from_arrays({"pressure_pa": ramps[k]}, run=f"run {k}") for k in range(5)]
    again = runs[0].with_(run="run 0 again")
    found = split_runs(blank([runs[0], again, *runs[1:]]))
    assert found.runs and not {0, 1} & set(found.runs)


def test_readings_do_not_decide():
    measurement = zeros()
    readings = [{"angle_rad": np.full(len(run), float(k))} for k, run in enumerate(measurement.runs)]
    other = make_measurement([run.history for run in measurement.runs], readings)
    assert split_runs(other).runs == split_runs(measurement).runs


def test_three_runs_are_too_few():
    measurement = blank(histories(1)[:3])
    found = split_runs(measurement)
    assert found.runs == () and found.training is measurement
    assert "too few" in found.why


def test_where_every_run_is_needed_none_is_put_aside_and_a_sentence_says_so():
    """The table has four runs, each under a different load."""
    drive = {"pressure_pa": np.linspace(0, 15e3, 7)}
    runs = [History.from_arrays(drive, run=f"force {k}", tip_force_n=[0.1 * k, 0, 0]) for k in range(4)]
    found = split_runs(blank(runs))
    assert found.runs == ()
    assert found.why.startswith("None of the 4 runs could be held out")
    assert "()" not in found.why
