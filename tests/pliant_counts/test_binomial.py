"""Exact statistics of counts against closed forms, scipy's own, and simulation."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import betabinom, chi2_contingency, fisher_exact

from pliant_counts.binomial import (
    chi_square,
    deviance,
    fisher_p,
    holm,
    log_bayes_factor,
    log_own,
    log_predictive,
    repeats_agree,
    signed_z,
    wilson,
)

COUNTS = st.integers(1, 40).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))


@given(COUNTS, COUNTS)
def test_fishers_test_is_scipys_and_does_not_ask_which_side_is_measured(a, b):
    table = [[a[0], a[1] - a[0]], [b[0], b[1] - b[0]]]
    assert fisher_p(a, b) == pytest.approx(fisher_exact(table).pvalue, rel=1e-6)
    assert fisher_p(a, b) == pytest.approx(fisher_p(b, a), rel=1e-9)
    assert signed_z(a, b) == pytest.approx(-signed_z(b, a))


@given(COUNTS, COUNTS)
def test_the_likelihood_is_beta_binomial(a, b):
    assert log_predictive(a, b) == pytest.approx(
        betabinom.logpmf(a[0], a[1], b[0] + 1, b[1] - b[0] + 1), rel=1e-9
    )
    assert log_bayes_factor(a, b) == pytest.approx(log_bayes_factor(b, a), abs=1e-9)  # two samples, one test


@given(COUNTS)
def test_probabilities_over_all_counts_sum_to_one(b):
    total = sum(np.exp(log_predictive((k, 12), b)) for k in range(13))
    assert total == pytest.approx(1.0)
    assert sum(np.exp(log_own((k, 12))) for k in range(13)) == pytest.approx(1.0)


def test_more_simulated_trials_come_to_the_binomial_likelihood():
    few, many = log_predictive((7, 10), (7, 10)), log_predictive((7, 10), (70_000, 100_000))
    exact = np.log(120 * 0.7**7 * 0.3**3)
    assert many == pytest.approx(exact, abs=1e-3)
    assert few < many


@given(COUNTS, COUNTS)
def test_the_deviance_belongs_to_the_best_simulation(a, b):
    assert deviance(a, b) >= 0.0
    assert min(deviance(a, (k, b[1])) for k in range(b[1] + 1)) == 0.0


def test_holm_by_hand():
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.6, 0.9]) == pytest.approx([1.0, 1.0])
    assert holm([]) == []


@given(COUNTS)
def test_wilsons_interval_holds_the_share(count):
    low, high = wilson(count)
    assert 0.0 <= low <= count[0] / count[1] <= high <= 1.0
    z2 = 1.959964**2
    for end in (low, high):  # its ends solve (p̂ − p)² = z² p (1 − p) / n
        assert (count[0] / count[1] - end) ** 2 == pytest.approx(z2 * end * (1 - end) / count[1], abs=1e-6)


def test_repeats_by_enumeration():
    sets = [(9, 10), (4, 10), (7, 10)]
    weights, beyond = 0.0, 0.0
    for outcome in itertools.product(range(11), repeat=3):
        if sum(outcome) == 20:
            table = list(zip(outcome, (10, 10, 10), strict=True))
            weight = np.prod([float(np.exp(_log_choose(10, k))) for k in outcome])
            weights += weight
            beyond += weight * (chi_square(table) >= chi_square(sets) - 1e-9)
    assert repeats_agree(sets) == pytest.approx(beyond / weights)
    assert chi_square(sets) == pytest.approx(
        chi2_contingency([[9, 4, 7], [1, 6, 3]], correction=False).statistic
    )


def test_repeats_in_one_set_or_with_certain_outcomes_say_nothing():
    assert repeats_agree([(3, 10)]) == 1.0
    assert repeats_agree([(10, 10), (10, 10), (5, 5)]) == 1.0


def test_many_repeats_are_tested_by_chi_square():
    rng = np.random.default_rng(0)
    p = [repeats_agree([(int(k), 50) for k in rng.binomial(50, 0.5, 12)]) for _ in range(200)]
    assert 0.01 < np.mean(np.array(p) < 0.05) < 0.10
    assert repeats_agree([(10, 50)] * 6 + [(40, 50)] * 6) < 1e-6


def _log_choose(n, k):
    from scipy.special import gammaln

    return gammaln(n + 1) - gammaln(k + 1) - gammaln(n - k + 1)
