"""Conversions: a planned run to a protocol of the bench and back, a recording to a measured run."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError, closest
from pliant.experiments.planned_run import NEW, PlannedRun
from pliant.measurements.reading import cycles
from pliant.records.design import Array
from pliant.records.history import BASE, FORCES, History
from pliant.records.measurement import MeasuredRun, Measurement
from pliant_bench.bench import BenchProtocol, BenchRecording

VALVE = "valve_open"
# Columns of a history that are no actuation of the model.
LOADS = ("moment_n_m", *FORCES)
CONDITIONS = (*LOADS, *BASE, "temperature_c", "payload_kg")
# A planned run has this many even samples, some after each corner of an input (in sampling periods), and so many more
# that every input is straight between them to within this share of its range.
EVEN, AFTER_CORNER, STRAIGHT = 60, (2, 6, 18), 0.03


def history_from_columns(
    name: str,
    time_s: Array,
    columns: Mapping[str, Any],
    inputs: Collection[str],
    specimen: str = "",
) -> History:
    """Return the history of a run; columns that are no input of the model are loads and conditions.

    Args:
        name: of the run.
        time_s: (t,) from the start of the run.
        columns: values (t,) or constants by the name of their column; an input that is missing is 0.
        inputs: names of the model's inputs.
        specimen: the tested body.

    Raises:
        UserError: a column that is neither an input nor a load or condition.
    """
    known = [*inputs, *(other for other in (*CONDITIONS, VALVE) if other not in inputs)]
    for column in columns:
        if column not in known:
            raise UserError(
                f"Run '{name}' sets '{column}', which the model does not have{closest(column, known)} "
                f"Its inputs are {', '.join(inputs)}."
            )
    n = len(time_s)
    own = {column: values for column, values in columns.items() if column not in inputs}

    def table(names: Sequence[str]) -> Array:
        return np.column_stack([np.broadcast_to(np.asarray(own.get(one, 0.0), float), n) for one in names])

    return History.from_arrays(
        {one: np.broadcast_to(np.asarray(columns.get(one, 0.0), float), n) for one in inputs},
        np.asarray(time_s, float),
        run=name,
        specimen=specimen,
        tip_force_n=table(FORCES),
        base_angles_rad=table(BASE),
        **{one: own[one] for one in ("moment_n_m", "temperature_c", "payload_kg", VALVE) if one in own},
    )


def protocol_history(protocol: BenchProtocol, inputs: Collection[str], specimen: str = "") -> History:
    """Return the history that a protocol asks for; arguments as for `history_from_columns`."""
    columns = {**protocol.conditions, **protocol.commands}
    return history_from_columns(protocol.name, protocol.time_s, columns, inputs, specimen)


def planned_from_protocol(
    protocol: BenchProtocol, inputs: Collection[str], minutes: float, specimen: str = ""
) -> PlannedRun:
    """Return the run for the planner, with fewer samples: evenly spaced ones, and more after each corner of an input.

    Args:
        protocol: the run.
        inputs: names of the model's inputs.
        minutes: of motion and of setting up.
        specimen: the body that was measured.
    """
    body = NEW if protocol.new_specimen else specimen
    history = protocol_history(protocol, inputs, body).at_samples(_thinned(protocol))
    return PlannedRun(protocol.name, protocol.words, history, minutes)


def _thinned(protocol: BenchProtocol) -> NDArray[np.intp]:
    """Return indices of the samples of a planned run."""
    n = len(protocol)
    spans = {name: float(np.ptp(values)) for name, values in protocol.commands.items()}
    moving = [protocol.commands[name] / (STRAIGHT * span) for name, span in spans.items() if span > 0.0]
    even = np.linspace(0, n - 1, min(n, EVEN)).round().astype(int)
    if not moving:
        return even
    corners = _corners(protocol.time_s, np.array(moving))
    after = np.add.outer(corners, AFTER_CORNER).ravel()
    kept: NDArray[np.intp] = np.unique(np.concatenate([even, corners, after[after < n]]))
    return kept


def _corners(clock: Array, signals: Array) -> NDArray[np.intp]:
    """Return the samples between which the signals are straight lines to within 1 (Douglas & Peucker 1973)."""
    kept, open_gaps = {0, len(clock) - 1}, [(0, len(clock) - 1)]
    while open_gaps:
        start, end = open_gaps.pop()
        if end - start < 2:
            continue
        way = (clock[start : end + 1] - clock[start]) / (clock[end] - clock[start])
        lines = signals[:, [start]] + (signals[:, [end]] - signals[:, [start]]) * way
        away = np.abs(signals[:, start : end + 1] - lines).max(axis=0)
        worst = start + int(np.argmax(away))
        if away[worst - start] > 1.0:
            kept.add(worst)
            open_gaps += [(start, worst), (worst, end)]
    return np.array(sorted(kept), dtype=np.intp)


def protocol_from_planned(run: PlannedRun, inputs: Collection[str], period_s: float) -> BenchProtocol | None:
    """Return the protocol of a planned run on the bench's clock; None where a condition changes during the run.

    Args:
        run: of the menu, with a clock.
        inputs: inputs of the bench; loads among them are driven, all others are conditions.
        period_s: sampling period of the bench.
    """
    history = run.history
    if history.time_s is None:
        return None
    start = float(history.time_s[0])
    count = int(np.ceil((history.time_s[-1] - start) / period_s)) + 1
    clock: Array = period_s * np.arange(count, dtype=float)
    commands: dict[str, Array] = {}
    conditions: dict[str, float] = {}
    for name, values in history.signals().items():
        if name in inputs:
            commands[name] = np.asarray(np.interp(clock, history.time_s - start, values), float)
        elif np.ptp(values) > 0.0:
            return None
        elif name in CONDITIONS:
            conditions[name] = float(values[0])
        elif name != VALVE and values[0] != 0.0:
            return None
    for name in (name for name in inputs if name not in commands):  # a supply that the menu leaves alone
        commands[name] = np.zeros(len(clock)) + (1.0 if name == VALVE else 0.0)
    return BenchProtocol(run.name, run.words, clock, commands, conditions, run.new_specimen)


def measured_run(recording: BenchRecording, inputs: Collection[str], specimen: str = "") -> MeasuredRun:
    """Return a recording as a measured run: samples that were read, on the clock of the readings.

    Args:
        recording: the run, also one that was stopped.
        inputs: names of the model's inputs.
        specimen: the tested body.
    """
    read = np.isfinite(recording.read_s)
    before = np.concatenate(
        [[-np.inf], np.maximum.accumulate(np.where(read, recording.read_s, -np.inf))[:-1]]
    )
    kept = np.flatnonzero(read & (recording.read_s > before))
    columns: dict[str, Any] = {name: values[kept] for name, values in recording.commands.items()}
    columns = {**recording.protocol.conditions, **columns}
    clock = recording.read_s[kept]
    history = history_from_columns(recording.protocol.name, clock - clock[:1], columns, inputs, specimen)
    outputs = {name: np.asarray(values, float)[kept] for name, values in recording.readings.items()}
    return MeasuredRun(history, outputs, {}, np.ones(len(kept)), np.zeros(0))


def measurement(runs: Sequence[MeasuredRun], source: str = "the bench") -> Measurement:
    """Return the runs as one measurement, with the numbers of their cycles.

    Written by `pliant.measurements.writing.write_measurement` it is a measurement file.
    """
    outputs = tuple(dict.fromkeys(name for run in runs for name in run.outputs))
    names = list(dict.fromkeys(name for run in runs for name in run.history.actuation))
    low = {name: min(float(run.input(name).min(initial=np.inf)) for run in runs) for name in names}
    high = {name: max(float(run.input(name).max(initial=-np.inf)) for run in runs) for name in names}
    ranges = {name: max(high[name] - low[name], 1e-300) for name in names}
    counted = []
    for run in runs:
        missing = np.full(len(run), np.nan)
        read = {name: run.outputs.get(name, missing) for name in outputs}
        cycle = np.asarray(cycles(run.history, ranges), float)
        counted.append(MeasuredRun(run.history, read, run.sigma, cycle, run.lines))
    return Measurement(tuple(counted), outputs, source)
