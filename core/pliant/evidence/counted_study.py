"""A study against a file of counts: read it, simulate every condition, compare."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pliant.config.measurements import MeasurementsConfig
from pliant.config.study import Study
from pliant.config.task_keys import changed_task
from pliant.errors import UserError
from pliant.evidence.counts import CountComparison, compare_counts
from pliant.evidence.trials import Setting, simulate_trials
from pliant.execution.executors import Workers
from pliant.interfaces.task import TaskConfig
from pliant.measurements.counts_reading import counts_trials, holds_counts, read_counts
from pliant.pipeline.workbench import Workbench
from pliant.records.counts import CountCondition, Counts


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

    def task_of(self, condition: CountCondition) -> TaskConfig:
        """The task as it was done under a condition, with the trials to simulate."""
        return changed_task(self.task, {**condition.changes, "task.trials": self.trials})


def is_counted(study: Study, data: Path | None = None) -> bool:
    """Whether the study's measurements, or `data`, are a file of counts."""
    path = _file(study, data)
    return path is not None and holds_counts(path, study.task, study.measurements)


def counted_study(study: Study, data: Path | None = None) -> CountedStudy:
    """Read the counts; raises `UserError` for a task that counts no trials, and what `read_counts` raises."""
    path = _file(study, data)
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


def compare_counted(bench: Workbench, counted: CountedStudy, workers: Workers = 1) -> CountComparison:
    """Simulate every condition under the study's noise, each an artifact of the store, and compare."""
    settings = [
        Setting(counted.task_of(condition), counted.study.effects) for condition in counted.counts.conditions
    ]
    return compare_counts(counted.counts, simulate_trials(bench, counted.study, settings, workers))


def _file(study: Study, data: Path | None) -> Path | None:
    if data is not None:
        return data
    return None if study.measurements is None else Path(study.measurements.file)
