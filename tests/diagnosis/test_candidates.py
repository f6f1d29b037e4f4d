"""Fit parameters: scaling and its inverse, bounds, starts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.diagnosis.quick import REGISTRY, VALUES

from pliant.diagnosis.candidates import MOST_STARTS, EffectSet, FitParameter
from pliant.errors import UserError
from pliant.interfaces.effect import EffectParameter

KNOBS = [parameter for kind in VALUES for parameter in EffectSet.from_kinds(REGISTRY, (kind,)).parameters]
parameters = pytest.mark.parametrize("parameter", KNOBS, ids=lambda parameter: parameter.name)


@parameters
@given(share=st.floats(0.0, 1.0), far=st.floats(-1e3, 500.0))
def test_values_and_numbers_there_and_back(parameter: FitParameter, share: float, far: float) -> None:
    low, high = parameter.plausible
    assert 0.9 < max(abs(low), abs(high)) < 1.7
    assert parameter.limits[0] <= low < high <= parameter.limits[1]
    if parameter.is_strength and parameter.declared.prior == "normal":
        assert parameter.value(0.0) == parameter.declared.neutral
    x = parameter.limits[0] + share * (parameter.limits[1] - parameter.limits[0])
    assert parameter.x(parameter.value(x)) == pytest.approx(x, abs=1e-9 * (1 + abs(x)))
    assert parameter.declared.bounds[0] <= parameter.value(far) <= parameter.declared.bounds[1]
    ends = max(parameter.limits[0], -2.0), min(parameter.limits[1], 2.0)
    x, h = ends[0] + (0.05 + 0.9 * share) * (ends[1] - ends[0]), 1e-6
    slope = (parameter.value(x + h) - parameter.value(x - h)) / (2 * h)
    assert slope == pytest.approx(parameter.slope(x), rel=1e-5)


@given(
    neutral=st.floats(-10, 10), reach=st.floats(1e-3, 1e3), share=st.floats(0.0, 0.9), x=st.floats(-0.9, 0.9)
)
def test_any_normal_parameter_scales_there_and_back(neutral, reach, share, x) -> None:
    bounds = (neutral - 2 * reach, neutral + 2 * reach)
    plausible = (neutral - share * reach, neutral + reach)
    parameter = FitParameter(0, "some", EffectParameter("value", "1", neutral, bounds, plausible))
    assert parameter.x(parameter.value(x)) == pytest.approx(x, abs=1e-6)
    assert bounds[0] <= parameter.value(10.0 * x) <= bounds[1]


@pytest.mark.parametrize("kind", VALUES)
def test_starts_are_legal_and_few(kind: str) -> None:
    candidate = EffectSet.from_kinds(REGISTRY, (kind,))
    low, high = candidate.limits()
    starts = candidate.starts()
    assert 1 <= len(starts) <= MOST_STARTS
    for x in starts:
        assert np.all((low <= x) & (x <= high))
        for config, kind_of in zip(candidate.configs(x), candidate.kinds, strict=True):
            assert config.kind == kind_of


def test_known_knobs_start_where_they_are() -> None:
    pair = EffectSet.from_kinds(REGISTRY, ("mullins", "stiffness"))
    known = {"mullins.softening": 0.7, "mullins.scale_rad": -0.2}
    for x in pair.starts(known):
        np.testing.assert_allclose(x[:2], [0.7, -0.2])
    assert pair.values(np.array([0.0, 0.0, 0.0])).keys() == {
        "mullins.softening",
        "mullins.scale_rad",
        "stiffness.factor",
    }


def test_nothing_has_no_knobs() -> None:
    nothing = EffectSet.from_kinds(REGISTRY, ())
    assert len(nothing) == 0
    assert nothing.configs(np.zeros(0)) == ()
    assert nothing.limits()[0].shape == (0,)


def test_unknown_kinds_are_named_with_the_closest() -> None:
    with pytest.raises(UserError, match="did you mean 'stiffness'"):
        EffectSet.from_kinds(REGISTRY, ("stifness",))
