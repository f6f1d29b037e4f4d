"""Error bars: ranks of scores, growth outside the box, units, nominal coverage, records."""

from __future__ import annotations

from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest
from tests.surrogates.laws import states

from pliant.records.error_bar import BarsOfAxes, ErrorBar
from pliant.records.fem import FemDataset
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial

BOX = np.array([[0.0, 15e3], [-0.2, 0.45]])
LEVELS = (0.5, 0.9, 0.99)


def places(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    points = np.random.default_rng(seed).uniform(BOX[:, 0], BOX[:, 1], (n, 2))
    return points[:, 0], points[:, 1:]


def errors(p: np.ndarray, u: np.ndarray, seed: int) -> np.ndarray:
    """Return independent errors that are five times as large at one end of the box as at the other."""
    size = 1e-4 * (1 + 4 * p / 15e3)
    return (size * np.random.default_rng(seed).standard_normal(len(p)))[:, None]


def bar(n: int = 40, seed: int = 0, factor: float = 1.0) -> ErrorBar:
    p, u = places(n, seed)
    return ErrorBar.from_residuals(BOX, p, u, factor * errors(p, u, seed + 1000))


def test_scores_are_sorted_and_levels_are_ordered() -> None:
    one = bar()
    assert np.all(np.diff(one.scores, axis=0) >= 0)
    widths = np.array(
        [one.half_width(*places(50, 3), level) for level in (0.1, 0.3, 0.5, 0.9, 0.97, 0.99, 0.999)]
    )
    assert np.all(np.diff(widths, axis=0) > 0)


def test_a_quantile_is_a_rank_between_ranks_a_line_beyond_them_a_normal_tail() -> None:
    one = replace(bar(9), scores=np.arange(1.0, 10.0)[:, None])
    assert one.quantile(0.5)[0] == pytest.approx(5.0)
    assert one.quantile(0.25)[0] == pytest.approx(2.5)
    assert one.quantile(0.05)[0] == pytest.approx(0.5)
    assert one.quantile(0.9)[0] == pytest.approx(9.0)
    normal = NormalDist()
    assert one.quantile(0.99)[0] == pytest.approx(9 * normal.inv_cdf(0.995) / normal.inv_cdf(0.95))


def test_the_band_grows_with_every_step_outside_the_box() -> None:
    one = bar()
    for p, u in (
        (np.linspace(15e3, 40e3, 9), np.full(9, 0.1)),
        (np.full(9, 8e3), np.linspace(-0.2, -1.0, 9)),
    ):
        width = one.half_width(p, u[:, None])[:, 0]
        assert np.all(np.diff(width) > 0)
    at_edge, beyond = one.half_width(np.array([15e3, 15e3 + 7.5e3 / 4]), np.full((2, 1), 0.1))[:, 0]
    assert beyond == pytest.approx(2 * at_edge)


def test_the_band_has_the_misses_unit_and_none_from_the_box() -> None:
    one, thrice = bar(), bar(factor=3.0)
    p, u = places(60, 5)
    np.testing.assert_allclose(thrice.half_width(p, u), 3 * one.half_width(p, u), rtol=1e-12)
    scale = np.array([1e-3, 180 / np.pi])
    p_fit, u_fit = places(40, 0)
    other = ErrorBar.from_residuals(
        BOX * scale[:, None], p_fit * scale[0], u_fit * scale[1], errors(p_fit, u_fit, 1000)
    )
    np.testing.assert_allclose(other.half_width(p * scale[0], u * scale[1]), one.half_width(p, u), rtol=1e-10)


def test_the_band_is_wider_where_the_misses_are_larger() -> None:
    one = bar(200)
    small, large = one.half_width(np.array([1e3, 14e3]), np.full((2, 1), 0.1))[:, 0]
    assert large > 2 * small


def test_errors_like_those_left_out_are_covered_as_stated() -> None:
    """400 bars of 30 misses, 5 new errors each: shares within 4.4 standard deviations of a binomial of 400 bars."""
    hits = {level: [] for level in LEVELS}
    for seed in range(400):
        one = bar(30, seed)
        p, u = places(5, seed + 10_000)
        missed = np.abs(errors(p, u, seed + 20_000))
        for level in LEVELS:
            hits[level].append(np.mean(missed <= one.half_width(p, u, level)))
    for level in (0.5, 0.9):
        assert abs(np.mean(hits[level]) - level) < 4.4 * np.sqrt(level * (1 - level) / 400)
    assert 0.96 < np.mean(hits[0.99]) < 1.0


def test_states_on_the_border_may_be_left_out_from_the_ranks_but_not_from_the_sizes() -> None:
    p, u = places(20, 0)
    p[:8] = np.repeat([0.0, 15e3], 4)
    missed = errors(p, u, 1)
    missed[:8] *= 10
    ranks_of_all, inner = (
        ErrorBar.from_residuals(BOX, p, u, missed),
        ErrorBar.from_residuals(BOX, p, u, missed, inner_scores=True),
    )
    assert (len(ranks_of_all.scores), len(inner.scores)) == (20, 12)
    np.testing.assert_array_equal(inner.misses, ranks_of_all.misses)
    few = ErrorBar.from_residuals(BOX, p[:12], u[:12], missed[:12], inner_scores=True)
    assert len(few.scores) == 12


def test_arrays_give_the_same_bits_and_many_points_equal_few() -> None:
    one = bar()
    again = ErrorBar.from_arrays(one.arrays())
    assert again is not None
    p, u = places(10_000, 2)
    width = one.half_width(p, u)
    np.testing.assert_array_equal(again.half_width(p, u), width)
    np.testing.assert_allclose(one.half_width(p[:7], u[:7]), width[:7], rtol=1e-12)
    assert ErrorBar.from_arrays({}) is None


def test_axis_bars_stand_side_by_side() -> None:
    first, second = bar(seed=1), bar(seed=2, factor=10.0)
    both = BarsOfAxes((first, None, second))
    p = np.array([3e3, 16e3])
    u = np.array([[0.1, 5.0, 0.2], [0.0, 1.0, -0.4]])
    widths = both.half_width(p, u)
    np.testing.assert_array_equal(widths[:, 0], first.half_width(p, u[:, :1])[:, 0])
    np.testing.assert_array_equal(widths[:, 2], second.half_width(p, u[:, 2:])[:, 0])
    assert np.all(widths[:, 1] == 0)


# -- bars of fitted laws ---------------------------------------------------------------------------


def bench(seed: int, n: int = 60, noise: float = 2e-4) -> FemDataset:
    """Return scattered states of a quadratic law with noise; the last 20 are to be scored."""
    rng = np.random.default_rng(seed)
    p, u = (c.ravel() for c in places(n + 20, seed))
    moment = 1.6e-6 * p * (1 - u) - 0.03 * u - 0.05 * u**2 + noise * rng.standard_normal(n + 20)
    return states(p, u, moment, check=np.arange(n + 20) >= n)


@pytest.mark.parametrize("config", [PolynomialConfig(max_degree=4), PolynomialConfig(form="study")])
def test_the_bar_from_noisy_states_covers_new_ones_as_stated(config: PolynomialConfig) -> None:
    covered = [Polynomial(config).fit(bench(seed)).report.details["error_bar"] for seed in range(12)]
    assert {row["n"] for row in covered} <= set(range(10, 21))
    assert (
        0.85 < np.average([row["covered"] for row in covered], weights=[row["n"] for row in covered]) < 0.95
    )


def test_a_fit_bar_scales_with_the_moments() -> None:
    data = bench(3)
    one = Polynomial(PolynomialConfig()).fit(data).law
    ten = Polynomial(PolynomialConfig()).fit(replace(data, moment_n_m=10 * data.moment_n_m)).law
    p, u = places(30, 9)
    np.testing.assert_allclose(ten.band(p, u), 10 * one.band(p, u), rtol=1e-6)


def test_a_fitted_law_keeps_its_bar_in_its_record_and_a_stated_one_has_none() -> None:
    law = Polynomial(PolynomialConfig()).fit(bench(1)).law
    again = Polynomial(PolynomialConfig()).load(law.record())
    p, u = places(30, 9)
    np.testing.assert_array_equal(again.band(p, u, 0.9), law.band(p, u, 0.9))
    stated = PolynomialConfig(form="study", coefficients={"k_n": 1e-6, "m_a": 0.0, "m_e": 0.0, "b_e": 0.03})
    assert Polynomial(stated).stated().band(p, u) is None
