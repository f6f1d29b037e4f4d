"""Search for the smallest learned term that predicts left-out runs better, if no listed effect explains the rest.

Every form of `forms` is fitted to the residuals by the engine's own slopes (`smooth_fit`) and judged on runs
that its values were not fitted to. Of those that predict as well as the best, within one standard error of their
difference, the simplest is taken (Breiman et al. 1984, the one-standard-error rule), refitted at the model that
includes it, and judged again. It is offered if the error on left-out runs falls by more than its uncertainty, and does
not rise on left-out conditions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.learned_forms import KIND, LearnedForm
from pliant.diagnosis.learned_term import LearnedTerm
from pliant.diagnosis.noise import NoiseView
from pliant.diagnosis.readings import ReadingVector
from pliant.errors import PliantError
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import EffectConfig
from pliant.mechanics.prescribed import is_held
from pliant.records.design import Array
from pliant_learned.forms import TUNED, SeenForms, complexity, with_knots
from pliant_learned.smooth_fit import CurvePrior, LinearModel, Sums, left_out, most_likely

# The fall of the squared error on left-out runs, in standard errors, and of its root as a share.
SURE, LEAST_FALL = 3.0, 0.03
# Rise of the squared error on left-out conditions that is still chance.
MOST_RISE = 1.05
# Gauss-Newton steps from the curve of the linear fit, and the fall of the squared error below which they end.
MOST_STEPS, STILL = 8, 2e-3
# A surface is not tried if a curve leaves less than this many times the floor's square on left-out runs.
ENOUGH = 1.1
# Forms that are fitted beyond the first order (the best of those that help); scales of a covariate that are tried.
MOST_REFINED, MOST_SCALES = 4, 3
# Values of a surface or curve are reduced to this number of knots per correlation length.
KNOTS_PER_LENGTH = 1.5
FEWEST_KNOTS = 4
# Share of a typical value used as the step for slopes.
STEP = 1e-3


@dataclass(frozen=True, eq=False)
class _Fitted:
    """A form with its prior, to first order about no curve and about the values of each later step.

    Attributes:
        mean: (K,) posterior mean by the last of the models.
        left: (N,) residual of each reading with its fold left out.
    """

    form: LearnedForm
    prior: CurvePrior
    models: tuple[LinearModel, ...]
    mean: Array
    left: Array

    @property
    def square(self) -> float:
        """Return the mean square on left-out readings."""
        return _square(self.left)

    @property
    def last(self) -> LinearModel:
        return self.models[-1]

    @property
    def gram(self) -> Array:
        return self.last.slopes.T @ self.last.slopes


def learn(
    predictor: Predictor,
    readings: ReadingVector,
    noise: NoiseView,
    conditions: NDArray[np.intp],
    folds: NDArray[np.intp],
) -> LearnedTerm | None:
    """Return the smallest learned term that these runs support, or None.

    Args:
        predictor: the model, with all effects that it has.
        readings: in units of their scales.
        noise: estimated from the residuals of the model, or of the best explanation.
        conditions: (N,) number of each reading's condition: repeats share one.
        folds: (N,) number of the fold of each reading.
    """
    held = any(is_held(run.history) for run in predictor.measurement.runs)
    if held or KIND not in predictor.context.registry.kinds("effect"):
        return None
    return _Learner(predictor, readings, noise, conditions, folds).learn()


class _Learner:
    """A learner for one model, its readings, and their division into folds."""

    def __init__(
        self,
        predictor: Predictor,
        readings: ReadingVector,
        noise: NoiseView,
        conditions: NDArray[np.intp],
        folds: NDArray[np.intp],
    ) -> None:
        predictor = predictor.refined(predictor.steps_between_samples())
        self.predictor, self.readings = predictor, readings
        self.conditions, self.folds = conditions, folds
        self.by_run = all(len(np.unique(folds[readings.run == r])) <= 1 for r in range(readings.n_runs))
        self.config = predictor.context.registry.get("effect", KIND).config_model()
        self.seen = SeenForms(predictor)
        self.forms = self.seen.forms()
        self.plain = _filled(readings.values - readings.pack(predictor.evaluate().runs))
        self.n_effective = max(noise.n_effective, 2.0)
        square = noise.floor_square
        self.floor_square = square if np.isfinite(square) and square > 0.0 else 1e-3 * _square(self.plain)

    def learn(self) -> LearnedTerm | None:
        """Return the smallest learned term, see the function."""
        fitted: list[_Fitted] = []
        for n_covariates in (1, 2):
            forms = [form for form in self.forms if len(form.axes) == n_covariates]
            fitted += [one for form in forms if (one := self._linear(form)) is not None]
            if fitted and min(one.square for one in fitted) < ENOUGH * self.floor_square:
                break  # the curve already reaches the floor
        good = sorted((one for one in fitted if self._helps(one)), key=lambda one: one.square)
        refined = [self._refined(self._thinned(one)) for one in good[:MOST_REFINED]]
        refined = [one for one in refined if self._helps(one)]
        if not refined:
            return None
        best = min(refined, key=lambda one: one.square)
        smallest = min(
            (one for one in refined if self._as_good(one, best)),
            key=lambda one: (complexity(one.form), one.prior.freedom(one.gram)),
        )
        return self._term(self._rescaled(smallest), len(fitted))

    def _linear(self, form: LearnedForm) -> _Fitted | None:
        """Return the form fitted to the unchanged model's residuals; None if it cannot act, or changes no reading."""
        try:
            model = self._model(form, np.zeros(int(np.prod(form.shape))))
        except PliantError:
            return None
        sums = Sums.from_residuals(model.slopes, model.aim, self.folds)
        prior = most_likely(form.axes, sums, self.n_effective, self.floor_square)
        return None if prior is None else self._fitted(form, prior, (model,))

    def _fitted(self, form: LearnedForm, prior: CurvePrior, models: tuple[LinearModel, ...]) -> _Fitted:
        slopes = models[-1].slopes
        mean, _ = prior.posterior(slopes.T @ slopes, slopes.T @ models[-1].aim)
        return _Fitted(form, prior, models, mean, left_out(prior, models, self.folds))

    def _model(self, form: LearnedForm, value: Array) -> LinearModel:
        """Return the model to first order about these values; 0 where there is no equilibrium."""
        step = self._step(form)
        towards = [(self._effect(form, value + step * row),) for row in np.eye(len(value))]
        prediction, changes = self.predictor.vary((self._effect(form, value),), towards)
        residual = _filled(self.readings.values - self.readings.pack(prediction.runs))
        slopes = np.stack([_filled(self.readings.pack(change)) for change in changes], axis=1) / step
        return LinearModel(value, residual, slopes)

    def _step(self, form: LearnedForm) -> float:
        """Return a small change of a value, in its unit."""
        histories = [run.history for run in self.predictor.measurement.runs]
        pushed = max((float(np.abs(v).max()) for h in histories for v in h.actuation.values()), default=0.0)
        return STEP * (pushed or 1.0) if form.acts_on == "input" else 1e-2 * STEP

    def _effect(self, form: LearnedForm, value: Array, sd: Array | None = None) -> EffectConfig:
        return cast(EffectConfig, self.config.model_validate(form.block(value, sd)))

    def _gain(self, one: Array, other: Array) -> tuple[float, float]:
        """Return the fall of the summed square from the residuals `other` to `one`, and its standard error.

        The difference of squares r² and (r − d)² has, by the noise in r alone, the variance 4 σ² d², and N/n_eff times
        that in the sum if neighbours share their noise.
        """
        fall = float(other @ other - one @ one)
        apart = float(np.sum((one - other) ** 2))
        share = len(one) / self.n_effective
        return fall, 2.0 * float(np.sqrt(self.floor_square * share * apart))

    def _helps(self, one: _Fitted) -> bool:
        """Return whether the error falls significantly on left-out runs without a rise on left-out conditions."""
        fall, error = self._gain(one.left, self.plain)
        total = _square(self.plain)
        if not (fall > SURE * error and one.square < (1.0 - LEAST_FALL) ** 2 * total):
            return False
        if len(np.unique(self.conditions)) < 2:
            return True
        return _square(left_out(one.prior, one.models, self.conditions)) < MOST_RISE * total

    def _as_good(self, one: _Fitted, best: _Fitted) -> bool:
        """Return whether a form is within one standard error of the best."""
        fall, error = self._gain(best.left, one.left)
        return one is best or fall < error

    def _thinned(self, one: _Fitted) -> _Fitted:
        """Return a form with no more knots than its correlation lengths need; unchanged if that predicts worse."""
        shape = tuple(
            min(n, max(FEWEST_KNOTS, int(np.ceil(KNOTS_PER_LENGTH / length)) + 1))
            for n, length in zip(one.form.shape, one.prior.lengths, strict=True)
        )
        if shape == one.form.shape:
            return one
        fewer = self._linear(with_knots(one.form, shape))
        return fewer if fewer is not None and self._as_good(fewer, one) else one

    def _refined(self, one: _Fitted) -> _Fitted:
        """Return the form after Gauss–Newton steps, shortened where they go too far, as long as they lower the cost."""
        here = one.models[0]
        start, factor = here, np.asarray(np.linalg.inv(one.prior.factor), float)
        cost = self._cost(here, one.prior, factor)
        for _ in range(MOST_STEPS):
            for share in (1.0, 0.5, 0.2):
                model = self._model(one.form, here.value + share * (one.mean - here.value))
                now = self._cost(model, one.prior, factor)
                if now < cost:
                    break
            else:
                break
            small = now > (1.0 - STILL) * cost
            here, cost = model, now
            one = self._fitted(one.form, one.prior, (start, here))
            if small:
                break
        return one

    def _cost(self, model: LinearModel, prior: CurvePrior, factor: Array) -> float:
        """Return −2 log posterior of the model's values."""
        away = factor @ model.value
        return prior.weight * float(model.residual @ model.residual) + float(away @ away)

    def _rescaled(self, one: _Fitted) -> _Fitted:
        """Return the form with other times, widths and rates of its covariates if these predict better."""
        for k, axis in enumerate(one.form.axes):
            if axis.name not in TUNED:
                continue
            for share in (0.6, 1.6):
                for _ in range(MOST_SCALES):
                    axes = self.seen.rescaled(one.form, k, share)
                    other = self._linear(axes) if axes is not None else None
                    other = None if other is None else self._refined(other)
                    if other is None or not (other.square < one.square and self._helps(other)):
                        break
                    one = other
        return one

    def _term(self, one: _Fitted, tried: int) -> LearnedTerm:
        last = one.last
        _, covariance = one.prior.posterior(one.gram, last.slopes.T @ last.aim)
        value, sd = _rounded(last.value, np.sqrt(np.diag(covariance)))
        fall, error = self._gain(one.left, self.plain)
        over = 1.0 / np.sqrt(self.floor_square)
        return LearnedTerm(
            effect=self._effect(one.form, value, sd),
            form=one.form,
            value=value,
            sd=sd,
            covariance=covariance,
            before=float(np.sqrt(_square(self.plain))) * over,
            after=float(np.sqrt(one.square)) * over,
            sure=fall / error,
            freedom=one.prior.freedom(one.gram),
            residual=last.residual,
            left_out=one.left,
            tried=tried,
            drive=self.predictor.chain.actuators[0].input,
            on="runs left out" if self.by_run else "blocks left out",
        )


def _square(residual: Array) -> float:
    """Return the mean square."""
    return float(residual @ residual) / max(len(residual), 1)


def _filled(values: Array) -> Array:
    """Return values with 0 where there is no equilibrium: such readings carry no information."""
    return np.where(np.isfinite(values), values, 0.0)


def _rounded(value: Array, sd: Array) -> tuple[Array, Array]:
    """Return values rounded to a small share of the smallest standard deviation, or of the largest value."""
    finest = min(float(sd.min()), float(np.abs(value).max()) or 1.0) / 30.0
    digits = -int(np.floor(np.log10(finest)))
    return np.round(value, digits), np.array([float(f"{x:.2g}") for x in sd])
