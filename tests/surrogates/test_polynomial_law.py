"""The polynomial law: slopes, energy, the continuation outside its box, records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.surrogates.laws import BOX, WAVY, WORKED, points

from pliant.records.law import Domain, JointLaw
from pliant_plugins.surrogates.polynomial.law import largest_slope, study_law


def tau(law: JointLaw, p: np.ndarray, u: np.ndarray) -> np.ndarray:
    return law.evaluate(p, u).tau[:, 0]


def test_inside_it_is_the_polynomial() -> None:
    law = WAVY
    p, u = points(WAVY, 0.0, 50)
    x, v = (p - 7.5e3) / 7.5e3, (u[:, 0] - 0.125) / 0.325
    expected = np.polynomial.polynomial.polyval2d(x, v, law.coefficients) - 0.02 * u[:, 0] * np.abs(u[:, 0])
    np.testing.assert_allclose(tau(law, p, u), expected, rtol=1e-12, atol=1e-16)


def test_the_potential_is_the_integral_over_the_effort_where_quadrature_is_exact() -> None:
    law = replace(WAVY, odd=0.0)
    p, u = points(WAVY, 0.0, 100)
    np.testing.assert_allclose(law.potential(p, u), JointLaw.potential(law, p, u), rtol=1e-9, atol=1e-15)


def test_a_loop_in_pressure_and_angle_gives_the_actuation_work() -> None:
    """A rectangle in (p, u) does net work, that of the actuation; a law without it cannot lift anything."""
    law = WAVY
    high, low = (law.potential(np.array([p, p]), np.array([[0.0], [0.3]])) for p in (12e3, 2e3))
    assert (low[1] - low[0]) - (high[1] - high[0]) > 1e-3


@settings(max_examples=200, deadline=None)
@given(p=st.floats(-1e6, 1e6), u=st.floats(-50, 50))
def test_stable_on_the_border_means_stable_everywhere_outside(p: float, u: float) -> None:
    law = WAVY
    border = largest_slope(law)
    assert border < 0
    slope = law.evaluate(np.array([p]), np.array([[u]])).dtau_du[0, 0, 0]
    assert slope <= 0.45 * border


def test_worked_number_in_the_contracts() -> None:
    law = study_law(WORKED, True, Domain.unbounded(1))
    assert abs(tau(law, np.array([15e3]), np.array([[0.359718]]))[0]) < 1e-7
    p, u = np.array([8e3, 8e3]), np.array([[0.2], [-0.2]])
    by_hand = 1.637e-6 * 8e3 - 1.704e-6 * 8e3 * 0.2 - (0.1012 * 0.2**2 / 2 + 0.0245 * 0.2)
    mirrored = 1.637e-6 * 8e3 + 1.704e-6 * 8e3 * 0.2 + (0.1012 * 0.2**2 / 2 + 0.0245 * 0.2)
    np.testing.assert_allclose(tau(law, p, u), [by_hand, mirrored], rtol=1e-13)


def test_only_the_difference_between_b_a_and_b_e_acts() -> None:
    shifted = WORKED.model_copy(update={"b_a": 0.01, "b_e": 0.0345})
    p, u = points(WAVY, 0.6)
    laws = [study_law(coefficients, True, BOX) for coefficients in (WORKED, shifted)]
    np.testing.assert_allclose(tau(laws[0], p, u), tau(laws[1], p, u), rtol=1e-9, atol=1e-15)


def test_the_study_form_without_odd_softens_one_way_only() -> None:
    even, odd = (study_law(WORKED, flag, Domain.unbounded(1)) for flag in (False, True))
    p, u = np.zeros(2), np.array([[0.3], [-0.3]])
    difference = tau(odd, p, u) - tau(even, p, u)
    np.testing.assert_allclose(difference, [0.0, 0.1012 * 0.3**2], atol=1e-15)
