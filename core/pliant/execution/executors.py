"""Executors: this process, Pliant's own worker processes, or any given executor, including a dask cluster's.

`pliant.execution.jobs` decides what happens when a worker dies; an executor only replaces its workers on request
(`restart`).

Worker processes are those of `concurrent.futures`, spawned. loky (BSD) was the alternative: it adds functions
without a module and scripts without a `__main__` guard, which do not justify a dependency, and one dead worker ends the
whole pool there, too.

They have one BLAS thread each, and the reading end of a pipe whose writing end only the driver has: they end when it
closes, whether the driver stops them or was killed.
"""

from __future__ import annotations

import importlib
import json
import multiprocessing
import os
import signal
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from concurrent import futures
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeAlias

from pliant.errors import MissingDependencyError, UserError

THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMEXPR_NUM_THREADS")
MOST_WORKERS = 1024
MOST_THREADS = 4  # the part under Python's lock, about a fifth of a diagnosis, makes more threads wait
CONNECT_S = 10
COUNT_EVERY_S = 10.0


class Executor(ABC):
    """An executor that runs functions of a module with plain values.

    Attributes:
        size: how many calls run at a time; None if only the executor knows.
        remote: whether its workers may have other code or another file system than this process.
    """

    size: int | None = None
    remote = False

    @abstractmethod
    def submit(self, function: Callable[..., Any], *values: Any) -> futures.Future[Any]:
        """Submit a call of a module's function with plain values and return its future."""

    def capacity(self) -> int | None:
        """Return how many calls can run at a time at present; None where that is not known."""
        return self.size

    def restart(self) -> bool:
        """Replace the workers after one has died; return False where that is not possible."""
        return False

    def shutdown(self, at_once: bool) -> None:  # noqa: B027 - most have nothing to let go
        """Release the workers; `at_once` cancels running calls. Workers of the caller's executor stay."""


class InlineExecutor(Executor):
    """This process, which runs each call when it is submitted."""

    size: int | None = 1

    def submit(self, function: Callable[..., Any], *values: Any) -> futures.Future[Any]:
        future: futures.Future[Any] = futures.Future()
        future.set_result(function(*values))
        return future


