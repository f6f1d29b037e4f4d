"""Fits of the physical model: known parameters are recovered, the cost never rises, bounds are respected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from tests.diagnosis.quick import (
    REGISTRY,
    SIGMA,
    VALUES,
    P,
    effect,
    joint,
    make_fitter,
    make_predictor,
    measured,
    poor,
    rich,
)

from pliant.diagnosis import fitting
from pliant.diagnosis.candidates import PRIOR_WEIGHT, EffectSet
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.left_out import _bounded, condition_indices, heldout_residual
from pliant.evidence.prediction import Predictor

CHAIN = joint()


def fitted(kind: str, *, sigma: float = SIGMA) -> EffectFit:
    measurement = measured(CHAIN, rich(), effect(kind), sigma=sigma, phi=0.0, seed=3)
    return make_fitter(make_predictor(CHAIN, measurement), max(sigma, 1e-6)).fit(
        EffectSet.from_kinds(REGISTRY, (kind,))
    )


@pytest.mark.parametrize("kind", VALUES)
def test_parameters_come_back_within_their_error_bars(kind: str) -> None:
    fit = fitted(kind)
    spread = np.sqrt(np.diag(np.linalg.inv(fit.slopes.T @ fit.slopes)) * fit.mean_square())
    hidden = effect(kind).model_dump()  # parameters that VALUES does not state have their defaults
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


@pytest.mark.parametrize("kind", ["mullins", "friction_hysteresis", "dead_zone", "self_contact"])
def test_the_cost_never_rises_and_bounds_hold(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # The truth is another effect: the fit is driven toward the ends of its range.
    measurement = measured(CHAIN, rich(1), effect("stiffness", factor=0.5), seed=2)
    fitter = make_fitter(make_predictor(CHAIN, measurement))
    asked: list[np.ndarray] = []
    costs: list[tuple[float, float]] = []
    point, descend = fitting._ReadingMisfit.raw_point, Fitter._descend

    def watching(self: fitting._ReadingMisfit, x: np.ndarray) -> object:
        asked.append(x.copy())
        return point(self, x)

    def descending(self: Fitter, misfit, start, iterations):
        end, converged = descend(self, misfit, start, iterations)
        costs.append((start.cost, end.cost))
        return end, converged

    monkeypatch.setattr(fitting._ReadingMisfit, "raw_point", watching)
    monkeypatch.setattr(Fitter, "_descend", descending)
    candidate = EffectSet.from_kinds(REGISTRY, (kind,))
    fit = fitter.fit(candidate)
    assert costs and all(end <= start for start, end in costs)
    low, high = candidate.limits()
    assert asked and all(np.all((low - 1e-12 <= x) & (x <= high + 1e-12)) for x in asked)
    assert fit.mean_square() <= fitter.evaluate(candidate, candidate.starts()[0]).mean_square()


def test_a_bound_that_is_reached_is_told() -> None:
    measurement = measured(CHAIN, poor(), effect("sensor_bias", bias_rad=-0.2))
    fit = make_fitter(make_predictor(CHAIN, measurement)).fit(EffectSet.from_kinds(REGISTRY, ("dead_zone",)))
    (parameter,) = fit.candidate.parameters
    assert parameter.value(float(fit.x[0])) > P or fit.at_limit == (False,)
    shrunk = make_fitter(
        make_predictor(CHAIN, measured(CHAIN, rich(1), effect("actuation_gain", gain=1.2)))
    ).fit(EffectSet.from_kinds(REGISTRY, ("viscous_damping",)))
    assert shrunk.at_limit == (True,)
    assert shrunk.values["viscous_damping.time_s"] == 0.0


def test_weights_exclude_readings_from_the_cost() -> None:
    measurement = measured(CHAIN, rich(), effect("stiffness"), seed=4)
    spoiled = tuple(
        run.with_outputs({"angle_rad": run.outputs["angle_rad"] + (0.3 if k == 5 else 0.0)})
        for k, run in enumerate(measurement.runs)
    )
    made = make_fitter(make_predictor(CHAIN, type(measurement)(spoiled, measurement.outputs)))
    weights = (made.readings.run != 5).astype(float)
    candidate = EffectSet.from_kinds(REGISTRY, ("stiffness",))
    blind = Fitter(made.predictor, made.readings, weights).fit(candidate)
    seeing = made.fit(candidate)
    assert blind.values["stiffness.factor"] == pytest.approx(1.15, abs=0.01)
    assert abs(seeing.values["stiffness.factor"] - 1.15) > 0.02
    assert len(blind.residual) == len(made.readings)


def test_nothing_is_the_model_as_it_is() -> None:
    predictor = make_predictor(CHAIN, measured(CHAIN, poor()))
    fit = make_fitter(predictor).fit(EffectSet.from_kinds(REGISTRY, ()))
    assert fit.slopes.shape == (len(fit.residual), 0)
    pairs = zip(predictor.measurement.runs, predictor.predict(), strict=True)
    noise = np.concatenate([run.outputs["angle_rad"] - model["angle_rad"] for run, model in pairs]) / SIGMA
    assert fit.mean_square() == pytest.approx(np.mean(noise**2), rel=1e-12)


class Brittle(Predictor):
    """A model without equilibrium when its stiffness is raised by more than a hundredth."""

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
    plain = make_predictor(CHAIN, measurement)
    brittle = Brittle(plain.context, plain.backend, CHAIN, measurement)
    brittle.limit = limit
    fit = make_fitter(brittle).fit(EffectSet.from_kinds(REGISTRY, ("stiffness",)))
    if limit > 0:
        assert fit.values["stiffness.factor"] == pytest.approx(0.9, abs=0.02)
    else:
        assert fit.mean_square() == np.inf


# -- errors left out of a fit against refits ----------------------------------------------------------

CANDIDATE = EffectSet.from_kinds(REGISTRY, ("mullins", "stiffness"))  # three parameters


def linear(seed: int, n: int = 240, x: np.ndarray | None = None):
    """Return a fit of y = J x at its optimum (or at x), the readings and their groups."""
    rng = np.random.default_rng(seed)
    slopes, y = rng.normal(size=(n, 3)), rng.normal(size=n)
    y += slopes @ np.array([0.8, 0.1, -0.1])
    groups = np.repeat(np.arange(6), n // 6)
    best = np.linalg.lstsq(slopes, y, rcond=None)[0] if x is None else x
    return EffectFit(CANDIDATE, best, y - slopes @ best, slopes, True, (False,) * 3), slopes, y, groups


def refit(slopes: np.ndarray, y: np.ndarray, weight: float = PRIOR_WEIGHT) -> np.ndarray:
    return np.linalg.solve(slopes.T @ slopes + weight * np.eye(slopes.shape[1]), slopes.T @ y)


@pytest.mark.parametrize("seed", range(5))
def test_the_formula_is_the_refit(seed: int) -> None:
    fit, slopes, y, groups = linear(seed)
    left = heldout_residual(fit, groups)
    for group in range(6):
        mine = groups == group
        there = refit(slopes[~mine], y[~mine])
        np.testing.assert_allclose(left[mine], y[mine] - slopes[mine] @ there, atol=1e-10)
    assert left @ left > fit.residual @ fit.residual


def test_it_is_the_refit_from_any_point_near_the_optimum() -> None:
    best, _, _, groups = linear(0)
    moved, *_ = linear(0, x=best.x + 0.05)
    np.testing.assert_allclose(heldout_residual(moved, groups), heldout_residual(best, groups), atol=1e-10)


def test_what_only_one_group_shows_is_nothing_without_it() -> None:
    fit, slopes, y, groups = linear(1)
    slopes[groups != 2, 0] = 0.0
    best = np.linalg.lstsq(slopes, y, rcond=None)[0]
    fit = EffectFit(CANDIDATE, best, y - slopes @ best, slopes, True, (False,) * 3)
    mine = groups == 2
    others = refit(slopes[~mine][:, 1:], y[~mine])
    np.testing.assert_allclose(
        heldout_residual(fit, groups)[mine], y[mine] - slopes[mine][:, 1:] @ others, atol=1e-10
    )


@pytest.mark.parametrize("felt", [0.0, 1e-3])
def test_what_no_reading_feels_takes_no_prediction_away(felt: float) -> None:
    """With an idle shape (a time constant of zero) the result is that without it, not that without the effects."""
    fit, slopes, y, groups = linear(1)
    plain = y.copy()
    slopes[:, 2] *= felt
    best = np.append(np.linalg.lstsq(slopes[:, :2], y, rcond=None)[0], 0.0)
    fit = replace(fit, x=best, residual=y - slopes @ best, slopes=slopes)
    left = heldout_residual(fit, groups, plain)
    for group in range(6):
        mine = groups == group
        there = slopes[mine][:, :2] @ refit(slopes[~mine][:, :2], y[~mine])
        np.testing.assert_allclose(left[mine], y[mine] - there, atol=10.0 * felt + 1e-10)
    assert not np.allclose(left, plain)


def test_one_group_alone_predicts_as_the_model_without_the_effect_and_nothing_has_nothing_to_leave() -> None:
    fit, _, y, groups = linear(2)
    np.testing.assert_allclose(heldout_residual(fit, np.zeros_like(groups)), y, atol=1e-10)
    nothing = EffectFit(
        EffectSet.from_kinds(REGISTRY, ()), np.zeros(0), np.arange(4.0), np.zeros((4, 0)), True, ()
    )
    np.testing.assert_array_equal(heldout_residual(nothing, np.array([0, 0, 1, 1])), np.arange(4.0))


@pytest.mark.parametrize("alike", [0.0, 0.98])
def test_moves_stay_within_bounds_and_the_others_follow(alike: float) -> None:
    """A strength at its bound and a shape with nearly the same slope are refitted together when a group is left out."""
    _, slopes, y, groups = linear(3)
    slopes[:, 1] = alike * slopes[:, 0] + np.sqrt(1.0 - alike**2) * slopes[:, 1]
    low, high = CANDIDATE.limits()
    best = np.array([low[0], 0.3, 0.0])
    y = y + slopes @ (best - np.array([1.0, 0.0, 0.0]))  # the minimum of the loss is outside the bound
    fit = EffectFit(CANDIDATE, best, y - slopes @ best, slopes, True, (True, False, False))
    left = heldout_residual(fit, groups)
    for group in range(6):
        mine = groups == group
        normal = slopes[~mine].T @ slopes[~mine] + PRIOR_WEIGHT * np.eye(3)
        right = slopes[~mine].T @ y[~mine]
        there = minimize(
            lambda x, a=normal, b=right: (0.5 * x @ a @ x - b @ x, a @ x - b),
            best,
            jac=True,
            bounds=list(zip(low, high, strict=True)),
            options={"ftol": 1e-15, "gtol": 1e-10},
        ).x
        assert there[0] == pytest.approx(low[0])
        np.testing.assert_allclose(left[mine], y[mine] - slopes[mine] @ there, atol=1e-4)


def test_groups() -> None:
    np.testing.assert_array_equal(condition_indices(5, [(0, 3), (1, 4)]), [0, 1, 2, 0, 1])


def test_a_fit_without_an_equilibrium_has_no_left_out_error() -> None:
    found, _, y, groups = linear(0)
    lost = replace(found, residual=np.full_like(y, np.nan), slopes=np.full_like(found.slopes, np.nan))
    assert np.isnan(heldout_residual(lost, groups, y)).all()


def test_within_bounds_a_direction_that_rounding_took_below_zero_is_none():
    """For readings of a tiny range the information on a direction may be rounded to −10⁻¹⁷ of that on another."""
    known = np.array([[[2.0, 0.0], [0.0, -1e-17]], [[2.0, 0.5], [0.5, 1.0]]])
    moves = _bounded(
        known, np.array([[1.0, 1e-16], [1.0, 3.0]]), np.array([-1.0, -1.0]), np.array([1.0, 1.0])
    )
    np.testing.assert_allclose(moves[0][0], 0.5, rtol=1e-12)
    assert abs(moves[0][1]) <= 1.0
    np.testing.assert_allclose(
        moves[1], [0.25, 1.0], rtol=1e-12
    )  # the second parameter is at its bound, the first follows
