"""Data quality checks of readings: absolute pressure, a wrong zero, sensors that saturate or freeze.

Each check has thresholds so that healthy data raise none: pressures that are held, quantised sensors, specimens that
creep, stick and rest.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from pliant.formatting import number, plural
from pliant.measurements.columns import column_si_unit
from pliant.measurements.plausible import as_key
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import Doubt, MeasuredRun
from pliant_tables.schema import FileColumn

ATMOSPHERE_PA = (98e3, 104.5e3)  # range of the first value of an absolute sensor
HIGH_UP_PA = (60e3, 98e3)  # the same up to 4000 m above sea level, where readings must also begin at zero
BELOW_PA = 3e3  # by which it may fall below its first value
MOVES = 0.02  # of its first value: a pressure with a larger range moves
IDLE = 0.01  # of the range of an input: below it the input is zero
OFF, ALIKE = 0.2, 0.05  # of an output's range: a wrong zero, and the maximum difference between runs in it
STRETCH, SHARE = 8, 0.08  # samples, and share of the run, with a constant value
FINE = 0.02  # of the range: the step of a sensor that is not coarse
EXCURSION = 0.1  # of its range by which another signal moves away and returns meanwhile
BACK = 0.35  # of the excursion by which the return may miss the start
TRAVEL = 0.25  # of its range that the input travels while a sensor is constant
JUMP, TIMES = 0.05, 5.0  # of the range, and of the usual step, by which a frozen sensor resumes
DRIVEN, SETTLED = 0.1, 0.05  # of an input's range: it is on; of a motion: the remainder when it is over
MOTION, FEWEST = 0.5, 4  # of an output's range, and samples, of a motion without changing inputs
MID_MOTION = "begins in the middle of a motion"
FROM_ZERO = re.compile(r"(joint_\d+_)?angle(_[yz])?_rad|elongation_strain")


def sensor_doubts(runs: Sequence[MeasuredRun], columns: Mapping[str, FileColumn], notes: str) -> list[Doubt]:
    """Return doubts about readings and inputs.

    Args:
        runs: as read, SI.
        columns: those of the file by Pliant's name; others (of another logger, of the file's name) are not judged.
        notes: where the user states what the file does not contain.
    """
    doubts: list[Doubt] = []
    for name in runs[0].history.actuation:
        if name in columns and column_si_unit(name) == "Pa":
            doubts += _absolute(runs, columns[name], notes)
    if not doubts:  # an absolute pressure is never zero
        doubts += [
            d for name in runs[0].outputs if name in columns for d in _zero(runs, columns[name], notes)
        ]
    doubts += [
        d for name in runs[0].outputs if name in columns for d in _beginning(runs, columns[name], notes)
    ]
    for name in (*runs[0].history.actuation, *runs[0].outputs):
        if name in columns:
            doubts += _still(runs, name, columns[name], notes)
    return doubts


def quantity_text(value: float, column: FileColumn) -> str:
    """Return a value in SI as the file would have it, with its unit."""
    unit = column.in_unit or column.unit
    return f"{number((value - column.shift) / column.scale if column.scale else value, 5)} {unit}"


def _absolute(runs: Sequence[MeasuredRun], column: FileColumn, notes: str) -> list[Doubt]:
    values = [run.history.actuation[column.name] for run in runs if len(run)]
    begin = float(values[0][0])
    low, high = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
    at_sea = ATMOSPHERE_PA[0] <= begin <= ATMOSPHERE_PA[1]
    high_up = HIGH_UP_PA[0] <= begin < HIGH_UP_PA[1] and _bends_from_zero(runs)
    if not (at_sea or high_up) or low < begin - BELOW_PA or high < (1 + MOVES) * begin:
        return []
    value = quantity_text(begin, column)
    return [
        Doubt(
            column.written,
            "zero",
            f"{column.written} begins at {value} and never falls far below: is it absolute? Then write "
            f"'zero: {{{as_key(column.written)}: {value}}}' into {notes}. Nothing was changed.",
        )
    ]


def _bends_from_zero(runs: Sequence[MeasuredRun]) -> bool:
    """Return whether bends exist and all begin at zero, which excludes a gauge pressure of half an atmosphere."""
    first, bends = runs[0], [name for name in runs[0].outputs if FROM_ZERO.fullmatch(name)]
    values = [first.outputs[name] for name in bends if len(first)]
    return bool(values) and all(abs(v[0]) <= ALIKE * float(np.nanmax(np.abs(v), initial=0.0)) for v in values)


def _zero(runs: Sequence[MeasuredRun], column: FileColumn, notes: str) -> list[Doubt]:
    name = column.name
    if not FROM_ZERO.fullmatch(name):
        return []
    highest = {
        i: max(np.abs(run.history.actuation[i]).max() for run in runs) for i in runs[0].history.actuation
    }
    readings = np.concatenate([run.outputs[name] for run in runs])
    there = readings[np.isfinite(readings)]
    if not len(there):
        return []
    span = float(np.ptp(there))
    begins = []
    for run in runs:
        history = run.history
        rest = all(np.abs(v[0]) <= IDLE * highest[i] for i, v in history.actuation.items())
        if rest and _unloaded(history) and np.isfinite(run.outputs[name][0]):
            begins.append(float(run.outputs[name][0]))
    if not begins or span == 0 or np.ptp(begins) > ALIKE * span or min(map(abs, begins)) < OFF * span:
        return []
    value = quantity_text(float(np.median(begins)), column)
    return [
        Doubt(
            column.written,
            "zero",
            f"{column.written} begins at {value} where every input is zero: if that is the sensor's zero, write "
            f"'zero: {{{as_key(column.written)}: {value}}}' into {notes}. Nothing was changed.",
        )
    ]


def _unloaded(history: History) -> bool:
    """Return whether a run begins without any load that bends it."""
    return (
        not history.tip_force_n[0].any()
        and not history.moment_n_m[0]
        and not history.base_angles_rad[0].any()
        and (history.payload_kg is None or not history.payload_kg[0])
    )


def _beginning(runs: Sequence[MeasuredRun], column: FileColumn, notes: str) -> list[Doubt]:
    """Return a doubt for runs whose first readings travel far under constant inputs: a model begins them at rest."""
    found = settling(runs, column.name)
    if not found:
        return []
    name, (first, end, _) = next(iter(found.items()))
    spans = ", ".join(f"{{run: {run}, end: {number(until, 3)} s}}" for run, (_, _, until) in found.items())
    more = f" ({plural(len(found) - 1, 'more run')} likewise)" if len(found) > 1 else ""
    text = (
        f"{column.written}: run '{name}' {MID_MOTION}, from {quantity_text(first, column)} to "
        f"{quantity_text(end, column)} while its inputs stand still{more}, and a run is taken to begin at rest. "
        f"Write 'exclude: [{spans}]' into {notes}, or record the beginning. Nothing was changed."
    )
    return [Doubt(column.written, "beginning", text)]


def settling(runs: Sequence[MeasuredRun], output: str) -> dict[str, tuple[float, float, float]]:
    """Return runs that settle under constant inputs: the first reading, the last one, and the end time."""
    there = np.concatenate([run.outputs[output] for run in runs])
    span = float(np.ptp(there[np.isfinite(there)])) if np.isfinite(there).any() else 0.0
    signals = runs[0].history.actuation
    highest = {i: max(float(np.abs(run.history.actuation[i]).max()) for run in runs) for i in signals}
    found = {}
    for run in runs:
        time, values = run.history.time_s, run.outputs[output]
        held = _held_from_the_begin(run.history, highest)
        if (
            time is None
            or run.history.let_go is not None
            or held < FEWEST
            or not np.isfinite(values[:held]).all()
        ):
            continue
        end = float(np.median(values[held - max(held // 4, 1) : held]))
        if abs(end - values[0]) > MOTION * span:
            near = np.abs(values[:held] - end) <= SETTLED * abs(end - values[0])
            last = int(np.flatnonzero(~near)[-1]) + 1
            found[run.name] = (float(values[0]), end, float(time[min(last, held - 1)]))
    return found


def _held_from_the_begin(history: History, highest: Mapping[str, float]) -> int:
    """Return how many of the first samples have constant inputs that are on; 0 if none is on."""
    inputs = history.actuation
    if not any(abs(v[0]) > DRIVEN * highest[i] for i, v in inputs.items()):
        return 0
    moved = np.any([np.abs(v - v[0]) > IDLE * highest[i] for i, v in inputs.items()], axis=0)
    count = int(np.argmax(moved)) if moved.any() else len(history)
    return count if _alike(history, 0, count) else 0


def _still(runs: Sequence[MeasuredRun], name: str, column: FileColumn, notes: str) -> list[Doubt]:
    """Return a doubt if a sensor saturates at its largest value or freezes, in the first run where this is visible."""
    is_input = name in runs[0].history.actuation
    if is_input and len(runs[0].history.actuation) > 1:
        return []  # the other inputs also move the outputs
    values = [run.history.actuation[name] if is_input else run.outputs[name] for run in runs]
    there = np.concatenate([v[np.isfinite(v)] for v in values])
    if there.size < 2 * STRETCH or not np.ptp(there):
        return []
    top, span = float(there.max()), float(np.ptp(there))
    if np.diff(np.unique(there)).min() > FINE * span:
        return []
    for run, own in zip(runs, values, strict=True):
        others = run.outputs if is_input else run.history.actuation
        for start, end in _stretches(own):
            if not len(run.lines) or end - start < SHARE * len(own) or not _alike(run.history, start, end):
                continue
            if own[start] == top and any(_comes_back(v, start, end) for v in others.values()):
                kind, what = "saturated", "stands at its largest value,"
            elif not is_input and own[start] != top and _freezes(own, span, start, end, others):
                kind, what = "frozen", "reads exactly"
            else:
                continue
            first, last = run.lines[start], run.lines[end - 1]
            text = (
                f"{column.written} {what} {quantity_text(float(own[start]), column)}, from line {first} to {last}, "
                f"while the rest moves on: if it is {kind}, write "
                f"'exclude: [{{run: {run.name}, lines: [{first}, {last}]}}]' into {notes}. Nothing was changed."
            )
            return [Doubt(column.written, kind, text)]
    return []


def _stretches(values: Array) -> list[tuple[int, int]]:
    """Return start and end of each succession of equal values."""
    cuts = np.flatnonzero(np.diff(values) != 0) + 1  # NaN differs from everything
    ends = [0, *cuts.tolist(), len(values)]
    return [(a, b) for a, b in pairwise(ends) if b - a >= STRETCH]


def _alike(history: History, start: int, end: int) -> bool:
    """Return whether loads and conditions are constant over a stretch."""
    held = [*history.tip_force_n.T, history.moment_n_m, *history.base_angles_rad.T]
    held += [v for v in (history.payload_kg, history.valve_open) if v is not None]
    return all(np.ptp(v[start:end]) == 0 for v in held)


def _comes_back(values: Array, start: int, end: int) -> bool:
    """Return whether a signal moves away in the middle of a stretch and returns to its value at the start."""
    inside = values[start:end]
    whole = values[np.isfinite(values)]
    if not np.isfinite(inside).all() or not whole.size or not np.ptp(whole):
        return False
    away = float(np.max(inside[1:-1]) - max(inside[0], inside[-1]))
    return away > EXCURSION * float(np.ptp(whole)) and abs(inside[0] - inside[-1]) < BACK * away


def _freezes(own: Array, span: float, start: int, end: int, inputs: Mapping[str, Array]) -> bool:
    """Return whether a reading is constant while the input travels, and then jumps to its expected value."""
    if start == 0 or end == len(own) or not np.isfinite(own[end]):
        return False
    travels = any(np.ptp(v) and np.ptp(v[start:end]) > TRAVEL * np.ptp(v) for v in inputs.values())
    moves = np.abs(np.diff(own[np.isfinite(own)]))
    usual = float(np.median(moves[moves > 0])) if (moves > 0).any() else 0.0
    jump = abs(float(own[end] - own[end - 1]))
    return travels and jump > max(JUMP * span, TIMES * usual)
