"""How stages tell the outside what they do; the command line draws it, a notebook may ignore it."""

from __future__ import annotations

from typing import Protocol


class Task(Protocol):
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

    def begin(self, title: str, total: int, done: int = 0) -> Task:
        """A piece of work begins, `done` of its `total` steps being there already."""

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

    def begin(self, title: str, total: int, done: int = 0) -> Task:
        return self._inner.begin(title, total, done)

    def note(self, text: str) -> None:
        if text not in self._said:
            self._said.add(text)
            self._inner.note(text)
