"""Measurement noise: coloured and white within a run, an offset per run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from benchmarks.evidence.robots import Array
from scipy.signal import lfilter


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


def draw(
    spectrum: Spectrum, lengths: Sequence[int], sample_s: float, rng: np.random.Generator
) -> list[Array]:
    """Noise of unit σ for runs of these lengths: (t,) each."""
    return [_one_run(spectrum, n, sample_s, rng) for n in lengths]


def _one_run(spectrum: Spectrum, n: int, sample_s: float, rng: np.random.Generator) -> Array:
    keep = np.exp(-sample_s / spectrum.correlation_s)
    pushes = np.sqrt(1 - keep**2) * rng.standard_normal(n)
    pushes[0] /= np.sqrt(1 - keep**2)  # the first value has the stationary spread
    coloured = lfilter([1.0], [1.0, -keep], pushes)
    within = np.sqrt(spectrum.coloured_share) * coloured
    within += np.sqrt(1 - spectrum.coloured_share) * rng.standard_normal(n)
    noise: Array = within + spectrum.run_offset * rng.standard_normal()
    return noise
