"""`pliant plan`: which runs to do, before anything is measured or after."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from pliant.cli.bars import fitting_bar
from pliant.cli.evidence import Candidates, DataFile, read_session_measurement, write_runs
from pliant.cli.options import Fitters, Overrides, Scheduler, StudyFile, verb, workers_or_scheduler
from pliant.cli.session import Session, check_writable
from pliant.config.study import Study
from pliant.diagnosis.candidates import candidate_kinds
from pliant.diagnosis.classes import design_runs, unread
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
from pliant.errors import UserError
from pliant.evidence.prediction import Predictor
from pliant.experiments.experiment_catalogue import own_runs, planned_runs
from pliant.experiments.planned_run import BenchScale, PlannedRun
from pliant.pipeline.study import build_study_chain
from pliant.records.measurement import Measurement
from pliant.report.plan import design_document, plan_document

Runs = Annotated[
    int | None,
    typer.Option(
        "--runs", metavar="N", help="How many runs at most; 2 with data, without data as many as help."
    ),
]
Minutes = Annotated[
    float | None, typer.Option("--minutes", metavar="M", help="Bench time at most, setting up included.")
]
Folder = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder of the protocol files; runs/<name>-plan by default."),
]
AFTER_DATA = 2


@verb()
def plan(
    here: Session,
    study: StudyFile,
    overrides: Overrides = None,
    data: DataFile = None,
    runs: Runs = None,
    minutes: Minutes = None,
    effect: Candidates = None,
    out: Folder = None,
    workers: Fitters = None,
    scheduler: Scheduler = None,
) -> None:
    """Propose the next runs: with data those that decide between the remaining explanations, else a protocol."""
    loaded = here.study(study, overrides)
    here.leave_out_broken_effects()
    who = loaded.resolve_workers(workers_or_scheduler(workers, scheduler), 1)
    if runs is not None and runs < 1:
        raise UserError(f"--runs is {runs}; it should be 1 or more.")
    if minutes is not None and not minutes > 0:
        raise UserError(f"--minutes is {minutes:g}; it should be above 0.")
    folder = out or Path("runs") / f"{loaded.name}-plan"
    check_writable(folder)
    context, most = here.context(), np.inf if minutes is None else minutes
    kinds = candidate_kinds(here.registry, effect or None)
    here.result |= {"study": loaded.name, "out": str(folder)}
    if data or loaded.measurements is not None:
        measurement = read_session_measurement(here, context, loaded, data)
        found, chosen, remark = _after(here, loaded, measurement, kinds, runs or AFTER_DATA, most, who)
        planned = [(f"{k}_{one.name}", one.planned) for k, one in enumerate(chosen, 1) if one.planned]
        files = write_runs(folder, _named(planned), measurement.outputs, study, loaded, measurement, data)
        here.show(plan_document(loaded.name, measurement, found, chosen, files, here.registry, remark))
        return
    chain = build_study_chain(context, loaded).chain
    menu = planned_runs(loaded.protocols, BenchScale.from_chain(chain, task_actuation(loaded)))
    outputs = ("elongation_strain",) if chain.laws[0].joint == "prismatic" else ("angle_rad",)
    predictor = Predictor.from_study(context, loaded, unread(menu, outputs))
    fewest = design_runs(predictor, menu, kinds, most_runs=runs, minutes=most)
    named = _named([(f"{n}_{menu[k].name}", menu[k]) for n, k in enumerate(fewest.chosen, 1)])
    files = write_runs(folder, named, outputs, study, loaded)
    here.show(design_document(loaded.name, fewest, files, here.registry))


def _named(runs: Sequence[tuple[str, PlannedRun]]) -> list[tuple[str, PlannedRun]]:
    """Return the runs with file names."""
    return [(f"run_{name}.csv".replace(" ", "_").replace("/", "_"), run) for name, run in runs]


def _after(
    here: Session,
    loaded: Study,
    measurement: Measurement,
    kinds: Sequence[str],
    runs: int,
    minutes: float,
    who: int | str | None,
) -> tuple[Diagnosis, tuple[NextRun, ...], str]:
    """Return a diagnosis, runs that distinguish the remaining hypotheses, and a sentence if none does."""
    predictor = Predictor.from_study(here.context(), loaded, measurement)
    own = own_runs(loaded, predictor.chain, measurement)
    shortest = min(run.minutes for run in candidate_runs(predictor, own))
    if minutes < shortest:
        raise UserError(f"--minutes {minutes:g}: the shortest run takes {shortest:g} min with setting up.")
    with fitting_bar(here.progress, len(kinds)) as bar:
        found = diagnose(predictor, kinds=kinds, runs=own, tick=bar.tick, workers=who)
    if found.verdict == "not_repeatable" and found.next_run is not None:
        return found, (found.next_run,), ""
    belief = Belief.from_fits(found.fits, found.judgement.probability, found.noise)
    view = catalogue_view(predictor, found.scales, found.noise.n_effective, own)
    chosen = next_runs(view, belief, runs, minutes, done_before(view, predictor.measurement))
    return found, chosen, "" if chosen else undecidable(belief)


def task_actuation(loaded: Study) -> float | None:
    """Return the pressure or tendon force of the study's task, or None."""
    for name in ("pressure_pa", "tendon_force_n"):
        value = getattr(loaded.task, name, None)
        if isinstance(value, float | int):
            return float(value)
    return None
