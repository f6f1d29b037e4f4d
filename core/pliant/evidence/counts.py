"""Comparison of a model's trials with counted trials: conditions that disagree beyond chance, and repeats that do.

Both sides are finite: s of n measured, t of m simulated. The log-likelihood of a condition is that of the measured
count given the simulated one (`binomial.log_predictive`); its test is Fisher's exact one, adjusted for the number of
conditions by Holm. Sets of one condition are tested against each other in the same way: contradictory repeats are a
finding about the test rig, reported before any about the model.

The trials of a study's task under many settings are simulated here, each an artifact of the store, by any executor.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np
import scipy

from pliant.config.measurements import MeasurementsConfig
from pliant.config.study import Study
from pliant.config.task_keys import changed_task
from pliant.errors import NotReachedError, UserError
from pliant.evidence.binomial import (
    Count,
    chi_square,
    deviance,
    fisher_p,
    holm,
    log_bayes_factor,
    log_own,
    log_predictive,
    repeats_agree,
    signed_z,
    wilson,
)
from pliant.execution.executors import InlineExecutor, Workers, executor_for
from pliant.execution.jobs import JobQueue
from pliant.interfaces.effect import EffectConfig
from pliant.interfaces.task import TaskConfig
from pliant.measurements.counts_reading import counts_trials, holds_counts, read_counts
from pliant.measurements.files import Sources, expand_sources
from pliant.pipeline.remote import RemoteStudy
from pliant.pipeline.simulate import ChainSource, simulate_stage
from pliant.pipeline.study import build_study_chain, study_physics
from pliant.pipeline.workbench import RunContext
from pliant.records.counts import CountCondition, Counts
from pliant_tables.columns import is_frame

SHARE = "success_share"


@dataclass(frozen=True)
class Setting:
    """A task's config with its conditions, noise and number of trials, and the effects in the model."""

    task: TaskConfig
    effects: tuple[EffectConfig, ...]


def simulate_trials(
    context: RunContext, study: Study, settings: Sequence[Setting], workers: Workers = 1
) -> list[Count]:
    """Return successes and trials of each setting; results in the store are reused.

    Args:
        context: plugins, store, progress.
        study: chain, physics and everything else that the settings share.
        settings: see `Setting`; trials of one seed draw the same random numbers in every setting.
        workers: see `executor_for`; 1 simulates in this process.

    Raises:
        UserError: a task that does not count successes, or an engine that cannot simulate it.
        NotReachedError: a setting killed its worker twice; the results of the others are in the store.
    """
    source = build_study_chain(context, study)  # the law is stored before workers begin
    bar = context.progress.begin("simulating conditions", len(settings))
    function: Callable[[Any], Count] = partial(_simulated, context, study, source)
    items: Sequence[Any] = settings
    done = []
    try:
        with executor_for(workers, len(settings)) as executor:
            if not isinstance(executor, InlineExecutor):
                modules = (__name__,) if executor.remote else ()
                items = [
                    RemoteStudy.from_study(context, _with(study, setting), modules) for setting in settings
                ]
                function = simulate_remote
            with JobQueue(executor, function) as queue:
                for one in queue.each(items):
                    done.append(one)
                    bar.advance()
    finally:
        bar.finish()
    return [one.unwrap() for one in done]


def simulate_remote(remote: RemoteStudy) -> tuple[int, int]:
    """Run the task of a study in a worker, through the shared store."""
    context, study = remote.open()
    setting = Setting(study.need("task", "a simulation"), study.effects)
    return _simulated(context, study, build_study_chain(context, study), setting)


def _with(study: Study, setting: Setting) -> Study:
    """Return the study of one setting; its task includes the study's noise."""
    changes = {"task": setting.task, "effects": setting.effects}
    return study.model_copy(update={**changes, "noise": None, "measurements": None, "cross_check": ()})


