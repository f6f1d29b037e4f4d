"""Plans of runs: after a recording those that decide between the remaining explanations, before one a protocol."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.config.study import Study
from pliant.diagnosis.classes import RunDesign, design_runs, unread
from pliant.diagnosis.diagnosis import Diagnosis, diagnose
from pliant.diagnosis.next_run import (
    Belief,
    NextRun,
    candidate_runs,
    catalogue_view,
    done_before,
    next_runs,
    undecidable,
)
from pliant.diagnosis.search import Tick
from pliant.errors import UserError
from pliant.evidence.measured_model import MeasuredModel
from pliant.evidence.prediction import Predictor
from pliant.execution.executors import Workers
from pliant.experiments.experiment_catalogue import own_runs, planned_runs
from pliant.experiments.planned_run import BenchScale, PlannedRun
from pliant.pipeline.study import build_study_chain
from pliant.pipeline.workbench import RunContext

AFTER_DATA = 2


@dataclass(frozen=True, eq=False)
class RunPlan:
    """Runs that decide between the remaining explanations of a recording.

    Attributes:
        diagnosis: of the recording.
        chosen: the runs, the best first.
        remark: the reason if none was chosen although several explanations remain.
    """

    diagnosis: Diagnosis
    chosen: tuple[NextRun, ...]
    remark: str = ""


@dataclass(frozen=True, eq=False)
class FirstRuns:
    """The fewest runs that distinguish the effects before any measurement, and the outputs to record."""

    design: RunDesign
    outputs: tuple[str, ...]

    @property
    def chosen(self) -> tuple[PlannedRun, ...]:
        """The runs in their order."""
        return tuple(self.design.runs[k] for k in self.design.chosen)


def check_budget(runs: int | None, minutes: float | None) -> None:
    """Raise `UserError` for a number of runs below 1 or a duration that is not above 0."""
    if runs is not None and runs < 1:
        raise UserError(f"runs is {runs}; it should be 1 or more.")
    if minutes is not None and not minutes > 0:
        raise UserError(f"minutes is {minutes:g}; it should be above 0.")


def plan_after(
    predictor: MeasuredModel,
    study: Study,
    kinds: Sequence[str],
    *,
    runs: int | None = None,
    minutes: float | None = None,
    tick: Tick | None = None,
    workers: Workers = None,
) -> RunPlan:
    """Diagnose the predictor's recording and return runs that distinguish the remaining hypotheses.

    Args:
        predictor: the study's model, with the recording.
        study: its `protocols` replace the default menu.
        kinds: candidates of the diagnosis.
        runs: number of runs at most, 2 by default.
        minutes: bench time at most, with setting up.
        tick: called with the name of each hypothesis when it has been fitted.
        workers: where hypotheses are fitted.

    Raises:
        UserError: no run of the menu is that short.
    """
    most = np.inf if minutes is None else minutes
    own = own_runs(study, predictor)
    shortest = min(run.minutes for run in candidate_runs(predictor, own))
    if most < shortest:
        raise UserError(f"minutes is {most:g}; the shortest run takes {shortest:g} min with setting up.")
    found = diagnose(predictor, kinds=kinds, runs=own, tick=tick, workers=workers)
    if found.verdict == "not_repeatable" and found.next_run is not None:
        return RunPlan(found, (found.next_run,))
    belief = Belief.from_fits(found.fits, found.judgement.probability, found.noise)
    view = catalogue_view(predictor, found.scales, found.noise.n_effective, own)
    done = done_before(view, predictor.measurement)
    chosen = next_runs(view, belief, AFTER_DATA if runs is None else runs, most, done)
    return RunPlan(found, chosen, "" if chosen else undecidable(belief))


def plan_first_runs(
    context: RunContext,
    study: Study,
    kinds: Sequence[str],
    *,
    runs: int | None = None,
    minutes: float | None = None,
) -> FirstRuns:
    """Return the fewest runs of the menu that distinguish these effects; arguments as for `plan_after`."""
    if study.model is not None:
        raise UserError(
            f"study '{study.name}' has a model of its own: a plan needs a recording first, whose ranges it keeps; give "
            "'measurements' or --data."
        )
    chain = build_study_chain(context, study).chain
    menu = planned_runs(study.protocols, BenchScale.from_chain(chain, task_actuation(study)))
    outputs = ("elongation_strain",) if chain.laws[0].joint == "prismatic" else ("angle_rad",)
    predictor = Predictor.from_study(context, study, unread(menu, outputs))
    most = np.inf if minutes is None else minutes
    return FirstRuns(design_runs(predictor, menu, kinds, most_runs=runs, minutes=most), outputs)


def task_actuation(study: Study) -> float | None:
    """Return the pressure or tendon force of the study's task, or None."""
    for name in ("pressure_pa", "tendon_force_n"):
        value = getattr(study.task, name, None)
        if isinstance(value, float | int):
            return float(value)
    return None
