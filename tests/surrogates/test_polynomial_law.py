"""The polynomial law: slopes, energy, the continuation outside its box, records."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pliant.records.law import Domain, JointLaw, LawRecord
from pliant_plugins.surrogates.polynomial.config import StudyCoefficients
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw, largest_slope
from pliant_plugins.surrogates.polynomial.study_form import study_law

BOX = Domain(np.array([0.0, 15e3]), np.array([[-0.2, 0.45]]))
WORKED = StudyCoefficients(k_n=1.637e-6, m_a=-1.704e-6, b_a=0.0, m_e=0.1012, b_e=0.0245)


def wavy(odd: float = -0.02) -> PolynomialLaw:
    """A stable law of degree 4 whose stiffness changes with pressure in both directions."""
    table = 1e-3 * np.array(
        [
            [12.0, -20.0, 1.0, -2.0, -0.5],
            [11.0, 2.5, -1.5, 0.8, 0.0],
            [1.0, -1.2, 0.7, 0.0, 0.0],
            [0.2, 0.5, 0.0, 0.0, 0.0],
        ]
    )
    return PolynomialLaw(table, np.array([7.5e3, 7.5e3]), np.array([0.125, 0.325]), BOX, odd)


def states(n: int = 400, reach: float = 0.6) -> tuple[np.ndarray, np.ndarray]:
    """Random states in and around the box, `reach` box widths beyond it on each side."""
    rng = np.random.default_rng(3)
    p = 15e3 * rng.uniform(-reach, 1 + reach, n)
    u = -0.2 + 0.65 * rng.uniform(-reach, 1 + reach, (n, 1))
    return p, u


def tau(law: JointLaw, p: np.ndarray, u: np.ndarray) -> np.ndarray:
    return law.evaluate(p, u).tau[:, 0]


def test_inside_it_is_the_polynomial() -> None:
    law = wavy()
    p, u = states(50, 0.0)
    x, v = (p - 7.5e3) / 7.5e3, (u[:, 0] - 0.125) / 0.325
    expected = np.polynomial.polynomial.polyval2d(x, v, law.coefficients) - 0.02 * u[:, 0] * np.abs(u[:, 0])
    np.testing.assert_allclose(tau(law, p, u), expected, rtol=1e-12, atol=1e-16)


def test_slopes_are_the_derivatives_in_and_outside() -> None:
    law = wavy()
    p, u = states()
    effort = law.evaluate(p, u)
    dp, du = 0.5, 1e-5
    by_p = (tau(law, p + dp, u) - tau(law, p - dp, u)) / (2 * dp)
    by_u = (tau(law, p, u + du) - tau(law, p, u - du)) / (2 * du)
    np.testing.assert_allclose(effort.dtau_dp[:, 0], by_p, rtol=1e-5, atol=1e-11)
    np.testing.assert_allclose(effort.dtau_du[:, 0, 0], by_u, rtol=1e-5, atol=1e-7)


def test_minus_the_gradient_of_the_potential_is_the_effort() -> None:
    law = wavy()
    p, u = states()
    du = 1e-5
    slope = (law.potential(p, u + du) - law.potential(p, u - du)) / (2 * du)
    np.testing.assert_allclose(-slope, tau(law, p, u), rtol=1e-6, atol=1e-11)
    np.testing.assert_array_equal(law.potential(p, np.zeros_like(u)), 0.0)


def test_the_potential_is_the_integral_of_the_effort_where_quadrature_is_exact() -> None:
    law = wavy(odd=0.0)
    p, u = states(100, 0.0)
    np.testing.assert_allclose(law.potential(p, u), JointLaw.potential(law, p, u), rtol=1e-9, atol=1e-15)


def test_a_closed_loop_at_fixed_pressure_does_no_work() -> None:
    """Out through the border and back in other steps: the work cancels, and one way it is the potential's."""
    law = wavy()
    for pressure in (-4e3, 6e3, 25e3):
        there, back = np.linspace(-0.5, 0.9, 4001), np.linspace(0.9, -0.5, 5003)
        work = sum(
            np.trapezoid(tau(law, np.full(len(path), pressure), path[:, None]), path)
            for path in (there, back)
        )
        one_way = law.potential(np.array([pressure]), np.array([[-0.5]])) - law.potential(
            np.array([pressure]), np.array([[0.9]])
        )
        assert abs(work) < 1e-6 * abs(one_way[0])
        np.testing.assert_allclose(
            np.trapezoid(tau(law, np.full(4001, pressure), there[:, None]), there), one_way[0], rtol=1e-5
        )


def test_a_loop_in_pressure_and_angle_gives_the_work_of_the_actuation() -> None:
    """A rectangle in (p, u) does net work: the actuation's. A law without that cannot lift anything."""
    law = wavy()
    high, low = (law.potential(np.array([p, p]), np.array([[0.0], [0.3]])) for p in (12e3, 2e3))
    assert (low[1] - low[0]) - (high[1] - high[0]) > 1e-3


