"""The law of a polynomial energy: gradients, its continuation outside the box, its compiled form."""

from dataclasses import replace

import numpy as np
import pytest
from tests.surrogates.laws import energy_law, points

from pliant.records.law import Domain
from pliant_plugins.surrogates.polynomial import energy_law as energy_law_module
from pliant_plugins.surrogates.polynomial.energy import EnergyBasis
from pliant_plugins.surrogates.polynomial.energy_law import EnergyPolynomialLaw


@pytest.fixture(params=[1, 2, 3])
def law(request: pytest.FixtureRequest) -> EnergyPolynomialLaw:
    return energy_law(request.param)


def test_inside_the_box_the_law_is_the_polynomial(law: EnergyPolynomialLaw) -> None:
    p, u = points(law, 0.0, 50)
    k = len(law.axes)
    tau = np.stack(
        [-law.basis.derivative(p, u, (0, *np.eye(k, dtype=int)[i])) @ law.coefficients for i in range(k)], 1
    )
    assert law.evaluate(p, u).tau == pytest.approx(tau, abs=1e-15)


def test_where_bowls_help_no_axis_that_is_inside_coupling_ends_sooner() -> None:
    """x softens with y's excess: at the first reach it is unstable for any bowls; half of its stiffness remains.

    Π = ½ x² + 50 y² − 0.45 x² y² on |x| ≤ 1, 0 ≤ y ≤ 1 has ∂²Π/∂x² = 1 − 0.9 y²: negative from y = 1.05 on.
    """
    exponents = np.array([[0, 2, 0], [0, 0, 2], [0, 2, 2]])
    unit_maps = np.array([[0.0, 1.0], [0.0, 1.0]])
    basis = EnergyBasis(exponents, np.array([0.0, 1.0]), unit_maps)
    domain = Domain(np.array([0.0, 1.0]), np.array([[-1.0, 1.0], [-1e-3, 1.0]]))
    law = EnergyPolynomialLaw(basis, np.array([0.5, 50.0, -0.45]), domain, axes=("x", "y"))
    y = np.linspace(1.0, 6.0, 200)
    for x in (0.0, 1.0):
        slopes = law.evaluate(np.zeros(200), np.column_stack([np.full(200, x), y])).dtau_du
        stiffness = np.linalg.eigvalsh(-slopes).min(axis=1)
        assert stiffness.min() > 0.45 * stiffness[0] > 0.02


def test_a_continuation_takes_milliseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A design search makes thousands of laws, so few points are evaluated."""
    seen: list[int] = []
    evaluate = energy_law_module.evaluate

    def counted(p: np.ndarray, u: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        seen.append(len(p))
        return evaluate(p, u, parameters)

    monkeypatch.setattr(energy_law_module, "evaluate", counted)
    law = energy_law(3)
    box = np.concatenate([law.domain.actuation[None], law.domain.deformation])
    energy_law_module.continuation(law.basis, law.coefficients, box)
    assert sum(seen) < 2500


def test_closed_loops_create_no_energy() -> None:
    """∮ τ·du + ∮ V dp = 0 with V = −∂Π/∂p, on a loop that leaves the box in p and in every u."""
    law = energy_law(3)
    t = np.linspace(0, 2 * np.pi, 20001)[:-1]
    p = 9e3 + 12e3 * np.sin(t)
    u = np.stack([0.5 * np.cos(t), 0.15 + 0.6 * np.sin(t + 1), 0.5 * np.sin(2 * t)], 1)
    dt = t[1] - t[0]
    rates = [np.stack([-0.5 * np.sin(t), 0.6 * np.cos(t + 1), np.cos(2 * t)], 1), 12e3 * np.cos(t)]
    by_u = np.sum(law.evaluate(p, u).tau * rates[0]) * dt
    by_p = -np.sum((law.potential(p + 0.5, u) - law.potential(p - 0.5, u)) * rates[1]) * dt
    assert abs(by_u) > 1e-5
    assert by_u + by_p == pytest.approx(0, abs=1e-9 * np.abs(law.evaluate(p, u).tau).max() + 1e-5 * abs(by_u))


def test_a_law_without_limits_is_the_polynomial_everywhere() -> None:
    law = replace(energy_law(3), domain=Domain.unbounded(3))
    p, u = points(energy_law(3), 1.5, 30)
    bare = -law.basis.derivative(p, u, (0, 0, 1, 0)) @ law.coefficients
    assert law.evaluate(p, u).tau[:, 1] == pytest.approx(bare, rel=1e-12)
