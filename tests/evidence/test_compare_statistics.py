"""Noise models, tests and intervals against closed forms and simulation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.evidence.compare_data import bench, colour

from pliant.evidence.error_bins import Noise, bin_means, coloured_count, output_noise, significant
from pliant.evidence.scores import block_sums, interval
from pliant.measurements.floors import noise_floors
from pliant.measurements.repeats import repeat_groups


@given(st.lists(st.integers(0, 2), min_size=1, max_size=30), st.floats(0, 0.99), st.integers(0, 2**30))
def test_the_coloured_count_is_the_double_sum(code, phi, mask):
    code = np.array(code)
    there = np.array([bool(mask >> k & 1) for k in range(len(code))])
    lag = np.abs(np.subtract.outer(np.arange(len(code)), np.arange(len(code))))
    expected = []
    for k in range(3):
        member = ((code == k) & there).astype(float)
        expected.append(member @ phi**lag @ member)
    np.testing.assert_allclose(coloured_count(code, there, 3, phi), expected, atol=1e-9)


def test_the_standard_error_in_a_bin_is_the_scatter_in_its_mean():
    rng = np.random.default_rng(0)
    codes = [np.arange(60) // 20 % 2, np.arange(40) // 10 % 2]
    noise = Noise(within=1.0, between=0.5, memory_s=-0.1 / np.log(0.7))
    means = []
    for _ in range(3000):
        series = [colour(rng, len(code), 1.0, 0.7) + rng.normal(0, 0.5) for code in codes]
        found = bin_means(series, codes, 2, noise, [0.1, 0.1])
        means.append(found.mean)
    np.testing.assert_allclose(np.std(means, axis=0), found.standard_error, rtol=0.04)


def test_few_repeats_make_the_test_cautious():
    codes = [np.zeros(50, int)] * 4
    series = [np.full(50, 1.0)] * 4
    sure = bin_means(series, codes, 1, Noise(0.1, 1.0), [1.0] * 4)
    unsure = bin_means(series, codes, 1, Noise(0.1, 1.0, freedom_between=2), [1.0] * 4)
    assert unsure.z[0] == sure.z[0]
    assert unsure.p[0] > 2 * sure.p[0]


def test_benjamini_and_hochberg_by_their_own_example():
    """Four of the 15 p-values of their section 3.3 are rejected at 0.05."""
    p = [0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262, 0.5719]
    p = np.array([*p, 0.6528, 0.7590, 1.0])
    mixed = np.random.default_rng(0).permutation(len(p))
    assert significant(p, 0.05).tolist() == [True] * 4 + [False] * 11
    assert significant(p[mixed], 0.05).tolist() == significant(p, 0.05)[mixed].tolist()
    assert not significant(np.full(3, np.nan), 0.05).any()


@pytest.mark.parametrize("runs", [3, 12])
def test_intervals_cover_what_they_say(runs):
    """95 % intervals of a mean, by blocks of three runs and by twelve whole runs of coloured noise."""
    rng, hits, sets = np.random.default_rng(runs), 0, 400
    memory = [6 * -1 / np.log(0.8)] * runs
    for seed in range(sets):
        columns = [np.stack([np.ones(200), colour(rng, 200, 1.0, 0.8)], axis=1) for _ in range(runs)]
        low, high = interval(block_sums(columns, memory), lambda s: s[:, 1] / s[:, 0], seed)
        hits += low < 0 < high
    assert 0.90 <= hits / sets <= 0.99


def test_two_blocks_have_no_interval():
    assert np.isnan(interval(np.ones((2, 2)), lambda s: s[:, 1])).all()


@pytest.mark.parametrize("phi", [0.0, 0.8, 0.95])
def test_the_noise_memory_is_estimated_from_repeats(phi):
    measurement, _ = bench(1, phi=phi, offset=0.003)
    floor = noise_floors(measurement)["angle_rad"]
    found = output_noise(
        floor, measurement, repeat_groups(measurement), [r.outputs["angle_rad"] for r in measurement.runs]
    )
    assert found.correlation(0.1) == pytest.approx(phi, abs=0.06)
    assert found.within == pytest.approx(0.004, rel=0.25)
    assert 0.0005 < found.between < 0.008
