"""Energy or three laws apart: the choice by states left out, the law's bar and terms, and its compiled forms."""

from dataclasses import replace

import numpy as np
import pytest

from pliant.testing.samples import coupled_law, module_table_of
from pliant_plugins.surrogates.polynomial.axes import AxesLaw
from pliant_plugins.surrogates.polynomial.energy_fit import compared, fit_apart, fit_energy
from pliant_plugins.surrogates.polynomial.energy_kernel import evaluate
from pliant_plugins.surrogates.polynomial.energy_law import EnergyLaw
from pliant_plugins.surrogates.polynomial.posterior import Posterior
from pliant_plugins.surrogates.polynomial.states import split
from pliant_plugins.surrogates.polynomial.system import System


def test_a_coupled_module_gets_a_coupled_law_and_the_report_says_why() -> None:
    details = fit_energy(module_table_of(coupled_law()), 5).report.details
    assert details["form"] == "energy"
    assert compared(details["left_out_together"], details["left_out_apart"]) < 1


def test_states_that_no_smooth_energy_has_get_three_laws() -> None:
    """Efforts of lateral states with signs at random contradict every energy; y's own states are smooth."""
    data = module_table_of(coupled_law())
    random = np.random.default_rng(0)
    rough = np.where(data.explored[:, None] == "coupling", 0.05 * random.standard_normal(data.tau.shape), 0.0)
    nan = np.full_like(data.dtau_du, np.nan)
    spoiled = replace(data, tau=data.tau + rough, dtau_du=np.where(rough[:, :, None] != 0, nan, data.dtau_du))
    fitted = fit_energy(spoiled, 5)
    assert isinstance(fitted.law, AxesLaw)
    assert fitted.report.details["form"] == "axes apart"
    assert fitted.law.error is not None


def test_misses_of_one_axis_are_those_of_refitting_without_the_state() -> None:
    data = module_table_of(coupled_law())
    noise = 1e-4 * np.random.default_rng(2).standard_normal(data.tau.shape)
    own = replace(data, tau=data.tau + noise).rows(data.explored == "y").axis("y")
    states = split(own)
    system = System(states.fit, states.domain)
    terms = np.array([(i, j) for i in range(3) for j in range(3)])
    posterior = Posterior.of(system, terms)
    assert posterior is not None
    matrix, right, state = system.rows(terms)
    for k in (0, 4):
        others = state != k
        solution = np.linalg.lstsq(matrix[others], right[others], rcond=None)[0]
        assert posterior.misses()[k] == pytest.approx(right[k] - matrix[k] @ solution, abs=1e-9)


def test_states_of_two_axes_have_no_three_laws() -> None:
    data = module_table_of(coupled_law())
    assert fit_apart(data.rows(data.explored != "z"), 5) is None


def test_pruning_changes_efforts_by_less_than_it_says() -> None:
    law = fit_energy(module_table_of(coupled_law()), 5).law
    assert isinstance(law, EnergyLaw)
    more = replace(law.basis, exponents=np.vstack([law.basis.exponents, [[2, 4, 2, 2]]]))
    ranges = np.array([0.01, 0.01, 0.01])
    wide = replace(law, basis=more, coefficients=np.append(law.coefficients, 1e-12))
    kept = wide.pruned(ranges)
    assert len(kept.coefficients) <= len(law.coefficients)
    random = np.random.default_rng(0)
    p = random.uniform(*law.domain.actuation, 200)
    u = random.uniform(law.domain.deformation[:, 0], law.domain.deformation[:, 1], (200, 3))
    moved = np.abs(kept.evaluate(p, u).tau - wide.evaluate(p, u).tau) / ranges
    assert 0 < moved.max() < 1e-7


def test_points_in_the_box_are_the_same_beside_others_outside() -> None:
    """Side by side and one by one agree to rounding, and where a point stands changes nothing."""
    law = fit_energy(module_table_of(coupled_law()), 5).law
    assert isinstance(law, EnergyLaw)
    random = np.random.default_rng(1)
    p = random.uniform(*law.domain.actuation, 130)
    u = random.uniform(law.domain.deformation[:, 0], law.domain.deformation[:, 1], (130, 3))
    inside = evaluate(p, u, law._parameters)
    mixed_p, mixed_u = np.insert(p, 7, 5e4), np.insert(u, 7, 2.0, axis=0)
    mixed = evaluate(mixed_p, mixed_u, law._parameters)
    assert np.array_equal(np.delete(mixed, 7, axis=0), inside)
    form = law.scalar()
    tau, gain, slopes = np.zeros(3), np.zeros(3), np.zeros((3, 3))
    for at, wanted in ((0, inside[0]), (129, inside[129])):
        form.function(p[at], u[at], form.parameters, tau, gain, slopes)
        assert tau == pytest.approx(wanted[1:4], rel=1e-11, abs=1e-15)
        assert slopes[np.triu_indices(3)] == pytest.approx(wanted[7:], rel=1e-11, abs=1e-13)
    assert np.isnan(evaluate(np.array([np.nan]), u[:1], law._parameters)).any()


def test_the_band_of_an_energy_covers_states_that_it_has_not_seen() -> None:
    data = module_table_of(coupled_law())
    random = np.random.default_rng(5)
    noisy = replace(data, tau=data.tau + 1e-4 * random.standard_normal(data.tau.shape))
    law = fit_energy(noisy, 4).law
    p = random.uniform(*law.domain.actuation, 300)
    u = random.uniform(law.domain.deformation[:, 0], law.domain.deformation[:, 1], (300, 3))
    wanted = coupled_law().evaluate(p, u).tau + 1e-4 * random.standard_normal((300, 3))
    band = law.band(p, u)
    assert band is not None
    assert 0.75 < np.mean(np.abs(law.evaluate(p, u).tau - wanted) <= band) < 0.99
