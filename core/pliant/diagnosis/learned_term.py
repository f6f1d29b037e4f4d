"""The smallest learned term that predicts runs left out better: what to add when no listed effect explains the rest.

Every form of `learned_forms` is fitted to the residuals by the engine's own slopes (`smooth_fit`) and judged on runs
that its values were not fitted to. Of those that predict as well as the best, within one standard error of their
difference, the simplest is taken (Breiman et al. 1984, the one-standard-error rule), fitted again where it has led the
model, and judged again. It is offered where the error on runs left out falls by more than its uncertainty, and does not
rise on conditions left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.fitting import ReadingVector
from pliant.diagnosis.learned_forms import LearnedForm, forms_of
from pliant.diagnosis.noise import NoiseView
from pliant.diagnosis.smooth_fit import Prior, Sums, left_out, most_likely
from pliant.errors import PliantError
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import EffectConfig
from pliant.records.design import Array

KIND = "learned"
# The fall of the squared error on runs left out, in standard errors, and of its root as a share.
SURE, LEAST_FALL = 3.0, 0.03
# Rise of the squared error on conditions left out that is still chance.
MOST_RISE = 1.05
# Gauss-Newton steps from the curve of the linear fit, and the fall of the squared error below which they end.
MOST_STEPS, STILL = 4, 2e-3
# Values of a surface or curve are thinned to so many knots per length over which it changes.
KNOTS_PER_LENGTH = 1.5
FEWEST_KNOTS = 4
# Share of a typical value at which slopes are taken.
STEP = 1e-3


@dataclass(frozen=True, eq=False)
class LearnedTerm:
    """A learned term, fitted.

    Attributes:
        effect: as a study has it.
        form: where it acts and over what.
        value, sd: at its knots, in the order of the effect's `value`.
        covariance: (K, K) of the values.
        before, after: RMS error over the noise floor on runs left out, without and with it.
        sure: fall of the squared error on runs left out over its standard error.
        freedom: values that the readings decide, less than there are knots.
        residual: (N,) reading − prediction over the scales, with all runs.
        left_out: (N,) with each run left out of the term's fit.
        tried: forms that were fitted.
    """

    effect: EffectConfig
    form: LearnedForm
    value: Array
    sd: Array
    covariance: Array
    before: float
    after: float
    sure: float
    freedom: float
    residual: Array
    left_out: Array
    tried: int


@dataclass(frozen=True, eq=False)
class _Fitted:
    """A form at the posterior mean of its values; `change` (N,) is what it does to each reading left out."""

    form: LearnedForm
    prior: Prior
    value: Array
    slopes: Array
    residual: Array
    change: Array
    square: float


def learn(
    predictor: Predictor,
    readings: ReadingVector,
    noise: NoiseView,
    conditions: NDArray[np.intp],
    folds: NDArray[np.intp] | None = None,
) -> LearnedTerm | None:
    """The smallest learned term that these runs support; None where there is none.

    Args:
        predictor: the model, with all effects that it has.
        readings: in units of their scales.
        noise: as the residuals of the model, or of the best explanation, show it.
        conditions: (N,) number of each reading's condition: repeats share one.
        folds: (N,) what is left out together; the readings' own folds by default.
    """
    if KIND not in predictor.bench.registry.kinds("effect"):
        return None
    learner = _Learner(predictor, readings, noise, conditions, readings.fold if folds is None else folds)
    return learner.learn()


class _Learner:
    """One model, its readings, and how they are divided."""

    def __init__(
        self,
        predictor: Predictor,
        readings: ReadingVector,
        noise: NoiseView,
        conditions: NDArray[np.intp],
        folds: NDArray[np.intp],
    ) -> None:
        self.predictor, self.readings = predictor, readings
        self.conditions, self.folds = conditions, folds
        self.config = predictor.bench.registry.get("effect", KIND).config_model()
        self.plain = _filled(readings.values - readings.pack(predictor.predict()))
        self.n_effective = max(noise.n_effective, 2.0)
        square = noise.floor_square
        self.floor_square = square if np.isfinite(square) and square > 0.0 else 1e-3 * self.square(self.plain)

    @staticmethod
    def square(residual: Array) -> float:
        """Mean square."""
        return float(residual @ residual) / max(len(residual), 1)

    def learn(self) -> LearnedTerm | None:
        """See the function."""
        forms = forms_of(self.predictor)
        fitted = [one for form in forms if (one := self._linear(form)) is not None]
        good = [one for one in fitted if self._helps(one)]
        if not good:
            return None
        best = min(good, key=lambda one: one.square)
        for one in sorted(good, key=lambda one: (one.form.complexity, one.prior.freedom(_gram(one)))):
            if self._as_good(one, best):
                found = self._refined(self._thinned(one))
                if found is not None and self._helps(found):
                    return self._term(found, len(fitted))
        return None

    def _linear(self, form: LearnedForm) -> _Fitted | None:
        """The form fitted to the residuals of the model as it is."""
        zero = np.zeros(int(np.prod(form.shape)))
        return self._at(form, zero, None)

    def _at(self, form: LearnedForm, value: Array, prior: Prior | None) -> _Fitted | None:
        """One Gauss-Newton step from these values; None where the engine cannot, or the curve moves nothing."""
        try:
            residual, slopes = self._slopes(form, value)
        except PliantError:
            return None
        aim = residual + slopes @ value
        sums = Sums.of(slopes, aim, self.folds)
        found = prior or most_likely(form.axes, sums, self.n_effective, self.floor_square)
        if found is None:
            return None
        mean, _ = found.posterior(sums.gram.sum(axis=0), sums.right.sum(axis=0))
        change = left_out(found, slopes, aim, self.folds)
        return _Fitted(form, found, mean, slopes, aim, change, self.square(aim - change))

    def _slopes(self, form: LearnedForm, value: Array) -> tuple[Array, Array]:
        """Residual (N,) at these values and slopes (N, K) of the prediction; 0 where there is no equilibrium."""
        step = self._step(form)
        towards = [(self._effect(form, value + step * row),) for row in np.eye(len(value))]
        prediction, changes = self.predictor.vary((self._effect(form, value),), towards)
        residual = _filled(self.readings.values - self.readings.pack(prediction.runs))
        slopes = np.stack([_filled(self.readings.pack(change)) for change in changes], axis=1) / step
        return residual, slopes

    def _step(self, form: LearnedForm) -> float:
        """A small change of a value, in its unit."""
        histories = [run.history for run in self.predictor.measurement.runs]
        pushed = max((float(np.abs(v).max()) for h in histories for v in h.actuation.values()), default=0.0)
        return STEP * (pushed or 1.0) if form.acts_on == "input" else 1e-2 * STEP

    def _effect(self, form: LearnedForm, value: Array, sd: Array | None = None) -> EffectConfig:
        return cast(EffectConfig, self.config.model_validate(form.block(value, sd)))

    def _gain(self, one: _Fitted, over: _Fitted | None, by: Array) -> tuple[float, float]:
        """Fall of the summed square on readings left out against another form, or none, and its standard error.

        Of squares (r − a)² and (r − b)² the difference has, by the noise in r alone, the variance 4 σ² (a − b)², N/n_eff
        times that of the sum where neighbours share their noise.
        """
        other = np.zeros(len(self.plain)) if over is None else over.change
        aim = self.plain if over is None else over.residual
        fall = float(np.sum((aim - other) ** 2) - np.sum((one.residual - one.change) ** 2))
        apart = float(np.sum((one.change - other) ** 2))
        return fall, 2.0 * float(np.sqrt(self.floor_square * len(by) / self.n_effective * apart))

    def _helps(self, one: _Fitted) -> bool:
        """The error on runs left out falls by more than its uncertainty, and that on conditions left out does not rise."""
        fall, error = self._gain(one, None, self.plain)
        total = float(self.plain @ self.plain)
        if not (fall > SURE * error and one.square < (1.0 - LEAST_FALL) ** 2 * total / len(self.plain)):
            return False
        if len(np.unique(self.conditions)) < 2:
            return True
        change = left_out(one.prior, one.slopes, one.residual, self.conditions)
        return float(np.sum((one.residual - change) ** 2)) < MOST_RISE * total

    def _as_good(self, one: _Fitted, best: _Fitted) -> bool:
        """Within one standard error of the best."""
        if one is best:
            return True
        fall, error = self._gain(best, one, self.plain)
        return fall < error

    def _thinned(self, one: _Fitted) -> _Fitted:
        """With no more knots than its lengths need; as it was where that predicts worse."""
        shape = [
            min(n, max(FEWEST_KNOTS, int(np.ceil(KNOTS_PER_LENGTH / length)) + 1))
            for n, length in zip(one.form.shape, one.prior.lengths, strict=True)
        ]
        if tuple(shape) == one.form.shape:
            return one
        fewer = self._linear(one.form.with_knots(shape))
        return fewer if fewer is not None and self._as_good(fewer, one) else one

    def _refined(self, one: _Fitted) -> _Fitted | None:
        """Steps from where the linear fit has led the model, as long as they lower the error."""
        best, square = None, self.square(self.plain)
        for _ in range(MOST_STEPS):
            found = self._at(one.form, one.value, one.prior)
            if found is None:
                break
            now = self.square(found.residual - found.slopes @ one.value)  # of the model at one.value
            if not now < square:
                break
            best = replace(found, value=one.value)
            if now > (1.0 - STILL) * square:
                break
            square, one = now, found
        return best

    def _term(self, one: _Fitted, tried: int) -> LearnedTerm:
        gram = _gram(one)
        _, covariance = one.prior.posterior(gram, _right(one))
        sd = np.sqrt(np.diag(covariance))
        value, sd = _rounded(one.value, sd)
        fall, error = self._gain(one, None, self.plain)
        over = 1.0 / np.sqrt(self.floor_square)
        return LearnedTerm(
            effect=self._effect(one.form, value, sd),
            form=one.form,
            value=value,
            sd=sd,
            covariance=covariance,
            before=float(np.sqrt(self.square(self.plain))) * over,
            after=float(np.sqrt(one.square)) * over,
            sure=fall / error,
            freedom=one.prior.freedom(gram),
            residual=one.residual - one.slopes @ one.value,
            left_out=one.residual - one.change,
            tried=tried,
        )


def _gram(one: _Fitted) -> Array:
    return one.slopes.T @ one.slopes


def _right(one: _Fitted) -> Array:
    return one.slopes.T @ one.residual


def _filled(values: Array) -> Array:
    """0 where there is no equilibrium: such readings say nothing."""
    return np.where(np.isfinite(values), values, 0.0)


def _rounded(value: Array, sd: Array) -> tuple[Array, Array]:
    """At a hundredth of the smallest standard deviation, or of the largest value."""
    finest = min(float(sd.min()), float(np.abs(value).max()) or 1.0) / 30.0
    digits = -int(np.floor(np.log10(finest)))
    return np.round(value, digits), np.array([float(f"{x:.2g}") for x in sd])
