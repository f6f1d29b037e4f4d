"""What a fit asks of the engine: no point twice, no slope of a parameter that is held, no idle step."""

from __future__ import annotations

import numpy as np
import pytest
from tests.diagnosis.formula import candidate, fitter, measured, parameter

from pliant.diagnosis.uncertainty import uncertainty

T = np.linspace(0.0, 3.0, 40)


def line(t, a, b):
    return a + b * t


def bent(t, a, b):
    return a * np.exp(0.3 * b * t)


def made(function, scale=0.05):
    noise = 0.05 * np.random.default_rng(4).normal(size=(3, len(T)))
    return fitter(function, measured([function(T, 1.0, 0.5) + row for row in noise], [T] * 3), scale)


@pytest.fixture
def counted(monkeypatch):
    """A fitter of a line, and the number of changes that its engine was asked for at each call."""
    found = made(line)
    asked = []
    vary = found.predictor.vary

    def counting(configs, towards):
        asked.append(len(towards))
        return vary(configs, towards)

    monkeypatch.setattr(found.predictor, "vary", counting)
    return found, asked


def two():
    return candidate(parameter("a"), parameter("b"))


def test_a_point_that_was_looked_at_is_not_asked_for_again(counted) -> None:
    found, asked = counted
    x = two().starts()[0]
    looked = found.look(two(), x)
    assert asked == [2]
    again = found.look(two(), x.copy())
    assert asked == [2]
    np.testing.assert_array_equal(looked.slopes, again.slopes)
    found.look(two(), 2.0 * x)
    assert asked == [2, 2]


def test_a_fit_begins_where_it_was_looked_at(counted) -> None:
    found, asked = counted
    found.look(two(), two().starts()[0])
    looks = len(asked)
    fit = found.fit(two())
    fresh = made(line).fit(two())
    np.testing.assert_array_equal(fit.x, fresh.x)
    # A line is solved in damped steps; the last one, which takes off what is left of the damping, needs no engine.
    assert fit.converged and len(asked) - looks <= 2


def test_slopes_of_a_held_knob_are_not_asked_for(counted) -> None:
    found, asked = counted
    fit = found.fit(two())
    asked.clear()
    uncertainty(found, fit, 100.0)
    assert asked and set(asked) == {1}


def test_a_knob_alone_takes_one_call_for_each_height_of_its_profile(counted) -> None:
    found, asked = counted
    fit = found.fit(candidate(parameter("a")))
    asked.clear()
    uncertainty(found, fit, 100.0)
    assert asked == [0, 0]


def test_profile_intervals_of_a_line_are_its_standard_deviations() -> None:
    found = made(line)
    fit = found.fit(two())
    for one in uncertainty(found, fit, 100.0).estimates:
        np.testing.assert_allclose([one.value - one.low, one.high - one.value], 1.6449 * one.sd, rtol=0.02)


def test_a_bent_valley_is_followed_to_the_ends_of_its_profile() -> None:
    found = made(bent)
    fit = found.fit(two())
    best, scale = found.weights @ fit.residual**2, fit.mean_square() * len(fit.residual) / 98.0
    for k, one in enumerate(uncertainty(found, fit, 100.0).estimates):
        for end in (one.low, one.high):
            x = fit.candidate.parameters[k].x(end)
            other = np.linspace(-0.02, 0.02, 4001) + fit.x[1 - k]
            rows = [(x, y) if k == 0 else (y, x) for y in other]
            values = [
                [parameter.value(v) for parameter, v in zip(fit.candidate.parameters, row, strict=True)]
                for row in rows
            ]
            costs = [
                np.sum((found.readings.values - np.tile(bent(T, a, b), 3) / 0.05) ** 2) for a, b in values
            ]
            assert np.sqrt((min(costs) - best) / scale) == pytest.approx(1.6449, rel=0.03)
