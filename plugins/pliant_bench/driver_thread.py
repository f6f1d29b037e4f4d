"""Calls of a driver in a separate thread, so that a call that hangs does not keep the bench from being vented."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Any

from pliant_bench.bench import ConnectionLostError


class DriverThread:
    """A thread that calls a driver, so that a call that hangs can be given up; without `stall_s` there is no thread."""

    def __init__(self, stall_s: float | None) -> None:
        self._stall_s = stall_s
        self._calls: queue.SimpleQueue[Callable[[], Any] | None] = queue.SimpleQueue()
        self._results: queue.SimpleQueue[tuple[Any, BaseException | None]] = queue.SimpleQueue()

    def __enter__(self) -> DriverThread:
        if self._stall_s is not None:
            threading.Thread(target=self._work, name="pliant bench", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._calls.put(None)

    def call(self, function: Callable[[], Any], failure: str) -> Any:
        """Return the result of a call, or raise its error or that it takes too long."""
        if self._stall_s is None:
            return function()
        self._calls.put(function)
        try:
            result, error = self._results.get(timeout=self._stall_s)
        except queue.Empty:
            raise ConnectionLostError(f"The bench {failure} for {self._stall_s:g} s.") from None
        if error is not None:
            raise error
        return result

    def _work(self) -> None:
        while (function := self._calls.get()) is not None:
            try:
                self._results.put((function(), None))
            except BaseException as error:
                self._results.put((None, error))


def call_driver(stall_s: float | None, function: Callable[[], Any]) -> Any:
    """Return the result of one call of a driver, as `DriverThread.call` does."""
    with DriverThread(stall_s) as worker:
        return worker.call(function, "did not answer")
