"""How stages tell the outside what they do; the command line draws it, a notebook may ignore it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

LINE_EVERY_S = 20.0


class ProgressBar(Protocol):
    """One piece of work with a known or an expected number of steps."""

    def advance(self, steps: int = 1) -> None:
        """Some steps are done."""

    def describe(self, text: str) -> None:
        """What is under way within the present steps."""

    def expect(self, total: int) -> None:
        """The number of steps is now thought to be `total`."""

    def finish(self) -> None:
        """The work ended, done or not."""


class Progress(Protocol):
    """Receives what a run says while it runs."""

    def begin(self, title: str, total: int, done: int = 0) -> ProgressBar:
        """A piece of work begins, `done` of its `total` steps being there already; 0 where nobody knows how many."""

    def note(self, text: str) -> None:
        """One sentence that the user should see."""


class Silent:
    """Progress that nobody watches; also its own task."""

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
    """Progress that says the same sentence once, however many designs give rise to it."""

    def __init__(self, inner: Progress) -> None:
        self._inner, self._said = inner, set[str]()

    def begin(self, title: str, total: int, done: int = 0) -> ProgressBar:
        return self._inner.begin(title, total, done)

    def note(self, text: str) -> None:
        if text not in self._said:
            self._said.add(text)
            self._inner.note(text)


@contextmanager
def bar_of(progress: Progress, title: str, total: int, done: int = 0) -> Iterator[ProgressBar]:
    """The bar of a piece of work for the time of the block; see `Progress.begin`."""
    bar = progress.begin(title, total, done)
    try:
        yield bar
    finally:
        bar.finish()


class LogBar:
    """One piece of work in lines, for logs of batch systems: now and then one with the rate and the time left.

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
