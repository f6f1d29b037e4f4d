"""Comparison by law: false alarms, power, shares, symmetry, scale; questions that cannot be judged are reported."""

from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from tests.evidence.compare_data import angle, bench, colour, creep, falling_shift, measured_run

from pliant.errors import UserError
from pliant.evidence.comparison import compare
from pliant.evidence.comparison_sentences import headline, interpret
from pliant.records.history import History
from pliant.records.measurement import Measurement
from pliant.report.comparison import comparison_json

SHIFT = 0.01


@pytest.fixture(scope="module")
def friction():
    measurement, predicted = bench(0, effect=falling_shift(SHIFT))
    return compare(measurement, predicted)


def place(comparison, condition):
    return next(p for p in comparison.places if p.condition == condition)


@pytest.mark.slow
def test_clean_data_raise_few_alarms():
    """With every floor, offset and noise memory estimated from the repeats, at most 8 % of data sets alarm."""
    sets = 60
    offsets = (0.0, 0.001, 0.003)
    found = [compare(*bench(seed, offset=offsets[seed % 3], dt=0.4)) for seed in range(sets)]
    assert sum(bool(one.significant) for one in found) <= 0.08 * sets
    assert sum(any(place.loud for place in one.places) for one in found) <= 0.08 * sets


def test_an_effect_in_the_falling_branch_is_identified_there(friction):
    falling, rising = place(friction, "falling pressure"), place(friction, "rising pressure")
    assert falling.significant and falling.z > 10
    assert falling.outputs["angle_rad"].mean == pytest.approx(SHIFT, abs=1.2e-3)  # three standard errors
    assert not rising.significant
    assert friction.worst[0].condition == "falling pressure"
    assert next(iter(friction.depends_on)) == "direction"


def test_a_drift_is_found_over_time_in_hold():
    settings = [(5e3, 0.0), (5e3, 0.02)]
    measurement, predicted = bench(2, effect=creep(0.03, 5.0), settings=settings, repeats=3)
    comparison = compare(measurement, predicted)
    assert {p.covariate for p in comparison.significant} >= {"hold_s", "pressure_pa"}
    assert comparison.rmse_over_floor > 2


def test_errors_equal_the_residual(friction):
    measurement, predicted = bench(0, effect=falling_shift(SHIFT))
    pairs = zip(measurement.runs, predicted, strict=True)
    residual = np.concatenate([run.outputs["angle_rad"] - model["angle_rad"] for run, model in pairs])
    error = friction.outputs["angle_rad"]
    assert error.rmse == pytest.approx(np.sqrt(np.mean(residual**2)))
    assert error.bias == pytest.approx(residual.mean())
    assert friction.rmse_over_floor == pytest.approx(error.rmse / error.noise_floor)
    assert error.n == friction.n_samples == residual.size
    assert len(measurement.runs) < friction.n_effective < residual.size
    assert error.rmse_interval[0] < error.rmse < error.rmse_interval[1]


def test_shares_sum_to_one():
    comparison = compare(*bench(1, n_joints=3, effect=falling_shift(SHIFT)))
    error, samples = defaultdict(float), defaultdict(float)
    for p in comparison.places:
        error[p.covariate] += p.share_of_error
        samples[p.covariate] += p.share_of_samples
    assert set(error) > {"pressure_pa", "direction", "hold_s", "position", "direction × pressure_pa"}
    assert all(total == pytest.approx(1) for total in (*error.values(), *samples.values()))
    assert sum(run.share_of_error for run in comparison.runs) == pytest.approx(1)
    assert sum(group.share_of_error for group in comparison.conditions) == pytest.approx(1)


def test_position_along_the_chain_finds_the_joint_that_is_off():
    measurement, predicted = bench(3, n_joints=4)
    off = [{**run, "joint_3_angle_rad": run["joint_3_angle_rad"] - 0.004} for run in predicted]
    comparison = compare(measurement, off)
    found = [p.condition for p in comparison.places if p.covariate == "position" and p.significant]
    assert found == ["joint 3"]
    assert comparison.depends_on["position"] > 0.05


def test_the_run_order_does_not_matter(friction):
    measurement, predicted = bench(0, effect=falling_shift(SHIFT))
    order = np.random.default_rng(0).permutation(len(predicted))
    mixed = replace(measurement, runs=tuple(measurement.runs[k] for k in order))
    other = compare(mixed, [predicted[k] for k in order])
    assert other.rmse_over_floor == pytest.approx(friction.rmse_over_floor)
    assert other.n_effective == pytest.approx(friction.n_effective)
    history = ("run_number", "past_pressure_pa")  # these test the order
    for p in friction.places:
        if p.covariate not in history:
            twin = place(other, p.condition)
            assert (twin.z, twin.share_of_error) == pytest.approx((p.z, p.share_of_error))