@settings(max_examples=200, deadline=None)
@given(
    along=st.floats(-0.8, 1.8),
    side=st.sampled_from(["low p", "high p", "low u", "high u"]),
)
def test_value_and_slopes_are_continuous_across_every_border(along: float, side: str) -> None:
    law = wavy()
    step = 1e-9
    if side.endswith("p"):
        edge = 0.0 if side == "low p" else 15e3
        p, u = edge + 15e3 * step * np.array([-1, 1]), np.full((2, 1), -0.2 + 0.65 * along)
    else:
        edge = -0.2 if side == "low u" else 0.45
        p, u = np.full(2, 15e3 * along), edge + step * np.array([[-1.0], [1.0]])
    effort = law.evaluate(p, u)
    for values, scale in ((effort.tau, 0.02), (effort.dtau_dp, 2e-6), (effort.dtau_du, 0.05)):
        assert abs(values[1] - values[0]).max() < 1e-6 * scale


@settings(max_examples=200, deadline=None)
@given(p=st.floats(-1e6, 1e6), u=st.floats(-50, 50))
def test_stable_on_the_border_means_stable_everywhere_outside(p: float, u: float) -> None:
    law = wavy()
    border = largest_slope(law)
    assert border < 0
    slope = law.evaluate(np.array([p]), np.array([[u]])).dtau_du[0, 0, 0]
    assert slope <= 0.45 * border


def test_leaving_the_box_is_flagged_by_the_domain() -> None:
    excess = wavy().domain.excess(np.array([16e3, 5e3]), np.array([[0.1], [-0.3]]))
    np.testing.assert_allclose(excess, [[1e3, 0.0], [0.0, -0.1]], atol=1e-12)


def test_an_unstable_border_is_continued_to_finite_numbers() -> None:
    law = replace(wavy(), coefficients=-wavy().coefficients, odd=0.0)
    assert largest_slope(law) > 0
    effort = law.evaluate(np.array([-1e6, 1e6]), np.array([[-9.0], [9.0]]))
    assert all(np.isfinite(values).all() for values in (effort.tau, effort.dtau_dp, effort.dtau_du))


def test_worked_number_of_the_contracts() -> None:
    law = study_law(WORKED, True, Domain.unbounded(1))
    assert abs(tau(law, np.array([15e3]), np.array([[0.359718]]))[0]) < 1e-7
    p, u = np.array([8e3, 8e3]), np.array([[0.2], [-0.2]])
    by_hand = 1.637e-6 * 8e3 - 1.704e-6 * 8e3 * 0.2 - (0.1012 * 0.2**2 / 2 + 0.0245 * 0.2)
    mirrored = 1.637e-6 * 8e3 + 1.704e-6 * 8e3 * 0.2 + (0.1012 * 0.2**2 / 2 + 0.0245 * 0.2)
    np.testing.assert_allclose(tau(law, p, u), [by_hand, mirrored], rtol=1e-13)


def test_only_the_difference_of_b_a_and_b_e_acts() -> None:
    shifted = WORKED.model_copy(update={"b_a": 0.01, "b_e": 0.0345})
    p, u = states()
    laws = [study_law(coefficients, True, BOX) for coefficients in (WORKED, shifted)]
    np.testing.assert_allclose(tau(laws[0], p, u), tau(laws[1], p, u), rtol=1e-9, atol=1e-15)


def test_the_study_form_without_odd_softens_one_way_only() -> None:
    even, odd = (study_law(WORKED, flag, Domain.unbounded(1)) for flag in (False, True))
    p, u = np.zeros(2), np.array([[0.3], [-0.3]])
    difference = tau(odd, p, u) - tau(even, p, u)
    np.testing.assert_allclose(difference, [0.0, 0.1012 * 0.3**2], atol=1e-15)


def test_shapes() -> None:
    effort = wavy().evaluate(np.zeros(7), np.zeros((7, 1)))
    assert (effort.tau.shape, effort.dtau_dp.shape, effort.dtau_du.shape) == ((7, 1), (7, 1), (7, 1, 1))


@pytest.mark.parametrize(
    "law", [wavy(), study_law(WORKED, True, Domain.unbounded(1))], ids=["box", "unbounded"]
)
def test_a_record_makes_the_same_bits(law: PolynomialLaw) -> None:
    record = law.record()
    through_json = LawRecord(record.kind, json.loads(json.dumps(record.values)), record.arrays)
    copy = PolynomialLaw.of_record(through_json)
    p, u = states()
    first, second = law.evaluate(p, u), copy.evaluate(p, u)
    for name in ("tau", "dtau_dp", "dtau_du"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    np.testing.assert_array_equal(law.potential(p, u), copy.potential(p, u))
    assert (copy.joint, copy.axes, copy.actuation_name) == (law.joint, law.axes, law.actuation_name)
