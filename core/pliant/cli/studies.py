"""The verbs that run a study's stages: run, fem, simulate, report."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.fields import DEFAULT_WHICH, FieldsFolder, FieldsOf, fields_request, write_fields
from pliant.cli.options import (
    DEFAULT_STORE,
    JsonFile,
    Overrides,
    Quiet,
    Scheduler,
    StoreFolder,
    StudyFile,
    Workers,
)
from pliant.cli.session import Session, check_writable, plain, session
from pliant.cli.sweeps import fem_of_sweep
from pliant.errors import UserError
from pliant.formatting import seconds
from pliant.pipeline.study import (
    StudyRun,
    check_study,
    fem_of_study,
    laws_of_study,
    simulate_study,
)
from pliant.report.fem import fem_document, stored_fem_page
from pliant.report.folder import finished, read_folder, table_name, write_folder
from pliant.report.run import run_document, run_json, run_lines, simulation_document, stored_run_page
from pliant.report.search_files import is_search
from pliant.tabular.fem_writing import write_table

OutFolder = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Output folder; runs/<name> by default.")
]
NOT_CONVERGED = 3


def run(
    study: StudyFile,
    overrides: Overrides = None,
    out: OutFolder = None,
    store: StoreFolder = DEFAULT_STORE,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """Run the stages that the study declares, from FEM to report; cached stages are not recomputed."""
    with session("run", json, quiet) as here:
        loaded = here.study(study, overrides)
        folder = out or Path("runs") / loaded.name
        started = time.perf_counter()
        bench = here.bench(store)
        check_study(bench, loaded)
        check_writable(folder)
        if loaded.chain is None or loaded.task is None:
            done = StudyRun(loaded, laws_of_study(bench, loaded))
        else:
            done = simulate_study(bench, loaded)
        summary = plain(run_json(done, folder))
        write_folder(folder, done, summary)
        read = finished(done, summary)
        here.show(run_document(read, run_lines(done)), folder, stored_run_page(bench, done, read))
        here.result["wall_s"] = time.perf_counter() - started
        here.say(f"time     {seconds(here.result['wall_s'])} in all")
        _exit_unless_converged(here, done)


def fem(
    study: StudyFile,
    overrides: Overrides = None,
    out: OutFolder = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    fields: FieldsFolder = None,
    fields_of: FieldsOf = DEFAULT_WHICH,
    store: StoreFolder = DEFAULT_STORE,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """Only the FEM data set with its page, of one design or of the study's sweep; resumes where it was interrupted."""
    with session("fem", json, quiet) as here:
        loaded = here.study(study, overrides, uses=["sweep"])
        folder = out or Path("runs") / loaded.name
        bench = here.bench(store)
        loaded.need("family", "FEM")
        request = fields_request(fields, fields_of)
        if loaded.sweep is not None:
            if request is not None:
                raise UserError(f"--fields is for one design; study '{loaded.name}' has a 'sweep'.")
            fem_of_sweep(here, bench, loaded, folder, workers, scheduler)
            return
        if workers is not None or scheduler is not None:
            raise UserError(
                f"--workers and --scheduler are for a sweep; study '{loaded.name}' has no 'sweep'."
            )
        check_study(bench, loaded)
        check_writable(folder)
        artifacts = fem_of_study(bench, loaded)
        tables = [folder / table_name(number) for number in range(len(artifacts))]
        for artifact, table in zip(artifacts, tables, strict=True):
            write_table(artifact.value, table)
        if request is not None:
            write_fields(here, bench, loaded, artifacts, request)
        document = fem_document(loaded, artifacts, [str(table) for table in tables])
        here.show(document, folder, stored_fem_page(bench, loaded, artifacts))
        if here.result["failed"]:
            here.exit_code = NOT_CONVERGED


def simulate(
    study: StudyFile,
    overrides: Overrides = None,
    store: StoreFolder = DEFAULT_STORE,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """The chain in the chosen physics under the study's task."""
    with session("simulate", json, quiet) as here:
        loaded = here.study(study, overrides).model_copy(update={"cross_check": ()})
        done = simulate_study(here.bench(store), loaded)
        here.show(simulation_document(done))
        _exit_unless_converged(here, done)


def report(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="The --out folder of 'pliant run' or 'pliant optimize'.")
    ],
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """A self-contained HTML report of a finished run or search."""
    with session("report", json, quiet) as here:
        if is_search(folder):
            from pliant.report.search import rebuild_search_page  # matplotlib takes a second to import

            check_writable(folder)
            here.result["report"] = rebuild_search_page(folder)
            here.say(f"report   {here.result['report']}")
            return
        run_read = read_folder(folder, here.registry)
        check_writable(folder)
        here.show(run_document(run_read), folder)


def _exit_unless_converged(here: Session, done: StudyRun) -> None:
    ran = [engine.result for engine in done.engines if engine.result is not None]
    if not all(result.final.converged and not result.not_reached for result in ran):
        here.exit_code = NOT_CONVERGED
