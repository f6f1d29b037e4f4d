"""Counts against counts: conditions that differ, and contradictory repeats."""

import numpy as np
import pytest

from pliant_counts.comparison import compare_counts
from pliant_counts.comparison_page import counts_json, interpret_counts
from pliant_counts.records import CountCondition, Counts, CountSet


def make_counts(*conditions):
    """Return counts in which each condition is a list of successes out of ten."""
    return Counts(
        tuple(
            CountCondition(
                {"task.extra_weights": k},
                f"{k} weights",
                tuple(CountSet(f"s{i}", s, 10) for i, s in enumerate(sets)),
            )
            for k, sets in enumerate(conditions)
        )
    )


def test_a_model_with_the_right_probabilities_disagrees_one_time_in_twenty_at_most():
    rng, alarms = np.random.default_rng(1), 0
    shares = (0.02, 0.3, 0.6, 0.97)
    for _ in range(300):
        measured = make_counts(*[rng.binomial(10, p, 3).tolist() for p in shares])
        found = compare_counts(measured, [(int(rng.binomial(15, p)), 15) for p in shares])
        alarms += bool(found.disagreeing)
    assert alarms <= 0.05 * 300


def test_a_wrong_condition_is_found_and_named():
    found = compare_counts(make_counts([10, 9, 10], [0, 0, 0], [6, 7, 6]), [(0, 10), (0, 10), (6, 10)])
    assert [one.condition.words for one in found.disagreeing] == ["0 weights"]
    worst = counts_json(found)["worst"][0]
    assert worst["condition"] == "0 weights" and worst["significant"] and worst["z"] > 4
    assert worst["share_of_error"] > 0.9
    assert "0 weights, measured 29/30, simulated 0/10" in interpret_counts(found)
    assert found.bias == pytest.approx((29 / 30 + 0 + 19 / 30 - 0.6) / 3)


def test_sums_and_the_contracts_keys():
    found = compare_counts(make_counts([5, 5], [9, 10]), [(3, 8), (7, 8)])
    result = counts_json(found)
    assert found.log_likelihood == pytest.approx(sum(one.log_likelihood for one in found.conditions))
    assert sum(one.share_of_error for one in found.conditions) == pytest.approx(1.0)
    assert set(result["outputs"]["success"]) >= {"rmse", "unit", "noise_floor", "ratio_to_floor", "bias"}
    assert result["n_samples"] == 40 and len(result["runs"]) == 4
    assert result["rmse_over_floor"] == result["outputs"]["success"]["ratio_to_floor"]
    assert not found.disagreeing and "chance" in interpret_counts(found)


def test_the_floor_is_what_equal_probabilities_give():
    rng, ratios = np.random.default_rng(2), []
    for _ in range(200):
        p = rng.uniform(0.1, 0.9, 6)
        measured = make_counts(*[rng.binomial(10, q, 3).tolist() for q in p])
        ratios.append(compare_counts(measured, [(int(rng.binomial(20, q)), 20) for q in p]).ratio_to_floor)
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.1)


def test_contradictory_repeats_are_a_separate_finding():
    found = compare_counts(make_counts([10, 0, 5], [10, 10, 10]), [(5, 10), (10, 10)])
    assert [one.condition.words for one in found.contradictory] == ["0 weights"]
    assert found.overdispersion > 5 and found.n_effective < found.n_samples / 5
    assert interpret_counts(found).startswith(
        "The repeats contradict each other: 0 weights gave 10/10 and 0/10"
    )
    assert counts_json(found)["repeats"]["contradictory"] == ["0 weights"]


def test_repeats_with_one_probability_are_rarely_called_contradictory():
    rng = np.random.default_rng(3)
    alarms = sum(
        bool(
            compare_counts(make_counts(*rng.binomial(10, 0.5, (4, 3)).tolist()), [(5, 10)] * 4).contradictory
        )
        for _ in range(200)
    )
    assert alarms <= 0.07 * 200


def test_single_sets_say_nothing_about_repeats():
    found = compare_counts(make_counts([3], [4]), [(3, 10), (4, 10)])
    assert found.n_repeated == 0 and np.isnan(found.overdispersion) and found.n_effective == 20
