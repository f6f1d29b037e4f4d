"""Fit a candidate to measured readings with the physics in the loop.

Levenberg–Marquardt (`pliant.least_squares`) in the fit parameters' x, with the engine's own derivatives.

Errors on runs that a fit has not seen, by leaving them out one after another.

The fit is not repeated: without the readings G the parameters x move by

    dx = (A + λ)⁻¹ (b − λ x),      A = Σ_{i ∉ G} J_iᵀ J_i,      b = Σ_{i ∉ G} J_iᵀ r_i

within their bounds (all at once: Stark & Parker, Comput. Stat. 10, 1995), and leave r_G − J_G dx, exact for a linear
model (Cook & Weisberg 1982, section 2.2.2). The weak prior λ (`FitParameter.pull`) decides only where the other
readings say nothing about a parameter: it then returns to x = 0, the neutral strength or the typical shape, as a fit
without G would have left it.
"""

from __future__ import annotations

import pickle
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.candidates import EffectSet
from pliant.errors import ImpossibleEffectError, UserError
from pliant.evidence.places import Residuals, padded
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import EffectConfig
from pliant.least_squares import Point, Steps, descend
from pliant.measurements.floors import Floor, noise_floors
from pliant.measurements.repeats import RepeatGroup
from pliant.pipeline.remote import code_of, other_version, registry_with
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.registry.files import FILE_MODULE, files_of

FEWEST_FOLDS = 3
QUARTERS = 4


