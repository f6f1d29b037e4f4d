"""`pliant plan`: which runs to do, before anything is measured or after."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from pliant import api
from pliant.cli.bars import fitting_bar
from pliant.cli.evidence import Candidates, DataFile, read_session_measurement, write_runs
from pliant.cli.options import Fitters, Overrides, Scheduler, StudyFile, verb, workers_or_scheduler
from pliant.cli.session import Session, check_writable
from pliant.diagnosis.planning import check_budget
from pliant.experiments.planned_run import PlannedRun
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


@verb()
def plan(
    session: Session,
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
    loaded = session.study(study, overrides)
    session.leave_out_broken_effects()
    who = loaded.resolve_workers(workers_or_scheduler(workers, scheduler), 1)
    check_budget(runs, minutes)
    folder = out or Path("runs") / f"{loaded.name}-plan"
    check_writable(folder)
    opened = api.OpenStudy(loaded, session.context())
    kinds = api.candidates(opened, effect)
    session.result |= {"study": loaded.name, "out": str(folder)}
    if not data and loaded.measurements is None:
        first = api.plan_first_runs(opened, kinds=kinds, runs=runs, minutes=minutes)
        named = _named([(f"{n}_{run.name}", run) for n, run in enumerate(first.chosen, 1)])
        files = write_runs(folder, named, first.outputs, study, loaded)
        session.show(design_document(loaded.name, first.design, files, session.registry))
        return
    measurement = read_session_measurement(session, opened, data)
    with fitting_bar(session.progress, len(kinds)) as bar:
        found = api.plan(
            opened, measurement, kinds=kinds, runs=runs, minutes=minutes, tick=bar.tick, workers=who
        )
    planned = [(f"{k}_{one.name}", one.planned) for k, one in enumerate(found.chosen, 1) if one.planned]
    files = write_runs(folder, _named(planned), measurement.outputs, study, loaded, measurement, data)
    session.show(plan_document(loaded.name, measurement, found, files, session.registry))


def _named(runs: Sequence[tuple[str, PlannedRun]]) -> list[tuple[str, PlannedRun]]:
    """Return the runs with file names."""
    return [(f"run_{name}.csv".replace(" ", "_").replace("/", "_"), run) for name, run in runs]
