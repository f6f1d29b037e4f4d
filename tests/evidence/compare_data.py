"""Bench data computed from formulas: known inputs, a known model, noise of known colour, effects of known size."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement

KPA = 1e3


def profile(rate_pa_s: float, hold_s: float, dt: float = 0.1, top: float = 15e3, cycles: int = 1):
    """Return time and pressure of ramps up, a pause, ramps down and a rest."""
    ramp = top / rate_pa_s
    corner = np.cumsum([0.0, *([ramp, hold_s, ramp, hold_s] * cycles)])
    level = [0.0, *([top, top, 0.0, 0.0] * cycles)]
    time = np.arange(0.0, corner[-1], dt)
    return time, np.interp(time, corner, level)


def colour(rng, n: int, sigma: float, phi: float):
    """Return stationary first-order autoregressive noise."""
    white = rng.normal(0, sigma * np.sqrt(1 - phi**2), n)
    white[0] = rng.normal(0, sigma)
    return lfilter([1.0], [1.0, -phi], white)


def angle(pressure_pa, moment_n_m=0.0, payload_kg=0.0):
    """Return the angle of a model: softening bend, less under load."""
    return 0.7 * np.tanh(pressure_pa / 20e3) - 2.0 * np.asarray(moment_n_m) - 1.5 * np.asarray(payload_kg)


def bench(
    seed: int = 0,
    *,
    sigma: float = 0.004,
    phi: float = 0.8,
    offset: float = 0.0,
    effect=None,
    repeats: int = 2,
    settings=None,
    n_joints: int = 0,
    dt: float = 0.1,
):
    """Return (measurement, predicted): two rates, two loads, each `repeats` times.

    `effect(history)` is what the model lacks, (t,) rad. `offset` is the standard deviation between runs.
    """
    rng = np.random.default_rng(seed)
    settings = settings or [(r, m) for r in (1.0 * KPA, 5.0 * KPA) for m in (0.0, 0.02)]
    runs, predicted = [], []
    for number, (rate, moment) in enumerate(settings):
        for again in range(repeats):
            time, pressure = profile(rate, 12.0, dt)
            history = History.from_arrays(
                {"pressure_pa": pressure}, time, run=f"r{number}{'abcdef'[again]}", moment_n_m=moment
            )
            truth = angle(pressure, moment) + (effect(history) if effect else 0.0)
            names = [f"joint_{k}_angle_rad" for k in range(1, n_joints + 1)] or ["angle_rad"]
            outputs, model = {}, {}
            for name in names:
                outputs[name] = truth + rng.normal(0, offset) + colour(rng, len(time), sigma, phi)
                model[name] = angle(pressure, moment)
            runs.append(measured_run(history, outputs))
            predicted.append(model)
    return Measurement(tuple(runs), tuple(names)), tuple(predicted)


def measured_run(history, outputs):
    n = len(history)
    return MeasuredRun(history, outputs, {}, np.ones(n), np.arange(n) + 2)


def falling_shift(size: float):
    """Return a friction effect: on the falling branch the readings stay high."""

    def effect(history):
        slope = np.gradient(history.actuation["pressure_pa"], history.time_s)
        return size * (slope < -1.0)

    return effect


def creep(size: float, tau_s: float = 5.0):
    """Return one relaxing branch driven by the model's bend."""

    def effect(history):
        bend = angle(history.actuation["pressure_pa"])
        step = float(history.time_s[1] - history.time_s[0])
        keep = np.exp(-step / tau_s)
        return size / 0.45 * lfilter([1 - keep], [1.0, -keep], bend)

    return effect