def _simulated(context: RunContext, study: Study, source: ChainSource, setting: Setting) -> Count:
    task = setting.task
    made = simulate_stage(context, source, study_physics(context, study), task, setting.effects)
    share, trials = made.value.metrics.get(SHARE), int(getattr(task, "trials", 1))
    if share is None:
        raise UserError(
            f"task '{task.kind}' does not say how many trials succeed ('{SHARE}'); counts need one."
        )
    if not 0.0 <= share <= 1.0:
        raise NotReachedError(f"task '{task.kind}' gives a share of successes of {share:g}")
    return round(share * trials), trials


LEVEL = 0.05


@dataclass(frozen=True)
class ConditionResult:
    """One condition.

    Attributes:
        condition: what was set and measured.
        simulated: successes and trials of the model.
        log_likelihood: of the measured count given the simulated one.
        deviance: twice the log-likelihood lost against the best possible simulated count; ≥ 0.
        log_bayes_factor: one probability for both over one each; negative values are evidence against the model.
        p: Fisher's exact test; `p_adjusted` after Holm over all conditions.
        z: its normal score, positive where more succeeded than in the model.
        p_repeats: of the sets having one probability, 1 for a single set; `p_repeats_adjusted` after Holm.
        share_of_error: of the total deviance.
    """

    condition: CountCondition
    simulated: Count
    log_likelihood: float
    deviance: float
    log_bayes_factor: float
    p: float
    p_adjusted: float
    z: float
    p_repeats: float
    p_repeats_adjusted: float
    share_of_error: float

    @property
    def measured(self) -> Count:
        """Return successes and trials over all sets."""
        return self.condition.successes, self.condition.trials

    @property
    def disagrees(self) -> bool:
        """Return whether the model differs from the measurement by more than chance, adjusted for all conditions."""
        return self.p_adjusted < LEVEL

    @property
    def contradictory(self) -> bool:
        """Return whether the sets of this condition differ by more than chance, adjusted for all conditions."""
        return self.p_repeats_adjusted < LEVEL

    @property
    def error(self) -> float:
        """Return the measured minus the simulated share of successes."""
        return self.measured[0] / self.measured[1] - self.simulated[0] / self.simulated[1]

    @property
    def interval(self) -> tuple[float, float]:
        """Return the 95 % interval of the measured share (Wilson)."""
        return wilson(self.measured)


@dataclass(frozen=True)
class CountComparison:
    """A comparison of counts under all conditions.

    Attributes:
        conditions: in the file's order.
        log_likelihood, deviance: sums over the conditions.
        log_likelihood_own: of a model with a separate uniform probability for every condition: the value that an
            informative model has to exceed.
        rmse: root mean square of the differences of shares; `bias` their mean.
        noise_floor: the expected `rmse` if model and measurement had the same probabilities.
        overdispersion: χ² of the repeats per degree of freedom, where at least one condition repeats; else NaN.
        p_overdispersion: of sets that scatter binomially, by that χ²; 1 without repeats.
        n_repeated: conditions with more than one set.
        remarks: of the reader.
        unit, source: of `rmse`, and where its floor comes from; the same for all counts.
    """

    unit: ClassVar[str] = "1"
    source: ClassVar[str] = "binomial"
    conditions: tuple[ConditionResult, ...]
    log_likelihood: float
    deviance: float
    log_likelihood_own: float
    rmse: float
    bias: float
    noise_floor: float
    overdispersion: float
    p_overdispersion: float
    n_repeated: int
    remarks: tuple[str, ...]

    @property
    def ratio_to_floor(self) -> float:
        """Return the error in units of the error expected from chance alone."""
        return self.rmse / self.noise_floor

    @property
    def n_samples(self) -> int:
        """Return the number of trials measured in all conditions."""
        return sum(one.measured[1] for one in self.conditions)

    @property
    def n_effective(self) -> float:
        """Return the effective number of trials: smaller where sets scatter more than binomially."""
        return self.n_samples / self.scatter

    @property
    def scatter(self) -> float:
        """Return the overdispersion if it exceeds chance, else 1."""
        return max(1.0, self.overdispersion) if self.p_overdispersion < LEVEL else 1.0

    @property
    def disagreeing(self) -> tuple[ConditionResult, ...]:
        """Return the conditions that disagree beyond chance, the worst first."""
        return tuple(sorted((c for c in self.conditions if c.disagrees), key=lambda c: -c.deviance))

    @property
    def contradictory(self) -> tuple[ConditionResult, ...]:
        """Return the conditions whose repeats contradict each other."""
        return tuple(c for c in self.conditions if c.contradictory)


