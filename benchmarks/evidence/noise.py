"""Measurement noise: coloured and white within a run, an offset per run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from benchmarks.evidence.robots import Array


@dataclass(frozen=True)
class Spectrum:
    """σ² is split into a first-order autoregressive share and a white one; offsets per run come on top.

    Attributes:
        coloured_share: share of the variance within a run that is coloured.
        correlation_s: its autocorrelation falls to 1/e after this time.
        run_offset: standard deviation of a run's offset, in σ.
    """

    coloured_share: float = 0.5
    correlation_s: float = 4.0
    run_offset: float = 0.25


JUDGED = Spectrum()
# Thresholds are calibrated under another spectrum than they are judged under.
CALIBRATION = Spectrum(coloured_share=0.65, correlation_s=2.5, run_offset=0.2)
SPECTRA = {"judged": JUDGED, "calibration": CALIBRATION}


def draw(spectrum: Spectrum, clocks: Sequence[Array], rng: np.random.Generator) -> list[Array]:
    """Noise of unit σ for runs sampled at these times: (t,) each."""
    return [_one_run(spectrum, clock, rng) for clock in clocks]


def _one_run(spectrum: Spectrum, clock: Array, rng: np.random.Generator) -> Array:
    keep = np.exp(-np.diff(clock) / spectrum.correlation_s).tolist()
    pushes = rng.standard_normal(len(clock)).tolist()
    coloured = [pushes[0]]  # the first value has the stationary spread
    for kept, push in zip(keep, pushes[1:], strict=True):
        coloured.append(kept * coloured[-1] + math.sqrt(1.0 - kept * kept) * push)
    within = np.sqrt(spectrum.coloured_share) * np.array(coloured)
    within += np.sqrt(1 - spectrum.coloured_share) * rng.standard_normal(len(clock))
    noise: Array = within + spectrum.run_offset * rng.standard_normal()
    return noise