def test_units_do_not_matter(friction):
    measurement, predicted = bench(0, effect=falling_shift(SHIFT))
    runs = [run.with_outputs({"angle_rad": 1e3 * run.outputs["angle_rad"]}) for run in measurement.runs]
    scaled = compare(
        replace(measurement, runs=tuple(runs)), [{"angle_rad": 1e3 * m["angle_rad"]} for m in predicted]
    )
    assert scaled.outputs["angle_rad"].rmse == pytest.approx(1e3 * friction.outputs["angle_rad"].rmse)
    assert scaled.rmse_over_floor == pytest.approx(friction.rmse_over_floor)
    assert place(scaled, "falling pressure").z == pytest.approx(place(friction, "falling pressure").z)


def test_repeats_are_one_condition(friction):
    assert len(friction.runs) == 8
    assert [len(group.runs) for group in friction.conditions] == [2, 2, 2, 2]


def test_sentences():
    friction = compare(*bench(0, effect=falling_shift(SHIFT)))
    assert interpret(friction).startswith("The model is off by 1.")
    assert "of the squared error is at falling pressure" in interpret(friction)
    assert "above the model" in interpret(friction)
    assert headline(friction).covariate == "direction"
    assert interpret(compare(*bench(6))).startswith("Within the noise")
    measurement, predicted = bench(0, repeats=1)
    sentence = interpret(compare(measurement, predicted))
    assert "cannot be judged, because no run was repeated and no sigma is stated." in sentence


def off_both_ways(size, narrow, seed=0):
    """Return the comparison of a bench with two errors.

    One error has `size` noise floors and both signs at the highest pressures; the other is a small shift of one sign,
    `narrow` floors, of the last run alone.
    """
    measurement, predicted = bench(seed, repeats=3)
    floor = compare(measurement, predicted).outputs["angle_rad"].noise_floor
    off = []
    for k, (run, model) in enumerate(zip(measurement.runs, predicted, strict=True)):
        pressure = run.history.actuation["pressure_pa"]
        high = pressure > 0.7 * max(r.history.actuation["pressure_pa"].max() for r in measurement.runs)
        signs = np.where(np.arange(len(run)) % 2, 1.0, -1.0)
        shift = narrow * floor if k == len(predicted) - 1 else 0.0
        off.append({"angle_rad": model["angle_rad"] - floor * size * high * signs - shift})
    return compare(measurement, off)


def test_the_headline_names_where_most_squared_error_is():
    """Most of it has both signs and hence no mean; the bin with a mean of one sign contains a small part of it."""
    comparison = off_both_ways(6.0, 1.5)
    place = headline(comparison)
    assert place.condition.startswith("pressure ") or "pressure" in place.covariate
    assert place.share_of_error > 0.5 and place.loud
    assert max(comparison.places, key=lambda p: abs(p.z)).share_of_error < 0.5
    sentence = interpret(comparison)
    assert f"of the squared error is at {place.condition}" in sentence and "to both sides" in sentence


def test_a_small_share_is_no_headline():
    """A shift of one run is significant by its mean, but no condition has clearly more of the error than of data."""
    measurement, predicted = bench(0, repeats=3)
    every = [{"angle_rad": run["angle_rad"] - 0.02} for run in predicted]
    every[-1] = {"angle_rad": every[-1]["angle_rad"] - 0.004}
    comparison = compare(measurement, every)
    assert comparison.significant and headline(comparison) is None
    assert "spread over all conditions" in interpret(comparison)


def test_a_constant_error_is_named_as_one():
    measurement, predicted = bench(0)
    sentence = interpret(compare(measurement, [{"angle_rad": run["angle_rad"] - 0.02} for run in predicted]))
    assert "spread over all conditions:" in sentence
    assert "1.1° above the model" in sentence


def test_a_stated_sigma_is_enough_to_judge():
    measurement, predicted = bench(5, repeats=1)
    runs = [replace(run, sigma={"angle_rad": np.full(len(run), 0.004)}) for run in measurement.runs]
    comparison = compare(replace(measurement, runs=tuple(runs)), predicted)
    assert comparison.judged
    assert comparison.outputs["angle_rad"].noise_floor == pytest.approx(0.004)
    assert comparison.rmse_over_floor == pytest.approx(1, abs=0.1)


def test_without_repeats_a_large_effect_still_stands_out():
    comparison = compare(*bench(0, repeats=1, effect=falling_shift(0.05)))
    assert not comparison.judged
    assert place(comparison, "falling pressure").significant


def test_the_same_seed_gives_the_same_intervals():
    measurement, predicted = bench(0)
    first, second, other = (compare(measurement, predicted, seed=seed) for seed in (1, 1, 2))
    assert first.outputs["angle_rad"].rmse_interval == second.outputs["angle_rad"].rmse_interval
    assert first.outputs["angle_rad"].rmse_interval != other.outputs["angle_rad"].rmse_interval


