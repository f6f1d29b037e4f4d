"""What a worker does for a sweep: one design, from its config to an artifact in the shared store.

A job is small and holds plain values only; the worker finds its own plugins and opens the store by its path. It
never raises: whatever happens to a design is an answer.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pliant.errors import InvalidDesignError, NotReachedError, PliantError, UserError
from pliant.execution.progress_store import JobProgress
from pliant.pipeline.dataset import fem_stage
from pliant.pipeline.remote import other_version, registry_with, require_seen
from pliant.pipeline.workbench import Workbench
from pliant.store.store import ArtifactStore

Status = Literal["done", "refused", "not_reached", "error", "crashed", "busy", "stop"]


@dataclass(frozen=True)
class SweepJob:
    """One design for a worker.

    Attributes:
        number: of the design in its sweep.
        configs: family, material and fem as JSON values.
        plugins: Python files with kinds of the user's own.
        store: root of the store.
        progress: a folder in the store that the driver made (`ProgressStore`): its presence shows that the store is
            shared.
        key: of the artifact, as the driver's own code and libraries name it.
        waits: whether to wait for another process that computes this design now; else the answer is "busy".
    """

    number: int
    configs: Mapping[str, Any]
    plugins: tuple[str, ...]
    store: str
    progress: str
    key: str
    waits: bool = False


@dataclass(frozen=True)
class Answer:
    """How a design ended: `stop` is a mistake that no other design would escape."""

    status: Status
    cause: str = ""
    wall_s: float = 0.0
    notes: tuple[str, ...] = ()


def solve(job: SweepJob, say: Callable[[str], None] | None = None) -> Answer:
    """Solve one design, unless the store has it; `say` hears of its states where that is this process."""
    started = time.perf_counter()
    progress: JobProgress | None = None
    try:
        require_seen(Path(job.progress), job.store)
        progress = JobProgress(Path(job.progress) / str(job.number), say)
        store = ArtifactStore(Path(job.store))
        if not job.waits and store.computed_elsewhere("fem", job.key):
            return Answer("busy")
        status, cause = _solved(job, Workbench(registry_with(job.plugins), store, progress))
    except PliantError as error:
        status, cause = "stop", str(error)
    except OSError as error:  # the folder or the store went away
        status, cause = "stop", f"worker on {platform.node()}: {error}."
    notes = tuple(progress.notes) if progress else ()
    return Answer(status, cause, time.perf_counter() - started, notes)


def _solved(job: SweepJob, bench: Workbench) -> tuple[Status, str]:
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
        raise other_version(" (its result has another key)")
    return "done", ""
