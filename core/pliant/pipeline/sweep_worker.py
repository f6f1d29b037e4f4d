"""What a worker does for a sweep: one design, from its config to an artifact in the shared store.

A job is small and holds plain values only; the worker finds its own plugins and opens the store by its path. It
never raises: whatever happens to a design is an answer.
"""

from __future__ import annotations

import platform
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pliant.errors import InvalidDesignError, NotReachedError, PliantError, UserError
from pliant.pipeline.dataset import fem_stage
from pliant.pipeline.workbench import Workbench
from pliant.registry.discovery import Registry, discover
from pliant.registry.files import with_files
from pliant.store.store import ArtifactStore

Status = Literal["done", "refused", "not_reached", "error", "crashed", "busy", "stop"]
SEEN_WITHIN_S = 2.0
_LOADING = threading.Lock()  # files of plugins are executed once, also where a worker has several threads


@dataclass(frozen=True)
class Job:
    """One design for a worker.

    Attributes:
        number: of the design in its sweep.
        configs: family, material and fem as JSON values.
        plugins: Python files with kinds of the user's own.
        store: root of the store.
        desk: a folder in the store that the driver made: its presence shows that the store is shared.
        key: of the artifact, as the driver's own code and libraries name it.
        waits: whether to wait for another process that computes this design now; else the answer is "busy".
    """

    number: int
    configs: Mapping[str, Any]
    plugins: tuple[str, ...]
    store: str
    desk: str
    key: str
    waits: bool = False


@dataclass(frozen=True)
class Answer:
    """How a design ended: `stop` is a mistake that no other design would escape."""

    number: int
    status: Status
    cause: str = ""
    wall_s: float = 0.0
    notes: tuple[str, ...] = ()


class Desk:
    """Progress of one design as a small file, `done total`, which the driver reads; also its own task.

    When the driver ends, its desk goes, and the next state of a worker that is beyond its reach is the last.
    """

    def __init__(self, job: Job, say: Callable[[str], None] | None = None) -> None:
        self._file, self._say = Path(job.desk) / str(job.number), say
        self.notes: list[str] = []
        self._done = self._total = 0
        self._write()

    def begin(self, title: str, total: int, done: int = 0) -> Desk:
        self._done, self._total = done, total
        self._write()
        return self

    def advance(self, steps: int = 1) -> None:
        self._done += steps
        self._write()

    def describe(self, text: str) -> None:
        pass

    def expect(self, total: int) -> None:
        self._total = total
        self._write()

    def finish(self) -> None:
        pass

    def note(self, text: str) -> None:
        self.notes.append(text)

    def _write(self) -> None:
        self._file.write_text(f"{self._done} {self._total}")
        if self._say is not None and self._total:
            self._say(f"state {self._done} of {self._total}")


def solve(job: Job, say: Callable[[str], None] | None = None) -> Answer:
    """Solve one design, unless the store has it; `say` hears of its states where that is this process."""
    started = time.perf_counter()
    desk: Desk | None = None
    try:
        _check_store(job)
        desk = Desk(job, say)
        registry = _registry(job.plugins)
        store = ArtifactStore(Path(job.store))
        if not job.waits and store.computed_elsewhere("fem", job.key):
            return Answer(job.number, "busy")
        status, cause = _solved(job, Workbench(registry, store, desk))
    except PliantError as error:
        status, cause = "stop", str(error)
    except OSError as error:  # the desk or the store went away
        status, cause = "stop", f"worker on {platform.node()}: {error}."
    notes = tuple(desk.notes) if desk else ()
    return Answer(job.number, status, cause, time.perf_counter() - started, notes)


def _solved(job: Job, bench: Workbench) -> tuple[Status, str]:
    """Status and cause; raises `UserError` for what concerns every design."""
    try:
        family, material, fem = (
            bench.registry.get(interface, config["kind"]).config_model().model_validate(config)
            for interface, config in job.configs.items()
        )
        made = fem_stage(bench, family, material, fem)  # type: ignore[arg-type]
    except InvalidDesignError as error:
        return "refused", str(error)
    except NotReachedError as error:
        return "not_reached", str(error)
    except UserError:
        raise
    except (Exception, SystemExit) as error:  # a plugin may fail in any way
        text = " ".join(str(error).split())
        return "error", f"{type(error).__name__}: {text}" if text else type(error).__name__
    if made.key != job.key:
        raise UserError(
            f"the worker on {platform.node()} runs another version of Pliant, of a plugin or of a library than this "
            "process (its result has another key); install the same on both, and edit no code while a sweep runs."
        )
    return "done", ""


def _check_store(job: Job) -> None:
    until = time.monotonic() + SEEN_WITHIN_S
    while not Path(job.desk).is_dir():
        if time.monotonic() < until:
            time.sleep(0.2)  # a network file system shows new folders after a while
            continue
        raise UserError(
            f"the worker on {platform.node()} does not see the store {job.store}; workers need the same folder under "
            "the same path, on a shared file system (choose it with --store)."
        )


def _registry(plugins: tuple[str, ...]) -> Registry:
    with _LOADING:
        return with_files(discover(), [Path(file) for file in plugins])
