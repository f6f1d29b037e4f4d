"""Drawn polynomial laws are the law plus the drawn error, in a form that engines compile."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.surrogates.laws import WAVY, energy_law, points

from pliant.errors import UserError
from pliant.mechanics.law_draws import ONE_SIGMA, DrawnLaw, draws, error_tables
from pliant.records.error_bar import ErrorBar
from pliant.records.law import JointLaw
from pliant.testing.joint_laws import require_exact_slopes, require_potential
from pliant.testing.samples import opposed_law, opposed_table
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.several_law import SeveralLaw
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial


def with_bar(law: JointLaw) -> JointLaw:
    box = np.vstack([law.domain.actuation, law.domain.deformation])
    p, u = points(law, 0.0, 80, seed=1)
    misses = 1e-4 * np.random.default_rng(1).standard_normal(u.shape)
    return replace(law, error=ErrorBar.from_residuals(box, p, u, misses))  # type: ignore[type-var]


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


def test_drawn_laws_with_two_pressures_are_as_far_off_as_the_bar_says() -> None:
    """Over many draws the effort's deviation is the bar's at one standard deviation; each is a law of an energy."""
    law = Polynomial(PolynomialConfig(kind="polynomial")).fit_module(opposed_table()).law
    assert isinstance(law, SeveralLaw)
    box, random = law.domain.box, np.random.default_rng(6)
    at = box[:, 0] + np.ptp(box, axis=1) * random.random((60, 3))
    misses = 1e-4 * (1 + at[:, :1] / box[0, 1]) * random.choice([-1, 1], (60, 1))
    law = replace(law, error=ErrorBar.from_residuals(box, at[:, :2], at[:, 2:], misses))
    p, u = at[:, :2], at[:, 2:]
    drawn = law.draws(300, seed=2)
    apart = np.array([one.evaluate(p, u).tau - law.evaluate(p, u).tau for one in drawn])
    bar = law.band(p, u, ONE_SIGMA)
    assert bar is not None
    assert np.sqrt(np.mean(apart**2)) == pytest.approx(np.sqrt(np.mean(bar**2)), rel=0.1)
    assert np.abs(apart.mean(axis=0)).max() < 0.3 * bar.max()
    require_exact_slopes(drawn[0], 0.9 * p, 0.9 * u, rtol=1e-4)
    require_potential(drawn[0], p, u, rtol=1e-4)
    assert drawn[0].scalar() is not None


def test_a_law_with_two_pressures_without_draws_says_which_have_some() -> None:
    with pytest.raises(
        UserError, match="pressure_1_pa, pressure_2_pa can be drawn .* where they are polynomials"
    ):
        draws(opposed_law(), 2, 0)
