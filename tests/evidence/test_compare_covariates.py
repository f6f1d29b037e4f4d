"""Covariates, their bins and the part of a residual that they explain."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.evidence.compare_data import bench, measured_run, profile

from pliant.evidence.comparison import run_residuals
from pliant.evidence.covariates import Covariate, binned, covariates, crossed, phases
from pliant.evidence.importance import importance
from pliant.formatting import named_unit, number, output_unit
from pliant.records.history import History
from pliant.records.measurement import Measurement


@pytest.mark.parametrize("noise_pa", [0.0, 20.0])
def test_phases_in_a_ramp_and_a_hold(noise_pa):
    time, pressure = profile(1e3, 12.0)
    found = phases(pressure + np.random.default_rng(0).normal(0, noise_pa, len(time)), time)
    inside = lambda a, b: (time > a + 2) & (time < b - 2)  # noqa: E731 - away from the corners
    assert np.mean(found.direction[inside(0, 15)] == 1) > 0.98
    assert np.mean(found.direction[inside(15, 27)] == 0) > 0.98
    assert np.mean(found.direction[inside(27, 42)] == -1) > 0.98
    assert np.nanmedian(found.rate[inside(0, 15)]) == pytest.approx(1e3, rel=0.05)
    if not noise_pa:
        assert found.hold_s[np.searchsorted(time, 20.05)] == pytest.approx(5.0, abs=0.2)
        assert np.isnan(found.hold_s[inside(0, 15)]).all()


def test_a_slow_ramp_beside_a_long_hold_is_no_hold():
    time = np.arange(0.0, 1000.0)
    pressure = np.minimum(time * 50.0, 15e3)
    found = phases(pressure, time)
    assert (found.direction[1:300] == 1).all() and (found.direction[301:] == 0).all()


def test_a_step_belongs_to_the_sample_that_it_leads_to():
    found = phases(np.array([0.0, 0, 0, 5, 5, 5]), np.arange(6.0))
    assert found.direction.tolist() == [0, 0, 0, 1, 0, 0]
    assert found.hold_s[4:].tolist() == [1.0, 2.0]


def make_run(name, specimen, top, **conditions):
    time, pressure = profile(1e3, 3.0, top=top)
    history = History.from_arrays({"pressure_pa": pressure}, time, run=name, specimen=specimen, **conditions)
    return measured_run(history, {"angle_rad": np.zeros(len(time))})


def test_the_largest_level_is_carried_from_run_to_run_on_a_specimen():
    runs = (make_run("a", "A", 9e3), make_run("b", "B", 5e3), make_run("c", "A", 5e3))
    past = covariates(Measurement(runs, ("angle_rad",)))["past_pressure_pa"].values
    assert past[1].max() == pytest.approx(5e3, rel=0.02) and past[1][0] == 0
    assert (past[2] == past[0].max()).all()


def test_only_what_varies_is_a_covariate():
    alike = Measurement((make_run("a", "A", 9e3), make_run("b", "A", 9e3)), ("angle_rad",))
    names = covariates(alike).names
    assert {"pressure_pa", "direction", "hold_s", "clock_s", "run_number"} <= set(names)
    absent = {
        "moment_n_m",
        "payload_kg",
        "temperature_c",
        "specimen",
        "tip_force_n",
        "base_roll_rad",
        "cycle",
    }
    assert not absent & set(names)
    warm = make_run(
        "b", "B", 9e3, temperature_c=40.0, moment_n_m=-0.01, payload_kg=0.02, base_angles_rad=[0.5, 0, 0]
    )
    mixed = Measurement(
        (make_run("a", "A", 9e3), warm, make_run("c", "A", 9e3, moment_n_m=0.01)), ("angle_rad",)
    )
    expected = {"temperature_c", "moment_n_m", "moment_direction", "payload_kg", "specimen", "base_roll_rad"}
    assert expected <= set(covariates(mixed).names)


def test_force_directions():
    runs = [
        make_run(str(k), "", 9e3, tip_force_n=f) for k, f in enumerate(([0, 0, -1], [0.5, 0, 0], [0, 0, 0]))
    ]
    bins = binned(covariates(Measurement(tuple(runs), ("angle_rad",)))["tip_force_direction"])
    words = [bins.words[codes[0]] for codes in bins.codes]
    assert words == ["tip force toward −z", "tip force toward +x", "no tip force"]


@given(
    st.lists(
        st.lists(st.floats(-1e6, 1e6) | st.just(np.nan), min_size=1, max_size=40), min_size=1, max_size=4
    )
)
def test_bins_hold_every_sample_once(values):
    arrays = tuple(np.array(v, float) for v in values)
    bins = binned(Covariate("pressure_pa", named_unit("pressure", "Pa"), arrays))
    assert [len(c) for c in bins.codes] == [len(v) for v in arrays]
    used = np.unique(np.concatenate(bins.codes))
    assert used.tolist() == list(range(len(bins)))
    assert len(bins.centres) == len(bins.words)


def test_levels_get_a_bin_each_and_a_ramp_does_not():
    payload = Covariate("payload_kg", named_unit("payload", "kg"), (np.repeat([0.0, 0.02, 0.05], 5),))
    assert binned(payload).words == ("payload 0 g", "payload 20 g", "payload 50 g")
    rates = np.concatenate([np.full(9, 100.0), np.full(9, 300.0), np.full(9, 30e3), [np.nan]])
    rate = Covariate("rate_pa_s", named_unit("pressure rate", "Pa/s"), (rates,), rest="held pressure")
    assert binned(rate).words == (
        *(f"pressure rate {r} kPa/s" for r in ("0.1", "0.3", "30")),
        "held pressure",
    )
    ramp = Covariate("pressure_pa", named_unit("pressure", "Pa"), (np.linspace(0, 15e3, 400),))
    bins = binned(ramp)  # no value that many readings share
    assert bins.words[0] == "pressure below 3 kPa" and bins.words[1] == "pressure 3 to 6 kPa"
    counts = np.bincount(bins.codes[0])
    assert counts.min() > 40


def test_a_value_that_many_samples_share_has_its_own_bin():
    values = np.concatenate([np.zeros(80), np.linspace(-4e-3, -1e-3, 30), np.linspace(1e-3, 4e-3, 30)])
    bins = binned(Covariate("moment_n_m", named_unit("moment", "N*m"), (values,)))
    counts = np.bincount(bins.codes[0])
    assert counts[bins.words.index("moment 0 mN·m")] == 80
    assert bins.words[0].startswith("moment below") and bins.words[-1].startswith("moment above")
    assert counts.sum() == len(values)


def test_crossed_bins_do_not_repeat_themselves():
    measurement, _ = bench(0)
    found = covariates(measurement)
    words = crossed(binned(found["direction"]), binned(found["pressure_pa"])).words
    assert "falling pressure, 0 to 5 kPa" in words
    assert not any("pressure, pressure" in word for word in words)


RESIDUALS = {
    "direction": lambda h, f: 1.0 * (f["direction"] == 2),
    "moment_n_m": lambda h, f: 40 * h.moment_n_m,
    "pressure_pa": lambda h, f: h.actuation["pressure_pa"] / 15e3,
}


@pytest.mark.parametrize("name", RESIDUALS)
def test_the_covariate_that_made_a_residual_tells_most(name):
    measurement, _ = bench(0)
    found = covariates(measurement)
    rng = np.random.default_rng(0)
    residuals = []
    for k, run in enumerate(measurement.runs):
        here = {item.name: item.values[k] for item in found.items}
        residuals.append({"angle_rad": RESIDUALS[name](run.history, here) + rng.normal(0, 0.3, len(run))})
    told = importance(residuals, found)
    assert next(iter(told)) == name
    assert told[name] > 0.3


def test_noise_and_a_constant_are_told_by_nothing():
    measurement, predicted = bench(1, phi=0.0)
    biased = [{"angle_rad": run["angle_rad"] - 0.1} for run in predicted]
    told = importance(run_residuals(measurement, biased), covariates(measurement))
    assert max(told.values()) < 0.03


def test_a_pair_is_named_where_neither_alone_tells():
    measurement, _ = bench(0, settings=[(r, m) for r in (1e3, 5e3) for m in (-0.02, 0.0, 0.02)])
    residuals = [
        {"angle_rad": np.sign(run.history.moment_n_m) * run.history.actuation["pressure_pa"] / 15e3}
        for run in measurement.runs
    ]
    told = importance(residuals, covariates(measurement))
    first = next(iter(told))
    assert " × " in first and "moment" in first
    assert told[first] > 0.9


def test_one_run_is_cross_validated_by_stretches():
    measurement, _ = bench(0)
    one = replace(measurement, runs=measurement.runs[:1])
    residuals = [{"angle_rad": one.runs[0].history.actuation["pressure_pa"] / 15e3}]
    told = importance(residuals, covariates(one))
    assert told["pressure_pa"] > 0.8 and "run_number" not in told


def test_numbers_along_the_chain():
    position = covariates(bench(0, n_joints=2)[0]).position
    assert position == {"joint_1_angle_rad": 1, "joint_2_angle_rad": 2}


def test_units_for_people():
    assert output_unit("tip_x_m").text(0.0123) == "12.3 mm"
    assert output_unit("joint_2_angle_rad").text(np.pi) == "180°"
    assert output_unit("elongation_strain").axis == "elongation (%)"
    assert output_unit("angle_rad").label == "bend angle"
    assert [number(v, 3) for v in (-0.5, 1234.0, np.nan, 0.0)] == ["−0.5", "1234", "–", "0"]
