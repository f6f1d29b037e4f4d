"""Ridge by marginal likelihood: the hidden function is in the band, pure noise gives zero, leaving out is exact."""

import numpy as np
import pytest

from pliant.mechanics.learned_curve import CurveAxis, basis
from pliant_learned.smooth_fit import LinearModel, Sums, left_out, most_likely

AXIS = CurveAxis("angle", 0.0, 1.0, 20)


def bench(truth, sigma=1.0, n=600, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.uniform(0, 1, n)
    slopes = basis([AXIS], [x])
    return slopes, truth(x) + rng.normal(0, sigma, n), np.arange(n) % 10


def fitted(slopes, residual, groups):
    sums = Sums.from_residuals(slopes, residual, groups)
    prior = most_likely([AXIS], sums, float(len(residual)), 1.0)
    return prior, *prior.posterior(slopes.T @ slopes, slopes.T @ residual)


@pytest.mark.parametrize("seed", range(3))
def test_a_hidden_curve_lies_within_its_band(seed):
    def truth(x):
        return 3.0 * np.sin(5.0 * x) * x

    prior, mean, covariance = fitted(*bench(truth, seed=seed))
    z = (mean - truth(AXIS.at)) / np.sqrt(np.diag(covariance))
    assert np.mean(np.abs(z) < 2.0) >= 0.85
    assert 3.0 < prior.freedom(gram_matrix(bench(truth, seed=seed)[0])) < 12.0


def gram_matrix(slopes):
    return slopes.T @ slopes


def test_noise_alone_is_shrunk_to_nearly_nothing():
    prior, mean, _ = fitted(*bench(lambda x: 0.0 * x))
    assert np.abs(mean).max() < 0.2
    assert prior.freedom(gram_matrix(bench(lambda x: 0.0 * x)[0])) < 2.0


def test_leaving_out_is_what_a_fit_without_the_group_predicts():
    slopes, residual, groups = bench(lambda x: x)
    prior, _, _ = fitted(slopes, residual, groups)
    left = left_out(prior, [LinearModel(np.zeros(20), residual, slopes)], groups)
    kept = groups != 3
    mean, _ = prior.posterior(gram_matrix(slopes[kept]), slopes[kept].T @ residual[kept])
    np.testing.assert_allclose(left[~kept], residual[~kept] - slopes[~kept] @ mean, atol=1e-9)


def test_slopes_beyond_all_measure_leave_a_posterior():
    """Near a snap the slope by one value is 1e12 times those by the others: rounding must not end the fit."""
    slopes, residual, groups = bench(lambda x: x)
    prior, plain, _ = fitted(slopes, residual, groups)
    steep = slopes * np.where(np.arange(20) % 2, 1e12, 1.0)
    mean, covariance = prior.posterior(gram_matrix(steep), steep.T @ residual)
    assert np.isfinite(mean).all() and np.linalg.eigvalsh(covariance).min() > -1e-12
    assert np.abs(mean[1::2]).max() < 1e-9 * np.abs(plain).max()


def test_a_curve_that_moves_nothing_has_no_prior():
    slopes, residual, groups = bench(lambda x: x)
    assert most_likely([AXIS], Sums.from_residuals(0.0 * slopes, residual, groups), 600.0, 1.0) is None
