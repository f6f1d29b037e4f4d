"""Whole states of three axes become one energy, or three separate laws: recovery of laws, the choice, bar and terms."""

from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.interfaces.surrogate import FittedLaw
from pliant.records.fem import ModuleData
from pliant.testing.samples import coupled_law, linear_spherical_law, sample_module_table
from pliant_plugins.surrogates.polynomial.axes import AxesLaw
from pliant_plugins.surrogates.polynomial.energy_fit import compared, fit_apart, fit_energy
from pliant_plugins.surrogates.polynomial.energy_kernel import evaluate
from pliant_plugins.surrogates.polynomial.energy_law import EnergyPolynomialLaw
from pliant_plugins.surrogates.polynomial.posterior import CoefficientPosterior
from pliant_plugins.surrogates.polynomial.states import split
from pliant_plugins.surrogates.polynomial.system import System

Points = tuple[np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def data() -> ModuleData:
    return sample_module_table(coupled_law())


@pytest.fixture(scope="module")
def fitted(data: ModuleData) -> FittedLaw:
    return fit_energy(data, 4)


def scattered(n: int = 40, seed: int = 3) -> Points:
    random = np.random.default_rng(seed)
    return 15e3 * random.random(n), random.uniform([-0.3, -0.2, -0.3], [0.3, 0.45, 0.3], (n, 3))


def require_found(fitted: FittedLaw) -> None:
    law, (p, u) = coupled_law(), scattered()
    wanted, found = law.evaluate(p, u), fitted.law.evaluate(p, u)
    assert isinstance(fitted.law, EnergyPolynomialLaw)
    assert found.tau == pytest.approx(wanted.tau, abs=1e-8)
    assert found.dtau_du == pytest.approx(wanted.dtau_du, abs=1e-6)
    assert fitted.law.potential(p, u) == pytest.approx(law.potential(p, u), abs=1e-8)
    assert fitted.report.details["even_in_lateral_axes"] == "each"
    assert fitted.report.details["stable"]
    assert fitted.report.r2 > 1 - 1e-9


def test_a_coupled_energy_is_found_and_the_report_says_why(fitted: FittedLaw) -> None:
    require_found(fitted)
    details = fitted.report.details
    assert details["form"] == "energy"
    assert compared(details["left_out_together"], details["left_out_apart"]) < 1


@pytest.mark.parametrize(("energies", "slopes"), [(False, True), (False, False)])
def test_a_coupled_energy_is_found_from_less(energies: bool, slopes: bool) -> None:
    require_found(fit_energy(sample_module_table(coupled_law(), energies, slopes), 4))


def test_axes_that_are_not_even_are_found_too() -> None:
    """K_xy and a gain about z: the energy is odd in lateral axes."""
    law = linear_spherical_law()
    fitted = fit_energy(sample_module_table(law), 3)
    p, u = scattered()
    assert fitted.law.evaluate(p, u).tau == pytest.approx(law.evaluate(p, u).tau, abs=1e-8)
    assert fitted.report.details["even_in_lateral_axes"] != "each"


def test_energies_with_a_wrong_sign_would_be_noticed(data: ModuleData, fitted: FittedLaw) -> None:
    """∂Π/∂p = −travel: with the sign of travel reversed, energies contradict efforts and the misses show it."""
    wrong = fit_energy(replace(data, travel=-data.travel), 4).report.details["left_out_rmse_of_range"]
    assert fitted.report.details["left_out_rmse_of_range"] < 1e-8 < 1e-3 < wrong


def test_check_states_are_scored_and_each_axis_is_reported(data: ModuleData, fitted: FittedLaw) -> None:
    states, report = split(data), fitted.report
    assert set(states.fit.role) == {"fit"} and set(states.check.role) == {"check"}
    assert report.n_heldout == len(states.check)
    assert set(report.details["axes"]) == set(report.details["coupling"]) == {"x", "y", "z"}
    of_z = report.details["axes"]["z"]
    assert of_z["n_heldout"] == np.sum((data.role == "check") & (data.explored == "z")) > 2
    assert of_z["effort_range"] == pytest.approx(np.ptp(data.tau[data.explored == "z", 2]))


def test_the_band_covers_noisy_states_that_the_law_has_not_seen(data: ModuleData) -> None:
    random = np.random.default_rng(5)
    law = fit_energy(replace(data, tau=data.tau + 1e-4 * random.standard_normal(data.tau.shape)), 4).law
    p, u = scattered(300)
    wanted = coupled_law().evaluate(p, u).tau + 1e-4 * random.standard_normal((300, 3))
    band = law.band(p, u)
    assert band is not None and 3e-5 < np.median(band) < 1e-3
    assert 0.75 < np.mean(np.abs(law.evaluate(p, u).tau - wanted) <= band) < 0.99


def test_states_that_no_smooth_energy_has_get_three_laws(data: ModuleData) -> None:
    """Efforts of lateral states with random signs contradict every energy; y's own states are smooth."""
    random = np.random.default_rng(0)
    rough = np.where(data.explored[:, None] == "coupling", 0.05 * random.standard_normal(data.tau.shape), 0.0)
    nan = np.full_like(data.dtau_du, np.nan)
    spoiled = replace(data, tau=data.tau + rough, dtau_du=np.where(rough[:, :, None] != 0, nan, data.dtau_du))
    fitted = fit_energy(spoiled, 4)
    assert isinstance(fitted.law, AxesLaw)
    assert fitted.report.details["form"] == "axes apart"
    assert fitted.law.error is not None
    assert fit_apart(data.rows(data.explored != "z"), 4) is None


def test_misses_on_one_axis_equal_refitting_without_the_state(data: ModuleData) -> None:
    noise = 1e-4 * np.random.default_rng(2).standard_normal(data.tau.shape)
    states = split(replace(data, tau=data.tau + noise).rows(data.explored == "y").axis("y"))
    system = System(states.fit, states.domain)
    terms = np.array([(i, j) for i in range(3) for j in range(3)])
    posterior = CoefficientPosterior.from_system(system, terms)
    assert posterior is not None
    matrix, right, state = system.rows(terms)
    for k in (0, 4):
        solution = np.linalg.lstsq(matrix[state != k], right[state != k], rcond=None)[0]
        assert posterior.misses()[k] == pytest.approx(right[k] - matrix[k] @ solution, abs=1e-9)


def test_pruning_changes_efforts_by_less_than_it_says(fitted: FittedLaw) -> None:
    law, ranges = fitted.law, np.full(3, 0.01)
    assert isinstance(law, EnergyPolynomialLaw)
    more = replace(law.basis, exponents=np.vstack([law.basis.exponents, [[2, 4, 2, 2]]]))
    wide = replace(law, basis=more, coefficients=np.append(law.coefficients, 1e-12))
    kept = wide.pruned(ranges)
    assert len(kept.coefficients) <= len(law.coefficients)
    moved = np.abs(kept.evaluate(*scattered(200)).tau - wide.evaluate(*scattered(200)).tau) / ranges
    assert 0 < moved.max() < 1e-7


def test_points_in_the_box_are_the_same_beside_others_outside(fitted: FittedLaw) -> None:
    """Batched and single evaluations agree to rounding, and the position of a point in the batch changes nothing."""
    law, (p, u) = fitted.law, scattered(130)
    assert isinstance(law, EnergyPolynomialLaw)
    inside = evaluate(p, u, law._parameters)
    mixed = evaluate(np.insert(p, 7, 5e4), np.insert(u, 7, 2.0, axis=0), law._parameters)
    assert np.array_equal(np.delete(mixed, 7, axis=0), inside)
    form = law.scalar()
    tau, gain, slopes = np.zeros(3), np.zeros(3), np.zeros((3, 3))
    for at in (0, 129):
        form.function(p[at], u[at], form.parameters, tau, gain, slopes)
        assert tau == pytest.approx(inside[at, 1:4], rel=1e-11, abs=1e-15)
        assert slopes[np.triu_indices(3)] == pytest.approx(inside[at, 7:], rel=1e-11, abs=1e-13)
    assert np.isnan(evaluate(np.array([np.nan]), u[:1], law._parameters)).any()


def test_wrong_states_are_refused_in_one_sentence(data: ModuleData) -> None:
    tau, twice = data.tau.copy(), data.rows(np.ones(len(data), bool))
    tau[5, 2] = np.nan
    twice.deformation[1], twice.actuation[1] = twice.deformation[0], twice.actuation[0]
    twice.tau[1] = twice.tau[0] + 0.05
    for wrong, sentence in (
        (replace(data, tau=tau), "of axis z is nan in state 6"),
        (data.rows(np.arange(len(data)) < 10), "at least 16 states"),
        (data.rows(data.explored == "y"), "same angle_rad of axis x"),
        (twice, "states 1 and 2 contradict"),
    ):
        with pytest.raises(UserError, match=sentence):
            fit_energy(wrong, 4)
