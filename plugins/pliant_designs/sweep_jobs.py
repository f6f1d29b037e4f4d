"""One design of a sweep in a worker: its job, its solution, its outcome."""

from __future__ import annotations

import platform
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pliant.errors import InvalidDesignError, NotReachedError, PliantError, UserError
from pliant.execution.progress_store import JobProgress
from pliant.pipeline.dataset import fem_stage
from pliant.pipeline.remote import other_version, registry_with, store_seen
from pliant.pipeline.workbench import RunContext
from pliant.store.parcel import packed
from pliant.store.store import (
    ArtifactStore,
)

Status = Literal["done", "refused", "not_reached", "error", "crashed", "busy", "stop"]


@dataclass(frozen=True)
class SweepJob:
    """One design for a worker.

    Attributes:
        number: of the design in its sweep.
        configs: family, material and fem as JSON values.
        plugins: Python files with the user's kinds.
        store: root of the store.
        progress: a folder that the driver made in the store (`ProgressStore`): its presence shows that the store is
            shared; a worker that does not see it uses a local store and returns its artifact as bytes.
        key: of the artifact, by the driver's code and libraries.
        waits: whether to wait for another process that is computing this design; else the answer is "busy".
    """

    number: int
    configs: Mapping[str, Any]
    plugins: tuple[str, ...]
    store: str
    progress: str
    key: str
    waits: bool = False


@dataclass(frozen=True)
class WorkerOutcome:
    """Outcome of a design in a worker: `stop` is a mistake that affects every design.

    `parcel` is the artifact as bytes, from a worker that does not see the store.
    """

    status: Status
    cause: str = ""
    wall_s: float = 0.0
    notes: tuple[str, ...] = ()
    parcel: bytes = b""


def solve(job: SweepJob, say: Callable[[str], None] | None = None) -> WorkerOutcome:
    """Solve one design in a worker, unless the store has it; `say` is notified of its states in this process.

    The worker finds its own plugins and opens the store by its path, or a store of its host. It never raises: every
    failure of a design is an answer.
    """
    started = time.perf_counter()
    progress: JobProgress | None = None
    status: Status = "stop"
    parcel = b""
    try:
        store = ArtifactStore(store_seen(Path(job.progress), job.store))
        shared = store.root == Path(job.store)
        with tempfile.TemporaryDirectory() if not shared else nullcontext(job.progress) as folder:
            progress = JobProgress(Path(folder) / str(job.number), say)
            if not job.waits and store.computed_elsewhere("fem", job.key):
                return WorkerOutcome("busy")
            status, cause = _solved(job, RunContext(registry_with(job.plugins), store, progress))
        if status == "done" and not shared:
            parcel = packed(store.root / "fem" / job.key)
    except PliantError as error:
        cause = str(error)
    except OSError as error:  # the folder or the store was removed
        status, cause = "stop", f"worker on {platform.node()}: {error}."
    notes = tuple(progress.notes) if progress else ()
    return WorkerOutcome(status, cause, time.perf_counter() - started, notes, parcel)


def _solved(job: SweepJob, context: RunContext) -> tuple[Status, str]:
    """Return status and cause; raise `UserError` for mistakes that affect every design."""
    try:
        family, material, fem = (
            context.registry.config_model(interface, config).model_validate(config)
            for interface, config in job.configs.items()
        )
        made = fem_stage(context, family, material, fem)  # type: ignore[arg-type]
    except InvalidDesignError as error:
        return "refused", str(error)
    except NotReachedError as error:
        return "not_reached", str(error)
    except UserError:
        raise
    except (Exception, SystemExit) as error:  # a plugin may raise anything
        return "error", ": ".join(filter(None, (type(error).__name__, " ".join(str(error).split()))))
    if made.key != job.key:
        raise other_version(" (its result has another key)")
    return "done", ""
