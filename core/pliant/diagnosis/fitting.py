"""EffectFit a candidate to measured readings with the physics in the loop.

Levenberg–Marquardt (Moré 1978) in the fit parameters' x, with the engine's own derivatives, projected on the bounds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.candidates import EffectSet
from pliant.evidence.prediction import Predictor
from pliant.records.design import Array
from pliant.records.measurement import Measurement

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
                pieces.append(piece)
                runs.append(np.full(len(piece), r))
                which.append(np.full(len(piece), k))
                quarters.append(QUARTERS * np.arange(len(piece)) // max(len(piece), 1))
        of_run = np.concatenate(runs).astype(np.intp)
        whole = len(np.unique(of_run)) >= FEWEST_FOLDS
        return ReadingVector(
            tuple(outputs),
            dict(scales),
            np.concatenate(pieces),
            of_run,
            np.concatenate(which).astype(np.intp),
            of_run if whole else (QUARTERS * of_run + np.concatenate(quarters)).astype(np.intp),
            masks,
        )

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
SMALL_GAIN = 1e-5
# The last step, which promises less than this share of the cost, is taken to first order without the engine.
SMALLEST_PROMISE = 1e-6
# Numbers that points which have been looked at may hold together.
MOST_KEPT = 8_000_000
# A parameter that the data do not feel stays near the middle of its prior: its weight in units of squared residuals.
PRIOR_WEIGHT = 0.1
# Starts are drawn toward neutral strengths and typical shapes by this factor where they have no equilibrium.
NEAR_NOTHING = 0.05
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
    """

    candidate: EffectSet
    x: Array
    residual: Array
    slopes: Array
    converged: bool
    at_limit: tuple[bool, ...]

    @property
    def values(self) -> dict[str, float]:
        """Parameter values by ``kind.name``."""
        return self.candidate.values(self.x)

    def mean_square(self, weights: Array | None = None) -> float:
        """Mean squared residual, in units of the noise floor's square; infinite without an equilibrium."""
        if weights is None:
            square = float(self.residual @ self.residual) / len(self.residual)
        else:
            square = float(weights @ self.residual**2) / float(weights.sum())
        return square if np.isfinite(square) else np.inf


@dataclass(frozen=True, eq=False)
class _Point:
    x: Array
    residual: Array
    slopes: Array
    cost: float


