"""`pliant fem` of a study with a sweep: options, JSON (docs/run_a_sweep_on_a_cluster.md) and lines for people."""

from __future__ import annotations

import json
from pathlib import Path

from pliant import __version__
from pliant.cli.options import workers_or_scheduler
from pliant.cli.session import Session, check_writable, plain
from pliant.config.study import Study
from pliant.errors import NotReachedError
from pliant.pipeline.sweep import sweep_study, write_sweep_table
from pliant.pipeline.workbench import Workbench
from pliant.report.sweep import sweep_document
from pliant.store.store import write_atomically

TABLE, INDEX = "fem.csv", "sweep.json"


def fem_of_sweep(
    here: Session, bench: Workbench, study: Study, folder: Path, workers: int | None, scheduler: str | None
) -> None:
    """Solve the sweep, write its table and index, say what came of it."""
    chosen = workers_or_scheduler(workers, scheduler)
    check_writable(folder)
    run = sweep_study(bench, study, executor=chosen)
    write_sweep_table(run, folder / TABLE)
    here.show(sweep_document(run, study.name, folder / TABLE))
    index = {"pliant": __version__, "study": study.name, **plain(here.result)}
    write_atomically(folder / INDEX, json.dumps(index, indent=1, allow_nan=False))
    here.say(f"table    {folder / TABLE}, designs in {folder / INDEX}")
    if here.result["failed"] or run.failed() or not run.done():
        here.exit_code = NotReachedError.exit_code
