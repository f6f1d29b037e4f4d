"""Whole states of three axes become one energy: known laws are found, and wrong states are refused."""

from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.testing.samples import coupled_law, linear_spherical_law, module_table_of
from pliant_plugins.surrogates.config import PolynomialConfig
from pliant_plugins.surrogates.polynomial.energy_fit import fit_energy
from pliant_plugins.surrogates.polynomial.energy_law import EnergyLaw
from pliant_plugins.surrogates.polynomial.surrogate import Polynomial


def scattered(n: int = 40) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(3)
    return 15e3 * random.random(n), random.uniform([-0.3, -0.2, -0.3], [0.3, 0.45, 0.3], (n, 3))


@pytest.mark.parametrize(("energies", "slopes"), [(True, True), (False, True), (False, False)])
def test_a_coupled_energy_is_found(energies: bool, slopes: bool) -> None:
    law = coupled_law()
    fitted = fit_energy(module_table_of(law, energies, slopes), 5)
    p, u = scattered()
    wanted, found = law.evaluate(p, u), fitted.law.evaluate(p, u)
    assert isinstance(fitted.law, EnergyLaw)
    assert found.tau == pytest.approx(wanted.tau, abs=1e-8)
    assert found.dtau_du == pytest.approx(wanted.dtau_du, abs=1e-6)
    assert fitted.law.potential(p, u) == pytest.approx(law.potential(p, u), abs=1e-8)
    assert fitted.report.details["even_in_lateral_axes"] == "each"
    assert fitted.report.details["stable"]
    assert fitted.report.r2 > 1 - 1e-9


def test_axes_that_are_not_even_are_found_too() -> None:
    """K_xy and a gain about z: the energy is odd in lateral axes."""
    law = linear_spherical_law()
    fitted = fit_energy(module_table_of(law), 4)
    p, u = scattered()
    assert fitted.law.evaluate(p, u).tau == pytest.approx(law.evaluate(p, u).tau, abs=1e-8)
    assert fitted.report.details["even_in_lateral_axes"] != "each"


def test_energies_of_the_wrong_sign_would_be_noticed() -> None:
    """∂Π/∂p = −travel: with travel turned round, energies contradict efforts and the misses say so."""
    data = module_table_of(coupled_law())
    right = fit_energy(data, 4).report.details["left_out_rmse_of_range"]
    wrong = fit_energy(replace(data, travel=-data.travel), 4).report.details["left_out_rmse_of_range"]
    assert right < 1e-8 < 1e-3 < wrong


def test_check_states_are_not_seen() -> None:
    data = module_table_of(coupled_law())
    spoiled = np.where((data.role == "check")[:, None], data.tau + 1e-3, data.tau)
    p, u = scattered()
    first, second = (fit_energy(replace(data, tau=tau), 4) for tau in (data.tau, spoiled))
    assert np.array_equal(first.law.evaluate(p, u).tau, second.law.evaluate(p, u).tau)
    assert first.report.worst < 1e-8 < 5e-4 < second.report.worst


def test_the_report_has_each_axis_and_states_that_hold_several() -> None:
    data = module_table_of(coupled_law())
    report = Polynomial(PolynomialConfig(max_degree=2)).fit_module(data).report
    check = data.role == "check"
    assert report.n_heldout == check.sum()
    assert set(report.details["axes"]) == set(report.details["coupling"]) == {"x", "y", "z"}
    own = check & (data.explored == "z")
    assert report.details["axes"]["z"]["n_heldout"] == own.sum() > 2
    assert report.details["axes"]["z"]["effort_range"] == pytest.approx(
        np.ptp(data.tau[data.explored == "z", 2])
    )


def test_the_error_bar_is_of_all_axes() -> None:
    data = module_table_of(coupled_law())
    noisy = replace(data, tau=data.tau + 1e-5 * np.random.default_rng(1).standard_normal(data.tau.shape))
    fitted = fit_energy(noisy, 4).law
    p, u = scattered()
    band = fitted.band(p, u)
    assert band is not None
    assert band.shape == (40, 3)
    assert 3e-6 < np.median(band) < 1e-4


def test_wrong_states_are_refused_in_one_sentence() -> None:
    data = module_table_of(coupled_law())
    tau = data.tau.copy()
    tau[5, 2] = np.nan
    with pytest.raises(UserError, match="of axis z is nan in state 6"):
        fit_energy(replace(data, tau=tau), 4)
    with pytest.raises(UserError, match="at least 16 states"):
        fit_energy(data.rows(np.arange(len(data)) < 10), 4)
    with pytest.raises(UserError, match="same angle_rad of axis x"):
        fit_energy(data.rows(data.explored == "y"), 4)
    twice = data.rows(np.arange(len(data)).repeat(1) >= 0)
    twice.deformation[1], twice.actuation[1] = twice.deformation[0], twice.actuation[0]
    twice.tau[1] = twice.tau[0] + 0.05
    with pytest.raises(UserError, match="states 1 and 2 contradict"):
        fit_energy(twice, 4)
