"""Error bars of unseen designs cover the errors of held-out designs and do not depend on the design itself."""

from dataclasses import replace

import numpy as np
import pytest

from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain
from pliant.testing.samples import linear_law
from pliant_designs.error_bars import Bars, _Axis

STATES = 20


def misses(random, designs, states=STATES, slope=1.0):
    """Return (n, s, 3) p, u in [−1, 1] and misses: larger for some designs and with |u|, one sign within a design."""
    n = len(designs)
    size = 1e-3 * np.exp(1.5 * slope * designs[:, 0] + 0.5 * random.standard_normal(n))
    places = random.uniform(-1, 1, (n, states, 2))
    sign = random.choice([-1.0, 1.0], n)
    shape = 0.2 + np.abs(places[:, :, 1]) + 0.3 * random.standard_normal((n, states))
    return places, (sign * size)[:, None] * shape


def make_bars(designs, places, missed, doubt=None):
    n, states = missed.shape
    return Bars(
        low=np.zeros(2),
        width=np.ones(2),
        values=designs,
        doubt=np.ones(n) if doubt is None else doubt,
        design=np.repeat(np.arange(n), states),
        place=places.reshape(-1, 2),
        share=np.abs(missed).reshape(-1, 1),
    )


@pytest.fixture(scope="module")
def sample():
    random = np.random.default_rng(3)
    designs = random.random((60, 2))
    return designs, *misses(random, designs)


LAW = linear_law(gain=1e-6, stiffness=0.04, domain=Domain(np.array([0.0, 2e4]), np.array([[-0.5, 0.5]])))
SIZE = 0.02 + 0.04  # range of LAW's effort over its box


def band(bars, values, places, level):
    """Return half-widths of LAW's band at scaled positions, in its own unit."""
    bar = bars.bar(LAW, values, 1.0)
    return bar.half_width(1e4 * (places[:, 0] + 1), 0.5 * places[:, 1:2], level)[:, 0]


def test_the_record_says_what_the_bars_say(sample):
    designs, places, missed = sample
    bars = make_bars(designs, places, missed)
    one, everyone = _Axis.from_bars(bars, 0), np.ones(60, bool)
    power = one.power(everyone)
    sizes = one.sizes(power, everyone)
    at = np.array([[0.4, 0.6]])
    new = one.sizes_at(power, everyone, at, np.ones(1))[0]
    for level in (0.5, 0.9):
        quantile = one.quantiles(sizes, everyone, np.array([level]))
        wanted = SIZE * new * quantile * one.places(sizes, everyone, own=False)
        got = band(bars, at[0], bars.place, level)
        assert got == pytest.approx(wanted, rel=1e-3)
        assert isinstance(bars.bar(LAW, at[0], 1.0), ErrorBar)


def test_bars_cover_designs_that_are_left_out(sample):
    designs, places, missed = sample
    found = make_bars(designs, places, missed).coverage(np.any(np.abs(designs - 0.5) > 0.4, axis=1))
    assert 0.85 <= found["all"]["0.9"] <= 0.95
    assert 0.42 <= found["all"]["0.5"] <= 0.58
    assert found["all"]["0.99"] >= 0.97
    assert set(found) == {"all", "interior", "border"}


def test_bars_cover_new_designs(sample):
    designs, places, missed = sample
    bars = make_bars(designs, places, missed)
    random = np.random.default_rng(11)
    new = random.random((100, 2))
    new_places, new_missed = misses(random, new)
    inside = [
        np.mean(SIZE * np.abs(m) <= band(bars, v, p, 0.9))
        for v, p, m in zip(new, new_places, new_missed, strict=True)
    ]
    assert 0.85 <= np.mean(inside) <= 0.96


