"""White noise of a recording, from third differences, which vanish for smooth signals."""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array

FEWEST = 8  # readings
OUTLIER = 4.0  # differences beyond this number of robust sigmas are steps of the signal, not noise
CORRELATION = 2.3125  # 1 + 2 Σ ρ² of third differences of white noise, ρ = −15/20, 6/20, −1/20


def noise_variance(clock: Array, values: Array) -> tuple[float, float]:
    """Return the variance of the noise between neighbouring readings, and its degrees of freedom.

    Third divided differences at unequal times, scaled to unit variance for white noise, vanish for signals that are
    parabolas over four readings (Gasser, Sroka and Jennen-Steinmetz 1986, "Residual variance and residual pattern in
    nonlinear regression", with second differences), and exclude slow noise. Differences beyond four robust sigmas are
    steps of the signal and are left out.

    Args:
        clock: (t,) increasing.
        values: (t,) finite.

    Returns:
        (nan, 0.0) below 8 readings.
    """
    n = values.size - 3
    if values.size < FEWEST:
        return float("nan"), 0.0
    times = np.stack([clock[k : n + k] for k in range(4)]) / max(float(np.median(np.diff(clock))), 1e-300)
    gaps = times[:, None, :] - times[None, :, :] + np.eye(4)[:, :, None]
    weights = 1.0 / gaps.prod(axis=1)
    readings = np.stack([values[k : n + k] for k in range(4)])
    scaled = (weights * readings).sum(axis=0) / np.sqrt((weights**2).sum(axis=0))
    robust = float(np.median(np.abs(scaled))) / 0.6745
    if robust > 0:
        scaled = scaled[np.abs(scaled) <= OUTLIER * robust]
    return float(np.mean(scaled**2)), scaled.size / CORRELATION
