"""The regression meta-model: closed forms against scikit-learn, expected gain against refitting, designs left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pliant.records.design import Array
from pliant_designs.meta_models.config import RegressionConfig
from pliant_designs.meta_models.regression import (
    GaussianProcesses,
    Regression,
    RegressionLaws,
    _fitted,
    fit_kernel_ridge,
    fit_polynomial,
    legendre_products,
)
from pliant_designs.records import SolvedDesigns
from pliant_designs.samples import RANGE, grid, solved_designs, unseen_designs

pytest.importorskip("sklearn", reason="needs scikit-learn")


def _sample(n: int = 24, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    places = random.uniform(-1, 1, (n, 2))
    s, t = places.T
    clean = np.stack([np.sin(2 * s) + 0.5 * t, s * t], axis=1)
    return places, clean + 0.02 * random.standard_normal((n, 2))


@pytest.fixture(scope="module")
def processes() -> GaussianProcesses:
    return GaussianProcesses.fit(*_sample())


@pytest.mark.parametrize("rough", [False, True])
def test_mean_and_deviation_are_scikit_learns(rough: bool) -> None:
    places, targets = _sample()
    column = (targets[:, 0] - targets[:, 0].mean()) / targets[:, 0].std()
    theirs = _fitted(places, column, rough)
    kernel = theirs.kernel_
    ours = GaussianProcesses(
        places,
        column[:, None],
        np.zeros(1),
        np.ones(1),
        np.asarray(kernel.k1.k1.k2.length_scale)[None],
        np.array([[kernel.k1.k1.k1.constant_value, kernel.k1.k2.k1.constant_value, kernel.k2.noise_level]]),
        np.array([rough]),
    )
    at = np.random.default_rng(2).uniform(-1.2, 1.2, (15, 2))
    mean, deviation = theirs.predict(at, return_std=True)
    np.testing.assert_allclose(ours.mean(at)[:, 0], mean, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(np.sqrt(ours.variance(at)[:, 0]), deviation, rtol=1e-4, atol=1e-7)


def _without(processes: GaussianProcesses, left: int) -> GaussianProcesses:
    keep = np.arange(len(processes.places)) != left
    return replace(processes, places=processes.places[keep], targets=processes.targets[keep])


def test_left_out_designs_in_closed_form_equal_refitting(processes: GaussianProcesses) -> None:
    missed = processes.left_out()
    for left in (0, 7, 23):
        alone = _without(processes, left).mean(processes.places[left : left + 1])[0]
        np.testing.assert_allclose(missed[left], alone - processes.targets[left], rtol=1e-6, atol=1e-9)


def test_gain_is_what_refitting_with_the_design_takes_from_the_variance(processes: GaussianProcesses) -> None:
    random = np.random.default_rng(4)
    candidates, over = random.uniform(-1.5, 1.5, (3, 2)), random.uniform(-1.5, 1.5, (20, 2))
    before = processes.variance(over).sum()
    for candidate, gain in zip(candidates, processes.gain(candidates, over), strict=True):
        more = replace(
            processes,
            places=np.vstack([processes.places, candidate]),
            targets=np.vstack([processes.targets, np.zeros(2)]),
        )
        assert gain == pytest.approx(1 - more.variance(over).sum() / before, rel=1e-5, abs=1e-9)
        assert 0 <= gain <= 1


def test_polynomials_and_kernel_ridge_are_scored_by_refitting_without_a_design() -> None:
    places, targets = _sample()
    smoother, missed = fit_kernel_ridge(places, targets)
    from sklearn.kernel_ridge import KernelRidge

    inner = smoother.features(places) @ smoother.weights
    ridge = float(np.mean((targets - smoother.centre - inner) / smoother.weights))
    theirs = KernelRidge(alpha=ridge, kernel="rbf", gamma=1 / (2 * smoother.width**2))
    theirs.fit(places, targets - smoother.centre)
    at = np.random.default_rng(2).uniform(-1, 1, (9, 2))
    np.testing.assert_allclose(smoother.mean(at), theirs.predict(at) + smoother.centre, rtol=1e-5, atol=1e-7)
    theirs.fit(places[1:], (targets - smoother.centre)[1:])
    alone = theirs.predict(places[:1])[0] + smoother.centre - targets[0]
    np.testing.assert_allclose(missed[0], alone, rtol=1e-4, atol=1e-7)
    # A cubic is exact for cubics, left out or not.
    cubic = legendre_products(places, np.array([[3, 0], [1, 1], [0, 0]])) @ np.array([[1.0], [2.0], [3.0]])
    _, missed = fit_polynomial(places, cubic)
    assert np.abs(missed).max() < 1e-3 * np.ptp(cubic)


@pytest.mark.parametrize("regressor", ["gaussian_process", "kernel_ridge", "polynomial"])
def test_each_regressor_is_taken_and_recorded(regressor: str) -> None:
    model = Regression(RegressionConfig.model_validate({"regressor": regressor}))
    fitted = model.fit(solved_designs((3, 3)))
    assert fitted.details["regressor"] == regressor
    again, values = model.load(fitted.laws.record()), unseen_designs(1)
    assert isinstance(again, RegressionLaws) and isinstance(fitted.laws, RegressionLaws)
    assert (again.smoother is None) == (regressor == "gaussian_process")
    np.testing.assert_array_equal(again.targets(values), fitted.laws.targets(values))


@pytest.mark.slow
@pytest.mark.parametrize("regressor", ["gaussian_process", "polynomial"])
def test_logarithms_enter_as_plain_inputs_to_the_exponent_would(regressor: str) -> None:
    """Designs at 10^s with inputs by their logarithm are those at s with plain ones; plain at 10^s they are not."""
    plain = solved_designs((3, 3))
    exponents = (plain.values - RANGE[:, 0]) / np.ptp(RANGE, axis=1)
    decades = replace(plain, values=10.0**exponents)
    at = np.array([[0.3, 0.7], [0.5, 0.2]])

    def targets(inputs: str, designs: SolvedDesigns, values: Array) -> Array:
        config = RegressionConfig.model_validate({"regressor": regressor, "inputs": inputs})
        laws = Regression(config).fit(designs).laws
        assert isinstance(laws, RegressionLaws)
        return laws.targets(values)

    wanted = targets("plain", replace(plain, values=exponents), at)
    np.testing.assert_allclose(targets("logarithm", decades, 10.0**at), wanted, rtol=1e-6, atol=1e-9)
    assert np.abs(targets("plain", decades, 10.0**at) - wanted).max() > 1e-4 * np.abs(wanted).max()


def test_auto_takes_the_smallest_error_on_designs_left_out() -> None:
    fitted = Regression(RegressionConfig()).fit(solved_designs((3, 3)))
    assert isinstance(fitted.laws, RegressionLaws)
    chosen, left_out = fitted.details["regressor"], fitted.details["left_out"]
    assert chosen == min(left_out, key=left_out.get)
    assert (fitted.laws.smoother is None) == (chosen == "gaussian_process")


def test_gain_and_doubt_are_largest_where_nothing_is_solved() -> None:
    """A quarter of the range has no design: its far corner gains most, a solved design next to nothing."""
    designs = solved_designs((4, 4))
    middle = RANGE.mean(axis=1)
    laws = Regression(RegressionConfig()).fit(designs.rows(~np.all(designs.values > middle, axis=1))).laws
    candidates = np.array([RANGE[:, 1], RANGE[:, 0], [RANGE[0, 0], RANGE[1, 1]]])
    gain = laws.gain(candidates, grid((9, 9)))
    assert gain is not None and np.argmax(gain) == 0
    assert gain[0] > 5 * max(gain[1:])
    doubt = laws.doubt(candidates)
    assert np.argmax(doubt) == 0