@dataclass(frozen=True, eq=False)
class ReadingVector:
    """Readings that are there, output by output and within each run by run.

    Attributes:
        outputs: their names, in the vector's order.
        scales: noise floor of each output, in its unit.
        values: (N,) readings over their scales.
        run, output: (N,) index of the run and of the output of each.
        fold: (N,) number of the part that is left out together: the run; with fewer than `FEWEST_FOLDS` of them,
            quarters of each run.
    """

    outputs: tuple[str, ...]
    scales: Mapping[str, float]
    values: Array
    run: NDArray[np.intp]
    output: NDArray[np.intp]
    fold: NDArray[np.intp]
    _masks: tuple[tuple[NDArray[np.bool_], ...], ...]

    @staticmethod
    def of(measurement: Measurement, outputs: Sequence[str], scales: Mapping[str, float]) -> ReadingVector:
        """All readings of these outputs that are finite."""
        masks = tuple(tuple(np.isfinite(run.outputs[name]) for run in measurement.runs) for name in outputs)
        pieces, runs, which, quarters = [], [], [], []
        for k, name in enumerate(outputs):
            for r, run in enumerate(measurement.runs):
                piece = run.outputs[name][masks[k][r]] / scales[name]
                n = len(piece)
                pieces.append(piece)
                runs.append(np.full(n, r))
                which.append(np.full(n, k))
                quarters.append(QUARTERS * np.arange(n) // max(n, 1))
        of_run, of_output, quarter = (np.concatenate(v).astype(np.intp) for v in (runs, which, quarters))
        fold = of_run if len(np.unique(of_run)) >= FEWEST_FOLDS else QUARTERS * of_run + quarter
        values = np.concatenate(pieces)
        return ReadingVector(tuple(outputs), dict(scales), values, of_run, of_output, fold, masks)

    def __len__(self) -> int:
        return len(self.values)

    @property
    def n_runs(self) -> int:
        return len(self._masks[0])

    def pack(self, readings: Sequence[Mapping[str, Array]]) -> Array:
        """(N,) of readings per run by output, over their scales."""
        return np.concatenate(
            [
                readings[r][name][mask] / self.scales[name]
                for name, masks in zip(self.outputs, self._masks, strict=True)
                for r, mask in enumerate(masks)
            ]
        )

    def unpack(self, vector: Array) -> tuple[dict[str, Array], ...]:
        """Per run by output (t,), in the outputs' units; NaN where nothing was read."""
        runs: tuple[dict[str, Array], ...] = tuple({} for _ in range(self.n_runs))
        at = 0
        for name, masks in zip(self.outputs, self._masks, strict=True):
            for r, mask in enumerate(masks):
                n = int(mask.sum())
                runs[r][name] = np.full(len(mask), np.nan)
                runs[r][name][mask] = vector[at : at + n] * self.scales[name]
                at += n
        return runs


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


@dataclass(frozen=True, eq=False)
class EffectFit:
    """A candidate at its best parameters.

    Attributes:
        candidate: what was fitted.
        x: (k,) parameters.
        residual: (N,) reading − prediction over the noise floor, with all runs.
        slopes: (N, k) d prediction / dx over the noise floor.
        converged: the last step gained next to nothing.
        at_limit: (k,) the parameter ended on a bound.
        parts: steps of the integration from each sample to the next.
    """

    candidate: EffectSet
    x: Array
    residual: Array
    slopes: Array
    converged: bool
    at_limit: tuple[bool, ...]
    parts: int = 1

    @property
    def values(self) -> dict[str, float]:
        """Parameter values by ``kind.name``."""
        return self.candidate.values(self.x)

    @property
    def named(self) -> dict[str, float]:
        """x by ``kind.name``."""
        return {one.name: float(x) for one, x in zip(self.candidate.parameters, self.x, strict=True)}

    def mean_square(self, weights: Array | None = None) -> float:
        """Mean squared residual, in units of the noise floor's square; infinite without an equilibrium."""
        if weights is None:
            square = float(self.residual @ self.residual) / len(self.residual)
        else:
            square = float(weights @ self.residual**2) / float(weights.sum())
        return square if np.isfinite(square) else np.inf


def reason_of(error: UserError) -> str:
    """Why an effect is left out, without its plugin's advice on a study."""
    return error.reason if isinstance(error, ImpossibleEffectError) else str(error)


class Fitter:
    """Fits candidates to one measurement; `weights` (N,) leave readings out of the cost but not of the run."""

    def __init__(self, predictor: Predictor, readings: ReadingVector, weights: Array | None = None) -> None:
        self.predictor, self.readings = predictor, readings
        self.weights = np.ones(len(readings)) if weights is None else weights
        self._seen: dict[tuple[object, ...], _LinearPoint] = {}
        self._lock = Lock()  # fits may run in threads
        self.code: tuple[tuple[str, ...], str] = (), ""  # modules and their fingerprint, where it is compared

    def __reduce__(self) -> tuple[Any, ...]:
        """As it travels to a worker: without its points, and after the files with effects of the user's own."""
        files = files_of(self.predictor.bench.registry)
        model = pickle.dumps((self.predictor, self.readings, self.weights))
        return _arrived, (files, self.code, model)

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
    ) -> EffectFit:
        """The best of fits from several starts; short trials decide which one is finished.

        Where the model finds no equilibrium at any start the fit holds NaN, and its mean square is infinite.

        Args:
            candidate: what is fitted.
            starts: points (k,); the candidate's own by default.
            parts: steps of the integration from sample to sample.
            refine: go on in finer steps from there, where they change what is predicted.
        """
        found = self._fit(candidate, starts or candidate.starts(), parts)
        for _ in range(MOST_REFINED if refine and np.isfinite(found.mean_square()) else 0):
            effects = candidate.configs(found.x)
            finer = self.steps(effects, found.parts)
            if finer == found.parts:
                break
            found = self._fit(candidate, [found.x], finer)
        return found

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
        best = min(looked, key=lambda one: one.mean_square(self.weights), default=fit)
        if not best.mean_square(self.weights) < fit.mean_square(self.weights):
            return fit
        again = self.fit(fit.candidate, [best.x], fit.parts)
        return again if again.mean_square(self.weights) < fit.mean_square(self.weights) else fit

    def steps(self, effects: Sequence[EffectConfig], least: int = 1) -> int:
        """Steps from sample to sample whose error is small beside the noise."""
        close = {name: NEGLIGIBLE * scale for name, scale in self.readings.scales.items()}
        return self.predictor.steps_between_samples(effects, least, close)

    def _fit(self, candidate: EffectSet, tried: Sequence[Array], parts: int) -> EffectFit:
        if not len(candidate):
            return self.look(candidate, np.zeros(0), parts)
        points = [self._start(candidate, x, parts) for x in tried]
        if not any(np.isfinite(point.cost) for point in points):  # so far out none: begin near nothing
            points = [self._start(candidate, NEAR_NOTHING * x, parts) for x in tried]
        if len(points) > 1:
            points = [self._descend(candidate, point, TRIAL_ITERATIONS, parts)[0] for point in points]
        best = min(points, key=lambda point: point.cost)
        point, converged = self._descend(candidate, best, MOST_ITERATIONS, parts)
        low, high = candidate.limits()
        margin = 1e-6 * (1.0 + np.abs(point.x))
        at_limit = tuple(((point.x - low) < margin) | ((high - point.x) < margin))
        return EffectFit(candidate, point.x, point.residual, point.slopes, converged, at_limit, parts)

    def look(self, candidate: EffectSet, x: Array, parts: int = 1) -> EffectFit:
        """The candidate at x, not fitted."""
        point = self._start(candidate, x, parts)
        return EffectFit(candidate, point.x, point.residual, point.slopes, True, (False,) * len(x), parts)

    def _start(self, candidate: EffectSet, x: Array, parts: int) -> _LinearPoint:
        """The point, remembered: what is looked at is often where a fit begins."""
        low, high = candidate.limits()
        held = tuple(np.flatnonzero(low == high).tolist())
        key = (candidate.kinds, candidate.forms, repr(candidate.configs(x)), x.tobytes(), held, parts)
        with self._lock:
            known = self._seen.pop(key, None)
        point = known or _ReadingMisfit(self, candidate, parts).point(x)
        with self._lock:
            self._seen[key] = point
            while sum(p.residual.size + p.slopes.size for p in self._seen.values()) > MOST_KEPT:
                self._seen.pop(next(iter(self._seen)))
        return point

    def _descend(
        self, candidate: EffectSet, point: _LinearPoint, iterations: int, parts: int
    ) -> tuple[_LinearPoint, bool]:
        if not np.isfinite(point.cost):
            return point, False
        misfit, steps = _ReadingMisfit(self, candidate, parts), replace(STEPS, most=iterations)
        found, converged = descend(misfit, point, steps, candidate.limits(), self.weights, misfit.pulls)
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
    """Readings less the predictions of a candidate, with the engine's own derivatives."""

    fitter: Fitter
    candidate: EffectSet
    parts: int

    @property
    def pulls(self) -> Array:
        """(k,) weights of the prior: none on strengths."""
        return np.array([0.0 if p.is_strength else p.pull for p in self.candidate.parameters])

    def point(self, x: Array) -> _LinearPoint:
        """Residuals and slopes at x; an infinite cost where the model has no equilibrium."""
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
        cost = float(self.fitter.weights @ residual**2) + float(self.pulls @ x**2)
        return _LinearPoint(x, residual, cost, slopes)

    def slopes(self, point: Point) -> Array | None:
        """Those of the point, which has them."""
        return point.slopes


