"""Energies and travels of the states in addition to efforts and slopes: τ = −∂Π/∂u and −∂Π/∂p of one Π."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.surrogates.laws import BOX, states

from pliant.pipeline.residuals import as_module_data
from pliant.records.fem import FemDataset
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.posterior import CoefficientPosterior, all_terms, fit_prior, solve
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial
from pliant_plugins.surrogates.polynomial.system import System

P = 15e3


def table(p, u, potential, tau, slopes, travel, check: int = 0) -> FemDataset:
    scored = np.arange(len(p)) >= len(p) - check
    return states(p, u, tau, *slopes, check=scored, energy_j=potential + p * travel, travel=travel)


def polynomial_module() -> FemDataset:
    """Return Π = (3 u² + u³ + q u² − 2 q u − q² u + q³ + q/2) mJ with q = p / 15 kPa."""
    rng = np.random.default_rng(3)
    q, u = rng.random(12), rng.uniform(-0.2, 0.45, 12)
    q[:4], u[:4] = [0, 0, 1, 1], [-0.2, 0.45, -0.2, 0.45]
    potential = 3 * u**2 + u**3 + q * u**2 - 2 * q * u - q**2 * u + q**3 + q / 2
    tau = -(6 * u + 3 * u**2 + 2 * q * u - 2 * q - q**2)
    by_p, by_u = -(2 * u - 2 - 2 * q) / P, -(6 + 6 * u + 2 * q)
    travel = -(u**2 - 2 * u - 2 * q * u + 3 * q**2 + 0.5) / P
    parts = (potential, tau, (by_p, by_u), travel)
    scaled = [
        1e-3 * part if isinstance(part, np.ndarray) else tuple(1e-3 * s for s in part) for part in parts
    ]
    return table(P * q, u, *scaled)


def smooth_module(states: int, seed: int) -> FemDataset:
    """Return a module that is no polynomial, at its box's corners and scattered inside; 60 states to check."""
    rng = np.random.default_rng(seed)
    q, u = rng.random(states + 60), rng.uniform(-0.2, 0.45, states + 60)
    q[:4], u[:4] = [0, 0, 1, 1], [-0.2, 0.45, -0.2, 0.45]
    A, dA = 0.024 * q * (1 + 0.15 * q), 0.024 * (1 + 0.3 * q)
    B, dB = 0.012 / (1 + 0.3 * q), -0.0036 / (1 + 0.3 * q) ** 2
    e, s, c = np.exp(-1.2 * u), np.sinh(2.5 * u), np.cosh(2.5 * u)
    potential = A * e / 1.2 + B * c / 2.5 + 1e-3 * q**2
    slopes = ((dA * e - dB * s) / P, -1.2 * A * e - 2.5 * B * c)
    travel = -(dA * e / 1.2 + dB * c / 2.5 + 2e-3 * q) / P
    return table(P * q, u, potential, A * e - B * s, slopes, travel, check=60)


def fitted(data: FemDataset):
    return Polynomial(PolynomialConfig()).fit(data)


def test_rows_are_the_derivatives_from_one_potential() -> None:
    data = polynomial_module()
    system, terms = System(data, BOX), all_terms(3, potential=True)
    matrix, right, state = system.rows(terms)
    assert len(right) == 5 * len(data) and np.array_equal(state[: len(data)], np.arange(len(data)))
    solution = solve(matrix, right)
    assert solution is not None
    assert np.abs(matrix @ solution - right).max() < 1e-10
    assert system.law(terms, solution).evaluate(data.actuation, data.angle_rad[:, None]).tau[:, 0] == (
        pytest.approx(data.moment_n_m, abs=1e-12)
    )


def test_terms_without_effort_bear_none() -> None:
    system, terms = System(polynomial_module(), BOX), all_terms(3, potential=True)
    posterior = CoefficientPosterior.from_system(system, terms, fit_prior(system, terms))
    assert posterior is not None and posterior.potential
    alone = terms[:, 1] < 0
    x, v = np.array([0.3, -0.8]), np.array([-0.1, 0.9])
    others = np.where(alone, 5.0, posterior.solution)
    laws = [system.law(terms, solution).coefficients for solution in (posterior.solution, others)]
    assert np.array_equal(*laws)
    assert np.all(posterior.shape(x, v) >= 1.0)


def test_without_these_terms_energies_and_travels_change_no_row() -> None:
    data, terms = polynomial_module(), all_terms(3)
    known, blank = System(data, BOX).rows(terms), System(replace(data, travel=None), BOX).rows(terms)
    assert all(np.array_equal(one, other) for one, other in zip(known, blank, strict=True))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_energies_and_travels_at_least_halve_the_error_with_few_states(seed: int) -> None:
    data = smooth_module(8, seed)
    with_them, without = fitted(data).report, fitted(replace(data, travel=None)).report
    assert with_them.details["potential"] and not without.details["potential"]
    assert with_them.rmse < 0.5 * without.rmse


def test_energies_from_another_model_are_not_believed() -> None:
    """For example, a quarter of the module was meshed and its energies were not multiplied by four."""
    data = smooth_module(14, 4)
    blank = fitted(replace(data, travel=None))
    wrong = fitted(replace(data, energy_j=data.energy_j / 4, travel=data.travel / 4))  # type: ignore[operator]
    assert not wrong.report.details["potential"]
    assert np.array_equal(wrong.law.coefficients, blank.law.coefficients)  # type: ignore[attr-defined]


def test_states_that_do_not_know_them_are_fitted_by_what_they_know() -> None:
    data = smooth_module(14, 5)
    some = np.where(np.arange(len(data)) % 2 == 0, data.travel, np.nan)
    rows = System(replace(data, travel=some), BOX).rows(all_terms(3, potential=True))[2]
    assert sorted(np.bincount(rows)) == [3] * (len(data) // 2) + [5] * (len(data) // 2)
    assert fitted(replace(data, travel=some)).report.worst_of_range < 2e-4
    none = fitted(replace(data, travel=np.full(len(data), np.nan))).law
    assert np.array_equal(
        none.coefficients,  # type: ignore[attr-defined]
        fitted(replace(data, travel=None)).law.coefficients,  # type: ignore[attr-defined]
    )


def test_data_on_an_axis_keep_the_travel() -> None:
    data = smooth_module(10, 6)
    module = replace(as_module_data(data), travel=data.travel)
    axis = module.axis("y")
    assert np.array_equal(axis.travel, data.travel)  # type: ignore[arg-type]
    kept = axis.rows(data.role == "check").travel
    assert kept is not None and np.array_equal(kept, data.travel[-60:])  # type: ignore[index]