class ProcessExecutor(Executor):
    """Worker processes of this machine, started when there is work for them."""

    def __init__(self, workers: int) -> None:
        self.size = self._workers = workers
        self._open()

    def _open(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._ours, theirs = context.Pipe()
        self._theirs: Any = theirs
        self._pool = futures.ProcessPoolExecutor(self._workers, context, _begin_worker, (theirs,))

    def submit(self, function: Callable[..., Any], *values: Any) -> futures.Future[Any]:
        with one_thread_each(), ignore_sigint():  # processes are spawned when a call needs one
            try:
                return self._pool.submit(function, *values)
            except OSError as error:
                if error.errno is not None:  # an error of the system: too many files, no memory
                    raise
                raise futures.BrokenExecutor(  # the pool closed its pipes while this process started
                    "a worker died while another began"
                ) from error

    def restart(self) -> bool:
        # The broken pool's thread is not awaited: it may hang on a call that a dead worker had half received.
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._end_workers()
        self._open()
        return True

    def shutdown(self, at_once: bool) -> None:
        if at_once:
            self._end_workers()
        # Python 3.11 may fail at its exit if the pool's thread still closes its pipes.
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._end_workers()

    def _end_workers(self) -> None:
        self._ours.close()
        self._theirs.close()


class ThreadExecutor(Executor):
    """Threads of this process, for work that is mostly compiled loops that release Python's lock."""

    def __init__(self, threads: int) -> None:
        self.size = threads
        self._pool = futures.ThreadPoolExecutor(threads)

    def submit(self, function: Callable[..., Any], *values: Any) -> futures.Future[Any]:
        return self._pool.submit(function, *values)

    def shutdown(self, at_once: bool) -> None:
        self._pool.shutdown(wait=not at_once, cancel_futures=True)


class FuturesExecutor(Executor):
    """An executor of the caller's: threads, processes, a cluster's. It is not shut down."""

    remote = True

    def __init__(self, executor: futures.Executor) -> None:
        self._executor = executor

    def submit(self, function: Callable[..., Any], *values: Any) -> futures.Future[Any]:
        return self._executor.submit(function, *values)


class DaskExecutor(FuturesExecutor):
    """The workers of a dask cluster; the connection ends with this executor, the cluster stays.

    Args:
        scheduler: its address, tcp://host:8786, or its file.

    Raises:
        MissingDependencyError: dask.distributed is not installed.
        UserError: no scheduler answers there.
    """

    def __init__(self, scheduler: str) -> None:
        try:
            distributed = importlib.import_module("distributed")  # by name: needed only on a cluster
        except ImportError:
            raise MissingDependencyError(
                "work on a dask cluster needs dask: pip install 'pliant[cluster]'."
            ) from None
        address = scheduler if "://" in scheduler else _address_in(Path(scheduler))
        try:
            self._client = _connect_client(distributed.Client, address)
        except Exception as error:  # the answering server may be no scheduler and raise anything
            cause = " ".join(str(error).split()) or type(error).__name__
            raise UserError(
                f"no scheduler answers at {scheduler} ({cause[:200]}); start one with 'dask scheduler'."
            ) from None
        super().__init__(self._client.get_executor())
        self._counted: tuple[float, int | None] = (-COUNT_EVERY_S, None)

    def capacity(self) -> int | None:
        """Return the number of threads of all workers, queried now and then because workers join and leave."""
        if time.monotonic() - self._counted[0] >= COUNT_EVERY_S:
            self._counted = time.monotonic(), sum(self._client.nthreads().values()) or None
        return self._counted[1]

    def shutdown(self, at_once: bool) -> None:
        self._client.close(timeout=CONNECT_S)


def _connect_client(client: Callable[..., Any], address: str) -> Any:
    """Return dask's client, or its error; a `TimeoutError` where no answer comes, for which dask waits for ever."""
    found: futures.Future[Any] = futures.Future()

    def connect() -> None:
        try:
            found.set_result(client(address, timeout=CONNECT_S, set_as_default=False))
        except Exception as error:  # of any kind: it is raised below
            found.set_exception(error)

    threading.Thread(target=connect, daemon=True).start()
    return found.result(timeout=2 * CONNECT_S)


# A number of processes, the address or file of a dask scheduler, an executor; None: a process for each CPU.
Workers: TypeAlias = int | str | futures.Executor | Executor | None


@contextmanager
def executor_for(workers: Workers, most: int | None = None, threads: int = 1) -> Iterator[Executor]:
    """Yield the requested executor for the time of the block; an error in the block cancels running calls.

    Args:
        workers: 1 means this process; executors of the caller's are not shut down.
        most: largest number of calls: no more processes are started.
        threads: of this process, if it does the work; see `own_threads`.

    Raises:
        UserError: an invalid number of workers, or no scheduler answers.
    """
    if isinstance(workers, str):
        executor: Executor = DaskExecutor(workers)
    elif isinstance(workers, futures.Executor):
        executor = FuturesExecutor(workers)
    elif isinstance(workers, Executor):
        executor = workers
    else:
        count = checked_workers(cpus() if workers is None else workers)
        count = count if most is None else min(count, most)
        alone: Executor = ThreadExecutor(threads) if threads > 1 else InlineExecutor()
        executor = ProcessExecutor(count) if count > 1 else alone
    whole = False
    try:
        yield executor
        whole = True
    finally:
        executor.shutdown(at_once=not whole)


def either(executor: Workers, workers: int | None, what: str) -> Workers:
    """Return the given one; raises `UserError` where both are given."""
    if executor is not None and workers is not None:
        raise UserError(f"{what} takes an executor or a number of workers, not both.")
    return workers if executor is None else executor


def cpus() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def own_threads() -> int:
    """Return the number of threads for compiled loops of this process: that of BLAS, `OMP_NUM_THREADS`, or a few.

    A worker process has one (`one_thread_each`), so that threads are not nested.
    """
    stated = os.environ.get(THREADS[0], "")
    return max(int(stated), 1) if stated.isdecimal() else min(cpus(), MOST_THREADS)


def checked_workers(workers: int) -> int:
    """Return the number of workers; raises `UserError` for an invalid one."""
    if isinstance(workers, bool) or not 1 <= workers <= MOST_WORKERS:
        raise UserError(f"workers is {workers}; it needs a whole number from 1 to {MOST_WORKERS}.")
    return workers


def _address_in(file: Path) -> str:
    """Return the address in a scheduler's file; raises for an invalid one, on which dask would wait for ever."""
    try:
        return str(json.loads(file.read_text(encoding="utf-8"))["address"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        cause = getattr(error, "strerror", None) or "it holds no address"
        raise UserError(
            f"{file} is no scheduler's file ({cause}); 'dask scheduler --scheduler-file FILE' writes "
            "one, or give an address such as tcp://host:8786."
        ) from None


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Limit processes that start now to one thread each, unless the user set another number."""
    missing = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(missing, "1"))
    try:
        yield
    finally:
        for name in missing:
            os.environ.pop(name, None)


@contextmanager
def ignore_sigint() -> Iterator[None]:
    """Let only the driver handle Ctrl-C: processes that start now ignore it, this process receives it afterwards."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # starting the tracker would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin_worker(driver: Connection) -> None:
    """Start a worker that ends with its driver."""

    def end_with_it() -> None:
        try:
            driver.recv_bytes()
        except (EOFError, OSError):
            os._exit(0)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=end_with_it, daemon=True).start()
