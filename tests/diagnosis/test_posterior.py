"""Laplace's posterior against closed forms: covariance, draws, blind directions, shares of variance, the check."""

import numpy as np
import pytest
from tests.diagnosis.formula import candidate, fitter, measured, parameter

from pliant.diagnosis.blind import unidentifiable_directions
from pliant.diagnosis.exploration import WIDER, asymmetric_parameter, explore
from pliant.diagnosis.posterior import laplace_posterior
from pliant.diagnosis.uncertainty import square_per_reading, uncertainty

CLOCK = np.arange(0.0, 20.0, 0.5)
N = CLOCK.size
SIGMA = 0.3


def line(t, a, b):
    return a + b * t


def fitted(function, a, b, of=None, sigma=SIGMA, seed=0):
    noise = np.random.default_rng(seed).normal(0, sigma, N)
    work = fitter(function, measured([function(CLOCK, a, b) + noise], [CLOCK]))
    fit = work.fit(of or candidate(parameter("a"), parameter("b")))
    return work, fit, laplace_posterior(fit, work.weights, N), square_per_reading(work.weights, fit, N)


def shape(name, low, high, bounds):
    return parameter(name, np.sqrt(low * high), bounds, (low, high), role="shape", prior="log_normal")


def test_a_line_has_the_ridge_regression_covariance():
    _, fit, posterior, scale = fitted(line, 1.5, -0.2)
    design = 10.0 * np.stack([np.ones(N), CLOCK], axis=1)  # x = 1 is the far end of the plausible range, 10
    expected = np.linalg.inv(design.T @ design / scale + np.eye(2))
    assert posterior.covariance == pytest.approx(expected, rel=1e-4)
    assert posterior.sd == pytest.approx(10.0 * np.sqrt(np.diag(expected)), rel=1e-4)
    assert posterior.values == pytest.approx([fit.values["formula.a"], fit.values["formula.b"]])
    assert posterior.freedom == N - 2


def test_draws_have_the_covariance_keep_to_the_bounds_and_are_seeded():
    _, _, posterior, _ = fitted(line, 1.5, -0.2)
    draws = posterior.draws(2048, 3)
    assert draws.mean(axis=0) == pytest.approx(
        posterior.x, abs=0.02 * np.sqrt(np.diag(posterior.covariance)).min()
    )
    assert np.cov(draws.T) == pytest.approx(posterior.covariance, rel=0.03)
    assert np.array_equal(draws, posterior.draws(2048, 3))
    assert not np.array_equal(draws, posterior.draws(2048, 4))
    narrow = candidate(parameter("a", bounds=(1.45, 1.55)), parameter("b"))
    _, _, bounded, _ = fitted(line, 1.5, -0.2, narrow)
    low, high = narrow.limits()
    inside = bounded.draws(256, 0)
    assert np.all(inside >= low) and np.all(inside <= high)
    assert np.ptp(inside[:, 0]) > 0.8 * (high[0] - low[0])


def test_where_only_the_sum_matters_the_difference_is_blind_and_the_sum_is_named():
    (one,) = unidentifiable_directions(fitted(lambda t, a, b: (a + b) * t, 0.3, 0.2)[2])
    assert set(one.parameters) == {"formula.a", "formula.b"}
    assert one.move[0] == pytest.approx(-one.move[1], rel=1e-3)
    assert one.seen == pytest.approx(0.0, abs=1e-3)
    assert "the sum of formula.a and formula.b" in one.words
    (other,) = unidentifiable_directions(fitted(lambda t, a, b: (a - b) * t, 0.5, 0.2)[2])
    assert "the difference of formula.a and formula.b" in other.words


def test_where_only_the_product_matters_the_product_is_named():
    both = candidate(shape("a", 0.5, 2.0, (0.05, 20.0)), shape("b", 0.5, 2.0, (0.05, 20.0)))
    (one,) = unidentifiable_directions(fitted(lambda t, a, b: a * b * t, 1.2, 0.8, both)[2])
    assert "the product of formula.a and formula.b" in one.words
    (ratio,) = unidentifiable_directions(fitted(lambda t, a, b: a / b * t, 1.2, 0.8, both)[2])
    assert "the ratio of formula.a and formula.b" in ratio.words


