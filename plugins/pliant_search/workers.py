"""Work of a search's worker: it evaluates candidates by an evaluator that it builds once and keeps.

The driver stores objects that evaluators share beforehand, such as a fitted meta-model.
"""

from __future__ import annotations

import importlib
import threading
from dataclasses import dataclass
from functools import partial

from pliant.config.study import Study
from pliant.execution.executors import Executor, InlineExecutor
from pliant.execution.jobs import Finished, JobQueue
from pliant.pipeline.remote import RemoteStudy
from pliant.pipeline.workbench import RunContext
from pliant_search.evaluate.evaluator import Evaluates, evaluated, evaluator_from_study
from pliant_search.optimizer import Trial
from pliant_search.stage_keys import MODULES

_KEPT = threading.local()  # the evaluator of the search that this thread works for


@dataclass(frozen=True)
class Setup:
    """Description of a worker's evaluator.

    Attributes:
        study: the searched study.
        make: "module:function" that builds an evaluator from a setup.
        confirm: whether the best candidates are re-evaluated (`search.confirm`).
    """

    study: RemoteStudy
    make: str = "pliant_search.workers:evaluator_from_setup"
    confirm: bool = False

    @classmethod
    def from_study(
        cls, context: RunContext, study: Study, executor: Executor, confirm: bool = False
    ) -> Setup:
        """Return the setup of a searched study; remote workers compare their code with that of this process."""
        return cls(
            RemoteStudy.from_study(context, study, MODULES if executor.remote else ()), confirm=confirm
        )


def trial_queue(executor: Executor, setup: Setup, here: Evaluates) -> JobQueue[Trial, Trial]:
    """Return the queue of candidates over an executor; this process uses its existing evaluator."""
    function = partial(evaluated, here) if isinstance(executor, InlineExecutor) else partial(work, setup)
    return JobQueue(executor, function)


def finished_trial(one: Finished[Trial, Trial]) -> Trial:
    """Return the evaluated trial of a finished job, or a failed trial if it has no result."""
    return one.unwrap() if one.failure is None else one.item.failed(one.failure.cause)


def work(setup: Setup, trial: Trial) -> Trial:
    """Evaluate a candidate in a worker; raise only an error that every candidate would meet."""
    if getattr(_KEPT, "setup", None) != setup:
        module, _, name = setup.make.partition(":")
        _KEPT.evaluator, _KEPT.setup = getattr(importlib.import_module(module), name)(setup), setup
    return evaluated(_KEPT.evaluator, trial)


def evaluator_from_setup(setup: Setup) -> Evaluates:
    """Return the evaluator of a setup in a worker; raise `UserError` as `RemoteStudy.open` does."""
    return evaluator_from_study(*setup.study.open(), setup.confirm)
