"""Progress of stages: the command line draws it, a notebook may ignore it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

LINE_EVERY_S = 20.0


class ProgressBar(Protocol):
    """One piece of work with a known or an expected number of steps."""

    def advance(self, steps: int = 1) -> None:
        """Advance by some finished steps."""

    def describe(self, text: str) -> None:
        """Describe the work within the present steps."""

    def expect(self, total: int) -> None:
        """Set the expected number of steps to `total`."""

    def finish(self) -> None:
        """End the bar, whether the work is finished or not."""


class Progress(Protocol):
    """A receiver of the progress of a run."""

    def begin(self, title: str, total: int, done: int = 0) -> ProgressBar:
        """Begin a piece of work, `done` of its `total` steps being finished already; 0 if the total is not known."""

    def note(self, text: str) -> None:
        """Show one sentence that the user should see."""


class Silent:
    """Progress that is not shown; also its own task."""

    def begin(self, title: str, total: int, done: int = 0) -> Silent:
        return self

    def note(self, text: str) -> None:
        pass

    def advance(self, steps: int = 1) -> None:
        pass

    def describe(self, text: str) -> None:
        pass

    def expect(self, total: int) -> None:
        pass

    def finish(self) -> None:
        pass


class Once:
    """Progress that passes each sentence on once, however many designs give rise to it."""

    def __init__(self, inner: Progress) -> None:
        self._inner, self._said = inner, set[str]()

    def begin(self, title: str, total: int, done: int = 0) -> ProgressBar:
        return self._inner.begin(title, total, done)

    def note(self, text: str) -> None:
        if text not in self._said:
            self._said.add(text)
            self._inner.note(text)


@contextmanager
def open_progress_bar(progress: Progress, title: str, total: int, done: int = 0) -> Iterator[ProgressBar]:
    """Yield the bar of a piece of work for the time of the block; see `Progress.begin`."""
    bar = progress.begin(title, total, done)
    try:
        yield bar
    finally:
        bar.finish()


class LogBar:
    """One piece of work as lines for logs of batch systems: a line now and then with the rate and the remaining time.

    Args:
        say: prints a line.
        title, total, done: see `Progress.begin`.
    """

    def __init__(self, say: Callable[[str], None], title: str, total: int, done: int) -> None:
        self._say, self.title, self.total = say, title, total
        self.first, self.done = done, done
        self.within = ""
        self.started = self.said = time.monotonic()
        if done:
            say(f"{title}: going on from {self._count}")

    def advance(self, steps: int = 1) -> None:
        self.done += steps
        if self.total:
            self.total = max(self.total, self.done)
        self._line()

    def describe(self, text: str) -> None:
        self.within = f" ({text})" if text else ""
        self._line()

    def expect(self, total: int) -> None:
        self.total = total

    def finish(self) -> None:
        elapsed = time.monotonic() - self.started
        self._say(f"{self.title}: {self._count} in {elapsed:.1f} s")

    @property
    def _count(self) -> str:
        return f"{self.done}/{self.total}" if self.total else f"{self.done} so far"

    def _line(self) -> None:
        now = time.monotonic()
        if now - self.said <= LINE_EVERY_S:
            return
        self.said = now
        line = f"{self.title}: {self._count}{self.within}"
        if self.done > self.first:
            each = (now - self.started) / (self.done - self.first)
            line += f", {each:.2f} s each"
            if self.total > self.done:
                line += f", about {each * (self.total - self.done):.0f} s left"
        self._say(line)
