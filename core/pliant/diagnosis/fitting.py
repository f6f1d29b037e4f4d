"""Fit a candidate to measured readings with the physics in the loop.

Levenberg–Marquardt (`pliant.least_squares`) in the fit parameters' x, with the engine's own derivatives.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any, cast

import numpy as np

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.effect_fit import EffectFit, add_law_error
from pliant.diagnosis.law_discrepancy import (
    LawErrorBasis,
    LawReference,
    law_columns,
    law_error_basis,
    strongest,
)
from pliant.diagnosis.law_posterior import LawError, LawErrorPrior, Whitener
from pliant.diagnosis.readings import ReadingVector
from pliant.errors import ImpossibleEffectError, UserError
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import EffectConfig
from pliant.least_squares import Point, Steps, descend
from pliant.pipeline.remote import code_of, other_version, registry_with
from pliant.records.design import Array
from pliant.registry.files import FILE_MODULE, files_of

STEP = 1e-4
MOST_ITERATIONS = 20
TRIAL_ITERATIONS = 4
STEPS = Steps(
    most=MOST_ITERATIONS,
    tries=6,
    harder=6.0,
    easier=5.0,
    least_damping=1e-9,
    least_gain=1e-5,
    least_promise=1e-6,
)
# Numbers that points which have been looked at may hold together.
MOST_KEPT = 8_000_000
# A fit is refined so often at most.
MOST_REFINED = 2
# An error of the integration is none below this share of the noise floor.
NEGLIGIBLE = 0.1
# Starts are drawn toward neutral strengths and typical shapes by this factor where they have no equilibrium.
NEAR_NOTHING = 0.05
# Noise floors by which a reading may change with a parameter; more is a joint that is about to fold.
STEEPEST = 1e9
# Share of the readings at which a trial may lose its equilibrium and still be compared.
MOST_LOST = 0.02


def reason_of(error: UserError) -> str:
    """Why an effect is left out, without its plugin's advice on a study."""
    return error.reason if isinstance(error, ImpossibleEffectError) else str(error)


