"""Laws of two pressures over designs: closed form recovered, stable laws, refusals, the shift of a polynomial."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.execution.progress import Silent
from pliant.records.law import Domain, JointLaw
from pliant.registry.discovery import discover
from pliant_designs.learning import design_learning
from pliant_designs.meta_model import MetaModel
from pliant_designs.meta_models.common_form import CommonForm
from pliant_designs.meta_models.common_form_fit import fit_common_form
from pliant_designs.meta_models.common_form_stable import StabilityGrid
from pliant_designs.records import SolvedDesigns
from pliant_designs.samples import (
    PRESSURE_PA,
    opposed_sample_law,
    solved_opposed_designs,
    unseen_designs,
)
from pliant_plugins.surrogates.polynomial.several_fit import weighted_degree_exponents
from pliant_plugins.surrogates.polynomial.several_law import SeveralLaw, lower_terms, powers, product, shifted


def model(kind: str, **keys: object) -> MetaModel:
    component = discover().get("meta_model", kind)
    built: MetaModel = component.build(component.config_model().model_validate({"kind": kind, **keys}))
    return built


@pytest.fixture(scope="module")
def opposed() -> tuple[SolvedDesigns, CommonForm, np.ndarray]:
    designs = solved_opposed_designs()
    return designs, *fit_common_form(designs)


def largest_relative_error(law: JointLaw, truth: JointLaw) -> float:
    random = np.random.default_rng(3)
    low, high = truth.domain.deformation.T
    p, u = PRESSURE_PA * random.random((80, 2)), low + (high - low) * random.random((80, 1))
    wanted = truth.evaluate(p, u).tau
    return float(np.max(np.abs(law.evaluate(p, u).tau - wanted)) / np.ptp(wanted))


def test_laws_with_two_pressures_are_recovered(opposed) -> None:
    """The law is a polynomial in p₁, p₂ and u, so one form represents it for every design."""
    designs, form, targets = opposed
    for values, own in zip(designs.values, targets, strict=True):
        law = form.law(values, own)
        assert law.actuations == ("pressure_1_pa", "pressure_2_pa")
        assert largest_relative_error(law, opposed_sample_law(values)) < 1e-3


def test_designs_between_those_solved_are_predicted(opposed) -> None:
    laws = model("regression").fit(opposed[0]).laws
    for values in unseen_designs():
        assert largest_relative_error(laws.law(values), opposed_sample_law(values)) < 3e-3


def test_exchanged_chambers_bend_to_the_other_side(opposed) -> None:
    """τ(p₁, p₂, u) = −τ(p₂, p₁, −u): no term enforces it, the states determine it."""
    designs, form, targets = opposed
    law, random = form.law(designs.values[5], targets[5]), np.random.default_rng(1)
    p, u = (
        PRESSURE_PA * random.random((50, 2)),
        0.9 * law.domain.deformation[0, 1] * (2 * random.random((50, 1)) - 1),
    )
    tau = law.evaluate(p, u).tau
    np.testing.assert_allclose(law.evaluate(p[:, ::-1], -u).tau, -tau, atol=1e-3 * np.ptp(tau))


def test_laws_from_any_targets_are_stable_under_all_pressures(opposed) -> None:
    _, form, targets = opposed
    random, moved = np.random.default_rng(0), 0
    for values in unseen_designs(4):
        wild = 6 * form.spread * random.standard_normal(targets.shape[1])
        law = form.law(values, wild)
        low, high = law.domain.deformation.T
        u = low + (high - low) * random.random((500, 1))
        assert law.evaluate(PRESSURE_PA * random.random((500, 2)), u).dtau_du.max() < 0
        place = form.parameters(values[None])
        moved += bool(np.any(form._stable(place[0], wild, form._box(place)) != wild))
    assert moved > 0


def test_stability_is_asked_for_on_four_axes_too() -> None:
    """Three pressures, three turns and an extension: one negative direction of the fourth axis is detected."""
    exponents = np.array([[0, 0, 0, *(2 * row)] for row in np.eye(4, dtype=int)])
    grid = StabilityGrid.from_box(exponents, np.array([[0.0, 1.0]] * 3 + [[-1.0, 1.0]] * 4), 1, np.ones(4))
    keep = np.ones(len(grid.points), bool)
    assert grid.stable(grid.at(np.ones(4), keep))
    assert not grid.stable(grid.at(np.array([1.0, 1.0, 1.0, -1.0]), keep))


def test_a_polynomial_is_the_same_from_another_origin() -> None:
    random = np.random.default_rng(2)
    exponents = weighted_degree_exponents(2, 3, 2, 1)
    exponents = exponents[exponents[:, 2] > 0]
    c, maps = random.standard_normal(len(exponents)), np.array([[0.5, 0.5], [0.4, 0.6], [-0.1, 1.3]])
    lower = lower_terms(exponents)
    moved, y = shifted(c, exponents, lower, maps), random.uniform(-1, 1, (20, 3))

    def values(terms: np.ndarray, of: np.ndarray, scales: np.ndarray, at: np.ndarray) -> np.ndarray:
        tables = [powers(at[:, d], scales[d], terms[:, d], False) for d in range(3)]
        return product(tables, {}) @ of

    unscaled = np.tile([0.0, 10.0], (3, 1))  # no value is outside [−1, 1]
    x = maps[:, 0] + maps[:, 1] * y
    old = values(exponents, c * 10.0 ** exponents.sum(axis=1), unscaled, x)
    new = values(lower, moved, np.tile([0.0, 1.0], (3, 1)), y)
    np.testing.assert_allclose(np.diff(new), np.diff(old), rtol=1e-9, atol=1e-9)


def test_the_published_form_has_one_actuation(opposed) -> None:
    with pytest.raises(UserError, match="one actuation.*pressure_1_pa, pressure_2_pa; use form 'adaptive'"):
        model("coefficients", form="study").fit(opposed[0])


def test_designs_are_left_out_for_the_learning_curve() -> None:
    """The errors that `pliant fit --out` draws decrease with more designs."""
    found = design_learning(model("regression"), solved_opposed_designs((3, 3)), Silent())
    errors = [point["all"]["rms"] for point in found["points"]]
    assert len(errors) >= 2 and errors[-1] < errors[0]


def test_one_state_knows_the_slopes_by_each_pressure(opposed) -> None:
    """No state has the slope by p₂, and half of the designs have none at p₂ > 0: the other designs determine it."""
    designs, _, _ = opposed
    blind = [replace(one, dtau_dp=one.dtau_dp * [1.0, np.nan]) for one in designs.data]
    form, targets = fit_common_form(replace(designs, data=tuple(blind)))
    law = form.law(designs.values[4], targets[4])
    assert isinstance(law, SeveralLaw) and isinstance(law.domain, Domain)
    assert largest_relative_error(law, opposed_sample_law(designs.values[4])) < 5e-3


def three_chambers(values: np.ndarray) -> SeveralLaw:
    """Return a law of three pressures 120° apart that bends about y and z and twists about x.

    Π is of total degree 3; each coefficient is a product of powers of the design's ratios.
    """
    r, t = values[0] / 7.5e-3, values[1] / 1.5e-3
    terms: dict[tuple[int, ...], float] = {}
    for j in range(3):
        by = np.eye(3, dtype=int)[j]
        for axis, share in ((1, np.cos(2 * np.pi * j / 3)), (2, np.sin(2 * np.pi * j / 3))):
            turned = np.eye(3, dtype=int)[axis]
            terms[(*by, *turned)] = -0.01 * r**3 * share
            terms[(*by, *(2 * turned))] = 0.003 * r * t
    terms |= {(0, 0, 0, 2, 0, 0): 0.01 * t, (0, 0, 0, 0, 2, 0): 0.01 * t**2, (0, 0, 0, 0, 0, 2): 0.01 * t**2}
    terms |= {(1, 0, 0, 1, 1, 0): 0.001 * r, (0, 0, 0, 0, 2, 2): 0.002 * t / r}
    box = Domain(np.tile([0.0, PRESSURE_PA], (3, 1)), np.tile([-0.5, 0.5], (3, 1)))
    maps = np.vstack([np.tile([0.0, PRESSURE_PA], (3, 1)), np.tile([0.0, 0.5], (3, 1))])
    names = "pressure_1_pa, pressure_2_pa, pressure_3_pa"
    return SeveralLaw(
        np.array(list(terms)), np.array(list(terms.values())), maps, box, names, ("x", "y", "z"), "spherical"
    )


def test_three_pressures_turn_three_axes(opposed) -> None:
    random = np.random.default_rng(12)
    places = random.random((70, 6))
    p, u = PRESSURE_PA * places[:, :3], places[:, 3:] - 0.5
    first, data = opposed[0].data[0], []
    values = opposed[0].values[::2]
    for row in values:
        law, n = three_chambers(row), len(p)
        effort = law.evaluate(p, u)
        words = {"branch": "constrained", "status": "ok", "role": "fit", "explored": "coupling"}
        columns = {name: np.full(n, word) for name, word in words.items()}
        numbers = {name: np.full(n, 0.0) for name in ("energy_j", "wall_s", "iterations")}
        slopes = {"dtau_dp": effort.dtau_dp, "dtau_du": effort.dtau_du, "travel": np.full((n, 3), np.nan)}
        own = {"joint": "spherical", "axes": law.axes, "actuation_name": law.actuation_name}
        states = {"actuation": p, "deformation": u, "tau": effort.tau}
        data.append(replace(first, **own, **states, **slopes, **columns, **numbers))
    designs = replace(opposed[0], values=values, data=tuple(data))
    form, targets = fit_common_form(designs)
    for row, own_targets in zip(values[:4], targets[:4], strict=True):
        law, truth = form.law(row, own_targets), three_chambers(row)
        wanted = truth.evaluate(p, 0.8 * u).tau
        assert np.abs(law.evaluate(p, 0.8 * u).tau - wanted).max() < 5e-3 * np.ptp(wanted)
        assert np.linalg.eigvalsh(law.evaluate(p, u).dtau_du).max() < 0
