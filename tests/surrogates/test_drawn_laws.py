"""Drawn polynomial laws are the law plus the drawn error, in a form that engines compile."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.surrogates.laws import WAVY, energy_law, points

from pliant.mechanics.law_draws import DrawnLaw, error_tables
from pliant.records.error_bar import ErrorBar
from pliant.records.law import JointLaw


def with_bar(law: JointLaw) -> JointLaw:
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    p, u = points(law, 0.0, 80, seed=1)
    misses = 1e-4 * np.random.default_rng(1).standard_normal(u.shape)
    return replace(law, error=ErrorBar.of(box, p, u, misses))  # type: ignore[type-var]


@pytest.mark.parametrize("law", [WAVY, energy_law(3)], ids=["polynomial", "energy"])
def test_a_drawn_law_is_the_law_plus_the_error(law: JointLaw) -> None:
    assert law.draws(3, seed=0) == ()  # type: ignore[attr-defined]
    law = with_bar(law)
    p, u = points(law, 0.0, 40)
    drawn = law.draws(3, seed=4)  # type: ignore[attr-defined]
    assert len(drawn) == 3
    for one, tables in zip(drawn, error_tables(law, 3, 4), strict=True):
        got, wanted = one.evaluate(p, u), DrawnLaw(law, tables).evaluate(p, u)
        np.testing.assert_allclose(got.tau, wanted.tau, atol=1e-9)
        np.testing.assert_allclose(got.dtau_dp, wanted.dtau_dp, atol=1e-12)
        np.testing.assert_allclose(got.dtau_du, wanted.dtau_du, atol=1e-7)
        assert one.scalar() is not None and one.domain is law.domain