def compare_counts(counts: Counts, simulated: Sequence[Count]) -> CountComparison:
    """Compare measured with simulated counts, condition by condition in the same order."""
    measured = [(c.successes, c.trials) for c in counts.conditions]
    pairs = list(zip(measured, simulated, strict=True))
    p = [fisher_p(a, b) for a, b in pairs]
    sets = [[(one.successes, one.trials) for one in c.sets] for c in counts.conditions]
    p_sets = [repeats_agree(one) for one in sets]
    repeated = [k for k, one in enumerate(sets) if len(one) > 1]
    p_sets_adjusted = dict(zip(repeated, holm([p_sets[k] for k in repeated]), strict=True))
    deviances = [deviance(a, b) for a, b in pairs]
    total = sum(deviances)
    # conditions that repeat and did not end alike; χ² over its degrees of freedom is 1 for binomial scatter
    told = [s for s in sets if len(s) > 1 and 0 < sum(k for k, _ in s) < sum(n for _, n in s)]
    freedom, scatter = sum(len(one) - 1 for one in told), sum(chi_square(one) for one in told)
    results = tuple(
        ConditionResult(
            condition=counts.conditions[k],
            simulated=b,
            log_likelihood=log_predictive(a, b),
            deviance=deviances[k],
            log_bayes_factor=log_bayes_factor(a, b),
            p=p[k],
            p_adjusted=p_adjusted,
            z=signed_z(a, b),
            p_repeats=p_sets[k],
            p_repeats_adjusted=p_sets_adjusted.get(k, 1.0),
            share_of_error=deviances[k] / total if total > 0 else 0.0,
        )
        for k, ((a, b), p_adjusted) in enumerate(zip(pairs, holm(p), strict=True))
    )
    errors = np.array([one.error for one in results])
    shares = [(s + t + 1) / (n + m + 2) for (s, n), (t, m) in pairs]  # of one probability for both
    noise = [q * (1 - q) * (1 / n + 1 / m) for q, ((_, n), (_, m)) in zip(shares, pairs, strict=True)]
    return CountComparison(
        conditions=results,
        log_likelihood=sum(one.log_likelihood for one in results),
        deviance=total,
        log_likelihood_own=sum(log_own(a) for a in measured),
        rmse=float(np.sqrt(np.mean(errors**2))),
        bias=float(np.mean(errors)),
        noise_floor=float(np.sqrt(np.mean(noise))),
        overdispersion=scatter / freedom if freedom else float("nan"),
        p_overdispersion=float(scipy.special.chdtrc(freedom, scatter)) if freedom else 1.0,
        n_repeated=len(repeated),
        remarks=counts.remarks,
    )


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


def is_counted(study: Study, data: Sources = None) -> bool:
    """Return whether the study's measurements, or `data`, are a file of counts."""
    path = _file(study, data)
    return path is not None and holds_counts(path, study.task, study.measurements)


def counted_study(study: Study, data: Sources = None) -> CountedStudy:
    """Read the counts; raise `UserError` for a task that counts no trials, besides the errors of `read_counts`."""
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


def compare_counted(context: RunContext, counted: CountedStudy, workers: Workers = 1) -> CountComparison:
    """Simulate every condition under the study's noise, each an artifact of the store, and compare."""
    settings = [
        Setting(counted.condition_task(condition), counted.study.effects)
        for condition in counted.counts.conditions
    ]
    return compare_counts(counted.counts, simulate_trials(context, counted.study, settings, workers))


def _file(study: Study, data: Sources) -> Any:
    """Return the one table that may contain counts; None where there are several, or none."""
    files = data if data is not None else study.measurements.file if study.measurements is not None else ()
    sources = expand_sources(files) if is_frame(files) or files else []
    return sources[0] if len(sources) == 1 else None
