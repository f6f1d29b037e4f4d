"""Which model predicts readings better that its fit has not seen: a question of its own, apart from its name.

Two models are compared by the squares of their errors on runs, or blocks of a run, that are left out one after another.
Within a block errors hang together, between blocks they hardly do, so the mean difference of the blocks' sums over its
standard error says whether one predicts better (a paired comparison: Diebold & Mariano, J. Bus. Econ. Stat. 13, 1995).
Of the models that predict as well as the best one, within one standard error, the smallest is taken (Breiman et al.,
Classification and Regression Trees, 1984).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pliant.diagnosis.evidence_table import NOTHING, Kinds
from pliant.diagnosis.left_out import BLOCKS, blocks_of, heldout_residual
from pliant.evidence.places import Residuals
from pliant.records.design import Array

if TYPE_CHECKING:
    from pliant.diagnosis.diagnosis import Diagnosis

# Blocks of each run at least.
LEAST_OF_RUN = 2
# An effect that nothing names is taken if it predicts better by so many standard errors, for many are tried.
SURE = 2.5


@dataclass(frozen=True)
class PredictionGain:
    """What a model's squares are less than another's, on readings that neither fit has seen.

    Attributes:
        share: of the other's sum of squares.
        se: standard error of that share, from block to block.
    """

    share: float
    se: float

    @property
    def sure(self) -> float:
        """The gain in standard errors."""
        if self.share <= 0.0:
            return min(self.share / self.se, 0.0) if self.se > 0.0 else 0.0
        return self.share / self.se if self.se > 0.0 else np.inf


def prediction_gain(before: Array, after: Array) -> PredictionGain:
    """Of two models' sums of squares (B,) block by block (`block_squares`)."""
    differences, total = before - after, float(before.sum())
    if not total > 0.0:
        return PredictionGain(0.0, 0.0)
    n = len(differences)
    spread = float(np.std(differences, ddof=1)) * np.sqrt(n) if n > 1 else np.inf
    return PredictionGain(float(differences.sum()) / total, spread / total)


def block_squares(residuals: Residuals, scales: Mapping[str, float]) -> Array:
    """(B,) sums of squares, in units of the scales, of contiguous parts of every run; readings that lack count none."""
    parts = max(LEAST_OF_RUN, -(-BLOCKS // len(residuals)))
    sums = np.zeros((len(residuals), parts))
    for row, run in enumerate(residuals):
        for name, scale in scales.items():
            values = run[name]
            place = parts * np.arange(len(values)) // max(len(values), 1)
            squares = np.where(np.isfinite(values), values / scale, 0.0) ** 2
            sums[row] += np.bincount(place, weights=squares, minlength=parts)
    return sums.ravel()


@dataclass(frozen=True)
class BestPrediction:
    """The smallest set of effects that predicts as well as any.

    Attributes:
        kinds: it.
        gain: over the model as it is.
        alike: single effects, its own included, that predict as well as it within their uncertainty; one for a set of
            several.
    """

    kinds: Kinds
    gain: PredictionGain
    alike: Kinds


def best_prediction(found: Diagnosis, without: Collection[str] = ()) -> BestPrediction | None:
    """Of the sets that were fitted, without these kinds; None where none predicts better beyond doubt."""
    squares = {
        kinds: _left_out_squares(found, kinds)
        for kinds, fit in found.fits.items()
        if not set(kinds) & set(without) and np.isfinite(fit.mean_square())
    }
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


def best_of(found: Diagnosis, kinds: Collection[str], usual: str) -> str:
    """Of single effects the one that predicts best, if it does so beyond its uncertainty; else the usual one."""
    fitted = [kind for kind in kinds if (kind,) in found.fits and found.fits[(kind,)].mean_square() < np.inf]
    if usual not in fitted:
        return usual
    squares = {kind: _left_out_squares(found, (kind,)) for kind in fitted}
    best = min(fitted, key=lambda kind: float(squares[kind].sum()))
    return best if prediction_gain(squares[usual], squares[best]).sure > 1.0 else usual


def _left_out_squares(found: Diagnosis, kinds: Kinds) -> Array:
    """(B,) sums of squares of a set's errors on runs, or blocks of a run, left out of its fit."""
    readings, plain = found.readings, found.fits[NOTHING].residual
    groups = readings.fold if len(np.unique(readings.run)) > 2 else blocks_of(readings)
    left = readings.unpack(heldout_residual(found.fits[kinds], groups, plain))
    return block_squares(left, readings.scales)
