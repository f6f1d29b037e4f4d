"""What a bench writes down wrongly: payloads that are not what their label says, and clocks that disagree.

A protocol is what stands in the file. `done` returns what was done: the runs that the truth follows. The clock is that
of the readings; the inputs (drive, load, valve) were logged by another one, so that a reading at t belongs to the
inputs that stand at t − late(t). Inputs are straight lines between samples and are shifted as such: the truth follows
them on a finer clock, and the samples of the file are kept.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from benchmarks.evidence.protocols import Protocol, Run

FINE_S = 0.04
# Runs are late by unlike amounts: the cosine of the run's number in golden angles.
GOLDEN_RAD = 2.399963


@dataclass(frozen=True)
class BenchError:
    """The defaults are a bench without errors.

    Attributes:
        label_factor: by how much every payload is heavier than its label, over the label.
        label_hook: what hangs on every loaded run beside the payload, over the largest label.
        label_run: number of the loaded run, from 1, whose payload is off; label_run_off: by how much, over its label.
        label_level: by how much all payloads of the largest label are off, over it.
        clock_late_s: by how much the readings are late after the inputs.
        clock_drift: by how much more per second of a run; clock_session: per second of the session.
        clock_jitter: by how much one run is later than another, over `clock_late_s`.
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
    """The runs as they were done, of those that are written down."""
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
    """The run with inputs that came later than they are written down."""
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
