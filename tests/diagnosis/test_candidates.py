"""Knobs: scaling there and back, bounds, starts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.diagnosis.quick import REGISTRY, VALUES

from pliant.diagnosis.candidates import MOST_STARTS, Candidate, Knob
from pliant.errors import UserError
from pliant.interfaces.effect import EffectParameter

KNOBS = [knob for kind in VALUES for knob in Candidate.of(REGISTRY, (kind,)).knobs]
knobs = pytest.mark.parametrize("knob", KNOBS, ids=lambda knob: knob.name)


@knobs
def test_the_plausible_end_is_of_order_one(knob: Knob) -> None:
    low, high = knob.plausible
    assert 0.9 < max(abs(low), abs(high)) < 1.7
    assert knob.limits[0] <= low < high <= knob.limits[1]
    if knob.is_strength and knob.parameter.prior == "normal":
        assert knob.value(0.0) == knob.parameter.neutral


@knobs
@given(share=st.floats(0.0, 1.0))
def test_values_and_knobs_there_and_back(knob: Knob, share: float) -> None:
    low, high = knob.limits
    x = low + share * (high - low)
    assert knob.x(knob.value(x)) == pytest.approx(x, abs=1e-9 * (1 + abs(x)))


@knobs
@given(x=st.floats(-1e3, 1e3))
def test_values_stay_within_bounds(knob: Knob, x: float) -> None:
    low, high = knob.parameter.bounds
    assert low <= knob.value(min(x, 500.0)) <= high


@knobs
@given(share=st.floats(0.05, 0.95))
def test_the_slope_is_that_of_the_value(knob: Knob, share: float) -> None:
    low, high = (max(knob.limits[0], -2.0), min(knob.limits[1], 2.0))
    x, h = low + share * (high - low), 1e-6
    assert (knob.value(x + h) - knob.value(x - h)) / (2 * h) == pytest.approx(knob.slope(x), rel=1e-5)


@given(
    neutral=st.floats(-10, 10),
    reach=st.floats(1e-3, 1e3),
    share=st.floats(0.0, 0.9),
    x=st.floats(-0.9, 0.9),
)
def test_any_normal_parameter_scales_there_and_back(
    neutral: float, reach: float, share: float, x: float
) -> None:
    bounds = (neutral - 2 * reach, neutral + 2 * reach)
    plausible = (neutral - share * reach, neutral + reach)
    knob = Knob(0, "some", EffectParameter("value", "1", neutral, bounds, plausible))
    assert knob.x(knob.value(x)) == pytest.approx(x, abs=1e-6)
    assert bounds[0] <= knob.value(10.0 * x) <= bounds[1]


@pytest.mark.parametrize("kind", VALUES)
def test_starts_are_legal_and_few(kind: str) -> None:
    candidate = Candidate.of(REGISTRY, (kind,))
    low, high = candidate.limits()
    starts = candidate.starts()
    assert 1 <= len(starts) <= MOST_STARTS
    for x in starts:
        assert np.all((low <= x) & (x <= high))
        for config, kind_of in zip(candidate.configs(x), candidate.kinds, strict=True):
            assert config.kind == kind_of


def test_known_knobs_start_where_they_are() -> None:
    pair = Candidate.of(REGISTRY, ("mullins", "stiffness"))
    known = {"mullins.softening": 0.7, "mullins.scale_rad": -0.2}
    for x in pair.starts(known):
        np.testing.assert_allclose(x[:2], [0.7, -0.2])
    assert pair.values(np.array([0.0, 0.0, 0.0])).keys() == {
        "mullins.softening",
        "mullins.scale_rad",
        "stiffness.factor",
    }


def test_nothing_has_no_knobs() -> None:
    nothing = Candidate.of(REGISTRY, ())
    assert len(nothing) == 0
    assert nothing.configs(np.zeros(0)) == ()
    assert nothing.limits()[0].shape == (0,)


def test_unknown_kinds_are_named_with_the_closest() -> None:
    with pytest.raises(UserError, match="did you mean 'stiffness'"):
        Candidate.of(REGISTRY, ("stifness",))
