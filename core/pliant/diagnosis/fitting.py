"""Fits of a candidate to measured readings with the physics in the loop.

Levenberg–Marquardt (`pliant.least_squares`) in the fit parameters' x, with the engine's own derivatives.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any, cast

import numpy as np

from pliant.diagnosis.candidates import EffectSet, is_neutral
from pliant.diagnosis.effect_fit import EffectFit, add_law_error
from pliant.diagnosis.law_discrepancy import (
    LawErrorBasis,
    LawReference,
    law_columns,
    law_error_basis,
    number_error_columns,
    strongest,
)
from pliant.diagnosis.law_posterior import LawError, LawErrorPrior, Whitener
from pliant.diagnosis.readings import ReadingVector
from pliant.errors import ImpossibleEffectError, UserError
from pliant.evidence.measured_model import MeasuredModel
from pliant.interfaces.effect import EffectConfig
from pliant.least_squares import Point, Steps, descend
from pliant.pipeline.remote import code_of, other_version, registry_with
from pliant.records.design import Array
from pliant.registry.files import FILE_MODULE, effect_files

STEP = 1e-4
MOST_ITERATIONS = 20
TRIAL_ITERATIONS = 4
# For starts that are near the optimum: best in coarser steps, or with another error of the law.
NEAR_ITERATIONS = 6
STEPS = Steps(
    most=MOST_ITERATIONS,
    tries=6,
    harder=6.0,
    easier=5.0,
    least_damping=1e-9,
    least_gain=1e-5,
    least_promise=1e-6,
    proven_promise=1e-4,
)
# Trials only decide which start is continued: they end where little is left to gain.
TRIAL_STEPS = replace(STEPS, most=TRIAL_ITERATIONS, enough=5e-4)
# Maximum number of floats in the cached points.
MOST_KEPT = 8_000_000
# Maximum number of refinements of a fit.
MOST_REFINED = 2
# An error of the integration below this share of the noise floor is negligible.
NEGLIGIBLE = 0.1
# Starts without an equilibrium are moved toward neutral strengths and typical shapes by this factor.
NEAR_NOTHING = 0.05
# Maximum change of a reading with a parameter, in noise floors; more is a joint that is about to fold.
STEEPEST = 1e9
# Share of the readings at which a trial may lose its equilibrium and still be compared.
MOST_LOST = 0.02
# A strength below this share of the largest plausible one is near neutral.
NEAR_NEUTRAL = 0.2
# Fits whose slopes cost as much as predictions: they end at gains that no evidence turns on, and ask for few slopes.
SPARING_STEPS = replace(STEPS, tries=4, least_gain=1e-4, least_promise=1e-5, proven_promise=0.0, secant=0.1)


def exclusion_reason(error: UserError) -> str:
    """Return why an effect is left out, without its plugin's advice on a study."""
    return error.reason if isinstance(error, ImpossibleEffectError) else str(error)


