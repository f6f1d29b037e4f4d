"""The space of runs that a bench may do: compositions of cycles, waves, steps, holds, loops and rests.

A member has a structure, which is drawn, and free numbers between 0 and 1, which a search may change: levels, rates,
durations, numbers of cycles. Whatever the numbers are, the run keeps the limits of every input.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from pliant.errors import UserError, closest
from pliant.formatting import number, quantity
from pliant.records.design import Array
from pliant.units import si_unit
from pliant_bench.bench import BenchChannel, BenchProtocol, ChannelLimits
from pliant_bench.config import ExperimentConfig
from pliant_bench.motions import Axis, Move, axes_within, sampled_path
from pliant_bench.plans import CONDITIONS, VALVE

Shape = Literal["cycles", "waves", "steps", "hold", "loops", "rest", "closed"]
SHAPES: tuple[Shape, ...] = ("cycles", "waves", "steps", "hold", "loops", "rest")
# Shapes that go to the end of a range on one side of rest, and to both ends.
ONE_SIDED: tuple[Shape, ...] = ("cycles", "waves", "steps", "hold", "loops")
TWO_SIDED: tuple[Shape, ...] = ("cycles", "waves")
# Numbers of a segment: highest level, lowest level, pace, duration of holds or change of pace, count.
NUMBERS = 5
MOST_SEGMENTS = 4
SHORTEST_RUN_S, STILL_S = 20.0, 0.5
SHORTEST_HOLD_S, LONGEST_HOLD_S = 1.0, 60.0
# Levels of steps and of loops, shares of the way from the lowest to the highest.
STEPS = (1.0, 0.4, 0.8, 0.2, 0.6)
LOOPS = (1.0, 0.2, 0.8, 0.35, 0.7, 0.0, 0.55, 0.15)
MOST_CYCLES = 6
SWEEP = 0.6


@dataclass(frozen=True)
class Segment:
    """A part of a run: its shape, the inputs that move, and `NUMBERS` free numbers between 0 and 1."""

    shape: Shape
    inputs: tuple[str, ...]
    numbers: tuple[float, ...]


@dataclass(frozen=True)
class SpaceMember:
    """A run of the space.

    Attributes:
        segments: in their order; inputs that do not move in one stay where they are.
        length: share of the longest run, logarithmic, at which the run is cut off.
        setting: level of each condition that a person sets, SI.
    """

    segments: tuple[Segment, ...]
    length: float
    setting: Mapping[str, float] = field(default_factory=dict)

    @property
    def numbers(self) -> Array:
        """Return all free numbers."""
        return np.array([self.length, *(value for one in self.segments for value in one.numbers)])

    def with_numbers(self, numbers: Array) -> SpaceMember:
        """Return the member with other free numbers, which are limited to 0 and 1."""
        inside = np.clip(numbers, 0.0, 1.0).tolist()
        parts = [inside[1 + NUMBERS * k : 1 + NUMBERS * (k + 1)] for k in range(len(self.segments))]
        segments = tuple(
            replace(one, numbers=tuple(part)) for one, part in zip(self.segments, parts, strict=True)
        )
        return replace(self, segments=segments, length=inside[0])


@dataclass(frozen=True)
class ProtocolSpace:
    """All runs that the limits allow.

    Attributes:
        axes: inputs of the bench with the levels of their moves.
        settings: every combination of what a person can set, the present one first.
        period_s, longest_s: sampling period, and duration of a run at most.
    """

    axes: tuple[Axis, ...]
    settings: tuple[Mapping[str, float], ...]
    period_s: float
    longest_s: float

    @staticmethod
    def from_settings(settings: ExperimentConfig, channels: Sequence[BenchChannel] = ()) -> ProtocolSpace:
        """Return the space within the limits of the study and of the driver.

        Args:
            settings: the block `experiment`.
            channels: inputs of the bench; without them those of the study, at rest at 0.

        Raises:
            UserError: an input without limits, or limits of an input that the bench does not have.
        """
        limits = {name: one.limits(name) for name, one in settings.inputs.items()}
        driven = tuple(channels) or tuple(
            BenchChannel(name, rest=1.0 if name == VALVE else 0.0) for name in limits
        )
        names = [one.name for one in driven]
        for name in limits:
            if name not in names:
                raise UserError(
                    f"'experiment: inputs' limits '{name}', which the bench does not have"
                    f"{closest(name, names)} Its inputs are {', '.join(names)}."
                )
        both = [replace(one, limits=one.limits.both(limits.get(one.name, ChannelLimits()))) for one in driven]
        for one in both:
            if not (np.isfinite(one.limits.low) and np.isfinite(one.limits.high)):
                raise UserError(
                    f"Input '{one.name}' of the bench has no range; give its 'low' and 'high' under "
                    "'experiment: inputs'."
                )
        axes = axes_within(both, settings.longest_run_s)
        return ProtocolSpace(axes, manual_settings(settings), settings.period_s, settings.longest_run_s)

    def random(
        self, rng: np.random.Generator, setting: Mapping[str, float], is_rich: bool = False
    ) -> SpaceMember:
        """Return a random member at this setting; a rich one has all its parts and may be long."""
        count = MOST_SEGMENTS if is_rich else int(rng.integers(1, MOST_SEGMENTS + 1))
        segments = tuple(self._segment(rng) for _ in range(count))
        return SpaceMember(segments, float(rng.uniform(0.5 if is_rich else 0.0, 1.0)), dict(setting))

    def covering(
        self, rng: np.random.Generator, setting: Mapping[str, float], inputs: Sequence[str]
    ) -> SpaceMember:
        """Return a random long member with a part for each of these inputs that goes to the ends of its range."""
        segments = [self._to_the_ends(rng, name) for name in inputs]
        more = int(rng.integers(0, 2)) if len(segments) < MOST_SEGMENTS else 0
        return SpaceMember((*segments, *(self._segment(rng) for _ in range(more))), 1.0, dict(setting))

    def _to_the_ends(self, rng: np.random.Generator, name: str) -> Segment:
        high, _, *others = rng.uniform(size=NUMBERS).tolist()
        if name == VALVE:
            supplied = [
                axis.channel.name for axis in self.axes if axis.channel.name not in (*CONDITIONS, VALVE)
            ]
            return Segment("closed", tuple(supplied[:1]), (high, 0.0, *others))
        is_two_sided = self._axis(name).low < self._axis(name).channel.rest
        shapes = TWO_SIDED if is_two_sided else ONE_SIDED
        return Segment(shapes[int(rng.integers(len(shapes)))], (name,), (1.0, float(is_two_sided), *others))

    def _segment(self, rng: np.random.Generator) -> Segment:
        names = [axis.channel.name for axis in self.axes if axis.channel.name != VALVE]
        supplied = [name for name in names if name not in CONDITIONS]
        has_valve = len(names) < len(self.axes) and bool(supplied)
        shapes: tuple[Shape, ...] = (*SHAPES, "closed") if has_valve else SHAPES
        shape = shapes[int(rng.integers(len(shapes)))]
        names = supplied if shape == "closed" else names
        count = 1 if rng.uniform() < 0.6 else int(rng.integers(1, len(names) + 1))
        moved = rng.choice(len(names), size=count, replace=False)
        values = tuple(rng.uniform(size=NUMBERS).tolist())
        return Segment(shape, tuple(names[k] for k in sorted(moved.tolist())), values)

    def protocol(self, member: SpaceMember, name: str) -> BenchProtocol:
        """Return the member as a run of the bench, within all limits."""
        shortest = min(SHORTEST_RUN_S, self.longest_s)
        longest = shortest * (self.longest_s / shortest) ** member.length
        parts = [self._moves(segment) for segment in member.segments]
        moves = [move for part in parts for move in part]
        clock, commands, done = sampled_path(moves, self.axes, self.period_s, longest, STILL_S)
        words = []
        for segment, part in zip(member.segments, parts, strict=True):
            if kept := part[:done]:
                words.append(self._words(segment, kept))
            done -= len(kept)
        words = list(dict.fromkeys(words)) or ["all inputs at rest"]
        return BenchProtocol(name, "; ".join([*words, "back to rest"]), clock, commands, dict(member.setting))

    def _axis(self, name: str) -> Axis:
        return next(axis for axis in self.axes if axis.channel.name == name)

    def _ends(self, name: str, high: float, low: float) -> tuple[float, float]:
        """Return the lowest and the highest level of an input: on both sides of its rest where the range has both."""
        axis = self._axis(name)
        rest = axis.channel.rest
        top = rest + (0.15 + 0.85 * high) * (axis.high - rest)
        if axis.low < rest:
            return rest + max(0.0, (low - 0.3) / 0.7) * (axis.low - rest), top
        return rest + 0.7 * max(0.0, (low - 0.5) / 0.5) * (top - rest), top

    def _moves(self, segment: Segment) -> list[Move]:
        """Return the moves of a segment."""
        high, low, pace, span, many = segment.numbers
        ends = {name: self._ends(name, high, low) for name in segment.inputs}
        longest_hold = max(min(LONGEST_HOLD_S, self.longest_s / 3.0), SHORTEST_HOLD_S)
        hold_s = SHORTEST_HOLD_S * (longest_hold / SHORTEST_HOLD_S) ** span

        def level(share: float) -> dict[str, float]:
            return {name: a + share * (b - a) for name, (a, b) in ends.items()}

        if segment.shape == "rest":
            return [Move({axis.channel.name: axis.channel.rest for axis in self.axes}, pace, hold_s)]
        if segment.shape == "hold":
            return [Move(level(1.0), pace, hold_s)]
        if segment.shape == "steps":
            return [Move(level(share), 1.0, hold_s) for share in STEPS[: 1 + _count(many, len(STEPS) - 1)]]
        if segment.shape == "loops":
            return [Move(level(share), pace) for share in LOOPS[: 2 + _count(many, len(LOOPS) - 2)]]
        if segment.shape == "closed":
            shut, opened = Move({VALVE: 0.0}, 1.0, hold_s), Move({VALVE: 1.0}, 1.0, 1.0)
            return [Move(level(1.0), pace, 2.0), shut, opened]
        count = _count(many, MOST_CYCLES)
        paces = np.clip(pace + SWEEP * (span - 0.5) * np.linspace(-1.0, 1.0, count), 0.0, 1.0)
        profile: Literal["line", "cosine"] = "line" if segment.shape == "cycles" else "cosine"
        return [Move(level(share), float(one), 0.0, profile) for one in paces for share in (1.0, 0.0)]

    def _words(self, segment: Segment, moves: Sequence[Move]) -> str:
        """Return an order to the experimenter."""
        if segment.shape == "rest":
            return f"all inputs at rest for {number(moves[-1].hold_s, 2)} s"
        names, levels = ", ".join(segment.inputs), [self._levels(segment, move) for move in moves]
        hold = number(moves[0].hold_s, 2)
        if segment.shape == "hold":
            return f"hold {names} at {levels[0]} for {hold} s"
        if segment.shape == "closed":
            return self._closed_words(names, levels[0], moves)
        if segment.shape == "steps":
            return f"step {names} to {', '.join(levels)}, {hold} s each"
        if segment.shape == "loops":
            return f"turn {names} at {', '.join(levels)}"
        first = segment.inputs[0]
        rates = sorted({self._axis(first).rate(move.pace) for move in moves})
        at = [quantity(rate, si_unit(first), 2) for rate in (rates[0], rates[-1])]
        pace = f"{at[0]}/s" if len(rates) == 1 else f"{at[0]}/s to {at[1]}/s"
        kind = "sine wave" if segment.shape == "waves" else "cycle"
        if len(moves) == 1:
            return f"half a {kind} of {names} to {levels[0]} at {pace} at most"
        count = f"{number(len(moves) / 2, 3)} {kind}{'' if len(moves) == 2 else 's'}"
        return f"{count} of {names} between {levels[1]} and {levels[0]} at {pace} at most"

    def _closed_words(self, names: str, level: str, moves: Sequence[Move]) -> str:
        fill = f"fill {names} to {level}"
        if len(moves) == 1:
            return fill
        closed = f"{fill}, close the valve for {number(moves[1].hold_s, 2)} s"
        return closed if len(moves) == 2 else f"{closed} and open it"

    def _levels(self, segment: Segment, move: Move) -> str:
        values = [move.targets[name] for name in segment.inputs if name in move.targets]
        texts = [
            quantity(value, si_unit(name), 3) for name, value in zip(segment.inputs, values, strict=False)
        ]
        return " and ".join(texts)


def _count(share: float, most: int) -> int:
    """Return a number from 1 to `most`."""
    return 1 + min(int(share * most), most - 1)


def manual_settings(settings: ExperimentConfig) -> tuple[Mapping[str, float], ...]:
    """Return every combination of the conditions that a person can set, SI, the present one first."""
    found: list[dict[str, float]] = [{}]
    for name in settings.manual:
        found = [{**one, name: value} for one in found for value in settings.levels(name)]
    return tuple(found)


def changed(setting: Mapping[str, float], before: Mapping[str, float]) -> int:
    """Return the number of conditions that a person has to set."""
    return sum(value != before.get(name) for name, value in setting.items())
