"""Clocks that pace a run: the real one, and one that skips the waits, for tests and simulated benches."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod

# The last part of a wait is left to short sleeps, since a wait for an event may end this much too late.
COARSE_S = 0.002


class Clock(ABC):
    """Time in seconds from an arbitrary zero, never backwards."""

    @abstractmethod
    def now(self) -> float:
        """Return the time."""

    @abstractmethod
    def sleep_until(self, instant_s: float, woken: threading.Event | None = None) -> bool:
        """Wait until the instant, or until the event is set; return whether the event is set."""


class RealClock(Clock):
    """The monotonic clock of the computer."""

    def now(self) -> float:
        return time.monotonic()

    def sleep_until(self, instant_s: float, woken: threading.Event | None = None) -> bool:
        event = woken or threading.Event()
        while (left := instant_s - time.monotonic()) > 0 and not event.is_set():
            if left > COARSE_S:
                event.wait(left - COARSE_S)
            else:
                time.sleep(left)
        return event.is_set()


class AcceleratedClock(Clock):
    """A clock that skips every wait.

    With `counts_work` the time between two waits is that of the computer, so that a loop can be too slow for its
    period; otherwise work takes no time, and every run has the same time stamps.
    """

    def __init__(self, counts_work: bool = False) -> None:
        self._counts_work = counts_work
        self._skipped_s = 0.0
        self._zero_s = time.monotonic()

    def now(self) -> float:
        worked_s = time.monotonic() - self._zero_s if self._counts_work else 0.0
        return self._skipped_s + worked_s

    def sleep_until(self, instant_s: float, woken: threading.Event | None = None) -> bool:
        if self._counts_work:
            self._skipped_s += max(instant_s - self.now(), 0.0)
        else:  # the instant itself, without a rounding error
            self._skipped_s = max(instant_s, self._skipped_s)
        return woken is not None and woken.is_set()
