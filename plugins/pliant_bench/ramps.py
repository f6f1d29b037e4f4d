"""Paths that keep limits: a raw path followed as closely as the limits allow, and ramps from and to rest.

A path with a limit on its acceleration approaches a level in the least number of sampling periods in which it can also
stop there: with `q` the largest change of slope per period h, a slope s needs the distance h (s + (s−q) + (s−2q) + …).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pliant.errors import UserError
from pliant.records.design import Array
from pliant_bench.bench import BenchChannel, BenchProtocol, ChannelLimits
from pliant_bench.limits import ROUNDING, check_protocol

# A ramp that takes longer than this is a mistake in the limits.
LONGEST_RAMP_S = 3600.0


def follow(raw: Array, start: float, period_s: float, limits: ChannelLimits) -> Array:
    """Return (t,) a path from `start`, at rest, that follows a raw path within the limits, sampled every `period_s`.

    With a dwell the path takes one level of the raw path at a time, and stays at each.
    """
    targets = np.clip(np.asarray(raw, float), limits.low, limits.high)
    path = np.empty(len(targets))
    value, slope, level, ended = start, 0.0, start, -np.inf
    moving = False
    for k, target in enumerate(targets.tolist()):
        if k == 0:
            path[0] = value
            continue
        if limits.dwell_s > 0:
            if not moving and (k - 1 - ended) * period_s >= limits.dwell_s * (1 - ROUNDING):
                level = target
            target = level
        value, slope = _advanced(value, slope, target, period_s, limits)
        path[k] = value
        was_moving, moving = moving or slope != 0, value != target
        if was_moving and not moving:
            ended = k
    return path


def _advanced(
    value: float, slope: float, target: float, period_s: float, limits: ChannelLimits
) -> tuple[float, float]:
    """Return value and slope one period later; the target itself where only a rounding error is left."""
    slope = _next_slope(target - value, slope, period_s, limits)
    after = value + slope * period_s
    is_there = abs(target - after) <= 1e-12 * max(abs(target), abs(value))
    return (target if is_there else after), slope


def _next_slope(distance: float, slope: float, period_s: float, limits: ChannelLimits) -> float:
    """Return the slope of the next period, with which the path can still stop at the target."""
    if not np.isfinite(limits.acceleration):
        wanted = distance / period_s
    else:
        q = limits.acceleration * period_s
        n = np.floor((np.sqrt(1 + 8 * abs(distance) / (q * period_s)) - 1) / 2)
        wanted = np.sign(distance) * (abs(distance) / (period_s * (n + 1)) + q * n / 2)
        wanted = min(max(wanted, slope - q), slope + q)
    return float(min(max(wanted, -limits.rate), limits.rate))


def ramp(start: float, end: float, period_s: float, limits: ChannelLimits) -> Array:
    """Return a path from a value to another, at rest at both, without the first value."""
    limits = replace(limits, dwell_s=0.0, low=-np.inf, high=np.inf)
    values, value, slope = [], start, 0.0
    while value != end or slope != 0.0:
        value, slope = _advanced(value, slope, end, period_s, limits)
        values.append(value)
        if value == end and abs(slope) <= limits.acceleration * period_s * (1 + ROUNDING):
            break
        if len(values) * period_s > LONGEST_RAMP_S:
            raise UserError(
                f"A ramp to {end:g} takes more than {LONGEST_RAMP_S:g} s: its limits of rate or acceleration are too "
                "low."
            )
    return np.array(values)


def with_ramps(protocol: BenchProtocol, inputs: Sequence[BenchChannel], period_s: float) -> BenchProtocol:
    """Return a protocol with ramps from rest to its first commands and from its last ones back to rest.

    Raises:
        UserError: the protocol itself exceeds a limit; the message names the first violation.
    """
    before, after = {}, {}
    for channel in inputs:
        values = np.asarray(protocol.commands[channel.name], float)
        rise = ramp(channel.rest, float(values[0]), period_s, channel.limits)
        fall = ramp(float(values[-1]), channel.rest, period_s, channel.limits)
        hold = int(np.ceil(channel.limits.dwell_s / period_s)) + 1
        before[channel.name] = np.concatenate(
            [[channel.rest], rise, np.full(hold if len(rise) else 0, values[0])]
        )
        after[channel.name] = np.concatenate([np.full(hold if len(fall) else 0, values[-1]), fall])
    risen = max(len(path) for path in before.values())
    fallen = max(len(path) for path in after.values())
    # The path before ends with the first command, which the protocol repeats: one instant less.
    shift_s = (risen - 1) * period_s
    time_s: Array = np.concatenate(
        [
            np.arange(risen - 1) * period_s,
            protocol.time_s + shift_s,
            protocol.time_s[-1] + shift_s + np.arange(1, fallen + 1) * period_s,
        ]
    )
    commands = {}
    for channel in inputs:
        rise, fall = before[channel.name], after[channel.name]
        start = np.full(risen - len(rise), channel.rest)
        end = np.full(fallen - len(fall), channel.rest)
        commands[channel.name] = np.concatenate(
            [start, rise[:-1], protocol.commands[channel.name], fall, end]
        )
    ramped = replace(protocol, time_s=time_s, commands=commands)
    check_protocol(ramped, inputs)
    return ramped


def shaped(protocol: BenchProtocol, inputs: Sequence[BenchChannel]) -> BenchProtocol:
    """Return a protocol of the same sampling period that follows the given one within the limits, from rest to rest.

    It lasts longer where the inputs need time to return to rest.

    Raises:
        UserError: the instants are not equally spaced.
    """
    steps = np.diff(protocol.time_s)
    period_s = float(np.mean(steps)) if len(steps) else 0.0
    if not len(steps) or np.ptp(steps) > 1e-6 * period_s:
        raise UserError(
            f"Run '{protocol.name}' has instants that are not equally spaced, and cannot be shaped."
        )
    paths = {c.name: _to_rest(protocol.commands[c.name], c, period_s) for c in inputs}
    count = max(len(path) for path in paths.values())
    rests = {channel.name: channel.rest for channel in inputs}
    commands = {n: np.concatenate([p, np.full(count - len(p), rests[n])]) for n, p in paths.items()}
    time_s = np.arange(count, dtype=float) * period_s
    return replace(protocol, time_s=time_s, commands=commands)


def _to_rest(raw: Array, channel: BenchChannel, period_s: float) -> Array:
    """Return the path that follows a raw path and then goes to rest, without the samples at rest after it."""
    limits, raw = channel.limits, np.asarray(raw, float)
    held = int(np.ceil(2 * limits.dwell_s / period_s))
    more = 64
    while True:
        path = follow(
            np.concatenate([raw, np.full(more + held, channel.rest)]), channel.rest, period_s, limits
        )
        away = np.flatnonzero(path != channel.rest)
        last = int(away[-1]) + 1 if len(away) else 0
        if last + 1 < len(path):
            return path[: max(len(raw), last + 2)]
        if more * period_s > LONGEST_RAMP_S:
            raise UserError(
                f"{channel.name} takes more than {LONGEST_RAMP_S:g} s to rest: its limits of rate or acceleration "
                "are too low."
            )
        more *= 4
