"""Errors of a bench's records: payloads that differ from their label, unsynchronised clocks, the study's gravity.

A protocol is the content of the file. `done` returns the runs that were performed and that the truth follows. The clock
is that of the readings; the inputs (drive, load, valve) were logged with another one, so that a reading at t belongs to
the inputs recorded at t − late(t). Inputs are straight lines between samples and are shifted as such: the truth follows
them on a finer clock, and the samples of the file are kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from benchmarks.evidence.protocols import Protocol, Run
from benchmarks.evidence.robots import GRAVITY_M_S2

Vector = tuple[float, float, float]
FINE_S = 0.04
# Runs are late by unlike amounts: the cosine of the run's number in golden angles.
GOLDEN_RAD = 2.399963
# Errors of the bench's records: the effects and the findings about the record that name them.
MISTAKES: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "wrong_payload": (("payload_error",), ("payload",)),
    "wrong_clock": (("clock_offset", "clock_drift"), ("clock",)),
    "wrong_gravity": (("gravity_error",), ("gravity", "orientation")),
}
# They are as large as they are: a planet's gravity is not scaled.
UNSCALED = ("wrong_gravity",)
# Loaded runs of the protocol with payloads.
LOADED_RUNS = 16


@dataclass(frozen=True)
class BenchError:
    """Errors of a bench; the defaults are a bench without errors.

    Attributes:
        label_factor: relative excess of every payload over its label.
        label_hook: additional mass on every loaded run, over the largest label.
        label_run: number of the loaded run, from 1, whose payload is wrong; label_run_off: its error, over its label.
        label_level: error of all payloads of the largest label, over it.
        clock_late_s: delay of the readings relative to the inputs.
        clock_drift: growth of the delay per second of a run; clock_session: per second of the session.
        clock_jitter: variation of the delay between runs, over `clock_late_s`.
    """

    label_factor: float = 0.0
    label_hook: float = 0.0
    label_run: float = 0.0
    label_run_off: float = 0.0
    label_level: float = 0.0
    clock_late_s: float = 0.0
    clock_drift: float = 0.0
    clock_session: float = 0.0
    clock_jitter: float = 0.0


def done(runs: Protocol, error: BenchError) -> Protocol:
    """Return the runs as performed, from those that are recorded."""
    if error == BenchError():
        return runs
    return _shifted(_hung(runs, error), error)


def _hung(runs: Protocol, error: BenchError) -> Protocol:
    largest = max(run.payload_kg for run in runs)
    loaded = [k for k, run in enumerate(runs) if run.payload_kg > 0.0]
    masses = [run.payload_kg for run in runs]
    for number, k in enumerate(loaded, 1):
        label = runs[k].payload_kg
        more = error.label_factor + (error.label_run_off if number == error.label_run else 0.0)
        more += error.label_level if label == largest else 0.0
        masses[k] = max(0.0, label * (1.0 + more) + error.label_hook * largest)
    return tuple(replace(run, payload_kg=kg) for run, kg in zip(runs, masses, strict=True))


def _shifted(runs: Protocol, error: BenchError) -> Protocol:
    if not (error.clock_late_s or error.clock_drift or error.clock_session):
        return runs
    clock, found = 0.0, []
    for number, run in enumerate(runs):
        jitter = 1.0 + error.clock_jitter * np.cos(GOLDEN_RAD * number)
        found.append(_late(run, error.clock_late_s * jitter + error.clock_session * clock, error.clock_drift))
        clock += run.seconds
    return tuple(found)


def _late(run: Run, late_s: float, drift: float) -> Run:
    """Return the run with inputs that are delayed relative to their record."""
    spans = np.diff(run.time_s)
    parts = np.maximum(1, np.rint(spans / FINE_S).astype(int))
    fine = [np.linspace(a, b, n + 1)[1:] for a, b, n in zip(run.time_s, run.time_s[1:], parts, strict=False)]
    time_s = np.concatenate([run.time_s[:1], *fine])
    samples = np.zeros(len(time_s), dtype=bool)
    samples[np.concatenate([[0], np.cumsum(parts)])] = run.kept if run.kept is not None else True
    then = time_s - late_s - drift * time_s
    index = np.clip(np.searchsorted(run.time_s, then, side="left"), 0, len(run) - 1)
    return replace(
        run,
        pressure_pa=np.interp(then, run.time_s, run.pressure_pa),
        moment_n_m=np.interp(then, run.time_s, run.moment_n_m),
        valve_open=None if run.valve_open is None else run.valve_open[index],
        time_s=time_s,
        kept=samples,
    )


def _wrong_payload(s: float, v: Any) -> dict[str, float]:
    if hasattr(v, "one_run"):
        return {"label_run": 1.0 + int(v.at * LOADED_RUNS), "label_run_off": 0.3 * v.sign * s}
    if hasattr(v, "hook"):
        return {"label_hook": 0.3 * s}
    return {"label_level" if hasattr(v, "level") else "label_factor": 0.3 * v.sign * s}


def _wrong_clock(s: float, v: Any) -> dict[str, float]:
    if hasattr(v, "offset"):
        return {"clock_late_s": 0.3 * v.sign * s}
    return {"clock_drift": 2e-3 * v.sign * s} if hasattr(v, "drift") else {"clock_session": 1e-4 * v.sign * s}


def _wrong_gravity(s: float, v: Any) -> dict[str, float]:
    real, stated = gravities(v)
    return {
        f"gravity_{axis}_m_s2": (1.0 - s) * one + s * other
        for axis, one, other in zip("xyz", stated, real, strict=True)
    }


def gravities(v: Any) -> tuple[Vector, Vector]:
    """Return the true gravity and the study's gravity, m/s²."""

    def inclined(angle: float) -> Vector:
        across = GRAVITY_M_S2 * np.sin(angle)
        down = -GRAVITY_M_S2 * np.cos(angle)
        x, y, z = (round(float(one), 6) for one in (across * np.cos(v.way), across * np.sin(v.way), down))
        return x, y, z

    return (
        (inclined(v.mounted), (0.0, 0.0, 0.0))
        if hasattr(v, "forgotten")
        else (inclined(0.0), inclined(v.turned))
    )


# The largest strength of each mistake, and its fields at a strength.
MISTAKE_CHANGES: Mapping[str, tuple[float, Callable[[float, Any], dict[str, float]]]] = {
    "wrong_payload": (3.0, _wrong_payload),
    "wrong_clock": (8.0, _wrong_clock),
    "wrong_gravity": (1.0, _wrong_gravity),
}
