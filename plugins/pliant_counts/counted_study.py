"""A study with a file of counts, and the comparison of its task with them."""

from __future__ import annotations

from dataclasses import dataclass

from pliant.config.measurements import MeasurementsConfig
from pliant.config.study import Study
from pliant.errors import UserError
from pliant.execution.executors import Workers
from pliant.interfaces.task import TaskConfig
from pliant.measurements.files import Sources
from pliant.pipeline.workbench import RunContext
from pliant_counts.comparison import CountComparison, compare_counts
from pliant_counts.reading import read_counts
from pliant_counts.recognition import counts_file, counts_trials
from pliant_counts.records import CountCondition, Counts
from pliant_counts.task_keys import changed_task
from pliant_counts.trials import Setting, simulate_trials


@dataclass(frozen=True)
class CountedStudy:
    """A study with the counts that it is compared with.

    Attributes:
        study: chain, physics, task, effects.
        task: its task with the study's noise.
        counts: what was measured.
        trials: to simulate for each condition.
    """

    study: Study
    task: TaskConfig
    counts: Counts
    trials: int

    def condition_task(self, condition: CountCondition) -> TaskConfig:
        """Return the task as performed under a condition, with the trials to simulate."""
        return changed_task(self.task, {**condition.changes, "task.trials": self.trials})


def counted_study(study: Study, data: Sources = None) -> CountedStudy:
    """Read the counts; raise `UserError` for a task that counts no trials, besides the errors of `read_counts`."""
    path = counts_file(study, data)
    if path is None:
        raise UserError(f"study '{study.name}' names no measurements; give --data counts.csv.")
    settings = study.measurements or MeasurementsConfig(file=str(path))
    if study.task is None or not counts_trials(study.task):
        has = f"its task '{study.task.kind}' has no trials" if study.task else "it has no 'task'"
        raise UserError(
            f"{path} is a file of counts, and study '{study.name}' cannot be counted: {has}. Counts need a task with "
            "'trials', such as 'grasp'."
        )
    task = study.noisy_task()
    return CountedStudy(study, task, read_counts(path, task, settings), settings.trials)


def compare_counted(context: RunContext, counted: CountedStudy, workers: Workers = 1) -> CountComparison:
    """Simulate every condition under the study's noise, each an artifact of the store, and compare."""
    settings = [
        Setting(counted.condition_task(condition), counted.study.effects)
        for condition in counted.counts.conditions
    ]
    return compare_counts(counted.counts, simulate_trials(context, counted.study, settings, workers))
