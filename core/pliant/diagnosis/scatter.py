"""Scatter of single readings about a fitted model: the noise, and the residuals of the fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.noise import NoiseView
from pliant.records.design import Array


@dataclass(frozen=True)
class ReadingScatter:
    """The scatter of single readings of one output about a fitted model, standard deviations in its SI unit.

    Attributes:
        floor: the noise floor; 0 if it is unknown.
        left: root mean square of the fit's residuals, corrected for its parameters.
    """

    floor: float
    left: float


def reading_scatter(
    noise: NoiseView, residuals: Sequence[Mapping[str, Array]], fitted: int
) -> dict[str, ReadingScatter]:
    """Return the scatter of a fit; its parameters are subtracted from the independent readings of all outputs.

    Args:
        noise: estimated from the fit's residuals.
        residuals: of the fit, per run by output (t,), SI.
        fitted: number of parameters.
    """
    more = float(np.sqrt(noise.n_effective / max(noise.n_effective - fitted, 1.0)))
    found = {}
    for name in residuals[0]:
        values = np.concatenate([run[name] for run in residuals])
        there = values[np.isfinite(values)]
        if len(there):
            floor = noise.floors[name].value if name in noise.floors else 0.0
            left = float(np.sqrt(np.mean(there**2))) * more
            found[name] = ReadingScatter(floor if np.isfinite(floor) else 0.0, left)
    return found
