"""What a worker does for a search: a few candidates, by an evaluator that it builds once and keeps.

A job is small and holds plain values only: the study as JSON, the plugin files, the store's path, the candidates.
What evaluators share, such as a fitted meta-model, the driver has put into the store before.
"""

from __future__ import annotations

import importlib
import json
import platform
import threading
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pliant.config.study import Study, study_model
from pliant.errors import UserError
from pliant.interfaces.optimizer import Trial
from pliant.pipeline.workbench import Workbench
from pliant.registry.discovery import discover
from pliant.registry.files import with_files
from pliant.search.evaluate.evaluator import Evaluates, evaluated, evaluator_of_study
from pliant.search.stage_keys import MODULES
from pliant.store.fingerprint import code_fingerprint
from pliant.store.store import ArtifactStore

MAKE = "pliant.search.workers:evaluator_of"
_LOADING = threading.Lock()  # files of plugins are executed once, also where a worker has several threads
_KEPT = threading.local()  # the evaluator of the search that this thread works for


@dataclass(frozen=True)
class Setup:
    """How a worker gets its evaluator.

    Attributes:
        study: as canonical JSON.
        plugins: Python files with kinds of the user's own.
        store: root of the store.
        code: fingerprint of the code that the driver runs; empty: not compared.
        make: "module:function" that builds an evaluator from a setup.
        confirm: whether the best candidates are tried once more (`search.confirm`).
    """

    study: str
    plugins: tuple[str, ...]
    store: str
    code: str = ""
    make: str = MAKE
    confirm: bool = False

    @classmethod
    def of(cls, bench: Workbench, study: Study, code: str = "") -> Setup:
        """Of a study as it is searched."""
        plugins = tuple(str(file) for file in study.plugins)
        return cls(json.dumps(study.canonical()), plugins, str(bench.store.root.resolve()), code)

    def evaluator(self) -> Evaluates:
        """Build it."""
        module, _, name = self.make.partition(":")
        made: Evaluates = getattr(importlib.import_module(module), name)(self)
        return made


@dataclass(frozen=True)
class Job:
    """Candidates for a worker."""

    setup: Setup
    tasks: tuple[Trial, ...]


def work(job: Job) -> tuple[Trial, ...]:
    """Evaluate the candidates of a job; raises only what every candidate would meet."""
    evaluator = _kept(job.setup)
    return tuple(evaluated(evaluator, task) for task in job.tasks)


def evaluator_of(setup: Setup) -> Evaluates:
    """The evaluator of a study, with the scenarios of a robust search; raises `UserError` as `opened` does."""
    return evaluator_of_study(*opened(setup), setup.confirm)


def opened(setup: Setup) -> tuple[Workbench, Study]:
    """The surroundings and the study of a setup.

    Raises:
        UserError: the worker runs other code, or does not see the store.
    """
    if setup.code and code_fingerprint(MODULES) != setup.code:
        raise UserError(
            f"the worker on {platform.node()} runs another version of Pliant than this process; install the same on "
            "both, and edit no code while a search runs."
        )
    if not Path(setup.store).is_dir():
        raise UserError(
            f"the worker on {platform.node()} does not see the store {setup.store}; workers need the same folder "
            "under the same path, on a shared file system (choose it with --store)."
        )
    with _LOADING:
        registry = with_files(discover(), [Path(file) for file in setup.plugins])
    raw = json.loads(setup.study)
    study: Study = study_model(raw, registry).model_validate(raw)
    return Workbench(registry, ArtifactStore(Path(setup.store))), study


def _kept(setup: Setup) -> Evaluates:
    if getattr(_KEPT, "setup", None) != setup:
        _KEPT.evaluator, _KEPT.setup = setup.evaluator(), setup
    kept: Evaluates = _KEPT.evaluator
    return kept


class Inline:
    """The crew of this process: evaluates where a job is handed in."""

    def __init__(self, evaluator: Evaluates) -> None:
        self.size: int | None = 1
        self._evaluator = evaluator

    def submit(self, job: Job) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(tuple(evaluated(self._evaluator, task) for task in job.tasks))
        return future

    def renew(self) -> bool:
        return False

    def stop(self, at_once: bool) -> None:
        pass
