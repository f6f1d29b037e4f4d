"""Numbers of a motion in time: decaying swings, the answer to a step, the answer to a sine."""

from __future__ import annotations

import numpy as np

from pliant.records.design import Array

# Samples that the pencil takes; the shares of the largest singular value, and of the largest swing, that still are a
# mode.
MOST_SAMPLES, FAINTEST, SMALLEST = 400, 1e-5, 1e-3


def swings(time_step_s: float, signal: Array) -> list[tuple[float, float]]:
    """Return frequency (Hz, of the damped swing) and damping ratio of each mode in a free motion (t,), slowest first.

    By the matrix pencil: the signal is a sum of decaying exponentials, a constant among them, and the poles are the
    eigenvalues that take its Hankel matrix one sample on (Hua & Sarkar, IEEE Trans. ASSP 38, 1990). Long signals are
    thinned to every k-th sample. Modes that do not swing, grow from noise or are very small are left out.
    """
    every = max(1, len(signal) // MOST_SAMPLES)
    taken = signal[::every]
    count = len(taken) // 2
    if count < 3 or np.ptp(taken) == 0.0 or not np.isfinite(taken).all():
        return []
    hankel = np.lib.stride_tricks.sliding_window_view(taken, count + 1)
    _, sizes, rows = np.linalg.svd(hankel, full_matrices=False)
    kept = rows[sizes > FAINTEST * sizes[0]].T
    poles = np.linalg.eigvals(np.linalg.pinv(kept[:-1]) @ kept[1:])
    powers = poles[None, :] ** np.arange(len(taken))[:, None]
    sizes = np.abs(np.linalg.lstsq(powers, taken.astype(complex), rcond=None)[0])
    swinging = (np.abs(poles) > 0.0) & (poles.imag > 1e-9)
    if not swinging.any():
        return []
    seen = swinging & (sizes >= SMALLEST * sizes[swinging].max())
    rates = np.log(poles[seen]) / (every * time_step_s)
    found = [(float(r.imag / (2 * np.pi)), float(-r.real / abs(r))) for r in rates]
    return sorted(one for one in found if 0.0 <= one[1] < 0.99 and np.isfinite(one[0]))


def step_response(time_s: Array, signal: Array, tail: float = 0.1) -> dict[str, float]:
    """Evaluate a motion (t,) from rest after a step at `time_s[0]`; its final value is the mean of its last share
    `tail`.

    `rise_time_s` from 10 to 90 % of the way, `settling_time_s` after which it stays within 5 %, `overshoot_share`
    beyond the final value. A number that cannot be determined from the record is left out.
    """
    end = float(np.mean(signal[-max(1, int(tail * len(signal))) :]))
    span = end - float(signal[0])
    if span == 0.0 or not np.isfinite(signal).all():
        return {}
    way = (signal - signal[0]) / span
    numbers = {"overshoot_share": max(0.0, float(way.max()) - 1.0)}
    crossed = [_first_time(time_s, way, share) for share in (0.1, 0.9)]
    if crossed[0] is not None and crossed[1] is not None:
        numbers["rise_time_s"] = crossed[1] - crossed[0]
    outside = np.flatnonzero(np.abs(way - 1.0) > 0.05)
    if len(outside) and outside[-1] + 1 < (1.0 - tail) * len(way):
        numbers["settling_time_s"] = float(time_s[outside[-1] + 1] - time_s[0])
    return numbers


def _first_time(time_s: Array, way: Array, share: float) -> float | None:
    """Return the time at which the way first passes a share, interpolated linearly between samples."""
    beyond = np.flatnonzero(way >= share)
    if not len(beyond) or beyond[0] == 0:
        return None
    k = beyond[0]
    part = (share - way[k - 1]) / (way[k] - way[k - 1])
    return float(time_s[k - 1] + part * (time_s[k] - time_s[k - 1]))


def sine_response(time_s: Array, signal: Array, frequency_hz: float) -> tuple[complex, float]:
    """Fit the first harmonic to the last whole periods of the second half; return its complex amplitude and the
    residual.

    The amplitude A is that of Re(A e^{iωt}); the residual is the root mean square of the rest (harmonics, transients).
    """
    periods = max(1, int(0.5 * (time_s[-1] - time_s[0]) * frequency_hz))
    late = time_s > time_s[-1] - periods / frequency_hz
    angle = 2 * np.pi * frequency_hz * time_s[late]
    columns = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], axis=1)
    c, *_ = np.linalg.lstsq(columns, signal[late], rcond=None)
    return complex(c[0], -c[1]), float(np.sqrt(np.mean((signal[late] - columns @ c) ** 2)))
