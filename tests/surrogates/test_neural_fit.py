"""Training: known laws are recovered, FEM states are fitted, check states are not used; several axes; wrong input."""

from __future__ import annotations

from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from pliant.fem_tables.reading import read_table
from pliant.interfaces.surrogate import FittedLaw
from pliant.pipeline.workbench import RunContext
from pliant.registry.discovery import Registry
from pliant.store.store import ArtifactStore, Recipe
from pliant.testing.samples import coupled_law, sample_module_table, sample_table, softening_law
from pliant_plugins.manifest import pliant_components
from pliant_plugins.surrogates.config import NeuralConfig

torch = pytest.importorskip("torch", reason="pip install 'pliant[neural]'")
from pliant_plugins.surrogates.neural.surrogate import Neural  # noqa: E402
from pliant_plugins.surrogates.neural.training import ResidualSystem, Scales, States  # noqa: E402

TABLE = Path(__file__).parents[2] / "examples/data/bellow_bending.csv"
UNITS = 12


@pytest.fixture(scope="module")
def fitted() -> FittedLaw:
    """Return the law of a shipped table."""
    return Neural(NeuralConfig(units=UNITS)).fit(read_table(TABLE))


@pytest.mark.parametrize(("k", "m"), [(1, 1), (3, 1), (2, 3)])
def test_jacobian_is_the_residuals_derivative(k: int, m: int) -> None:
    random = np.random.default_rng(0)
    n = 7
    slope = random.normal(size=(n, k, k))
    slope[2] = np.nan
    states = States(
        np.column_stack([1e4 * random.random((n, m)), random.uniform(-0.2, 0.4, (n, k))]),
        random.normal(size=(n, k)), 1e-4 * random.normal(size=(n, k, m)), slope,
    )  # fmt: skip
    scales = Scales(
        np.array([*[5e3] * m, *[0.1] * k]), np.array([*[5e3] * m, *[0.3] * k]), np.arange(1.0, k + 1)
    )
    seen = np.ones((2, n), bool)
    seen[1, :3] = False
    system = ResidualSystem(torch, states, scales, 3, seen)
    theta = system.start(3)
    theta = theta + 0.1 * torch.from_numpy(random.normal(size=theta.shape))
    jacobian, step = system.jacobian(theta).numpy(), 1e-6
    for j in range(theta.shape[1]):
        h = torch.zeros_like(theta)
        h[:, j] = step
        wanted = (system.residual(theta + h) - system.residual(theta - h)).numpy() / (2 * step)
        np.testing.assert_allclose(jacobian[:, :, j], wanted, atol=1e-7)
    # one of several networks is the same as alone
    np.testing.assert_array_equal(system.jacobian(theta[1:], [1]), jacobian[1:])
    # the networks in SI give the residuals, and one does not use what is left out
    for network, of_network, in_sight in zip(theta, system.residual(theta).numpy(), seen, strict=True):
        tau, gains, _ = system.network(network).efforts(states.points)
        missed = (tau - states.tau) / scales.ranges
        residual = np.full((n, system.rows), np.nan)
        residual.ravel()[system.known] = of_network
        wanted = missed * in_sight[:, None] / np.sqrt(in_sight.sum())
        np.testing.assert_allclose(residual[:, :k], wanted, atol=1e-12)
        if in_sight.all():
            step = 1e-3 * np.eye(m + k)[:m]
            ahead, back = (
                np.stack([system.network(network).efforts(states.points + s)[0] for s in sign * step], axis=2)
                for sign in (1, -1)
            )
            np.testing.assert_allclose(gains, (ahead - back) / 2e-3, rtol=1e-4, atol=1e-9)


def test_states_left_out_from_fem_are_met(fitted: FittedLaw) -> None:
    report = fitted.report
    assert report.worst_of_range < 5e-3
    assert report.worst_of_range < report.details["study_form"]["worst_of_range"] / 1.5
    assert report.details["stable"]


