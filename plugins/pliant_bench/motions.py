"""Motions of inputs within their limits: moves from level to level and holds, sampled on the bench's clock.

Moves and holds begin and end at samples, so that the samples keep rate, acceleration and dwell as the motion does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pliant.records.design import Array
from pliant_bench.bench import BenchChannel
from pliant_bench.plans import VALVE

# Without a limit of the rate, a stroke takes this long at the shortest; the slowest stroke takes the second.
SHORTEST_STROKE_S, LONGEST_STROKE_S = 0.3, 60.0
Profile = Literal["line", "cosine"]


@dataclass(frozen=True)
class Move:
    """A move of some inputs, which begin together, and a hold.

    Attributes:
        targets: level at the end of the move by input, SI; other inputs stay where they are.
        pace: 0 for the slowest rate, 1 for the fastest allowed one.
        hold_s: from the end of the move.
        profile: straight lines with rounded ends where acceleration is limited, or half a cosine.
    """

    targets: Mapping[str, float]
    pace: float
    hold_s: float = 0.0
    profile: Profile = "line"


@dataclass(frozen=True)
class Axis:
    """An input with the fastest and the slowest rate of its moves.

    Attributes:
        channel: the input, with its limits and its rest.
        low, high: levels that moves reach, finite.
    """

    channel: BenchChannel
    low: float
    high: float

    @property
    def span(self) -> float:
        """Return the range of the levels."""
        return max(self.high - self.low, 1e-300)

    def rate(self, pace: float) -> float:
        """Return the rate of a move, from the slowest at pace 0 to the fastest at 1, evenly in its logarithm."""
        fastest = min(self.channel.limits.rate, self.span / SHORTEST_STROKE_S)
        slowest = min(self.span / LONGEST_STROKE_S, fastest)
        return slowest * (fastest / slowest) ** pace

    def shape(self, distance: float, pace: float, profile: Profile, period_s: float) -> Array:
        """Return (k,) shares of a move's way at the samples after its start, the last one 1; k ≥ 1."""
        if self.channel.name == VALVE:  # a switch
            return np.ones(1)
        rate, most = self.rate(pace), self.channel.limits.acceleration
        seconds, rounded = _duration(abs(distance), rate, most, profile)
        count = max(1, math.ceil(seconds / period_s - 1e-9))
        way: Array = np.arange(1, count + 1) / count
        if profile == "cosine":
            return np.asarray(0.5 - 0.5 * np.cos(np.pi * way))
        return _trapezoid(way, rounded / seconds if seconds > 0.0 else 0.0)


def _duration(distance: float, rate: float, acceleration: float, profile: Profile) -> tuple[float, float]:
    """Return the shortest time of a move at this rate, and the time of its acceleration."""
    if profile == "cosine":
        return max(0.5 * np.pi * distance / rate, np.pi * math.sqrt(0.5 * distance / acceleration)), 0.0
    rounded = rate / acceleration
    if distance < rate * rounded:
        rounded = math.sqrt(distance / acceleration)
        return 2.0 * rounded, rounded
    return distance / rate + rounded, rounded


def _trapezoid(way: Array, rounded: float) -> Array:
    """Return the share of a move's way at shares of its time, with this share of acceleration at either end."""
    if rounded <= 0.0:
        return way
    top = 1.0 / (1.0 - rounded)
    start = 0.5 * top * way**2 / rounded
    middle = top * (way - 0.5 * rounded)
    end = 1.0 - 0.5 * top * (1.0 - way) ** 2 / rounded
    return np.asarray(np.where(way < rounded, start, np.where(way > 1.0 - rounded, end, middle)))


def axes_within(channels: Sequence[BenchChannel], longest_s: float) -> tuple[Axis, ...]:
    """Return the inputs with the levels that they can reach and leave again within the longest run.

    Args:
        channels: inputs with finite ranges.
        longest_s: duration of a run at most.
    """
    found = []
    for channel in channels:
        limits, rest = channel.limits, channel.rest
        # half of a run for both ways, at the lower of the mean rates that rate and acceleration allow
        way = 0.25 * longest_s * limits.rate if np.isfinite(limits.rate) else np.inf
        if np.isfinite(limits.acceleration):
            way = min(0.5 * way, limits.acceleration * (0.125 * longest_s) ** 2)
        found.append(Axis(channel, max(limits.low, rest - way), min(limits.high, rest + way)))
    return tuple(found)


def sampled_path(
    moves: Sequence[Move], axes: Sequence[Axis], period_s: float, longest_s: float, still_s: float
) -> tuple[Array, dict[str, Array], int]:
    """Return the clock, the commands, and the number of moves done.

    Every run begins with a rest of `still_s` and ends with a return to rest. Moves that would make it longer than
    `longest_s` are left out.
    """
    by_name = {axis.channel.name: axis for axis in axes}
    now = {axis.channel.name: axis.channel.rest for axis in axes}
    rest = dict(now)
    dwell_s = max(axis.channel.limits.dwell_s for axis in axes)
    first = max(1, math.ceil(max(still_s, dwell_s) / period_s - 1e-9))
    pieces = {name: [np.full(first + 1, value)] for name, value in now.items()}
    length, most, done = first + 1, math.floor(longest_s / period_s + 1e-9) + 1, 0

    def added(move: Move) -> dict[str, Array]:
        """Return the samples of a move and its hold by input."""
        targets = {n: move.targets.get(n, now[n]) for n in now}
        shapes = {
            n: by_name[n].shape(targets[n] - now[n], move.pace, move.profile, period_s)
            for n in now
            if targets[n] != now[n]
        }
        hold = math.ceil(max(move.hold_s, dwell_s) / period_s - 1e-9)
        count = max((len(shape) for shape in shapes.values()), default=0) + hold
        found = {}
        for n in now:
            way = shapes.get(n, np.zeros(0))
            whole = np.concatenate([way, np.ones(count - len(way))])
            found[n] = now[n] + (targets[n] - now[n]) * whole
        return found

    for move in moves:
        piece = added(move)
        count, before = len(next(iter(piece.values()))), dict(now)
        if not count:
            done += 1
            continue
        now.update({n: float(values[-1]) for n, values in piece.items()})
        back = len(next(iter(added(Move(rest, 1.0)).values())))
        if length + count + back > most:
            now.update(before)
            break
        for n, values in piece.items():
            pieces[n].append(values)
        length, done = length + count, done + 1
    last_pace = moves[done - 1].pace if done else 1.0
    for pace in (last_pace, 1.0):
        piece = added(Move(rest, pace))
        if length + len(next(iter(piece.values()))) <= most:
            break
    for n, values in piece.items():
        pieces[n].append(values)
    commands = {n: np.concatenate(some) for n, some in pieces.items()}
    clock: Array = period_s * np.arange(len(next(iter(commands.values()))), dtype=float)
    return clock, commands, done