class Fitter:
    """A fitter of candidates to one measurement; `weights` (N,) exclude readings from the cost but not from the run."""

    def __init__(
        self,
        predictor: MeasuredModel,
        readings: ReadingVector,
        weights: Array | None = None,
        law: LawReference | None = None,
    ) -> None:
        self.predictor, self.readings, self.law = predictor, readings, law
        self.weights = np.ones(len(readings)) if weights is None else weights
        self._seen: dict[tuple[object, ...], _LinearPoint] = {}
        self._lock = Lock()  # fits may run in threads
        self.code: tuple[tuple[str, ...], str] = (), ""  # modules and their fingerprint, if it is compared

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the state for a worker: without cached points, and with the files of the user's own effects."""
        files = effect_files(self.predictor.context.registry)
        model = pickle.dumps((self.predictor, self.readings, self.weights, self.law))
        return _arrived, (files, self.code, model)

    @property
    def joint_law(self) -> LawReference | None:
        """Return the error of the joint law; None without one, also where it is that of a model's own numbers."""
        return self.law if self.law is not None and self.law.basis is not None else None

    def with_law_error(self, nothing: EffectFit, prior: LawErrorPrior, n_effective: float) -> Fitter:
        """Return a fitter with the law's error in every hypothesis; itself if these runs cannot show one.

        Args:
            nothing: the unchanged model.
            prior: of the error's size.
            n_effective: independent readings.
        """
        if not np.isfinite(nothing.raw).all():
            return self
        basis = law_error_basis(self.predictor)
        if basis is None:
            found = number_error_columns(self.predictor.refined(nothing.parts), self.readings, prior.most)
            reference = None if found is None else LawReference(None, prior, found, n_effective)
            return Fitter(self.predictor, self.readings, self.weights, reference)
        columns = self._law_columns(nothing.candidate, nothing.x, nothing.parts, basis)
        if columns is None:
            return self
        kept, felt = strongest(basis, columns, prior.most)
        if not len(kept):
            return self
        reference = LawReference(kept, prior, felt, n_effective)
        return Fitter(self.predictor, self.readings, self.weights, reference)

    def _law_columns(self, candidate: EffectSet, x: Array, parts: int, basis: LawErrorBasis) -> Array | None:
        return law_columns(self.predictor.refined(parts), self.readings, candidate.configs(x), basis)

    def checked(self) -> None:
        """Make workers that receive the fitter from now on compare their code with ours."""
        registry = self.predictor.context.registry
        effects = (one.implementation for one in registry.components if one.interface == "effect")
        modules = {__name__, *self.predictor.modules, *(place.partition(":")[0] for place in effects)}
        shipped = tuple(sorted(name for name in modules if not name.startswith(FILE_MODULE)))
        self.code = shipped, code_of(shipped)

    def fit_from(self, asked: tuple[EffectSet, Sequence[Array], int, bool, int | None]) -> EffectFit:
        """Call `fit` with these arguments as one item of a `JobQueue`; raise `UserError` if the code differs.

        The law's error has its sensitivities at the unchanged model; `with_own_law_error_from` gives the fit its own.
        """
        self._check_code()
        candidate, starts, parts, refine, iterations = asked
        return self.fit(candidate, starts, parts, refine, own_law_error=False, iterations=iterations)

    def with_own_law_error_from(self, fit: EffectFit) -> EffectFit:
        """Call `with_own_law_error` as one item of a `JobQueue`, as `fit_from`."""
        self._check_code()
        return self.with_own_law_error(fit)

    def evaluate_from(self, asked: tuple[EffectSet, Array, int]) -> EffectFit:
        """Call `evaluate` with these arguments, in the same way."""
        self._check_code()
        return self.evaluate(*asked)

    def residual_from(self, asked: tuple[EffectSet, Array, int]) -> Array:
        """Return (N,) the residual of a candidate at x without slopes, in the same way; NaN without a state."""
        self._check_code()
        candidate, x, parts = asked
        return self._misfit(candidate, parts, None).residual_at(x).residual

    def stronger_end_from(self, asked: tuple[EffectSet, Sequence[Array], EffectFit]) -> Array:
        """Call `stronger_end` with these arguments, in the same way."""
        self._check_code()
        return self.stronger_end(*asked)

    def promise_from(self, asked: tuple[EffectSet, Array, int]) -> float:
        """Call `promise` with these arguments, in the same way."""
        self._check_code()
        return self.promise(*asked)

    def check_applicable(self, asked: tuple[EffectSet, Array]) -> str:
        """Return why a candidate is not applicable to this chain, in the plugin's words; empty if it is."""
        self._check_code()
        candidate, x = asked
        try:
            if self.predictor.costly_slopes:
                self.predictor.check(candidate.configs(x))
            else:
                self.evaluate(candidate, x)
        except UserError as error:
            return exclusion_reason(error)
        return ""

    def _check_code(self) -> None:
        modules, code = self.code
        if code and code_of(modules) != code:
            raise other_version("")

    def fit(
        self,
        candidate: EffectSet,
        starts: Sequence[Array] | None = None,
        parts: int = 1,
        refine: bool = True,
        law: LawError | None = None,
        own_law_error: bool = True,
        iterations: int | None = None,
    ) -> EffectFit:
        """Return the best of fits from several starts; short trials decide which one is finished.

        If the model has no equilibrium at any start the fit contains NaN, and its mean square is infinite.

        Args:
            candidate: what is fitted.
            starts: points (k,); the candidate's own by default.
            parts: steps of the integration from sample to sample.
            refine: continue in finer steps from there, if they change the prediction.
            law: sensitivities and size of the law's error for the fit; its own by default.
            own_law_error: whether a fit without `law` gets the sensitivities at its own point at the end.
            iterations: steps at most; `MOST_ITERATIONS` by default.
        """
        found = self._fit(candidate, starts or candidate.starts(), parts, law, iterations)
        found = self._in_finer_steps(found, law) if refine else found
        return self.with_own_law_error(found) if law is None and own_law_error else found

    def refined(self, fit: EffectFit) -> EffectFit:
        """Return a fit continued in finer steps if they change the prediction, with its own law error."""
        return self.with_own_law_error(self._in_finer_steps(fit, None))

    def refined_from(self, fit: EffectFit) -> EffectFit:
        """Call `refined` as one item of a `JobQueue`, as `fit_from`."""
        self._check_code()
        return self.refined(fit)

    def _in_finer_steps(self, fit: EffectFit, law: LawError | None) -> EffectFit:
        for _ in range(MOST_REFINED if np.isfinite(fit.mean_square()) else 0):
            finer = self.steps(fit.candidate.configs(fit.x), fit.parts)
            if finer == fit.parts:
                break
            fit = self._fit(fit.candidate, [fit.x], finer, law, NEAR_ITERATIONS)
        return fit

    def with_own_law_error(self, fit: EffectFit) -> EffectFit:
        """Return the fit with the sensitivities and the size of the law's error at its own point."""
        if self.law is None or self.law.basis is None or fit.law is None:
            return fit
        own = self._law_columns(fit.candidate, fit.x, fit.parts, self.law.basis)
        if own is None:
            return fit
        plain = replace(fit, residual=fit.raw, law=None)
        first = add_law_error(plain, own, self.law.prior, self.law.n_effective)
        if len(fit.candidate):
            again = self._fit(fit.candidate, [fit.x], fit.parts, first.law, NEAR_ITERATIONS)
            plain = replace(again, residual=again.raw, law=None)
        if not np.isfinite(plain.residual).all():
            return fit
        return add_law_error(plain, own, self.law.prior, self.law.n_effective)

    def refit_from(self, fit: EffectFit, near: Sequence[Mapping[str, float]]) -> EffectFit:
        """Return the fit, or one that begins at the best of some smaller fits if it has a lower cost.

        A smaller model is the larger one with the other effects at their neutral strength, x = 0: no descent from there
        ends above it, while starts in the middle of the plausible range may end in a worse minimum.

        Args:
            fit: from the usual starts.
            near: x by ``kind.name`` (`EffectFit.named`); parameters that are not named are neutral.
        """
        names = [parameter.name for parameter in fit.candidate.parameters]
        points = [np.array([known.get(name, 0.0) for name in names]) for known in near if known]
        looked = [self.evaluate(fit.candidate, x, fit.parts) for x in points]
        best = min(looked, key=lambda one: one.cost(self.weights), default=fit)
        if not best.cost(self.weights) < fit.cost(self.weights):
            return fit
        again = self.fit(fit.candidate, [best.x], fit.parts)
        return again if again.cost(self.weights) < fit.cost(self.weights) else fit

    def steps(self, effects: Sequence[EffectConfig], least: int = 1) -> int:
        """Return the steps from sample to sample whose error is small compared with the noise."""
        close = {name: NEGLIGIBLE * scale for name, scale in self.readings.scales.items()}
        return self.predictor.steps_between_samples(effects, least, close)

    def _fit(
        self,
        candidate: EffectSet,
        tried: Sequence[Array],
        parts: int,
        law: LawError | None = None,
        iterations: int | None = None,
    ) -> EffectFit:
        if not len(candidate):
            return self.evaluate(candidate, np.zeros(0), parts, law)
        misfit = self._misfit(candidate, parts, law)
        if self.predictor.costly_slopes:
            # few iterations: an effect that explains little, whose shape does not matter much
            middle = [np.mean(tried, axis=0)] if iterations is not None else tried
            tried = [self._most_promising(misfit, middle)]
        # Which start is the best one shows in the coarsest steps.
        coarse = self._misfit(candidate, 1, law) if len(tried) > 1 else misfit
        points = [self._start(coarse, x) for x in tried]
        if not any(np.isfinite(point.cost) for point in points):  # none that far out: begin near neutral
            points = [self._start(coarse, NEAR_NOTHING * x) for x in tried]
        if len(points) > 1:
            points = [self._descend(coarse, point, TRIAL_STEPS)[0] for point in points]
        best = min(points, key=lambda point: point.cost)
        if coarse.parts != misfit.parts:
            best = self._start(misfit, best.x)
        steps = SPARING_STEPS if self.predictor.costly_slopes else STEPS
        most = MOST_ITERATIONS if iterations is None else iterations
        point, converged = self._descend(misfit, best, replace(steps, most=most))
        low, high = candidate.limits()
        margin = 1e-6 * (1.0 + np.abs(point.x))
        at_limit = tuple(((point.x - low) < margin) | ((high - point.x) < margin))
        return self._at(misfit, point, converged, at_limit, law)

    def _most_promising(self, misfit: _ReadingMisfit, tried: Sequence[Array]) -> Array:
        """Return the start with the lowest cost, without slopes.

        The strength of an effect alone is scaled to what the change that it makes there would need, to first order: a
        start far too strong says little of its shape.
        """
        candidate = misfit.candidate
        strengths = np.array(
            [one.is_strength and one.declared.prior == "normal" for one in candidate.parameters]
        )
        ends = candidate.limits()
        plain = misfit.residual_without_neutral(np.where(strengths, 0.0, tried[0]))
        points: list[Point] = []
        for x in tried:
            point = misfit.residual_at(x)
            points.append(point)
            change = plain - point.residual
            if not np.isfinite(point.cost) or not np.isfinite(change).all() or not change.any():
                continue
            share = float(change @ plain) / float(change @ change)
            scaled = np.clip(np.where(strengths, share * x, x), *ends)
            if np.abs(scaled - x).max(initial=0.0) > STEP:
                points.append(misfit.residual_at(scaled))
        return min(points, key=lambda point: point.cost).x

    def evaluate(
        self, candidate: EffectSet, x: Array, parts: int = 1, law: LawError | None = None
    ) -> EffectFit:
        """Return the candidate at x without fitting; `law` as for `fit`."""
        misfit = self._misfit(candidate, parts, law)
        return self._at(misfit, self._start(misfit, x), True, (False,) * len(x), law)

    def promise(self, candidate: EffectSet, x: Array, parts: int = 1) -> float:
        """Return the cost after one step within bounds from x, to first order; infinite without an equilibrium."""
        misfit = self._misfit(candidate, parts, None)
        try:
            point = self._start(misfit, x)
        except UserError:
            return float("inf")
        if not np.isfinite(point.cost):
            return float("inf")
        low, high = candidate.limits()
        pulls = np.array([parameter.pull for parameter in candidate.parameters])
        normal = point.slopes.T @ point.slopes + np.diag(pulls)
        step = np.linalg.solve(normal, point.slopes.T @ point.residual - pulls * point.x)
        step = np.clip(point.x + step, low, high) - point.x
        left = point.residual - point.slopes @ step
        return float(left @ left)

    def stronger_end(self, candidate: EffectSet, ends: Sequence[Array], nothing: EffectFit) -> Array:
        """Return the end (k,) of a plausible range at which the readings change most, without slopes.

        An end that is near the neutral strength is not simulated.
        """
        strengths = np.abs(np.array(ends)[:, np.ptp(ends, axis=0) > 0.0]).max(axis=1, initial=0.0)
        tried = [e for e, size in zip(ends, strengths, strict=True) if size >= NEAR_NEUTRAL * strengths.max()]
        if len(tried) == 1:
            return tried[0]
        misfit = self._misfit(candidate, nothing.parts, None)
        changes = [nothing.raw - misfit.residual_at(end).residual for end in tried]
        sizes = [
            float(np.nanmean(one**2)) if 2 * np.isfinite(one).sum() > len(one) else 0.0 for one in changes
        ]
        return tried[int(np.argmax(sizes))]

    def whitened(self, values: Array) -> Array:
        """Return (N,) or (N, k) of readings with the possible changes by a law error of the usual size removed."""
        if self.law is None:
            return values
        return self.law.whitener.apply(values)

    def _misfit(self, candidate: EffectSet, parts: int, law: LawError | None) -> _ReadingMisfit:
        if law is not None:
            return _ReadingMisfit(
                self, candidate, parts, Whitener.from_sensitivities(law.columns, law.precision)
            )
        if self.law is not None:
            return _ReadingMisfit(self, candidate, parts, self.law.whitener)
        return _ReadingMisfit(self, candidate, parts)

    def _at(
        self,
        misfit: _ReadingMisfit,
        point: _LinearPoint,
        converged: bool,
        at_limit: tuple[bool, ...],
        law: LawError | None,
    ) -> EffectFit:
        """Return the fit at a point, with the law's error of the given size, or estimated."""
        white, residual, slopes = misfit.whitener, point.residual, point.slopes
        if white is not None and np.isfinite(point.cost):
            residual, slopes = white.undo(residual), white.undo(slopes)
        fit = EffectFit(misfit.candidate, point.x, residual, slopes, converged, at_limit, misfit.parts)
        if white is None or not np.isfinite(point.cost):
            return fit
        if law is not None:
            coefficient = np.asarray(np.linalg.solve(law.normal, law.columns.T @ residual), float)
            held = replace(law, coefficient=coefficient)
            return replace(fit, residual=residual - held.change, law=held)
        assert self.law is not None
        return add_law_error(fit, self.law.columns, self.law.prior, self.law.n_effective)

    def _start(self, misfit: _ReadingMisfit, x: Array) -> _LinearPoint:
        """Return the point, cached: an evaluated point is often the start of a fit."""
        candidate = misfit.candidate
        low, high = candidate.limits()
        held = tuple(np.flatnonzero(low == high).tolist())
        effects = repr(candidate.configs(x))
        key = (candidate.kinds, candidate.forms, effects, x.tobytes(), held, misfit.parts)
        with self._lock:
            known = self._seen.pop(key, None)
        point = known or misfit.raw_point(x)
        with self._lock:
            self._seen[key] = point
            while sum(p.residual.size + p.slopes.size for p in self._seen.values()) > MOST_KEPT:
                self._seen.pop(next(iter(self._seen)))
        return misfit.whitened(point)

    def _descend(
        self, misfit: _ReadingMisfit, point: _LinearPoint, steps: Steps
    ) -> tuple[_LinearPoint, bool]:
        if not np.isfinite(point.cost):
            return point, False
        found, converged = descend(
            misfit, point, steps, misfit.candidate.limits(), self.weights, misfit.pulls
        )
        if found.slopes is None:  # too many readings without a slope
            return misfit.point_with_slopes(found.x), False
        return cast(_LinearPoint, found), converged


