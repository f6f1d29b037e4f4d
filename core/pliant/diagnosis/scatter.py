"""How single readings scatter about a fitted model: the noise, and what the fit left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.noise import NoiseView
from pliant.records.design import Array


@dataclass(frozen=True)
class ReadingScatter:
    """How single readings of one output lie about a fitted model, standard deviations in its SI unit.

    Attributes:
        floor: the noise floor; 0 where nothing tells it.
        left: root mean square of the fit's residuals, its parameters counted.
    """

    floor: float
    left: float


def scatter_of(
    noise: NoiseView, residuals: Sequence[Mapping[str, Array]], fitted: int
) -> dict[str, ReadingScatter]:
    """Of a fit of so many parameters, which count against the independent readings of all outputs together.

    Args:
        noise: as the fit's residuals show it.
        residuals: of the fit, per run by output (t,), SI.
        fitted: parameters.
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
