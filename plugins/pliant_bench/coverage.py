"""Coverage of the allowed range of every input by the runs so far.

The predictions of a wrong model are unreliable where no run has been. A verdict therefore ends an experiment only if
the runs went to both ends of the range of every input, by 90 % of the way from its rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.formatting import listed, quantity
from pliant.units import si_unit
from pliant_bench.bench import BenchProtocol, BenchRecording, ChannelLimits
from pliant_bench.motions import Axis

# Share of the way from rest to an end of the range that counts as the whole.
COVERED = 0.9


@dataclass(frozen=True)
class RangeEnd:
    """An end of the range of an input: a level beyond `level` covers it, SI."""

    name: str
    level: float
    is_upper: bool

    def reached_by(self, protocol: BenchProtocol) -> bool:
        """Return whether the run goes there."""
        values = protocol.commands.get(self.name, np.zeros(0))
        at_least = values >= self.level if self.is_upper else values <= self.level
        return bool(np.any(at_least))

    def __str__(self) -> str:
        side = "above" if self.is_upper else "below"
        return f"{self.name} {side} {quantity(self.level, si_unit(self.name), 3)}"


@dataclass(frozen=True)
class Coverage:
    """The ends of the allowed ranges to which no run has gone."""

    missing: tuple[RangeEnd, ...] = ()

    @staticmethod
    def from_recordings(
        axes: Sequence[Axis], recordings: Sequence[BenchRecording], envelopes: Mapping[str, ChannelLimits]
    ) -> Coverage:
        """Return the coverage by the runs so far.

        Args:
            axes: inputs with the levels that runs can reach.
            recordings: of all runs. One that left the envelope of an output counts as planned, because the specimen
                does not allow more.
            envelopes: ranges of the outputs, SI.
        """
        left = [end for axis in axes for end in _ends(axis)]
        for one in recordings:
            done = BenchProtocol("", "", one.commanded_s, one.commands)
            if _left_envelope(one, envelopes):
                done = one.protocol
            left = [end for end in left if not end.reached_by(done)]
        return Coverage(tuple(left))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Return the inputs with an end that is missing, each once."""
        return tuple(dict.fromkeys(end.name for end in self.missing))

    def added_by(self, protocol: BenchProtocol) -> int:
        """Return to how many of the missing ends a run goes."""
        return sum(end.reached_by(protocol) for end in self.missing)

    def __str__(self) -> str:
        return listed([str(end) for end in self.missing])


# Nothing is missing.
COVERED_ALL = Coverage()


def _ends(axis: Axis) -> list[RangeEnd]:
    rest, name = axis.channel.rest, axis.channel.name
    return [
        RangeEnd(name, rest + COVERED * (end - rest), end > rest)
        for end in (axis.low, axis.high)
        if end != rest
    ]


def _left_envelope(recording: BenchRecording, envelopes: Mapping[str, ChannelLimits]) -> bool:
    """Return whether a reading was outside the range of its output."""
    for name, envelope in envelopes.items():
        values = recording.readings.get(name, np.zeros(0))
        if np.any((values < envelope.low) | (values > envelope.high)):
            return True
    return False
