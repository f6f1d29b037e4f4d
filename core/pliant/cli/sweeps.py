"""`pliant fem` of a study with a sweep: options, JSON (docs/run_a_sweep_on_a_cluster.md) and lines for people."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from pliant import __version__
from pliant.cli.session import Session, check_writable, plain
from pliant.config.study import Study
from pliant.errors import NotReachedError, UserError
from pliant.pipeline.crews import checked_workers, cluster
from pliant.pipeline.sweep import sweep_study
from pliant.pipeline.sweep_table import write_sweep_table
from pliant.pipeline.workbench import Workbench
from pliant.report.sweep import sweep_document
from pliant.store.store import write_atomically

Workers = Annotated[
    int | None,
    typer.Option("--workers", metavar="N", help="Processes that solve a sweep; by default one for each CPU."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Solve a sweep on a dask cluster: tcp://host:8786, or the scheduler's file.",
    ),
]
TABLE, INDEX = "fem.csv", "sweep.json"


def fem_of_sweep(
    here: Session, bench: Workbench, study: Study, folder: Path, workers: int | None, scheduler: str | None
) -> None:
    """Solve the sweep, write its table and index, say what came of it."""
    if workers is not None and scheduler is not None:
        raise UserError("give --workers or --scheduler, not both; a cluster's workers are its own.")
    if workers is not None:
        checked_workers(workers)
    check_writable(folder)
    with nullcontext() if scheduler is None else cluster(scheduler) as executor:
        run = sweep_study(bench, study, executor=executor, workers=workers)
    write_sweep_table(run, folder / TABLE)
    here.show(sweep_document(run, study.name, folder / TABLE))
    index = {"pliant": __version__, "study": study.name, **plain(here.result)}
    write_atomically(folder / INDEX, json.dumps(index, indent=1, allow_nan=False))
    here.say(f"table    {folder / TABLE}, designs in {folder / INDEX}")
    if here.result["failed"] or run.failed() or not run.done():
        here.exit_code = NotReachedError.exit_code