def test_designs_count_not_states(sample):
    designs, places, missed = sample
    states = np.repeat(np.arange(60), np.where(np.arange(60) == 7, STATES, 4))
    few = np.concatenate([np.arange(STATES) if d == 7 else np.arange(4) for d in range(60)])
    bars = make_bars(designs, places, missed)
    thin = replace(
        bars,
        design=states,
        place=places[states, few],
        share=np.abs(missed)[states, few][:, None],
    )
    assert thin.weights[states == 7].sum() == pytest.approx(thin.weights[states == 8].sum())
    one, everyone = _Axis.from_bars(thin, 0), np.ones(60, bool)
    sizes = one.sizes(0.0, everyone)
    score = thin.share[:, 0] / (one.places(sizes, everyone, own=True) * sizes[states])
    level = 0.8
    limit = one.quantiles(sizes, everyone, np.array([level]))[0]
    shares = [np.mean(score[states == d] <= limit) for d in range(60)]
    assert sum(shares) / 61 >= level - 1e-9
    below = [np.mean(score[states == d] < limit) for d in range(60)]
    assert sum(below) / 61 < level


def test_a_design_bar_does_not_know_its_own_misses(sample):
    designs, places, missed = sample
    tenfold = missed.copy()
    tenfold[5] *= 10
    one, other = (_Axis.from_bars(make_bars(designs, places, m), 0) for m in (missed, tenfold))
    rest = np.arange(60) != 5
    for axis in (one, other):
        assert axis.covered(5, (1.0,)).shape == (1,)
    widths = []
    for axis in (one, other):
        sizes = axis.sizes(0.0, rest)
        limit = axis.quantiles(sizes, rest, np.array([0.9]))[0]
        rows = axis.bars.design == 5
        widths.append(limit * axis.places(sizes, rest, own=False)[rows] * sizes[5])
    assert np.array_equal(*widths)


def test_a_doubt_that_tells_is_followed_and_one_that_does_not_is_not():
    random = np.random.default_rng(8)
    designs = random.random((60, 2))
    doubt = np.exp(random.standard_normal(60))
    places, missed = misses(random, designs, slope=0.0)
    told = make_bars(designs, places, missed * doubt[:, None], doubt)
    assert _Axis.from_bars(told, 0).power(np.ones(60, bool)) == 1.0
    assert band(told, designs[0], places[0], 0.9).shape == (STATES,)
    wide = told.bar(LAW, designs[0], 4.0).half_width(np.array([1e4]), np.array([[0.1]]))
    narrow = told.bar(LAW, designs[0], 1.0).half_width(np.array([1e4]), np.array([[0.1]]))
    assert wide == pytest.approx(4 * narrow)
    idle = make_bars(designs, places, missed, doubt)
    assert _Axis.from_bars(idle, 0).power(np.ones(60, bool)) == 0.0


def test_an_axis_without_design_states(sample):
    designs, places, missed = sample
    bars = make_bars(designs, places, missed)
    share = bars.share.copy()
    share[bars.design == 3] = np.nan
    found = replace(bars, share=share).coverage(np.zeros(60, bool))
    assert np.isfinite(found["all"]["0.9"])


def test_many_designs_are_thinned(monkeypatch, sample):
    from pliant_designs import error_bars as module

    monkeypatch.setattr(module, "MOST_STATES", 60 * 5)
    keep = module._chosen(np.repeat(np.arange(60), STATES), 60)
    assert keep.sum() == 60 * 5
    assert np.all(np.bincount(np.repeat(np.arange(60), STATES)[keep]) == 5)


def test_levels_that_few_designs_cannot_know_grow_as_normal_errors_do():
    random = np.random.default_rng(1)
    designs = random.random((8, 2))
    bar = make_bars(designs, *misses(random, designs, slope=0.0)).bar(LAW, designs[0], 1.0)
    known, stated, rare = (bar.quantile(level)[0] for level in (8 / 9, 0.95, 0.99))
    assert stated / known == pytest.approx(1.95996 / 1.59322, rel=2e-3)
    assert rare / known == pytest.approx(2.57583 / 1.59322, rel=2e-3)