class Fitter:
    """Fits candidates to one measurement; `weights` (N,) leave readings out of the cost but not of the run."""

    def __init__(
        self,
        predictor: Predictor,
        readings: ReadingVector,
        weights: Array | None = None,
        law: LawReference | None = None,
    ) -> None:
        self.predictor, self.readings, self.law = predictor, readings, law
        self.weights = np.ones(len(readings)) if weights is None else weights
        self._seen: dict[tuple[object, ...], _LinearPoint] = {}
        self._lock = Lock()  # fits may run in threads
        self.code: tuple[tuple[str, ...], str] = (), ""  # modules and their fingerprint, where it is compared

    def __reduce__(self) -> tuple[Any, ...]:
        """As it travels to a worker: without its points, and after the files with effects of the user's own."""
        files = files_of(self.predictor.bench.registry)
        model = pickle.dumps((self.predictor, self.readings, self.weights, self.law))
        return _arrived, (files, self.code, model)

    def with_law_error(self, nothing: EffectFit, prior: LawErrorPrior, n_effective: float) -> Fitter:
        """Return a fitter with the law's error in every hypothesis; itself where these runs cannot show one.

        Args:
            nothing: the model as it is.
            prior: of the error's size.
            n_effective: independent readings.
        """
        basis = law_error_basis(self.predictor)
        if basis is None or not np.isfinite(nothing.raw).all():
            return self
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
        """Workers that it travels to from now on compare their code with ours."""
        registry, backend = self.predictor.bench.registry, self.predictor.backend
        effects = (one.implementation for one in registry.components if one.interface == "effect")
        modules = {__name__, type(backend).__module__, *(place.partition(":")[0] for place in effects)}
        shipped = tuple(sorted(name for name in modules if not name.startswith(FILE_MODULE)))
        self.code = shipped, code_of(shipped)

    def fit_from(self, asked: tuple[EffectSet, Sequence[Array], int, bool]) -> EffectFit:
        """`fit` with these arguments as one item of a `JobQueue`; raises `UserError` where the code is another."""
        self._check_code()
        return self.fit(*asked)

    def look_from(self, asked: tuple[EffectSet, Array, int]) -> EffectFit:
        """`look` with these arguments, in the same way."""
        self._check_code()
        return self.look(*asked)

    def promise_from(self, asked: tuple[EffectSet, Array, int]) -> float:
        """`promise` with these arguments, in the same way."""
        self._check_code()
        return self.promise(*asked)

    def refusal_from(self, asked: tuple[EffectSet, Array]) -> str:
        """Why this chain cannot have a candidate, in the plugin's words, in the same way; empty where it can."""
        self._check_code()
        try:
            self.look(*asked)
        except UserError as error:
            return reason_of(error)
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
    ) -> EffectFit:
        """The best of fits from several starts; short trials decide which one is finished.

        Where the model finds no equilibrium at any start the fit holds NaN, and its mean square is infinite.

        Args:
            candidate: what is fitted.
            starts: points (k,); the candidate's own by default.
            parts: steps of the integration from sample to sample.
            refine: go on in finer steps from there, where they change what is predicted.
            law: sensitivities and size of the law's error that hold for the fit; its own by default.
        """
        found = self._fit(candidate, starts or candidate.starts(), parts, law)
        for _ in range(MOST_REFINED if refine and np.isfinite(found.mean_square()) else 0):
            effects = candidate.configs(found.x)
            finer = self.steps(effects, found.parts)
            if finer == found.parts:
                break
            found = self._fit(candidate, [found.x], finer, law)
        return found if law is not None else self._with_own_law_error(found)

    def _with_own_law_error(self, fit: EffectFit) -> EffectFit:
        """Return the fit beside a law's error with the sensitivities and the size that it has there."""
        if self.law is None or fit.law is None:
            return fit
        own = self._law_columns(fit.candidate, fit.x, fit.parts, self.law.basis)
        if own is None:
            return fit
        plain = replace(fit, residual=fit.raw, law=None)
        first = add_law_error(plain, own, self.law.prior, self.law.n_effective)
        if len(fit.candidate):
            again = self._fit(fit.candidate, [fit.x], fit.parts, first.law)
            plain = replace(again, residual=again.raw, law=None)
        if not np.isfinite(plain.residual).all():
            return fit
        return add_law_error(plain, own, self.law.prior, self.law.n_effective)

    def no_worse(self, fit: EffectFit, near: Sequence[Mapping[str, float]]) -> EffectFit:
        """The fit, or the one that begins at the best of some smaller fits where that leaves less.

        A smaller model is the larger one with the other effects at their neutral strength, x = 0: from there no descent
        ends above it, while starts in the middle of the plausible range may end in a worse valley.

        Args:
            fit: from the usual starts.
            near: x by ``kind.name`` (`EffectFit.named`); parameters that are not named are neutral.
        """
        names = [parameter.name for parameter in fit.candidate.parameters]
        points = [np.array([known.get(name, 0.0) for name in names]) for known in near if known]
        looked = [self.look(fit.candidate, x, fit.parts) for x in points]
        best = min(looked, key=lambda one: one.cost(self.weights), default=fit)
        if not best.cost(self.weights) < fit.cost(self.weights):
            return fit
        again = self.fit(fit.candidate, [best.x], fit.parts)
        return again if again.cost(self.weights) < fit.cost(self.weights) else fit

    def steps(self, effects: Sequence[EffectConfig], least: int = 1) -> int:
        """Steps from sample to sample whose error is small beside the noise."""
        close = {name: NEGLIGIBLE * scale for name, scale in self.readings.scales.items()}
        return self.predictor.steps_between_samples(effects, least, close)

    def _fit(
        self, candidate: EffectSet, tried: Sequence[Array], parts: int, law: LawError | None = None
    ) -> EffectFit:
        if not len(candidate):
            return self.look(candidate, np.zeros(0), parts, law)
        misfit = self._misfit(candidate, parts, law)
        points = [self._start(misfit, x) for x in tried]
        if not any(np.isfinite(point.cost) for point in points):  # so far out none: begin near nothing
            points = [self._start(misfit, NEAR_NOTHING * x) for x in tried]
        if len(points) > 1:
            points = [self._descend(misfit, point, TRIAL_ITERATIONS)[0] for point in points]
        best = min(points, key=lambda point: point.cost)
        point, converged = self._descend(misfit, best, MOST_ITERATIONS)
        low, high = candidate.limits()
        margin = 1e-6 * (1.0 + np.abs(point.x))
        at_limit = tuple(((point.x - low) < margin) | ((high - point.x) < margin))
        return self._at(misfit, point, converged, at_limit, law)

    def look(self, candidate: EffectSet, x: Array, parts: int = 1, law: LawError | None = None) -> EffectFit:
        """The candidate at x, not fitted; `law` as for `fit`."""
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

    def whitened(self, values: Array) -> Array:
        """Return (N,) or (N, k) of readings without what the law's own error of the usual size may do."""
        if self.law is None:
            return values
        return Whitener.of(self.law.columns, self.law.precision).apply(values)

    def _misfit(self, candidate: EffectSet, parts: int, law: LawError | None) -> _ReadingMisfit:
        if law is not None:
            return _ReadingMisfit(self, candidate, parts, Whitener.of(law.columns, law.precision))
        if self.law is not None:
            return _ReadingMisfit(self, candidate, parts, Whitener.of(self.law.columns, self.law.precision))
        return _ReadingMisfit(self, candidate, parts)

    def _at(
        self,
        misfit: _ReadingMisfit,
        point: _LinearPoint,
        converged: bool,
        at_limit: tuple[bool, ...],
        law: LawError | None,
    ) -> EffectFit:
        """Return the fit at a point, with the law's error beside it: that of a size that is given, or estimated."""
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
        """The point, remembered: what is looked at is often where a fit begins."""
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
        self, misfit: _ReadingMisfit, point: _LinearPoint, iterations: int
    ) -> tuple[_LinearPoint, bool]:
        if not np.isfinite(point.cost):
            return point, False
        steps = replace(STEPS, most=iterations)
        found, converged = descend(
            misfit, point, steps, misfit.candidate.limits(), self.weights, misfit.pulls
        )
        return cast(_LinearPoint, found), converged


