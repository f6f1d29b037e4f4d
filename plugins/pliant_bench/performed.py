"""What was done of a run: its motion in words, its protocol and its minutes, also of a run that was cut short."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pliant.formatting import listed, number, plural, quantity
from pliant.records.design import Array
from pliant.units import si_unit
from pliant_bench.bench import BenchProtocol, BenchRecording

# A motion back by less than this share of an input's planned range is no reversal.
SLACK = 0.02
# More levels than these are told by their range.
MOST_LEVELS = 6


def performed(recording: BenchRecording) -> BenchProtocol:
    """Return the protocol that was performed: the planned one of a complete run, else the inputs that were set."""
    if recording.ending == "complete":
        return recording.protocol
    was_set = np.isfinite(recording.commanded_s)
    return replace(
        recording.protocol,
        words=performed_words(recording),
        time_s=recording.commanded_s[was_set],
        commands={name: values[was_set] for name, values in recording.commands.items()},
    )


def performed_words(recording: BenchRecording) -> str:
    """Return the motion that was performed, in words; the planned words of a complete run."""
    planned = recording.protocol
    if recording.ending == "complete":
        return planned.words
    was_set = np.isfinite(recording.commanded_s)
    if not was_set.any():
        return f"cut short before its first sample, of {number(planned.duration_s, 3)} s"
    moved: list[tuple[str, list[float]]] = []
    still: list[tuple[str, list[float]]] = []
    for name, values in recording.commands.items():
        levels = turning_levels(
            values[was_set], SLACK * max(float(np.ptp(planned.commands.get(name, values))), 1e-12)
        )
        (moved if len(levels) > 1 else still).append((name, levels))
    said = [f"{name} went {_path(levels, si_unit(name))}" for name, levels in moved]
    said += [f"{name} stayed at {quantity(levels[0], si_unit(name), 3)}" for name, levels in still]
    after = f"{number(float(recording.commanded_s[was_set][-1]), 3)} of {number(planned.duration_s, 3)} s"
    vented = ", then it was vented" if recording.ending == "stopped" else ""
    return f"cut short after {after}: {listed(said)}{vented}"


def performed_minutes(recording: BenchRecording, planned_minutes: float) -> float:
    """Return the minutes of the run with setting up: the planned ones less the motion that was not performed."""
    if recording.ending == "complete":
        return planned_minutes
    last_s = float(np.nanmax(recording.commanded_s, initial=0.0))
    return planned_minutes - max(recording.protocol.duration_s - last_s, 0.0) / 60.0


def turning_levels(values: Array, slack: float) -> list[float]:
    """Return the first value, every level at which the motion turned back by more than `slack`, and the last value."""
    levels, extreme, direction = [float(values[0])], float(values[0]), 0.0
    for value in values[1:].tolist():
        if direction == 0.0 and abs(value - levels[0]) > slack:
            direction, extreme = float(np.sign(value - levels[0])), value
        elif direction * (value - extreme) > 0.0:
            extreme = value
        elif direction * (extreme - value) > slack:
            levels.append(extreme)
            direction, extreme = -direction, value
    if direction != 0.0:
        levels.append(extreme)
    return levels


def _path(levels: list[float], unit: str) -> str:
    """Return levels in words: ``from 0 Pa to 5 kPa and 1 kPa``."""
    if len(levels) > MOST_LEVELS:
        low, high = (quantity(value, unit, 3) for value in (min(levels), max(levels)))
        return f"{plural(len(levels) - 1, 'time')} between {low} and {high}"
    first, *rest = (quantity(value, unit, 3) for value in levels)
    return f"from {first} to {', '.join(rest)}"
