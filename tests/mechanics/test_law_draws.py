"""Drawn laws deviate from the law as its error bar states, with exact slopes."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.mechanics.law_draws import DrawnLaw, draws, error_tables
from pliant.records.law import Domain, JointLaw
from pliant.testing.samples import barred_law, linear_law, linear_spherical_law

BOX = Domain(np.array([0.0, 15e3]), np.array([[-0.2, 0.6]]))


def points(law: JointLaw, n: int = 60, reach: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(3)
    p, u = law.domain.actuation, law.domain.deformation
    centre, half = u.mean(axis=1), np.ptp(u, axis=1) / 2
    return p.max() * random.random(n), centre + reach * half * (2 * random.random((n, len(u))) - 1)


def test_draws_spread_as_the_band_says() -> None:
    law = barred_law(linear_law(), BOX, 1e-4)
    p, u = points(law)
    exact = law.evaluate(p, u).tau
    missed = np.array([drawn.evaluate(p, u).tau - exact for drawn in draws(law, 400, seed=1)])
    assert np.sqrt(np.mean(missed**2)) == pytest.approx(1e-4, rel=0.15)
    assert np.abs(missed.mean(axis=0)).max() < 0.35e-4  # no side is preferred


def test_draw_slopes_are_exact_and_symmetric_inside_and_outside() -> None:
    domain = Domain(BOX.actuation, np.tile(BOX.deformation, (3, 1)))
    law = barred_law(linear_spherical_law(), domain, 1e-3)
    drawn = draws(law, 1, seed=2)[0]
    for reach in (0.9, 2.0):
        p, u = points(law, reach=reach)
        effort = drawn.evaluate(p, u)
        np.testing.assert_allclose(effort.dtau_du, np.swapaxes(effort.dtau_du, 1, 2), atol=1e-15)
        for j in range(3):
            step = np.zeros(3)
            step[j] = 1e-6
            slope = (drawn.evaluate(p, u + step).tau - drawn.evaluate(p, u - step).tau) / 2e-6
            np.testing.assert_allclose(effort.dtau_du[:, :, j], slope, atol=1e-7)
        by_p = (drawn.evaluate(p + 0.5, u).tau - drawn.evaluate(p - 0.5, u).tau) / 1.0
        np.testing.assert_allclose(effort.dtau_dp[5:-5], by_p[5:-5], atol=1e-9)


def test_the_same_seed_draws_the_same_laws_and_others_differ() -> None:
    law = barred_law(linear_law(), BOX, 1e-4)
    one, two, other = (error_tables(law, 2, seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(one, two)
    assert not np.allclose(one, other)


def test_a_law_that_states_no_error_is_not_drawn() -> None:
    with pytest.raises(ValueError, match="no error bar"):
        draws(linear_law(domain=BOX), 3, seed=0)


def test_a_draw_keeps_what_the_law_is() -> None:
    law = barred_law(linear_spherical_law(), Domain(BOX.actuation, np.tile(BOX.deformation, (3, 1))), 1e-4)
    drawn = draws(law, 1, seed=0)[0]
    assert isinstance(drawn, DrawnLaw)
    assert (drawn.joint, drawn.axes, drawn.domain) == (law.joint, law.axes, law.domain)
