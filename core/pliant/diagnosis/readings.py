"""Measured readings as one vector in units of their noise floors, and errors of a model in those units."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.evidence.error_bins import Residuals, padded
from pliant.measurements.floors import Floor, noise_floors
from pliant.measurements.repeats import RepeatGroup
from pliant.records.design import Array
from pliant.records.measurement import Measurement

FEWEST_FOLDS = 3
QUARTERS = 4


@dataclass(frozen=True, eq=False)
class ReadingVector:
    """The finite readings, output by output, and run by run within each.

    Attributes:
        outputs: their names, in the vector's order.
        scales: noise floor of each output, in its unit.
        values: (N,) readings over their scales.
        run, output: (N,) index of the run and of the output of each.
        fold: (N,) number of the cross-validation fold: the run; with fewer than `FEWEST_FOLDS` runs,
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
    def from_measurement(
        measurement: Measurement, outputs: Sequence[str], scales: Mapping[str, float]
    ) -> ReadingVector:
        """Return all readings of these outputs that are finite."""
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
        """Return (N,) readings per run by output as a vector, over their scales."""
        return np.concatenate(
            [
                readings[r][name][mask] / self.scales[name]
                for name, masks in zip(self.outputs, self._masks, strict=True)
                for r, mask in enumerate(masks)
            ]
        )

    def unpack(self, vector: Array) -> tuple[dict[str, Array], ...]:
        """Return values per run by output (t,), in the outputs' units; NaN where nothing was read."""
        runs: tuple[dict[str, Array], ...] = tuple({} for _ in range(self.n_runs))
        at = 0
        for name, masks in zip(self.outputs, self._masks, strict=True):
            for r, mask in enumerate(masks):
                n = int(mask.sum())
                runs[r][name] = np.full(len(mask), np.nan)
                runs[r][name][mask] = vector[at : at + n] * self.scales[name]
                at += n
        return runs


# An output without any floor is scaled by this share of its range.
SHARE_OF_RANGE = 0.02


@dataclass(frozen=True)
class Score:
    """Root mean square errors.

    Attributes:
        rmse: by output, SI; outputs without a reading in these runs are left out.
        over_floor: over all outputs, each in units of its floor; NaN if one is unknown, or without readings.
        n: readings.
    """

    rmse: Mapping[str, float]
    over_floor: float
    n: int


def score(residuals: Residuals, floors: Mapping[str, Floor], runs: Collection[int] | None = None) -> Score:
    """Return the error of these runs, of all by default; missing readings do not count."""
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
    """Return readings in units of the floor estimated from a model's residuals, and the floors.

    An output without a known floor is in units of a share of its range; without a reading it is left out.

    Args:
        measurement: the runs.
        residuals: of the model, per run by output (t,).
        groups: repeats, if they are known already.

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
    return ReadingVector.from_measurement(measurement, tuple(scales), scales), floors