def _arrived(files: tuple[str, ...], code: tuple[tuple[str, ...], str], model: bytes) -> Fitter:
    registry_with(files)
    fitter = Fitter(*pickle.loads(model))
    fitter.code = code
    return fitter


class _LinearPoint(Point):
    """A point whose slopes are known."""

    slopes: Array


@dataclass(frozen=True, eq=False)
class _ReadingMisfit:
    """Readings less the predictions of a candidate, with the engine's own derivatives.

    With a `whitener`, what the law's own error may do to the readings is taken out of both.
    """

    fitter: Fitter
    candidate: EffectSet
    parts: int
    whitener: Whitener | None = None

    @property
    def pulls(self) -> Array:
        """(k,) weights of the prior: none on strengths."""
        return np.array([0.0 if p.is_strength else p.pull for p in self.candidate.parameters])

    def point(self, x: Array) -> _LinearPoint:
        """Residuals and slopes at x; an infinite cost where the model has no equilibrium."""
        return self.whitened(self.raw_point(x))

    def whitened(self, point: _LinearPoint) -> _LinearPoint:
        """Return a point without what the law's own error may do."""
        if self.whitener is None or not np.isfinite(point.cost):
            return point
        residual, slopes = self.whitener.apply(point.residual), self.whitener.apply(point.slopes)
        return _LinearPoint(point.x, residual, self._cost(point.x, residual), slopes)

    def _cost(self, x: Array, residual: Array) -> float:
        return float(self.fitter.weights @ residual**2) + float(self.pulls @ x**2)

    def raw_point(self, x: Array) -> _LinearPoint:
        """Residuals and slopes at x with the law as it is."""
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
        """Those of the point, which has them."""
        return point.slopes
