"""A queue of jobs before an executor, with replacement of dead workers.

A worker that dies loses its jobs. The jobs that were running are suspect and run again, alone; a job that kills a
worker twice, the second time alone, has failed, and the others are not affected. A cluster replaces its workers itself
and tries again on another one; a job that it gives up after several deaths is a suspect in the same way.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

from pliant.errors import NotReachedError, PliantError, UserError, interrupted
from pliant.execution.executors import Executor
from pliant.execution.progress import Progress, Silent, open_progress_bar

Item = TypeVar("Item")
Result = TypeVar("Result")

MOST_DEATHS = 2  # deaths of its worker, no other job running, after which a job has failed
KILLED = (
    f"its worker was killed {MOST_DEATHS} times, the last time alone (out of memory, "
    "or a crash of the engine or solver)"
)
KILLED_WORKER = "KilledWorker"  # dask's error, by name: dask is imported only where it is used
MOST_TRIES = 2  # losses of a job without the death of a worker
FAILED_AT_START = 2  # the number of times that workers may end before they begin


@dataclass(frozen=True)
class Failure:
    """The reason why an item has no result; `error` is the raised exception, None where it killed its worker."""

    cause: str
    error: BaseException | None = None

    @classmethod
    def from_exception(cls, error: BaseException) -> Failure:
        """Return the failure of an exception, described in one line."""
        text = " ".join(str(error).split())
        return cls(f"{type(error).__name__}: {text}" if text else type(error).__name__, error)


@dataclass(frozen=True)
class Finished(Generic[Item, Result]):
    """A finished item with its result or the failure; `key` is that of `submit`."""

    key: Any
    item: Item
    result: Result | None = None
    failure: Failure | None = None

    def unwrap(self) -> Result:
        """Return the result; raises the item's exception, or `NotReachedError` where it killed its worker."""
        if self.failure is None:
            return self.result  # type: ignore[return-value]
        raise self.failure.error or NotReachedError(
            f"{self.failure.cause[:1].upper()}{self.failure.cause[1:]}."
        )


@dataclass(frozen=True)
class _Job:
    """Items that are submitted together; for a single one, its number of worker deaths and of lost tries."""

    key: Hashable
    items: tuple[Any, ...]
    deaths: int = 0
    losses: int = 0

    def singles(self, losses: int = 0) -> list[_Job]:
        """Return a job for each item, so that the failing item can be identified."""
        return [_Job(self.key, (item,), losses=losses) for item in self.items]


