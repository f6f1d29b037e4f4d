"""The Gaussian process of a potential: exact on its trend, consistent derivatives, zero deviation at its data."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.pipeline.sampling.gaussian import Process, effort_orders, fit, slope_orders


def scattered(axes: int, n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (n, 1 + axes))


def all_orders(axes: int) -> np.ndarray:
    return np.concatenate([effort_orders(axes), slope_orders(axes)])


def wavy(points: np.ndarray, orders: np.ndarray) -> np.ndarray:
    """Return (n, a) derivatives of sin(0.9 Σ c_d x_d + 0.2)."""
    c = 0.9 * np.linspace(1.0, 0.6, points.shape[1])
    phase = points @ c + 0.2
    return np.stack([np.prod(c**a) * np.sin(phase + a.sum() * np.pi / 2) for a in orders], axis=1)


@pytest.mark.parametrize("axes", [1, 3])
def test_a_quadratic_potential_is_known_exactly(axes):
    points, orders = scattered(axes, 8), all_orders(axes)
    K = np.eye(axes) + 0.3
    g = np.linspace(0.5, 1.0, axes)

    def derivatives(x):
        efforts = x[1:] @ K - x[0] * g
        slopes = [K[i, j] for i in range(axes) for j in range(i, axes)]
        return np.concatenate([efforts, -g, slopes])

    values = np.array([derivatives(x) for x in points])
    process = Process(points, orders, values.ravel() + 1e-12, np.full(1 + axes, 1.0))
    new = scattered(axes, 20, seed=1)
    mean, _ = process.predict(new, orders)
    np.testing.assert_allclose(mean, [derivatives(x) for x in new], atol=1e-9)


@pytest.mark.parametrize("axes", [1, 3])
def test_predicted_slopes_match_the_predicted_effort(axes):
    points, orders = scattered(axes, 10), all_orders(axes)
    process = fit(points, orders, wavy(points, orders).ravel())
    here, h = scattered(axes, 5, seed=2), 1e-4
    _, slopes = np.split(process.predict(here, orders)[0], [axes], axis=1)
    for i in range(axes):  # ∂/∂p of effort i is slope i
        step = np.zeros(1 + axes)
        step[0] = h
        after, before = (process.predict(here + s * step, effort_orders(axes))[0][:, i] for s in (1, -1))
        np.testing.assert_allclose(slopes[:, i], (after - before) / (2 * h), atol=1e-5)


def test_data_are_met_with_next_to_no_deviation_and_the_unknown_has_some():
    points, orders = scattered(1, 8), all_orders(1)
    values = wavy(points, orders)
    process = fit(points, orders, values.ravel())
    mean, deviation = process.predict(points, orders)
    np.testing.assert_allclose(mean, values, atol=1e-5)
    outside = process.predict(np.array([[1.8, -1.8]]), orders)[1]
    assert deviation[:, 0].max() < 1e-2 * outside[0, 0]


def test_deviations_hold_the_errors():
    points, orders = scattered(1, 9), all_orders(1)
    process = fit(points, orders, wavy(points, orders).ravel())
    new = scattered(1, 300, seed=5)
    mean, deviation = process.predict(new, effort_orders(1))
    z = np.abs(mean - wavy(new, effort_orders(1))) / deviation
    assert np.sqrt(np.mean(z**2)) < 4


def test_a_state_left_out_is_missed_as_if_it_had_not_been_there():
    points, orders = scattered(1, 7), all_orders(1)
    values = wavy(points, orders)
    whole = fit(points, orders, values.ravel())
    misses, deviations = whole.left_out()
    for k in (0, 3):
        rest = np.arange(7) != k
        without = Process(points[rest], orders, values[rest].ravel(), whole.lengths)
        mean, deviation = without.predict(points[k : k + 1], effort_orders(1))
        assert misses[k] == pytest.approx(values[k, 0] - mean[0, 0], rel=1e-3, abs=1e-8)
        scale = np.sqrt(whole.variance / without.variance)
        assert deviations[k] == pytest.approx(scale * deviation[0, 0], rel=1e-2)


def test_lengths_follow_the_wave():
    points, orders = scattered(1, 12), all_orders(1)
    slow = fit(points, orders, wavy(points, orders).ravel()).lengths
    fast = fit(points, orders, (wavy(3 * points, orders) * 3.0 ** orders.sum(axis=1)).ravel()).lengths
    assert np.all(fast < slow)