def _arrived(files: tuple[str, ...], code: tuple[tuple[str, ...], str], model: bytes) -> Fitter:
    registry_with(files)
    fitter = Fitter(*pickle.loads(model))
    fitter.code = code
    return fitter


class _LinearPoint(Point):
    """A point with known slopes."""

    slopes: Array


@dataclass(frozen=True, eq=False)
class _ReadingMisfit:
    """Readings minus the predictions of a candidate, with the engine's own derivatives.

    With a `whitener`, the possible changes of the readings by the law's own error are removed from both.
    """

    fitter: Fitter
    candidate: EffectSet
    parts: int
    whitener: Whitener | None = None

    @property
    def pulls(self) -> Array:
        """Return (k,) weights of the prior: zero for strengths."""
        return np.array([0.0 if p.is_strength else p.pull for p in self.candidate.parameters])

    def point(self, x: Array) -> Point:
        """Return residuals and slopes at x; an infinite cost where the model has no equilibrium.

        Slopes that cost as much as predictions are left out: `slopes` finds them for points that are kept.
        """
        return (
            self.residual_at(x) if self.fitter.predictor.costly_slopes else self.whitened(self.raw_point(x))
        )

    def point_with_slopes(self, x: Array) -> _LinearPoint:
        """Return residuals and slopes at x."""
        return self.whitened(self.raw_point(x))

    def residual_at(self, x: Array) -> Point:
        """Return residuals at x without slopes; an infinite cost where the model has no equilibrium."""
        residual = self._residual(self.candidate.configs(x))
        lost = ~np.isfinite(residual)
        if lost.mean() > MOST_LOST:
            return Point(x, residual, np.inf)
        residual = np.where(lost, 0.0, residual)
        if self.whitener is not None:
            residual = self.whitener.apply(residual)
        return Point(x, residual, self._cost(x, residual))

    def residual_without_neutral(self, x: Array) -> Array:
        """Return (N,) residuals at x; effects with neutral strengths, which change nothing, are left out."""
        residual = self._residual([one for one in self.candidate.configs(x) if not is_neutral(one)])
        return residual if self.whitener is None else self.whitener.apply(residual)

    def _residual(self, effects: Sequence[EffectConfig]) -> Array:
        readings = self.fitter.readings
        predictor = self.fitter.predictor.refined(self.parts)
        return readings.values - readings.pack(predictor.evaluate(effects).runs)

    def whitened(self, point: _LinearPoint) -> _LinearPoint:
        """Return a point with the possible changes by the law's own error removed."""
        if self.whitener is None or not np.isfinite(point.cost):
            return point
        residual, slopes = self.whitener.apply(point.residual), self.whitener.apply(point.slopes)
        return _LinearPoint(point.x, residual, self._cost(point.x, residual), slopes)

    def _cost(self, x: Array, residual: Array) -> float:
        return float(self.fitter.weights @ residual**2) + float(self.pulls @ x**2)

    def raw_point(self, x: Array) -> _LinearPoint:
        """Return residuals and slopes at x with the unchanged law."""
        readings = self.fitter.readings
        low, high = self.candidate.limits()
        steps = {k: -STEP if x[k] + STEP > high[k] else STEP for k in np.flatnonzero(low < high)}
        towards = [self.candidate.configs(x + step * np.eye(len(x))[k]) for k, step in steps.items()]
        predictor = self.fitter.predictor.refined(self.parts)
        prediction, changes = predictor.vary(self.candidate.configs(x), towards)
        residual = readings.values - readings.pack(prediction.runs)
        slopes = np.zeros((len(residual), len(x)))
        with np.errstate(over="ignore"):
            for (k, step), change in zip(steps.items(), changes, strict=True):
                slopes[:, k] = readings.pack(change) / step
        lost = ~(np.isfinite(residual) & np.all(np.abs(slopes) < STEEPEST, axis=1))
        if lost.any():
            if lost.mean() > MOST_LOST:
                return _LinearPoint(x, residual, np.inf, slopes)
            residual, slopes = np.where(lost, 0.0, residual), np.where(lost[:, None], 0.0, slopes)
        return _LinearPoint(x, residual, self._cost(x, residual), slopes)

    def slopes(self, point: Point) -> Array | None:
        """Return the slopes of the point; None where too many readings have none."""
        if point.slopes is not None:
            return point.slopes
        found = self.point_with_slopes(point.x)
        return found.slopes if np.isfinite(found.cost) else None
