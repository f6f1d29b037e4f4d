"""Candidates out, outcomes back, dead workers replaced.

A worker that dies takes its candidates with it: who ran then is suspect and runs again, one candidate at a time
with nobody beside it. Who kills a worker twice, the second time alone, has failed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from dataclasses import dataclass, replace
from typing import Any

from pliant.errors import NotReachedError, PliantError, UserError
from pliant.interfaces.optimizer import Trial
from pliant.pipeline.crews import Crew
from pliant.pipeline.progress import Progress, Silent
from pliant.search.workers import Job, Setup

KILLED = "its worker was killed twice, the second time alone (out of memory, or a crash of the engine)"
MOST_TRIES = 2
GREETINGS = 2


@dataclass(frozen=True)
class Chunk:
    """Candidates of one branch that travel together; `tries` counts how often they came back without an
    outcome, 1 standing for a journey with others."""

    branch: int
    tasks: tuple[Trial, ...]
    tries: int = 0

    def singles(self) -> list[Chunk]:
        """Each candidate by itself, once more."""
        tries = self.tries + (2 if len(self.tasks) == 1 else 1)  # of several, it may not have been this one
        return [Chunk(self.branch, (task,), tries) for task in self.tasks]


class Team:
    """A crew with a queue before it; as a context it lets the workers go at its end, at once where that is an error."""

    def __init__(self, crew: Crew, setup: Setup) -> None:
        self.crew, self._setup = crew, setup
        self._queue: deque[Chunk] = deque()
        self._suspects: deque[Chunk] = deque()
        self._running: dict[Future[Any], Chunk] = {}
        self._alone = self._greeted = False

    def __enter__(self) -> Team:
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        self.close(at_once=kind is not None)

    @property
    def waiting(self) -> int:
        """Chunks that have not come back."""
        return len(self._queue) + len(self._suspects) + len(self._running)

    def greet(self, progress: Progress) -> None:
        """Wait once until workers begin, which takes seconds; in a script without its guard they never do.

        Raises:
            NotReachedError: they end before they begin.
        """
        if self._greeted or self.crew.size is None or self.crew.size == 1:
            return
        bar = progress.begin("workers begin", self.crew.size)
        try:
            for left in range(GREETINGS, 0, -1):
                try:
                    for answer in [self._submitted(()) for _ in range(self.crew.size)]:
                        answer.result()
                        bar.advance()
                    break
                except BrokenExecutor:
                    if left == 1 or not self.crew.renew():
                        raise NotReachedError(
                            "worker processes end before they begin; in a script, put the call under "
                            "\"if __name__ == '__main__':\", or take workers=1."
                        ) from None
        finally:
            bar.finish()
        self._greeted = True

    def submit(self, chunk: Chunk) -> None:
        """Hand in candidates."""
        self._queue.append(chunk)
        self._fill()

    def collect(self) -> list[tuple[int, tuple[Trial, ...]]]:
        """Branch and outcomes of chunks that have come back; waits for the first.

        Raises:
            UserError: what every candidate would meet.
            NotReachedError: the executor broke, or processes cannot be started.
        """
        back: list[tuple[int, tuple[Trial, ...]]] = []
        while not back and self.waiting:
            self._fill()
            ended, _ = wait(self._running, return_when=FIRST_COMPLETED)
            broken = []
            for future in ended:
                chunk = self._running.pop(future)
                error = _error_of(future)
                if error is None:
                    self._alone = False
                    back.append((chunk.branch, tuple(future.result())))
                elif isinstance(error, BrokenExecutor):
                    broken.append(chunk)
                else:
                    self._alone = False
                    back += self._faulty(chunk, error)
            if broken:
                back += self._broken(broken)
        return back

    def each(self, tasks: Sequence[Trial]) -> Iterator[Trial]:
        """The outcomes of candidates with numbers from 0, in their order; nothing else may be under way."""
        for task in tasks:
            self.submit(Chunk(0, (task,)))
        found: dict[int, Trial] = {}
        for task in tasks:
            while task.number not in found:
                found |= {row.number: row for _, rows in self.collect() for row in rows}
            yield found.pop(task.number)

    def close(self, at_once: bool) -> None:
        """Let the workers go."""
        for future in self._running:
            future.cancel()
        self.crew.stop(at_once)

    def _fill(self) -> None:
        """A suspect has the crew for itself."""
        if self._alone:
            return
        if self._suspects:
            if not self._running:
                self._alone = True
                self._begin(self._suspects.popleft())
            return
        while self._queue and (self.crew.size is None or len(self._running) <= self.crew.size):
            self._begin(self._queue.popleft())

    def _begin(self, chunk: Chunk) -> None:
        self.greet(Silent())
        future = self._submitted(chunk.tasks)
        self._running[future] = chunk

    def _submitted(self, tasks: Sequence[Trial]) -> Future[Any]:
        try:
            return self.crew.submit(Job(self._setup, tuple(tasks)))
        except BrokenExecutor as error:
            future: Future[Any] = Future()
            future.set_exception(error)
            return future

    def _faulty(self, chunk: Chunk, error: BaseException) -> list[tuple[int, tuple[Trial, ...]]]:
        """A job that ended in an error: of every candidate's, or of the cluster's."""
        if isinstance(error, PliantError):
            raise error
        if isinstance(error, ImportError):
            raise UserError(f"the workers cannot import what the study needs ({error}); install it there.")
        if chunk.tries + 1 >= MOST_TRIES:
            text = " ".join(str(error).split())
            return [
                (chunk.branch, tuple(task.failed(f"{type(error).__name__}: {text}") for task in chunk.tasks))
            ]
        self._queue.extendleft(reversed(chunk.singles()))
        return []

    def _broken(self, chunks: list[Chunk]) -> list[tuple[int, tuple[Trial, ...]]]:
        """A worker died. Who ran then is suspect; who dies alone is the one."""
        chunks += self._running.values()
        self._running.clear()
        if not self.crew.renew():
            raise NotReachedError(
                "the executor broke: a worker died. What was evaluated is kept; run again to go on."
            )
        was_alone, self._alone = self._alone, False
        if was_alone:
            (chunk,) = chunks
            if chunk.tries < MOST_TRIES:
                self._suspects.appendleft(replace(chunk, tries=chunk.tries + 1))
                return []
            return [(chunk.branch, tuple(task.failed(KILLED) for task in chunk.tasks))]
        self._suspects.extend(single for chunk in chunks for single in chunk.singles())
        return []


def _error_of(future: Future[Any]) -> BaseException | None:
    """What a job ended in; one that a cluster has cancelled raises its error where others return it."""
    try:
        return future.exception()
    except CancelledError as error:
        return error
