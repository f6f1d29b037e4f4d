"""Errors of chosen runs over the noise floor."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.measurements.floors import Floor
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.units import si_unit

Residuals = Sequence[Mapping[str, Array]]
# An output without any floor is weighed by this share of its range.
SHARE_OF_RANGE = 0.02


@dataclass(frozen=True)
class Score:
    """Root mean square errors.

    Attributes:
        rmse: by output, SI; outputs without a reading in these runs are left out.
        over_floor: over all outputs, each in units of its floor; NaN where a floor is not known.
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
    total = sum(float(np.sum((values / floors[name].value) ** 2)) for name, values in there.items())
    return Score(
        rmse={name: float(np.sqrt(np.mean(values**2))) for name, values in there.items()},
        over_floor=float(np.sqrt(total / n)) if n else np.nan,
        n=n,
    )


def score_json(found: Score) -> dict[str, dict[str, object]]:
    """By output: rmse and its SI unit."""
    return {name: {"rmse": value, "unit": si_unit(name)} for name, value in found.rmse.items()}


def scales_of(
    measurement: Measurement, floors: Mapping[str, Floor], outputs: Sequence[str]
) -> dict[str, float]:
    """The unit of each output's residuals: its floor, or a share of its range where nothing tells one.

    Outputs without a reading are left out.
    """
    scales = {}
    for name in outputs:
        series: Array = np.concatenate([run.outputs[name] for run in measurement.runs])
        there = series[np.isfinite(series)]
        if not len(there):
            continue
        span, value = float(np.ptp(there)), floors[name].value
        smallest = 1e-6 * max(span, float(np.abs(there).max()))
        scales[name] = value if np.isfinite(value) and value > smallest else (SHARE_OF_RANGE * span or 1.0)
    return scales
