"""What a worker does for a search: candidates, by an evaluator that it builds once and keeps.

What evaluators share, such as a fitted meta-model, the driver has put into the store before.
"""

from __future__ import annotations

import importlib
import threading
from dataclasses import dataclass
from functools import partial

from pliant.config.study import Study
from pliant.execution.executors import Executor, InlineExecutor
from pliant.execution.jobs import Finished, JobQueue
from pliant.interfaces.optimizer import Trial
from pliant.pipeline.remote import RemoteStudy
from pliant.pipeline.workbench import Workbench
from pliant.search.evaluate.evaluator import Evaluates, evaluated, evaluator_of_study
from pliant.search.stage_keys import MODULES

_KEPT = threading.local()  # the evaluator of the search that this thread works for


@dataclass(frozen=True)
class Setup:
    """How a worker gets its evaluator.

    Attributes:
        study: as it is searched.
        make: "module:function" that builds an evaluator from a setup.
        confirm: whether the best candidates are tried once more (`search.confirm`).
    """

    study: RemoteStudy
    make: str = "pliant.search.workers:evaluator_of"
    confirm: bool = False

    @classmethod
    def of(cls, bench: Workbench, study: Study, executor: Executor, confirm: bool = False) -> Setup:
        """Of a study as it is searched; workers that may have other code compare theirs with ours."""
        return cls(RemoteStudy.of(bench, study, MODULES if executor.remote else ()), confirm=confirm)


def queue_of(executor: Executor, setup: Setup, here: Evaluates) -> JobQueue[Trial, Trial]:
    """Candidates before an executor; this process takes the evaluator that it has."""
    function = partial(evaluated, here) if isinstance(executor, InlineExecutor) else partial(work, setup)
    return JobQueue(executor, function)


def told_of(one: Finished[Trial, Trial]) -> Trial:
    """What a candidate came to; one that has no result has failed."""
    return one.unwrap() if one.failure is None else one.item.failed(one.failure.cause)


def work(setup: Setup, trial: Trial) -> Trial:
    """In a worker: evaluate a candidate; raises only what every candidate would meet."""
    if getattr(_KEPT, "setup", None) != setup:
        module, _, name = setup.make.partition(":")
        _KEPT.evaluator, _KEPT.setup = getattr(importlib.import_module(module), name)(setup), setup
    return evaluated(_KEPT.evaluator, trial)


def evaluator_of(setup: Setup) -> Evaluates:
    """In a worker: the evaluator of a setup; raises `UserError` as `RemoteStudy.open` does."""
    return evaluator_of_study(*setup.study.open(), setup.confirm)
