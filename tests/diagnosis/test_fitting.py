"""Fits with the physics in the loop: known parameters come back, cost never rises, bounds hold."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.diagnosis.quick import (
    REGISTRY,
    SIGMA,
    VALUES,
    P,
    effect,
    fitter_of,
    joint,
    measured,
    poor,
    predictor_of,
    rich,
)

from pliant.diagnosis import fitting
from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.fitting import EffectFit, Fitter
from pliant.evidence.prediction import Predictor

CHAIN = joint()


def fitted(kind: str, *, sigma: float = SIGMA, seed: int = 3, fitter: type[Fitter] = Fitter) -> EffectFit:
    measurement = measured(CHAIN, rich(), effect(kind), sigma=sigma, phi=0.0, seed=seed)
    made = fitter_of(predictor_of(CHAIN, measurement), max(sigma, 1e-6))
    return fitter(made.predictor, made.readings).fit(EffectSet.of(REGISTRY, (kind,)))


@pytest.mark.parametrize("kind", VALUES)
def test_parameters_come_back_within_their_error_bars(kind: str) -> None:
    fit = fitted(kind)
    spread = np.sqrt(np.diag(np.linalg.inv(fit.slopes.T @ fit.slopes)) * fit.mean_square())
    hidden = effect(kind).model_dump()  # what VALUES does not state is at its default
    truth = np.array([k.x(hidden[k.declared.name]) for k in fit.candidate.parameters])
    assert np.all(np.abs(fit.x - truth) < 4.0 * spread), (fit.values, hidden)
    assert np.all(spread[[k.declared.name in VALUES[kind] for k in fit.candidate.parameters]] < 0.5)
    assert fit.mean_square() == pytest.approx(1.0, abs=0.12)
    assert fit.converged
    assert not any(fit.at_limit)


@pytest.mark.parametrize("kind", ["stiffness", "viscoelastic", "self_contact"])
def test_without_noise_they_come_back_exactly(kind: str) -> None:
    fit = fitted(kind, sigma=0.0)
    for name, value in VALUES[kind].items():
        assert fit.values[f"{kind}.{name}"] == pytest.approx(value, rel=2e-3)


class Watched(Fitter):
    """Keeps the costs that the descent accepts."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.paths: list[list[float]] = []

    def _descend(self, candidate, point, iterations):
        end, converged = super()._descend(candidate, point, iterations)
        self.paths.append([point.cost, end.cost])
        return end, converged


@pytest.mark.parametrize("kind", ["mullins", "friction_hysteresis", "dead_zone", "self_contact"])
def test_the_cost_never_rises_and_bounds_hold(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # The truth is another effect: the fit is pushed toward the ends of its range.
    measurement = measured(CHAIN, rich(1), effect("stiffness", factor=0.5), seed=2)
    made = fitter_of(predictor_of(CHAIN, measurement))
    watched = Watched(made.predictor, made.readings)
    asked: list[np.ndarray] = []
    point = fitting._Misfit.point

    def watching(self: fitting._Misfit, x: np.ndarray) -> object:
        asked.append(x.copy())
        return point(self, x)

    monkeypatch.setattr(fitting._Misfit, "point", watching)
    candidate = EffectSet.of(REGISTRY, (kind,))
    fit = watched.fit(candidate)
    assert all(end <= start for start, end in watched.paths)
    low, high = candidate.limits()
    assert asked and all(np.all((low - 1e-12 <= x) & (x <= high + 1e-12)) for x in asked)
    start = watched.look(candidate, candidate.starts()[0])
    assert fit.mean_square() <= start.mean_square()


def test_a_bound_that_is_reached_is_told() -> None:
    measurement = measured(CHAIN, poor(), effect("sensor_bias", bias_rad=-0.2))
    fit = fitter_of(predictor_of(CHAIN, measurement)).fit(EffectSet.of(REGISTRY, ("dead_zone",)))
    (parameter,) = fit.candidate.parameters
    assert parameter.value(float(fit.x[0])) > P or fit.at_limit == (False,)
    shrunk = fitter_of(predictor_of(CHAIN, measured(CHAIN, rich(1), effect("actuation_gain", gain=1.2)))).fit(
        EffectSet.of(REGISTRY, ("viscous_damping",))
    )
    assert shrunk.at_limit == (True,)
    assert shrunk.values["viscous_damping.time_s"] == 0.0


def test_weights_leave_readings_out_of_the_cost() -> None:
    measurement = measured(CHAIN, rich(), effect("stiffness"), seed=4)
    spoiled = tuple(
        run.with_outputs({"angle_rad": run.outputs["angle_rad"] + (0.3 if k == 5 else 0.0)})
        for k, run in enumerate(measurement.runs)
    )
    made = fitter_of(predictor_of(CHAIN, type(measurement)(spoiled, measurement.outputs)))
    weights = (made.readings.run != 5).astype(float)
    candidate = EffectSet.of(REGISTRY, ("stiffness",))
    blind = Fitter(made.predictor, made.readings, weights).fit(candidate)
    seeing = made.fit(candidate)
    assert blind.values["stiffness.factor"] == pytest.approx(1.15, abs=0.01)
    assert abs(seeing.values["stiffness.factor"] - 1.15) > 0.02
    assert len(blind.residual) == len(made.readings)


def test_nothing_is_the_model_as_it_is() -> None:
    measurement = measured(CHAIN, poor())
    fit = fitter_of(predictor_of(CHAIN, measurement)).fit(EffectSet.of(REGISTRY, ()))
    assert fit.slopes.shape == (len(fit.residual), 0)
    assert fit.mean_square() == pytest.approx(1.0, abs=0.3)


class Brittle(Predictor):
    """A model without equilibrium where its stiffness is raised by more than a hundredth."""

    limit = 1.01

    def vary(self, effects, towards):
        prediction, changes = super().vary(effects, towards)
        if effects and effects[0].factor > self.limit:
            lost = tuple(
                {name: np.full_like(v, np.nan) for name, v in run.items()} for run in prediction.runs
            )
            prediction = type(prediction)(lost, 1)
        return prediction, changes


@pytest.mark.parametrize("limit", [1.01, 0.0])
def test_starts_without_equilibrium(limit: float) -> None:
    measurement = measured(CHAIN, poor(), effect("stiffness", factor=0.9))
    plain = predictor_of(CHAIN, measurement)
    brittle = Brittle(plain.bench, plain.backend, CHAIN, measurement)
    brittle.limit = limit
    fit = fitter_of(brittle).fit(EffectSet.of(REGISTRY, ("stiffness",)))
    if limit > 0:
        assert fit.values["stiffness.factor"] == pytest.approx(0.9, abs=0.02)
    else:
        assert fit.mean_square() == np.inf