class JobQueue(Generic[Item, Result]):
    """A queue before an executor; as a context it cancels pending jobs at its end.

    Args:
        executor: does the work.
        function: called with each item, in a worker. An exception is its item's failure; a `PliantError` would
            occur for every item, and ends all.
        began: whether a worker has started an item, where that is known: others are not suspect.
    """

    def __init__(
        self,
        executor: Executor,
        function: Callable[[Item], Result],
        began: Callable[[Item], bool] = lambda item: True,
    ) -> None:
        self.executor, self._function, self._began = executor, function, began
        self._queue: deque[_Job] = deque()
        self._suspects: deque[_Job] = deque()
        self._running: dict[Future[Any], _Job] = {}
        self._alone = self._ready = False

    def __enter__(self) -> JobQueue[Item, Result]:
        return self

    def __exit__(self, *error: object) -> None:
        for future in self._running:
            future.cancel()

    @property
    def waiting(self) -> int:
        """Number of jobs that are not finished."""
        return len(self._queue) + len(self._suspects) + len(self._running)

    @property
    def running(self) -> list[Item]:
        """Items that the executor has."""
        return [item for job in self._running.values() for item in job.items]

    def wait_until_ready(self, progress: Progress, most: int | None = None) -> None:
        """Wait until workers are ready, which takes seconds; in a script without a `__main__` guard they never are.

        Args:
            progress: receives a bar of workers.
            most: no more workers than that are needed.

        Raises:
            NotReachedError: they end before they are ready.
        """
        size = self.executor.size
        if self._ready or size is None or size == 1:
            return
        size = size if most is None else min(size, most)
        with open_progress_bar(progress, "workers begin", size) as bar:
            for left in reversed(range(FAILED_AT_START)):
                try:
                    for future in [self._submitted(()) for _ in range(size)]:
                        future.result()
                        bar.advance()
                    break
                except BrokenExecutor:
                    if not left or not self.executor.restart():
                        raise NotReachedError(
                            "worker processes end before they begin; in a script, put the call under "
                            "\"if __name__ == '__main__':\", or take workers=1."
                        ) from None
        self._ready = True

    def submit(self, items: Sequence[Item], key: Hashable = None) -> None:
        """Submit items that travel together."""
        self._queue.append(_Job(key, tuple(items)))
        self._fill()

    def completed(self, timeout_s: float | None = None) -> list[Finished[Item, Result]]:
        """Return finished items; waits for the first one, or for the timeout.

        Raises:
            UserError: an error that would occur for every item.
            NotReachedError: the executor broke, or processes cannot be started.
        """
        back: list[Finished[Item, Result]] = []
        while not back and self.waiting:
            self._fill()
            ended, _ = wait(self._running, timeout=timeout_s, return_when=FIRST_COMPLETED)
            lost, broken = [], False
            for future in [one for one in self._running if one in ended]:  # in the order of submission
                job = self._running.pop(future)
                try:
                    error = future.exception()
                except CancelledError as cancelled:  # a cluster raises the error, other executors return it
                    error = cancelled
                if isinstance(error, BrokenExecutor) or type(error).__name__ == KILLED_WORKER:
                    lost.append(job)
                    broken |= isinstance(error, BrokenExecutor)
                    continue
                self._alone = False
                back += self._returned(job, future.result()) if error is None else self._lost(job, error)
            if broken:  # new workers; the other jobs of the dead worker's pool are lost, too
                lost += self._running.values()
                self._running.clear()
                self._ready = False
                if not self.executor.restart():
                    raise NotReachedError(
                        "the executor broke: a worker died. Finished work is kept; run the command again to continue."
                    )
            if lost:
                back += self._killed(lost)
            if timeout_s is not None:
                break
        return back

    def each(self, items: Sequence[Item]) -> Iterator[Finished[Item, Result]]:
        """Yield the results of the items, each a separate job, in their order; no other job may be running."""
        for number, item in enumerate(items):
            self.submit([item], number)
        found: dict[int, Finished[Item, Result]] = {}
        for number in range(len(items)):
            while number not in found:
                found |= {one.key: one for one in self.completed()}
            yield found.pop(number)

    def _fill(self) -> None:
        """Submit jobs: a suspect alone; else one for each worker and one in reserve."""
        if self._alone:
            return
        if self._suspects:
            if not self._running:
                self._alone = True
                self._begin(self._suspects.popleft())
            return
        size = self.executor.size
        most = None if size is None else size + (size > 1)
        while self._queue and (most is None or len(self._running) < most):
            self._begin(self._queue.popleft())

    def _begin(self, job: _Job) -> None:
        self.wait_until_ready(Silent(), 1 if self._alone else self.waiting + 1)
        self._running[self._submitted(job.items)] = job

    def _submitted(self, items: Sequence[Item]) -> Future[Any]:
        try:
            return self.executor.submit(_run, self._function, tuple(items))
        except BrokenExecutor as error:
            future: Future[Any] = Future()
            future.set_exception(error)
            return future

    def _returned(
        self, job: _Job, results: Sequence[tuple[Any, Exception | None]]
    ) -> list[Finished[Item, Result]]:
        if any(interrupted(error) for _, error in results):
            raise KeyboardInterrupt
        return [
            Finished(job.key, item, result, None if error is None else Failure.from_exception(error))
            for item, (result, error) in zip(job.items, results, strict=True)
        ]

    def _lost(self, job: _Job, error: BaseException) -> list[Finished[Item, Result]]:
        """Handle a job that ended in an error of the executor: submit each of its items again, or fail."""
        if isinstance(error, PliantError):
            raise error
        if isinstance(error, ImportError):
            raise UserError(f"the workers cannot import what the study needs ({error}); install it there.")
        if len(job.items) == 1 and job.losses + 1 >= MOST_TRIES:
            return [Finished(job.key, job.items[0], failure=Failure.from_exception(error))]
        self._queue.extendleft(reversed(job.singles(job.losses + 1)))
        return []

    def _killed(self, jobs: Sequence[_Job]) -> list[Finished[Item, Result]]:
        """Handle jobs whose workers died: each that had started runs again alone, or has failed."""
        was_alone, self._alone = self._alone, False
        suspect = [any(map(self._began, job.items)) for job in jobs]
        if not any(suspect):
            suspect = [True] * len(jobs)
        guilty = sum(suspect) == 1  # of several jobs any may have killed the worker
        failed: list[Finished[Item, Result]] = []
        for job, begun in reversed([*zip(jobs, suspect, strict=True)]):
            if not begun:
                self._queue.appendleft(job)
            elif len(job.items) > 1:
                self._suspects.extend(job.singles())
            elif was_alone and job.deaths + 1 >= MOST_DEATHS:
                failed.append(Finished(job.key, job.items[0], failure=Failure(KILLED)))
            else:
                self._suspects.append(replace(job, deaths=job.deaths + guilty))
        return failed


def _run(function: Callable[[Any], Any], items: Sequence[Any]) -> list[tuple[Any, Exception | None]]:
    """Return result and error of each item, in a worker; an exception of one item does not affect the others."""
    found: list[tuple[Any, Exception | None]] = []
    for item in items:
        try:
            found.append((function(item), None))
        except (PliantError, ImportError):  # errors that would occur for every item
            raise
        except Exception as error:
            found.append((None, error))
    return found