def test_the_history_tells_where_training_stopped(fitted: FittedLaw) -> None:
    details = fitted.report.details
    steps = [step["steps"] for step in details["training"]]
    chosen = [step for step in details["training"] if step["chosen"]]
    assert steps == sorted(steps)
    assert len(chosen) == 1
    assert chosen[0]["decay"] == details["decay"]
    assert chosen[0]["left_out_rmse_of_range"] < 0.01


def test_band_is_small_among_states_and_wide_outside(fitted: FittedLaw) -> None:
    law, data = fitted.law, read_table(TABLE).select("check")
    band = law.band(data.actuation, data.angle_rad[:, None])
    assert band is not None
    assert 0 < np.median(band) < 0.01 * np.ptp(data.moment_n_m)
    told = fitted.report.details["error_bar"]
    assert told["n"] == len(data)
    assert told["covered"] >= 0.75
    assert told["mean_half_width_of_range"] == pytest.approx(band.mean() / fitted.report.effort_range)
    far = law.band(np.array([6e4]), np.array([[2.0]]))
    assert far is not None
    assert far[0, 0] > 3 * np.median(band)


def test_scatter_is_not_learned() -> None:
    """For states without slopes and with scatter the law is nearer to the truth than the states are."""
    scatter = 4e-4
    data = sample_table(softening_law(), noise_n_m=scatter, pressures=8, angles=9)
    blank = np.full(len(data), np.nan)
    data = replace(data, dmoment_dp=blank, dmoment_du=blank)
    law = Neural(NeuralConfig(units=UNITS)).fit(data).law
    p, u = np.meshgrid(np.linspace(500, 14500, 15), np.linspace(-0.18, 0.43, 15))
    true = softening_law().evaluate(p.ravel(), u.reshape(-1, 1)).tau
    missed = law.evaluate(p.ravel(), u.reshape(-1, 1)).tau - true
    assert np.sqrt(np.mean(missed**2)) < scatter


@pytest.mark.slow
def test_three_coupled_axes() -> None:
    data = sample_module_table(coupled_law())
    found = Neural(NeuralConfig(units=UNITS)).fit_module(data)
    law, check = found.law, data.role == "check"
    missed = law.evaluate(data.actuation, data.deformation).tau - data.tau
    assert np.abs(missed[check]).max() < 0.01 * np.ptp(data.tau)
    assert found.report.r2 > 0.999
    assert (law.joint, law.axes) == ("spherical", ("x", "y", "z"))
    slope = law.evaluate(data.actuation, data.deformation).dtau_du
    np.testing.assert_allclose(slope[:, 1, 2], slope[:, 2, 1], atol=1e-15)
    assert np.abs(slope[:, 1, 2] - data.dtau_du[:, 1, 2]).max() < 2e-3
    band = law.band(data.actuation, data.deformation)
    assert band is not None
    assert band.shape == missed.shape
    details = found.report.details
    assert set(details["axes"]) == {"x", "y", "z"}
    told = details["error_bar"]
    own = (data.explored[:, None] == np.array(data.axes)) | (data.explored == "coupling")[:, None]
    assert told["n"] == (own & check[:, None]).sum()
    assert told["covered"] == np.mean((np.abs(missed) <= band)[own & check[:, None]])
    assert told["covered"] > 0.75
    assert 0 < told["mean_half_width_of_range"] < 0.01


def test_training_leaves_torch_as_it_was() -> None:
    torch.manual_seed(5)
    state, threads = torch.random.get_rng_state(), torch.get_num_threads()
    Neural(NeuralConfig(units=4)).fit(sample_table(softening_law(), pressures=3, angles=4))
    assert torch.equal(torch.random.get_rng_state(), state)
    assert torch.get_num_threads() == threads


def test_torch_counts_in_the_fit_key() -> None:
    component = next(c for c in pliant_components() if (c.interface, c.kind) == ("surrogate", "neural"))
    asked: list[Recipe] = []

    class Store:
        def make(self, recipe: Recipe, *others: object) -> None:
            asked.append(recipe)

    context = RunContext(Registry((component,)), cast(ArtifactStore, Store()))
    context.make("fit", lambda _: None, components=[component], modules=[], config={}, inputs={})
    assert asked[0].libraries["torch"] == version("torch")
