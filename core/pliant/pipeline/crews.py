"""Who solves the designs of a sweep: this process, processes of its own, or any executor that is given.

Processes of one's own are spawned with one BLAS thread each. They hold the reading end of a pipe whose writing end
only the driver has: they end when it closes, be it that the driver stops them or that it was killed.
"""

from __future__ import annotations

import importlib
import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Protocol

from pliant.errors import MissingDependencyError, UserError
from pliant.pipeline.sweep_worker import Answer, Job, solve

THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMEXPR_NUM_THREADS")
MOST_WORKERS = 1024
CONNECT_S = 10


class Crew(Protocol):
    """`size` jobs run at a time; None where the crew itself knows."""

    size: int | None

    def submit(self, job: Any) -> Future[Any]:
        """Begin a job."""

    def renew(self) -> bool:
        """Replace a crew of which a worker died; False where that is not possible."""

    def stop(self, at_once: bool) -> None:
        """Let the workers go; at once: what runs is cut off, what is finished stands in the store."""


class Here:
    """This process solves, one design after the other; `say` hears of its states."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self.size: int | None = 1
        self._say = say

    def submit(self, job: Job) -> Future[Answer]:
        future: Future[Answer] = Future()
        future.set_result(solve(job, self._say))
        return future

    def renew(self) -> bool:
        return False

    def stop(self, at_once: bool) -> None:
        pass


class Processes:
    """Processes of our own; `work` is what they do with a job, by default the solution of a design."""

    def __init__(self, workers: int, work: Callable[[Any], Any] = solve) -> None:
        self.size: int | None = workers
        self._workers, self._work = workers, work
        self._open()

    def _open(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._ours, theirs = context.Pipe()
        self._theirs: Any = theirs
        self._pool = ProcessPoolExecutor(self._workers, context, _begin, (theirs,))

    def submit(self, job: Any) -> Future[Any]:
        with _one_thread_each(), _deaf_to_interrupts():  # processes are spawned when a job needs one
            return self._pool.submit(self._work, job)

    def renew(self) -> bool:
        self.stop(at_once=True)
        self._open()
        return True

    def stop(self, at_once: bool) -> None:
        self._pool.shutdown(wait=not at_once, cancel_futures=True)
        self._ours.close()
        self._theirs.close()


class Given:
    """An executor of the caller's: threads, processes, a cluster's. It is not shut down."""

    def __init__(self, executor: Executor, work: Callable[[Any], Any] = solve) -> None:
        self.size: int | None = None
        self._executor, self._work = executor, work

    def submit(self, job: Any) -> Future[Any]:
        try:
            return self._executor.submit(self._work, job)
        except BrokenExecutor as error:
            future: Future[Any] = Future()
            future.set_exception(error)
            return future

    def renew(self) -> bool:
        return False

    def stop(self, at_once: bool) -> None:
        pass


def cpus() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def checked_workers(workers: int) -> int:
    """The number of workers; raises `UserError` where it is none."""
    if isinstance(workers, bool) or not 1 <= workers <= MOST_WORKERS:
        raise UserError(f"workers is {workers}; it needs a whole number from 1 to {MOST_WORKERS}.")
    return workers


@contextmanager
def cluster(scheduler: str) -> Iterator[Executor]:
    """The executor of a dask cluster: the scheduler's address, tcp://host:8786, or its file.

    Raises:
        MissingDependencyError: dask.distributed is not installed.
        UserError: no scheduler answers there.
    """
    try:
        distributed = importlib.import_module("distributed")  # by name: only sweeps on a cluster need it
    except ImportError:
        raise MissingDependencyError("--scheduler needs dask: pip install 'pliant[cluster]'.") from None
    address = scheduler if "://" in scheduler else _address_in(Path(scheduler))
    try:
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        cause = " ".join(str(error).split()) or type(error).__name__
        raise UserError(
            f"no scheduler answers at {scheduler} ({cause[:200]}); start one with 'dask scheduler'."
        ) from None
    try:
        yield client.get_executor()
    finally:
        client.close(timeout=CONNECT_S)


def _address_in(file: Path) -> str:
    """The address in a scheduler's file; dask itself would wait for ever for a file that is none."""
    try:
        return str(json.loads(file.read_text(encoding="utf-8"))["address"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        cause = getattr(error, "strerror", None) or "it holds no address"
        raise UserError(
            f"--scheduler: {file} is no scheduler's file ({cause}); 'dask scheduler --scheduler-file FILE' writes "
            "one, or give an address such as tcp://host:8786."
        ) from None


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """The environment of processes that begin now: their number is the parallelism, unless the user said otherwise."""
    missing = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(missing, "1"))
    try:
        yield
    finally:
        for name in missing:
            os.environ.pop(name, None)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Ctrl-C is the driver's to answer: processes that begin now do not hear it, this one hears it afterwards."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # its start would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(driver: Connection) -> None:
    """A worker begins; without a driver there is nothing for it to do."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(driver,), daemon=True).start()


def _end_with(driver: Connection) -> None:
    try:
        driver.recv_bytes()
    except (EOFError, OSError):
        os._exit(0)