def test_a_parameter_that_nothing_depends_on_is_said_to_be_unseen():
    (one,) = unidentifiable_directions(fitted(lambda t, a, b: a + 0.0 * b * t, 1.0, 0.0)[2])
    assert one.parameters == ("formula.b",) and "little information on formula.b" in one.words
    assert unidentifiable_directions(fitted(line, 1.5, -0.2)[2]) == ()


def test_parameters_that_are_seen_but_hardly_apart_are_told():
    found = unidentifiable_directions(
        fitted(lambda t, a, b: a * t + b * (t + 0.2 * np.sin(t)), 0.5, 0.2, sigma=0.05)[2]
    )
    (one,) = found
    assert "hardly be determined separately" in one.words and one.seen > 1.0
    assert one.move[0] * one.move[1] < 0.0


@pytest.mark.parametrize("far", [0.0, 30.0])  # correlation −0.87 and near 1
def test_shares_equal_a_linear_model_with_dependent_parameters(far):
    function = lambda t, a, b: a + b * (t - far)  # noqa: E731
    work, _, posterior, scale = fitted(function, 1.5, -0.2)
    shares = explore(work, posterior, scale).shares["angle_rad"]
    slopes = 10.0 * np.stack([np.ones(N), CLOCK - far], axis=1)
    c = posterior.covariance
    variance = np.einsum("na,ab,nb->n", slopes, c, slopes).sum()
    first = ((slopes @ c) ** 2).sum(axis=0) / np.diag(c) / variance
    total = (slopes**2).sum(axis=0) / np.diag(np.linalg.inv(c)) / variance
    assert [shares[f"formula.{k}"].first for k in "ab"] == pytest.approx(first, abs=0.03)
    assert [shares[f"formula.{k}"].total for k in "ab"] == pytest.approx(total, abs=0.03)


def test_the_check_finds_a_linear_model_normal():
    work, fit, posterior, scale = fitted(line, 1.5, -0.2)
    found = explore(work, posterior, scale)
    assert found.good
    assert found.off == pytest.approx(0.0, abs=0.1)
    assert found.factor == pytest.approx(1.0, abs=0.1)
    share = (np.sqrt(2 * WIDER**2 - 1) / WIDER**2) ** 2  # of wider normal draws, for each parameter
    assert found.worth == pytest.approx(share * len(found.x), rel=0.1)
    assert asymmetric_parameter(posterior, uncertainty(work, fit, N)) is None
    expected = np.sqrt(np.einsum("na,ab,nb->n", fit.slopes, posterior.covariance, fit.slopes).mean())
    assert found.spread["angle_rad"] == pytest.approx(expected, rel=0.1)


def test_a_bent_posterior_is_found_out():
    bent = candidate(parameter("a", bounds=(0.0, 100.0), plausible=(0.0, 10.0)), parameter("b"))
    work, fit, posterior, scale = fitted(lambda t, a, b: 0.5 * np.sqrt(a) + 0.02 * b * t, 0.3, 0.0, bent)
    assert not explore(work, posterior, scale).good
    side = asymmetric_parameter(posterior, uncertainty(work, fit, N))
    assert side.name == "formula.a" and (side.ratio > 1.0) == side.upwards  # a long way up, a short way down


@pytest.mark.slow
@pytest.mark.parametrize("far", [0.0, 12.0])
def test_a_sampler_finds_the_same_posterior(far):
    pytest.importorskip("emcee")
    from pliant.diagnosis.sampler import sample_posterior

    work, fit, posterior, _ = fitted(lambda t, a, b: a + b * (t - far), 1.5, -0.2)
    found = sample_posterior(work, fit, N, steps=2000)
    sd = np.sqrt(np.diag(posterior.covariance))
    sure = 4.0 / np.sqrt(found.worth)
    assert (found.x.mean(axis=0) - posterior.x) / sd == pytest.approx(0.0, abs=sure)
    assert found.x.std(axis=0) / sd == pytest.approx(1.0, abs=sure)
    assert np.corrcoef(found.x.T)[0, 1] == pytest.approx(posterior.correlation[0, 1], abs=sure)
