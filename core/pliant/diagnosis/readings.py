"""Measured readings as one vector in units of the noise floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