class Fitter:
    """Fits candidates to one measurement; `weights` (N,) leave readings out of the cost but not of the run."""

    def __init__(self, predictor: Predictor, readings: ReadingVector, weights: Array | None = None) -> None:
        self.predictor, self.readings = predictor, readings
        self.weights = np.ones(len(readings)) if weights is None else weights
        self._seen: dict[tuple[object, ...], _Point] = {}

    def fit(self, candidate: EffectSet, starts: Sequence[Array] | None = None) -> EffectFit:
        """The best of fits from several starts; short trials decide which one is finished.

        Where the model finds no equilibrium at any start the fit holds NaN, and its mean square is infinite.
        """
        if not len(candidate):
            point = self._start(candidate, np.zeros(0))
            return EffectFit(candidate, point.x, point.residual, point.slopes, True, ())
        tried = starts or candidate.starts()
        points = [self._start(candidate, x) for x in tried]
        if not any(
            np.isfinite(point.cost) for point in points
        ):  # no equilibrium so far out: begin near nothing
            points = [self._start(candidate, NEAR_NOTHING * x) for x in tried]
        if len(points) > 1:
            points = [self._descend(candidate, point, TRIAL_ITERATIONS)[0] for point in points]
        best = min(points, key=lambda point: point.cost)
        point, converged = self._descend(candidate, best, MOST_ITERATIONS)
        low, high = candidate.limits()
        margin = 1e-6 * (1.0 + np.abs(point.x))
        at_limit = tuple(((point.x - low) < margin) | ((high - point.x) < margin))
        return EffectFit(candidate, point.x, point.residual, point.slopes, converged, at_limit)

    def look(self, candidate: EffectSet, x: Array) -> EffectFit:
        """The candidate at x, not fitted."""
        point = self._start(candidate, x)
        return EffectFit(candidate, point.x, point.residual, point.slopes, True, (False,) * len(x))

    def _start(self, candidate: EffectSet, x: Array) -> _Point:
        """The point, remembered: what is looked at is often where a fit begins."""
        low, high = candidate.limits()
        held = tuple(np.flatnonzero(low == high).tolist())
        key = (candidate.kinds, repr(candidate.configs(x)), x.tobytes(), held)
        point = self._seen.pop(key, None) or self._point(candidate, x)
        self._seen[key] = point
        while sum(p.residual.size + p.slopes.size for p in self._seen.values()) > MOST_KEPT:
            self._seen.pop(next(iter(self._seen)))
        return point

    def _descend(self, candidate: EffectSet, point: _Point, iterations: int) -> tuple[_Point, bool]:
        if not np.isfinite(point.cost):
            return point, False
        low, high = candidate.limits()
        damping = 1e-3
        for _ in range(iterations):
            weighted = point.slopes * self.weights[:, None]
            pulls = self._prior_pulls(candidate)
            normal = weighted.T @ point.slopes + np.diag(pulls)
            gradient = weighted.T @ point.residual - pulls * point.x
            for _ in range(6):
                damped = normal + damping * np.diag(np.diag(normal) + 1e-9)
                step = _projected(damped, gradient, point.x, low, high)
                step = np.clip(point.x + step, low, high) - point.x
                promise = float(step @ (2.0 * gradient - normal @ step))
                if 0.0 <= promise < SMALLEST_PROMISE * point.cost:
                    residual = point.residual - point.slopes @ step
                    return _Point(point.x + step, residual, point.slopes, point.cost - promise), True
                trial = self._point(candidate, np.clip(point.x + step, low, high))
                if trial.cost < point.cost:
                    break
                damping *= 6.0
            else:
                return point, True
            gain, point = point.cost - trial.cost, trial
            damping = max(damping / 5.0, 1e-9)
            if gain < SMALL_GAIN * point.cost:
                return point, True
        return point, False

    def _point(self, candidate: EffectSet, x: Array) -> _Point:
        low, high = candidate.limits()
        free = np.flatnonzero(low < high)
        steps = {k: -STEP if x[k] + STEP > high[k] else STEP for k in free}
        towards = [candidate.configs(x + step * np.eye(len(x))[k]) for k, step in steps.items()]
        prediction, changes = self.predictor.vary(candidate.configs(x), towards)
        residual = self.readings.values - self.readings.pack(prediction.runs)
        slopes = np.zeros((len(residual), len(x)))
        for (k, step), change in zip(steps.items(), changes, strict=True):
            slopes[:, k] = self.readings.pack(change) / step
        if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(slopes))):
            lost = ~(np.isfinite(residual) & np.all(np.isfinite(slopes), axis=1))
            if lost.mean() > MOST_LOST:
                return _Point(x, residual, slopes, np.inf)
            residual, slopes = np.where(lost, 0.0, residual), np.where(lost[:, None], 0.0, slopes)
        pull = float(self._prior_pulls(candidate) @ x**2)
        return _Point(x, residual, slopes, float(self.weights @ residual**2) + pull)

    def _prior_pulls(self, candidate: EffectSet) -> Array:
        return np.array(
            [0.0 if parameter.is_strength else PRIOR_WEIGHT for parameter in candidate.parameters]
        )


def _projected(normal: Array, gradient: Array, x: Array, low: Array, high: Array) -> Array:
    """The damped step among parameters that are not held by a bound that they push against."""
    free = ~(((x <= low) & (gradient < 0)) | ((x >= high) & (gradient > 0)))
    step = np.zeros_like(x)
    if free.any():
        step[free] = np.linalg.solve(normal[np.ix_(free, free)], gradient[free])
    return step
