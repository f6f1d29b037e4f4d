"""Check of commands against the limits of a bench's inputs: of a whole protocol, and of each command before it is sent.

A *change* is an unbroken motion of a value in one direction; `dwell_s` is the least time between two changes, so that a
limit on it excludes reversals without a hold.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pliant.errors import UserError
from pliant.formatting import number, quantity
from pliant.records.design import Array
from pliant.units import si_unit
from pliant_bench.bench import BenchChannel, BenchProtocol, ChannelLimits

# Differences below this share of the limit are rounding errors.
ROUNDING = 1e-6


@dataclass(frozen=True)
class Violation:
    """The first instant at which a command exceeds a limit.

    Attributes:
        channel: name of the input.
        time_s: of the instant in the run.
        limit: which one: ``range``, ``rate``, ``acceleration``, ``dwell``, ``rest``.
        value, allowed: SI; of ``rest`` the command and the input's rest.
    """

    channel: str
    time_s: float
    limit: str
    value: float
    allowed: float

    def __str__(self) -> str:
        unit = si_unit(self.channel)
        when = f"at {number(self.time_s)} s"
        if self.limit == "range":
            side = "above" if self.value > self.allowed else "below"
            value, allowed = quantity(self.value, unit), quantity(self.allowed, unit)
            return f"{self.channel} is {value} {when}, {side} its limit of {allowed}"
        if self.limit == "rest":
            value, allowed = quantity(self.value, unit), quantity(self.allowed, unit)
            return f"{self.channel} is {value} {when}, where a run has to be at rest ({allowed})"
        if self.limit == "dwell":
            held, allowed = f"{number(self.value)} s", f"{number(self.allowed)} s"
            return f"{self.channel} changes {when} after a hold of {held}; its least dwell is {allowed}"
        per = "/s" if self.limit == "rate" else "/s²"
        value, allowed = (quantity(v, unit) + per for v in (self.value, self.allowed))
        what = "changes by" if self.limit == "rate" else "has an acceleration of"
        return f"{self.channel} {what} {value} {when}; its limit is {allowed}"


def check_protocol(protocol: BenchProtocol, inputs: Sequence[BenchChannel]) -> None:
    """Raise `UserError` with the first violation unless a protocol keeps the limits of all inputs.

    With a limit of rate or acceleration the run has to begin and end at rest.
    """
    run = f"Run '{protocol.name}'"
    times, names = np.asarray(protocol.time_s, float), [channel.name for channel in inputs]
    if len(times) < 2 or not np.all(np.isfinite(times)) or times[0] != 0 or np.any(np.diff(times) <= 0):
        raise UserError(f"{run} needs at least two instants that begin at 0 s and increase.")
    if unknown := sorted(set(protocol.commands) ^ set(names)):
        raise UserError(
            f"{run} and the bench differ in the inputs {', '.join(unknown)}; the bench has {', '.join(names)}."
        )
    for channel in inputs:
        values = np.asarray(protocol.commands[channel.name], float)
        if values.shape != times.shape or not np.all(np.isfinite(values)):
            raise UserError(
                f"{run} needs {len(times)} finite values of {channel.name}, one for each instant."
            )
    firsts = [first_violation(times, protocol.commands[c.name], c) for c in inputs]
    violations = [one for one in firsts if one is not None]
    if violations:
        first = min(violations, key=lambda one: one.time_s)
        raise UserError(f"{run} is not allowed: {first}. Change the run, or the limits of the bench.")


def first_violation(time_s: Array, values: Array, channel: BenchChannel) -> Violation | None:
    """Return the first violation of a path from rest to rest, or None."""
    t, v, limits = np.asarray(time_s, float), np.asarray(values, float), channel.limits
    firsts = [
        _range_violation(t, v, channel.name, limits),
        _too_fast(t, v, channel.name, limits),
        _too_jerky(t, v, channel.name, limits),
        _too_short_hold(t, v, channel.name, limits),
    ]
    if np.isfinite(limits.rate) or np.isfinite(limits.acceleration):
        tolerance = ROUNDING * max(float(np.ptp(v)), abs(channel.rest), 1e-12)
        firsts += [
            Violation(channel.name, float(t[k]), "rest", float(v[k]), channel.rest)
            for k in (0, -1)
            if abs(v[k] - channel.rest) > tolerance
        ]
    violations = [one for one in firsts if one is not None]
    return min(violations, key=lambda one: one.time_s) if violations else None


def _first(bad: NDArray[np.bool_]) -> int | None:
    return int(np.argmax(bad)) if np.any(bad) else None


def _range_violation(t: Array, v: Array, name: str, limits: ChannelLimits) -> Violation | None:
    span = [abs(end) for end in (limits.low, limits.high) if np.isfinite(end)]
    slack = ROUNDING * max(span, default=0.0)
    k = _first((v < limits.low - slack) | (v > limits.high + slack))
    if k is None:
        return None
    allowed = limits.high if v[k] > limits.high else limits.low
    return Violation(name, float(t[k]), "range", float(v[k]), allowed)


def _too_fast(t: Array, v: Array, name: str, limits: ChannelLimits) -> Violation | None:
    rates = np.abs(np.diff(v) / np.diff(t))
    k = _first(rates > limits.rate * (1 + ROUNDING))
    return None if k is None else Violation(name, float(t[k + 1]), "rate", float(rates[k]), limits.rate)


def _too_jerky(t: Array, v: Array, name: str, limits: ChannelLimits) -> Violation | None:
    """Return the first change of slope above the limit; before and after the path the value is at rest."""
    if not np.isfinite(limits.acceleration):
        return None
    steps = np.diff(t)
    steps = np.concatenate([steps[:1], steps, steps[-1:]])
    slopes = np.concatenate([[0.0], np.diff(v) / np.diff(t), [0.0]])
    accelerations = np.abs(np.diff(slopes)) / (0.5 * (steps[1:] + steps[:-1]))
    k = _first(accelerations > limits.acceleration * (1 + ROUNDING))
    if k is None:
        return None
    return Violation(name, float(t[k]), "acceleration", float(accelerations[k]), limits.acceleration)


def _too_short_hold(t: Array, v: Array, name: str, limits: ChannelLimits) -> Violation | None:
    if limits.dwell_s <= 0:
        return None
    steps = np.diff(v)
    directions = np.where(np.abs(steps) > ROUNDING * max(float(np.ptp(v)), 1e-300), np.sign(steps), 0.0)
    moving = np.flatnonzero(directions)
    before, after = moving[:-1], moving[1:]
    holds = t[after] - t[before + 1]
    goes_on = (after == before + 1) & (directions[after] == directions[before])
    k = _first(~goes_on & (holds < limits.dwell_s * (1 - ROUNDING)))
    if k is None:
        return None
    return Violation(name, float(t[after[k] + 1]), "dwell", float(holds[k]), limits.dwell_s)


@dataclass(frozen=True)
class _Sent:
    """The last value that was sent to an input, its slope and direction, and since when it has not changed.

    `step_s` is the time over which the slope was taken.
    """

    time_s: float
    value: float
    slope: float = 0.0
    direction: float = 0.0
    since_s: float = -np.inf
    step_s: float = 0.0


class CommandGuard:
    """Check of each command against the values that were really sent before it.

    Commands are sent up to one sampling period late, so that rate, acceleration and dwell are judged with one period of
    tolerance; the protocol as a whole was checked without.
    """

    def __init__(self, inputs: Sequence[BenchChannel], period_s: float) -> None:
        self._inputs, self._period_s = inputs, period_s
        self._sent = {c.name: _Sent(0.0, c.rest) for c in inputs}

    def admit(self, time_s: float, commands: Mapping[str, float]) -> Violation | None:
        """Remember commands as sent at this time and return None, or return what they would violate."""
        after = {}
        for channel in self._inputs:
            value, last = commands[channel.name], self._sent[channel.name]
            violation = self._violation(channel, last, time_s, value)
            if violation is not None:
                return violation
            after[channel.name] = _next(last, time_s, value, self._period_s)
        self._sent = after
        return None

    def _violation(self, channel: BenchChannel, last: _Sent, time_s: float, value: float) -> Violation | None:
        limits, name, period = channel.limits, channel.name, self._period_s
        tolerance = 1 + ROUNDING
        outside = _range_violation(np.array([time_s]), np.array([value]), name, limits)
        if outside is not None:
            return outside
        step_s = max(time_s - last.time_s, 0.0)
        change = value - last.value
        if abs(change) > limits.rate * (step_s + period) * tolerance:
            return Violation(name, time_s, "rate", abs(change) / (step_s + period), limits.rate)
        if step_s > 0.5 * period and np.isfinite(limits.acceleration):
            centres_s = 0.5 * (step_s + last.step_s) + period
            acceleration = abs(change / step_s - last.slope) / centres_s
            if acceleration > limits.acceleration * tolerance:
                return Violation(name, time_s, "acceleration", acceleration, limits.acceleration)
        begins = change != 0 and np.sign(change) != last.direction
        if begins and last.time_s - last.since_s < limits.dwell_s - period:
            held_s = last.time_s - last.since_s
            return Violation(name, time_s, "dwell", held_s, limits.dwell_s)
        return None


def _next(last: _Sent, time_s: float, value: float, period_s: float) -> _Sent:
    """Return what was sent last; a step shorter than half a period has no meaningful slope and keeps the last one."""
    change, step_s = value - last.value, time_s - last.time_s
    if step_s > 0.5 * period_s:
        slope, passed_s = change / step_s, step_s
    else:
        slope, passed_s = last.slope, last.step_s + step_s
    if change == 0:
        return replace(last, time_s=time_s, slope=slope, direction=0.0, step_s=passed_s)
    return _Sent(time_s, value, slope, float(np.sign(change)), time_s, passed_s)
