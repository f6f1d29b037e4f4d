"""Recent simulations of a system: effects of readings, and differences to a known prediction, need no further one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from threading import Lock

import numpy as np

from pliant.interfaces.model import Drive, SystemModel, SystemParts, SystemReadings

# Numbers that are kept in all.
MOST_KEPT = 6_000_000


@dataclass(frozen=True, eq=False)
class _Simulated:
    """What a system did: the readings of these drives with these changes."""

    parts: SystemParts
    drives: tuple[Drive, ...]
    readings: tuple[SystemReadings, ...]

    @property
    def size(self) -> int:
        """Return the count of its numbers, with about as many in the drives."""
        return 2 * sum(values.size for run in self.readings for values in run.values())

    def answers(self, parts: SystemParts, drives: Sequence[Drive]) -> bool:
        """Return whether the system would do the same again; maps of readings act on what it does."""
        return (
            _equal(self.parts.changes, parts.changes)
            and bool(self.parts.inputs) == bool(parts.inputs)
            and len(self.drives) == len(drives)
            and all(_same(a, b) for a, b in zip(self.drives, drives, strict=True))
        )


@dataclass(eq=False)
class Simulations:
    """The latest simulations of one system; several threads may ask."""

    _kept: list[_Simulated] = field(default_factory=list)
    _lock: Lock = field(default_factory=Lock)

    def simulated(
        self, system: SystemModel, parts: SystemParts, drives: Sequence[Drive]
    ) -> tuple[SystemReadings, ...]:
        """Return the readings of each run, simulated unless they are known."""
        with self._lock:
            known = next((one for one in reversed(self._kept) if one.answers(parts, drives)), None)
        if known is not None:
            return known.readings
        readings = system.simulate(parts, drives)
        with self._lock:
            self._kept.append(_Simulated(parts, tuple(drives), readings))
            while sum(one.size for one in self._kept) > MOST_KEPT and len(self._kept) > 1:
                self._kept.pop(0)
        return readings


def _same(one: Drive, other: Drive) -> bool:
    """Return whether two drives move a system alike."""
    a, b = one.history, other.history
    if one.first != other.first or a.run != b.run or len(a) != len(b):
        return False
    signals, others = a.signals(), b.signals()
    if signals.keys() != others.keys() or (a.time_s is None) != (b.time_s is None):
        return False
    pairs = [(values, others[name]) for name, values in signals.items()]
    if a.time_s is not None and b.time_s is not None:
        pairs.append((a.time_s, b.time_s))
    return all(x is y or np.array_equal(x, y, equal_nan=True) for x, y in pairs)


def _equal(some: Sequence[object], others: Sequence[object]) -> bool:
    """Return whether changes are the same; those that cannot be compared are not."""
    try:
        return len(some) == len(others) and all(bool(a == b) for a, b in zip(some, others, strict=True))
    except ValueError:  # arrays among their fields
        return False
