"""Comparison of models by their prediction of unseen readings, independent of their cause.

Two models are compared by the squares of their errors on runs, or blocks of a run, that are left out one after another.
Errors are correlated within a block and hardly between blocks, so the mean difference of the blocks' sums over its
standard error decides whether one predicts better (a paired comparison: Diebold & Mariano, J. Bus. Econ. Stat. 13,
1995). Of the models that predict as well as the best one, within one standard error, the smallest is taken (Breiman et
al., Classification and Regression Trees, 1984).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pliant.diagnosis.evidence_table import NOTHING, Kinds
from pliant.diagnosis.left_out import BLOCKS, assign_blocks, heldout_residual
from pliant.evidence.error_bins import Residuals
from pliant.records.design import Array

if TYPE_CHECKING:
    from pliant.diagnosis.diagnosis import Diagnosis

# Minimum number of blocks of each run.
LEAST_OF_RUN = 2
# A gain in standard errors from which an effect without a named cause is taken, because many are tried.
SURE = 2.5


@dataclass(frozen=True)
class PredictionGain:
    """The reduction of the squares of one model relative to another, on readings that neither fit has seen.

    Attributes:
        share: of the other's sum of squares.
        se: standard error of that share, from block to block.
    """

    share: float
    se: float

    @property
    def sure(self) -> float:
        """Return the gain in standard errors."""
        if self.share <= 0.0:
            return min(self.share / self.se, 0.0) if self.se > 0.0 else 0.0
        return self.share / self.se if self.se > 0.0 else np.inf


def prediction_gain(before: Array, after: Array) -> PredictionGain:
    """Return the gain from two models' sums of squares (B,) per block (`block_squares`)."""
    differences, total = before - after, float(before.sum())
    if not total > 0.0:
        return PredictionGain(0.0, 0.0)
    n = len(differences)
    spread = float(np.std(differences, ddof=1)) * np.sqrt(n) if n > 1 else np.inf
    return PredictionGain(float(differences.sum()) / total, spread / total)


def block_squares(models: Sequence[Residuals], scales: Mapping[str, float]) -> tuple[Array, ...]:
    """Return for each model (B,) sums of squares, in units of the scales, of contiguous parts of every run.

    The parts of a run have equal shares of the mean of duration and squared error of all models: where the models fail
    for a second of a long run, that second is several parts. The borders depend on the sum of the models' squares and
    not on their difference, so that they favour none. Missing readings count 0.
    """
    n_runs = len(models[0])
    parts = max(LEAST_OF_RUN, -(-BLOCKS // n_runs))
    sums = np.zeros((len(models), n_runs, parts))
    for row in range(n_runs):
        squares = np.array([_sample_squares(model[row], scales) for model in models])
        total, n = squares.sum(axis=0), squares.shape[1]
        share = np.full(n, 1.0 / max(n, 1))
        if total.any():
            share = 0.5 * (share + total / total.sum())
        place = np.minimum((parts * (np.cumsum(share) - 0.5 * share)).astype(int), parts - 1)
        sums[:, row] = [np.bincount(place, weights=one, minlength=parts) for one in squares]
    return tuple(one.ravel() for one in sums)


def _sample_squares(run: Mapping[str, Array], scales: Mapping[str, float]) -> Array:
    """Return (t,) sum over outputs of squared residuals over their scales."""
    values = np.array([run[name] / scale for name, scale in scales.items()])
    return np.asarray(np.where(np.isfinite(values), values, 0.0) ** 2).sum(axis=0)


@dataclass(frozen=True)
class BestPrediction:
    """The smallest set of effects that predicts as well as any.

    Attributes:
        kinds: the set.
        gain: over the unchanged model.
        alike: single effects, including its own, that predict as well within their uncertainty; one for a set of
            several.
    """

    kinds: Kinds
    gain: PredictionGain
    alike: Kinds


def best_prediction(diagnosis: Diagnosis, without: Collection[str] = ()) -> BestPrediction | None:
    """Return the best of the fitted sets without these kinds; None if none predicts significantly better."""
    squares = _left_out_squares(
        diagnosis,
        [
            kinds
            for kinds, fit in diagnosis.fits.items()
            if not set(kinds) & set(without) and np.isfinite(fit.mean_square())
        ],
    )
    gains = {
        kinds: prediction_gain(squares[NOTHING], mine) for kinds, mine in squares.items() if kinds != NOTHING
    }
    sure = [kinds for kinds, gain in gains.items() if gain.sure > SURE]
    if not sure:
        return None
    best = min(sure, key=lambda kinds: float(squares[kinds].sum()))
    as_good = [kinds for kinds in sure if prediction_gain(squares[kinds], squares[best]).sure <= 1.0]
    chosen = min(as_good, key=lambda kinds: (len(kinds), float(squares[kinds].sum())))
    alike = sorted(
        (kinds[0] for kinds in as_good if len(kinds) == 1), key=lambda kind: float(squares[(kind,)].sum())
    )
    return BestPrediction(chosen, gains[chosen], tuple(alike) if len(chosen) == 1 else ())


def best_single_effect(diagnosis: Diagnosis, kinds: Collection[str], usual: str) -> str:
    """Return the single effect that predicts best, if it does so beyond its uncertainty; else the usual one."""
    fitted = [
        kind for kind in kinds if (kind,) in diagnosis.fits and diagnosis.fits[(kind,)].mean_square() < np.inf
    ]
    if usual not in fitted:
        return usual
    alone = _left_out_squares(diagnosis, [(kind,) for kind in fitted])
    squares = {kind: alone[(kind,)] for kind in fitted}
    best = min(fitted, key=lambda kind: float(squares[kind].sum()))
    return best if prediction_gain(squares[usual], squares[best]).sure > 1.0 else usual


def _left_out_squares(diagnosis: Diagnosis, sets: Sequence[Kinds]) -> dict[Kinds, Array]:
    """Return for each set (B,) sums of squares of its errors on runs, or blocks of a run, left out of its fit."""
    readings, plain = diagnosis.readings, diagnosis.fits[NOTHING].residual
    groups = readings.fold if len(np.unique(readings.run)) > 2 else assign_blocks(readings)
    left = [readings.unpack(heldout_residual(diagnosis.fits[kinds], groups, plain)) for kinds in sets]
    return dict(zip(sets, block_squares(left, readings.scales), strict=True)) if left else {}
