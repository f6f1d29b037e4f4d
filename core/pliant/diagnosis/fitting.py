"""EffectFit a candidate to measured readings with the physics in the loop.

Levenberg–Marquardt (`pliant.least_squares`) in the fit parameters' x, with the engine's own derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.candidates import EffectSet
from pliant.evidence.prediction import Predictor
from pliant.least_squares import Point, Steps, descend
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


class Fitter:
    """Fits candidates to one measurement; `weights` (N,) leave readings out of the cost but not of the run."""

    def __init__(self, predictor: Predictor, readings: ReadingVector, weights: Array | None = None) -> None:
        self.predictor, self.readings = predictor, readings
        self.weights = np.ones(len(readings)) if weights is None else weights
        self._seen: dict[tuple[object, ...], _LinearPoint] = {}

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

    def _start(self, candidate: EffectSet, x: Array) -> _LinearPoint:
        """The point, remembered: what is looked at is often where a fit begins."""
        low, high = candidate.limits()
        held = tuple(np.flatnonzero(low == high).tolist())
        key = (candidate.kinds, repr(candidate.configs(x)), x.tobytes(), held)
        point = self._seen.pop(key, None) or _Misfit(self, candidate).point(x)
        self._seen[key] = point
        while sum(p.residual.size + p.slopes.size for p in self._seen.values()) > MOST_KEPT:
            self._seen.pop(next(iter(self._seen)))
        return point

    def _descend(
        self, candidate: EffectSet, point: _LinearPoint, iterations: int
    ) -> tuple[_LinearPoint, bool]:
        if not np.isfinite(point.cost):
            return point, False
        misfit, steps = _Misfit(self, candidate), replace(STEPS, most=iterations)
        found, converged = descend(misfit, point, steps, candidate.limits(), self.weights, misfit.pulls)
        return cast(_LinearPoint, found), converged


class _LinearPoint(Point):
    """A point whose slopes are known."""

    slopes: Array


@dataclass(frozen=True, eq=False)
class _Misfit:
    """Readings less the predictions of a candidate, with the engine's own derivatives."""

    fitter: Fitter
    candidate: EffectSet

    @property
    def pulls(self) -> Array:
        """(k,) weights of the prior: none on strengths."""
        return np.array([0.0 if p.is_strength else PRIOR_WEIGHT for p in self.candidate.parameters])

    def point(self, x: Array) -> _LinearPoint:
        """Residuals and slopes at x; an infinite cost where the model has no equilibrium."""
        readings = self.fitter.readings
        low, high = self.candidate.limits()
        steps = {k: -STEP if x[k] + STEP > high[k] else STEP for k in np.flatnonzero(low < high)}
        towards = [self.candidate.configs(x + step * np.eye(len(x))[k]) for k, step in steps.items()]
        prediction, changes = self.fitter.predictor.vary(self.candidate.configs(x), towards)
        residual = readings.values - readings.pack(prediction.runs)
        slopes = np.zeros((len(residual), len(x)))
        for (k, step), change in zip(steps.items(), changes, strict=True):
            slopes[:, k] = readings.pack(change) / step
        if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(slopes))):
            lost = ~(np.isfinite(residual) & np.all(np.isfinite(slopes), axis=1))
            if lost.mean() > MOST_LOST:
                return _LinearPoint(x, residual, np.inf, slopes)
            residual, slopes = np.where(lost, 0.0, residual), np.where(lost[:, None], 0.0, slopes)
        cost = float(self.fitter.weights @ residual**2) + float(self.pulls @ x**2)
        return _LinearPoint(x, residual, cost, slopes)

    def slopes(self, point: Point) -> Array | None:
        """Those of the point, which has them."""
        return point.slopes
