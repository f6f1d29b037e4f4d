"""Drawn polynomial laws are the law plus the drawn error, in a form that engines compile."""

from __future__ import annotations

import numpy as np
import pytest

from pliant.mechanics.law_draws import DrawnLaw, error_tables
from pliant.records.error_bar import ErrorBar
from pliant.records.law import Domain, JointLaw
from pliant_plugins.surrogates.polynomial.energy import EnergyBasis
from pliant_plugins.surrogates.polynomial.energy_law import EnergyLaw
from pliant_plugins.surrogates.polynomial.law import PolynomialLaw

BOX = Domain(np.array([0.0, 15e3]), np.array([[-0.2, 0.6]]))
BOX3 = Domain(np.array([0.0, 15e3]), np.array([[-0.3, 0.3], [-0.2, 0.6], [-0.4, 0.2]]))


def bar(domain: Domain, size: float) -> ErrorBar:
    random = np.random.default_rng(1)
    box = np.vstack([domain.actuation, domain.deformation])
    places = box[:, 0] + np.ptp(box, axis=1) * random.random((80, len(box)))
    return ErrorBar.of(box, places[:, 0], places[:, 1:], size * random.standard_normal((80, len(box) - 1)))


def one_axis(error: ErrorBar | None) -> PolynomialLaw:
    table = np.array([[0.0, -0.02, -0.001], [0.02, -0.01, 0.0]])
    return PolynomialLaw(table, np.array([2e3, 1e4]), np.array([0.1, 0.5]), BOX, error=error)


def three_axes(error: ErrorBar) -> EnergyLaw:
    exponents = np.array([[0, 2, 0, 0], [0, 0, 2, 0], [0, 0, 0, 2], [1, 0, 1, 0], [1, 1, 0, 1]])
    maps = np.array([[0.0, 0.3], [0.1, 0.5], [0.0, 0.4]])
    basis = EnergyBasis(exponents, np.array([0.0, 15e3]), maps)
    coefficients = np.array([4e-3, 6e-3, 5e-3, -8e-3, 2e-4])
    return EnergyLaw(basis, coefficients, BOX3, ("x", "y", "z"), "spherical", error=error)


def points(law: JointLaw) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(2)
    low, high = law.domain.deformation.T
    return 15e3 * random.random(40), low + (high - low) * random.random((40, len(low)))


def assert_same(drawn: tuple[JointLaw, ...], law: JointLaw, seed: int) -> None:
    """Each native draw and the law wrapped in the same error agree in the box."""
    p, u = points(law)
    assert len(drawn) == 3
    for one, tables in zip(drawn, error_tables(law, 3, seed), strict=True):
        got, wanted = one.evaluate(p, u), DrawnLaw(law, tables).evaluate(p, u)
        np.testing.assert_allclose(got.tau, wanted.tau, atol=1e-9)
        np.testing.assert_allclose(got.dtau_dp, wanted.dtau_dp, atol=1e-12)
        np.testing.assert_allclose(got.dtau_du, wanted.dtau_du, atol=1e-7)
        assert one.scalar() is not None and one.domain is law.domain


@pytest.mark.parametrize(
    "law", [one_axis(bar(BOX, 1e-4)), three_axes(bar(BOX3, 1e-4))], ids=["polynomial", "energy"]
)
def test_a_drawn_law_is_the_law_plus_the_error(law: JointLaw) -> None:
    assert_same(law.draws(3, seed=4), law, 4)


def test_a_law_without_an_error_bar_draws_nothing() -> None:
    assert one_axis(None).draws(3, seed=0) == ()
