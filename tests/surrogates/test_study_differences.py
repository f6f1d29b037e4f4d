"""The published procedure: coefficients from finite differences of energies and moments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.surrogates.laws import states as dataset

from pliant.errors import UserError
from pliant.records.fem import FemDataset
from pliant_plugins.surrogates.config import PolynomialConfig, StudyCoefficients
from pliant_plugins.surrogates.polynomial.study import fit_differences
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial

TRUE = StudyCoefficients(k_n=1.6e-6, m_a=-1.7e-6, b_a=-0.002, m_e=0.1, b_e=0.025)


def states(angles: int = 9, odd: bool = False, pressures: int = 4, from_zero: bool = False) -> FemDataset:
    """Return a module with exactly the published form of elastic energy and actuation, with U(p, 0) not zero."""
    low = 0.02 if from_zero else -0.2
    p, u = (c.ravel() for c in np.meshgrid(np.linspace(0, 15e3, pressures), np.linspace(low, 0.45, angles)))
    k = TRUE
    elastic = k.m_e * u * (np.abs(u) if odd else u) / 2 + k.b_e * u
    tau = k.k_n * p + (k.m_a * p + k.b_a) * u - elastic
    cube = u**2 * (np.abs(u) if odd else u)
    energy = k.m_e * cube / 6 + k.b_e * u**2 / 2 + 1e-12 * p**2
    check = (np.random.default_rng(0).random(len(p)) < 0.2) & (u > u.min()) & (u < u.max())
    return dataset(p, u, tau, check=check, energy_j=energy)


def test_fine_levels_recover_the_coefficients_behind_the_states() -> None:
    """Cubic energies have exact second differences on even steps; moments at u = 0 are interpolated between states."""
    found = fit_differences(states(601))
    for name in ("k_n", "m_a", "b_a", "m_e", "b_e"):
        assert getattr(found, name) == pytest.approx(getattr(TRUE, name), rel=2e-3), name


def test_even_steps_give_both_slopes_exactly_however_wide_they_are() -> None:
    found = fit_differences(states(7))
    for name in ("m_a", "m_e", "b_e"):
        assert getattr(found, name) == pytest.approx(getattr(TRUE, name), rel=1e-9), name


def test_where_no_state_stands_below_zero_the_form_itself_reaches_there() -> None:
    assert fit_differences(states(601, from_zero=True)).k_n == pytest.approx(TRUE.k_n, rel=2e-3)


def test_odd_takes_the_stiffness_for_the_same_on_both_sides() -> None:
    found = fit_differences(states(601, odd=True), odd=True)
    assert found.m_e == pytest.approx(TRUE.m_e, rel=5e-3)
    assert found.b_e == pytest.approx(TRUE.b_e, rel=5e-3)


def test_order_and_scattered_state_copies_do_not_matter() -> None:
    data = states(9)
    order = np.random.default_rng(1).permutation(len(data))
    shuffled = replace(data, **{c: getattr(data, c)[order] for c in ("actuation", "angle_rad", "moment_n_m")})
    shuffled = replace(shuffled, energy_j=data.energy_j[order], role=data.role[order])
    assert fit_differences(shuffled).canonical() == pytest.approx(
        fit_differences(data).canonical(), rel=1e-12
    )


def test_reports_put_both_procedures_beside_the_adaptive_law() -> None:
    details = Polynomial(PolynomialConfig()).fit(states(9)).report.details
    assert details["study_finite_differences"]["worst_of_range"] < 0.02
    assert details["study_form"]["worst_of_range"] < 1e-9
    chosen = Polynomial(PolynomialConfig(form="study", procedure="finite_differences")).fit(states(9)).report
    assert chosen.worst_of_range == pytest.approx(details["study_finite_differences"]["worst_of_range"])
    assert chosen.details["procedure"] == "finite_differences"
    assert chosen.details["error_bar"]["n"] == chosen.n_heldout


def test_without_energies_there_is_a_sentence_and_no_row_in_the_report() -> None:
    blank = replace(states(), energy_j=np.full(len(states()), np.nan))
    with pytest.raises(UserError, match="needs strain energies .column energy_j. of constrained states"):
        Polynomial(PolynomialConfig(form="study", procedure="finite_differences")).fit(blank)
    assert "study_finite_differences" not in Polynomial(PolynomialConfig()).fit(blank).report.details


def test_a_stiffness_at_one_angle_gets_a_sentence() -> None:
    with pytest.raises(UserError, match="needs a stiffness at two or more angles"):
        fit_differences(states(3, pressures=2))


def test_states_on_no_levels_get_a_sentence() -> None:
    data = states()
    spread = replace(data, actuation=data.actuation + np.linspace(0, 3e3, len(data)))
    with pytest.raises(UserError, match="needs 3 states or more at each of 2 or more values of pressure_pa"):
        fit_differences(spread)
    beside = Polynomial(PolynomialConfig()).fit(spread).report.details["study_finite_differences"]
    assert "least_squares" in beside["problem"]