def test_outputs_that_the_model_lacks_are_said():
    measurement, predicted = bench(0)
    runs = [
        run.with_outputs({**run.outputs, "tip_x_m": run.outputs["angle_rad"]}) for run in measurement.runs
    ]
    comparison = compare(replace(measurement, runs=tuple(runs), outputs=("angle_rad", "tip_x_m")), predicted)
    assert list(comparison.outputs) == ["angle_rad"]
    assert any("tip_x_m" in remark for remark in comparison.remarks)


def test_nothing_in_common_is_an_error():
    measurement, predicted = bench(0)
    with pytest.raises(UserError, match=r"outputs angle_rad, the model has tip_x_m"):
        compare(measurement, [{"tip_x_m": run["angle_rad"]} for run in predicted])
    with pytest.raises(UserError, match="every reading or prediction is missing"):
        compare(measurement, [{"angle_rad": np.full(len(run["angle_rad"]), np.nan)} for run in predicted])


def test_states_without_equilibrium_are_counted():
    measurement, predicted = bench(0)
    lost = [{"angle_rad": run["angle_rad"].copy()} for run in predicted]
    lost[0]["angle_rad"][:7] = np.nan
    comparison = compare(measurement, lost)
    assert any(remark.startswith("7 readings") for remark in comparison.remarks)
    assert comparison.n_samples == measurement.n_samples - 7


def constant(n, count):
    runs = []
    for k in range(count):
        history = History.from_arrays({"pressure_pa": np.full(n, 5e3)}, 0.1 * np.arange(n), run=f"c{k}")
        noise = colour(np.random.default_rng(k), n, 0.004, 0.5) if n > 1 else np.array([0.001])
        runs.append(measured_run(history, {"angle_rad": angle(np.full(n, 5e3)) + noise}))
    return Measurement(tuple(runs), ("angle_rad",)), [{"angle_rad": angle(np.full(n, 5e3))}] * count


def table(steps):
    """Return a table of states without time, twice."""
    pressure = np.linspace(0, 15e3, steps)
    runs = []
    for k in range(2):
        reading = 1.1 * angle(pressure) + np.random.default_rng(k).normal(0, 0.004, steps)
        runs.append(
            measured_run(
                History.from_arrays({"pressure_pa": pressure}, None, run=f"s{k}"), {"angle_rad": reading}
            )
        )
    return Measurement(tuple(runs), ("angle_rad",)), [{"angle_rad": angle(pressure)}] * 2


def with_gaps():
    measurement, predicted = bench(0)
    runs = list(measurement.runs)
    runs[0] = runs[0].with_outputs({"angle_rad": np.where(np.arange(len(runs[0])) < 100, np.nan, 0.1)})
    runs[1] = runs[1].with_outputs({"angle_rad": np.full(len(runs[1]), np.nan)})
    return replace(measurement, runs=tuple(runs)), predicted


def without_noise():
    measurement, predicted = bench(0)
    runs = [run.with_outputs(dict(model)) for run, model in zip(measurement.runs, predicted, strict=True)]
    return replace(measurement, runs=tuple(runs)), [
        {"angle_rad": 1.1 * run["angle_rad"]} for run in predicted
    ]


AWKWARD = {
    "one run": lambda: (lambda m, p: (replace(m, runs=m.runs[:1]), p[:1]))(*bench(0)),
    "constant inputs": lambda: constant(300, 3),
    "one constant run": lambda: constant(300, 1),
    "three samples": lambda: constant(3, 1),
    "one sample": lambda: constant(1, 1),
    "states without time": lambda: table(12),
    "missing readings": with_gaps,
    "no noise at all": without_noise,
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", AWKWARD)
def test_awkward_measurements_are_compared(case):
    comparison = compare(*AWKWARD[case]())
    error = comparison.outputs["angle_rad"]
    assert np.isfinite([error.rmse, error.bias, error.n_effective]).all()
    assert len(interpret(comparison)) > 20
    assert comparison_json(comparison)["n_samples"] == comparison.n_samples > 0


def test_outputs_without_a_joint_are_named():
    """The outputs are the tip of a chain whose joints are read too."""
    rng = np.random.default_rng(0)
    names = ("joint_1_angle_rad", "joint_2_angle_rad", "tip_x_m", "tip_z_m")
    histories = [
        History.from_arrays({"pressure_pa": np.linspace(0, 15e3, 40)}, run=f"r{k}") for k in range(3)
    ]
    predicted = [{name: np.zeros(40) for name in names} for _ in histories]
    runs = [
        measured_run(h, {n: rng.normal(0.05 * n.startswith("tip"), 1e-3, 40) for n in names})
        for h in histories
    ]
    comparison = compare(Measurement(tuple(runs), names), predicted)
    place(comparison, "the tip")
    assert "squared error is at the tip" in interpret(comparison)
