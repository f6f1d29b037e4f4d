"""Networks as meta-models: their training targets, their laws, and that only training needs torch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pliant.errors import UserError
from pliant.records.design import Array
from pliant.records.law import Domain
from pliant_designs.meta_models import networks
from pliant_designs.meta_models.coefficients import (
    CoefficientLaws,
    Coefficients,
    law_from_targets,
    study_targets,
)
from pliant_designs.meta_models.config import CoefficientsConfig, NeuralMetaConfig
from pliant_designs.meta_models.networks import Layers
from pliant_designs.meta_models.neural import EnergyLaws, NeuralMetaModel
from pliant_designs.meta_models.ridges import RidgeFamily, ScaledStates
from pliant_designs.records import SolvedDesigns
from pliant_designs.samples import (
    PRESSURE_PA,
    RANGE,
    grid,
    sample_law,
    solved_designs,
    solved_spherical_designs,
    unseen_designs,
)
from pliant_plugins.surrogates.config import NeuralConfig
from pliant_plugins.surrogates.neural.law import NeuralLaw
from pliant_plugins.surrogates.neural.surrogate import Neural

BOX = Domain(np.array([0.0, PRESSURE_PA]), np.array([[-0.2, 0.4]]))


@pytest.fixture(scope="module")
def designs() -> SolvedDesigns:
    return solved_designs((3, 3))


def random_family(axes: int, mirror: Array, units: int = 5) -> RidgeFamily:
    random = np.random.default_rng(3)
    outputs = 2 * units + 2 * axes + axes**2
    return RidgeFamily(
        inner=random.standard_normal((2, 4)),
        inner_bias=random.standard_normal(4),
        outer=random.standard_normal((4, outputs)),
        outer_bias=random.standard_normal(outputs),
        ridges=random.standard_normal((units, 1 + axes)),
        mirror=mirror,
    )


def test_layers_are_the_mean_over_their_starts() -> None:
    random = np.random.default_rng(0)
    weights = (random.standard_normal((2, 3, 4)), random.standard_normal((2, 4, 1)))
    biases = (random.standard_normal((2, 1, 4)), random.standard_normal((2, 1, 1)))
    layers = Layers("relu", weights, biases, np.array([5.0]), np.array([2.0]))
    x = random.standard_normal((6, 3))
    one, two = (
        np.maximum(x @ weights[0][s] + biases[0][s], 0) @ weights[1][s] + biases[1][s] for s in (0, 1)
    )
    assert layers(x) == pytest.approx(5.0 + 2.0 * (one + two) / 2, abs=1e-14)


def test_the_network_for_a_design_is_the_formula_in_si() -> None:
    family = random_family(1, np.ones(1))
    place, energy, top, reach = np.array([0.3, -0.2]), 2e-3, 15e3, np.array([0.4])
    network = family.network(place, energy, top, reach)
    values = np.tanh(place @ family.inner + family.inner_bias) @ family.outer + family.outer_bias
    b, c, (t, g, s) = values[:5], values[5:10], values[10:]
    x, v = 0.7, -0.3
    z = family.ridges @ [x, v] + b
    wanted = energy * (c @ np.sqrt(1 + z**2) - (t + x * g) * v + s * v**2 / 2)
    assert network.energy(np.array([[x * top, v * reach[0]]]))[0] == pytest.approx(wanted, rel=1e-12)


def test_a_mirrored_energy_does_not_see_the_side_axis_sign() -> None:
    family = random_family(3, np.array([-1.0, 1.0, -1.0]))
    network = family.network(np.array([0.1, 0.5]), 1e-3, 1e4, np.array([0.3, 0.5, 0.3]))
    points = np.random.default_rng(1).standard_normal((7, 4)) * [1e4, 0.3, 0.3, 0.3]
    mirrored = points * [1, -1, 1, -1]
    assert network.energy(points) == pytest.approx(network.energy(mirrored), rel=1e-12)
    assert network.efforts(np.array([[5e3, 0.0, 0.2, 0.0]]))[0][0, [0, 2]] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("mirror", [(1.0, 1.0, 1.0), (-1.0, 1.0, -1.0)])
def test_what_is_trained_is_what_is_evaluated(mirror: tuple[float, ...]) -> None:
    torch = pytest.importorskip("torch")
    from pliant_designs.meta_models.ridges import _RidgeMisfit

    family = random_family(3, np.array(mirror))
    random = np.random.default_rng(2)
    places, points = random.uniform(-1, 1, (2, 2)), random.uniform(-1, 1, (8, 4))
    design = np.repeat([0, 1], 4)
    found = [
        family.network(place, 1.0, 1.0, np.ones(3)).efforts(points[design == number])
        for number, place in enumerate(places)
    ]
    tau, gain, slope = (np.concatenate(part) for part in zip(*found, strict=True))
    states = ScaledStates(places, design, points, tau, gain, slope)
    names = ("inner", "inner_bias", "outer", "outer_bias", "ridges")
    leaves = {name: torch.tensor(getattr(family, name)) for name in names}
    values, slopes = _RidgeMisfit(torch, states, family.mirror)(leaves)
    assert float(values) < 1e-25
    assert float(slopes) < 1e-25
    other = _RidgeMisfit(torch, replace(states, slope=1.1 * slope), family.mirror)(leaves)[1]
    assert float(other) > 1e-4


def test_the_studys_coefficients_are_found_where_the_data_have_its_form(designs: SolvedDesigns) -> None:
    wanted = np.array([[1.6e-6 * r, -0.8e-6, -0.03 * r, 0.02] for r in np.linspace(1, 2, len(designs))])
    data = []
    for one, (k_n, m_a, b, m_e) in zip(designs.data, wanted, strict=True):
        p, u = one.actuation[:, None], one.deformation
        data.append(replace(one, tau=k_n * p + (m_a * p + b) * u - m_e * u**2 / 2))
    assert study_targets(replace(designs, data=tuple(data))) == pytest.approx(wanted, rel=1e-8)


def test_the_studys_law_is_stiffened_only_where_it_would_be_unstable() -> None:
    p, u = np.meshgrid(np.linspace(0, PRESSURE_PA, 9), np.linspace(-0.2, 0.4, 9))
    p, u = p.ravel(), u.reshape(-1, 1)
    stable = law_from_targets(np.array([1.6e-6, -0.8e-6, -0.03, 0.02]), BOX, "pressure_pa", "y", "revolute")
    tau = 1.6e-6 * p + (-0.8e-6 * p - 0.03) * u[:, 0] - 0.01 * u[:, 0] ** 2
    assert stable.evaluate(p, u).tau[:, 0] == pytest.approx(tau, abs=1e-15)
    # At u = -0.2 the slope of these would be -0.03 + 0.3 * 0.2 > 0.
    saved = law_from_targets(np.array([1.6e-6, -0.8e-6, -0.03, 0.3]), BOX, "pressure_pa", "y", "revolute")
    assert saved.evaluate(p, u).dtau_du.max() == pytest.approx(-0.02 * 0.03, rel=1e-9)


def test_the_studys_form_is_refused_for_three_axes() -> None:
    model = Coefficients(CoefficientsConfig(form="study"))
    with pytest.raises(UserError, match=r"law of one axis.* has 3 \(x, y, z\); use form 'adaptive'"):
        model.fit(solved_spherical_designs((2, 2)))


@pytest.mark.slow
def test_a_single_start_has_no_doubt(designs: SolvedDesigns) -> None:
    pytest.importorskip("torch")
    one = Coefficients(CoefficientsConfig(starts=1)).fit(designs).laws
    assert np.array_equal(one.doubt(unseen_designs()), np.ones(6))
    assert isinstance(one, CoefficientLaws)
    assert one.law(RANGE[:, 0]).error is None


def test_a_neural_design_law_is_read_by_the_neural_surrogate(designs: SolvedDesigns) -> None:
    pytest.importorskip("torch")
    laws = NeuralMetaModel(NeuralMetaConfig(units=12, steps=150)).fit(designs).laws
    assert isinstance(laws, EnergyLaws)
    law = laws.law(RANGE.mean(axis=1))
    assert isinstance(law, NeuralLaw)
    again = Neural(NeuralConfig()).load(law.record())
    p, u = np.array([0.0, 7e3, 2e4]), np.array([[0.1], [0.3], [-0.5]])
    assert np.array_equal(law.evaluate(p, u).tau, again.evaluate(p, u).tau)


def test_an_energy_that_is_unstable_for_a_design_is_stiffened(designs: SolvedDesigns) -> None:
    pytest.importorskip("torch")
    laws = NeuralMetaModel(NeuralMetaConfig(units=4, steps=10)).fit(designs).laws
    assert isinstance(laws, EnergyLaws)
    bias = laws.family.outer_bias.copy()
    bias[-1] -= 10.0
    soft = replace(laws, family=replace(laws.family, outer_bias=bias))
    for values in grid((2, 2)):
        law = soft.law(values)
        assert isinstance(law, NeuralLaw)
        assert law.outside.largest_slope < 0


def test_the_studys_torques_make_stable_laws(designs: SolvedDesigns, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    monkeypatch.setattr(networks, "ADAM_STEPS", 400)
    laws = NeuralMetaModel(NeuralMetaConfig(activation="relu", units=24)).fit(designs).laws
    for values in unseen_designs(3):
        truth, law = sample_law(values), laws.law(values)
        p, u = np.meshgrid(np.linspace(0, PRESSURE_PA, 7), np.linspace(*law.domain.deformation[0], 9))
        wanted, got = truth.evaluate(p.ravel(), u.reshape(-1, 1)), law.evaluate(p.ravel(), u.reshape(-1, 1))
        assert np.abs(got.tau - wanted.tau).max() < 0.1 * np.ptp(wanted.tau)
        assert got.dtau_du.max() < 0