# An output without any floor is weighed by this share of its range.
SHARE_OF_RANGE = 0.02


@dataclass(frozen=True)
class Score:
    """Root mean square errors.

    Attributes:
        rmse: by output, SI; outputs without a reading in these runs are left out.
        over_floor: over all outputs, each in units of its floor; NaN where one is not known, or none.
        n: readings.
    """

    rmse: Mapping[str, float]
    over_floor: float
    n: int


def score(residuals: Residuals, floors: Mapping[str, Floor], runs: Collection[int] | None = None) -> Score:
    """The error of these runs, of all by default; readings that are missing do not count."""
    chosen = range(len(residuals)) if runs is None else sorted(runs)
    series = {
        name: np.concatenate([residuals[k][name] for k in chosen] or [np.zeros(0)]) for name in residuals[0]
    }
    there = {name: values[np.isfinite(values)] for name, values in series.items()}
    there = {name: values for name, values in there.items() if len(values)}
    n = sum(len(values) for values in there.values())
    known = n and all(floors[name].value > 0.0 for name in there)
    squares = (np.sum((there[name] / floors[name].value) ** 2) for name in there) if known else (np.nan,)
    return Score(
        rmse={name: float(np.sqrt(np.mean(values**2))) for name, values in there.items()},
        over_floor=float(np.sqrt(sum(squares) / max(n, 1))),
        n=n,
    )


def readings_over_floor(
    measurement: Measurement, residuals: Residuals, groups: Sequence[RepeatGroup] | None = None
) -> tuple[ReadingVector, dict[str, Floor]]:
    """Readings in units of the floor that a model's residuals show, and the floors.

    An output is in units of a share of its range where nothing tells a floor; without a reading it is left out.

    Args:
        measurement: the runs.
        residuals: of the model, per run by output (t,).
        groups: repeats, where they are known already.

    Raises:
        UserError: no reading that the model has.
    """
    floors = noise_floors(measurement, padded(measurement, residuals), groups)
    outputs, scales = list(residuals[0]), {}
    for name in outputs:
        series: Array = np.concatenate([run.outputs[name] for run in measurement.runs])
        there = series[np.isfinite(series)]
        if not len(there):
            continue
        span, value = float(np.ptp(there)), floors[name].value
        smallest = 1e-6 * max(span, float(np.abs(there).max()))
        scales[name] = value if np.isfinite(value) and value > smallest else (SHARE_OF_RANGE * span or 1.0)
    if not scales:
        raise UserError(f"{measurement.source}: no reading of {', '.join(outputs)} is there.")
    return ReadingVector.of(measurement, tuple(scales), scales), floors
