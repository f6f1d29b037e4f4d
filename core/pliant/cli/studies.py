"""The verbs that run a study's stages: run, fem (a design, a sweep; fields for ParaView), simulate, report."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from pliant.cli.options import Overrides, Scheduler, StudyFile, Workers, verb
from pliant.cli.session import Session, check_writable, plain
from pliant.config.design_parameters import material_parameters
from pliant.errors import UserError
from pliant.fem_tables.writing import write_table
from pliant.formatting import seconds
from pliant.pipeline.run_folder import finished, read_folder, table_name, write_folder
from pliant.pipeline.self_check import checked_run
from pliant.pipeline.study import (
    StudyRun,
    build_study_laws,
    check_study,
    simulate_study,
    solve_study_fem,
)
from pliant.registry.function import package_function
from pliant.registry.result_folder import result_folder
from pliant.report.fem import fem_document, stored_fem_page
from pliant.report.run import run_document, run_json, run_lines, simulation_document, stored_run_page

OutFolder = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Output folder; runs/<name> by default.")
]
NOT_CONVERGED = 3

FieldsFolder = Annotated[
    Path | None,
    typer.Option(
        "--fields", metavar="DIR", help="Also write displacement and stress as VTU files for ParaView."
    ),
]
FieldsOf = Annotated[
    str,
    typer.Option(
        "--fields-of",
        metavar="WHICH",
        help="States whose fields are written: free, extremes (and the outermost held ones), or all.",
    ),
]
DEFAULT_WHICH = "extremes"


@verb()
def run(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
    out: OutFolder = None,
) -> None:
    """Run the stages that the study declares, from FEM to report; cached stages are not recomputed."""
    loaded = session.study(study, overrides)
    folder = out or Path("runs") / loaded.name
    started = time.perf_counter()
    context = session.context()
    check_study(context, loaded)
    check_writable(folder)
    if loaded.chain is None or loaded.task is None:
        laws = build_study_laws(context, loaded)
        done = StudyRun(loaded, laws)
    else:
        done = checked_run(context, simulate_study(context, loaded))
    summary = plain(run_json(done, folder))
    write_folder(folder, done, summary)
    read = finished(done, summary)
    session.show(run_document(read, run_lines(done)), folder, stored_run_page(context, done, read))
    session.result["wall_s"] = time.perf_counter() - started
    session.say(f"time     {seconds(session.result['wall_s'])} in all")
    _exit_unless_converged(session, done)


@verb()
def fem(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
    out: OutFolder = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    fields: FieldsFolder = None,
    fields_of: FieldsOf = DEFAULT_WHICH,
) -> None:
    """Solve only the FEM data set with its page, of one design or of the study's sweep; resumes where interrupted."""
    loaded = session.study(study, overrides, uses=["sweep"])
    folder = out or Path("runs") / loaded.name
    context = session.context()
    loaded.need("family", "FEM")
    write_fields = fields_writer(fields, fields_of)
    if loaded.block("sweep") is not None:
        if write_fields is not None:
            raise UserError(f"--fields is for one design; study '{loaded.name}' has a 'sweep'.")
        package_function("report_sweep", "pliant_designs")(
            session, context, loaded, folder, workers, scheduler
        )
        return
    if workers is not None or scheduler is not None:
        raise UserError(f"--workers and --scheduler are for a sweep; study '{loaded.name}' has no 'sweep'.")
    check_study(context, loaded)
    check_writable(folder)
    artifacts = solve_study_fem(context, loaded)
    tables = [folder / table_name(number) for number in range(len(artifacts))]
    for artifact, table in zip(artifacts, tables, strict=True):
        write_table(artifact.value, table, material_parameters(loaded.need("material", "FEM")))
    if write_fields is not None:
        write_fields(session, context, loaded, artifacts)
    document = fem_document(loaded, artifacts, [str(table) for table in tables])
    session.show(document, folder, stored_fem_page(context, loaded, artifacts))
    if session.result["failed"]:
        session.exit_code = NOT_CONVERGED


@verb()
def simulate(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
) -> None:
    """Simulate the chain in the chosen physics under the study's task."""
    loaded = session.study(study, [*(overrides or ()), "cross_check=[]"])
    context = session.context()
    done = checked_run(context, simulate_study(context, loaded))
    session.show(simulation_document(done))
    _exit_unless_converged(session, done)


@verb(store=False)
def report(
    session: Session,
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="The --out folder of 'pliant run' or 'pliant optimize'.")
    ],
) -> None:
    """Write a self-contained HTML report of a finished run or search."""
    if (other := result_folder(folder)) is not None:
        rebuild = other.function()  # its module imports matplotlib, which takes a second
        check_writable(folder)
        session.result["report"] = rebuild(folder)
        session.say(f"report   {session.result['report']}")
        return
    run_read = read_folder(folder, session.registry)
    check_writable(folder)
    session.show(run_document(run_read), folder)


def _exit_unless_converged(session: Session, done: StudyRun) -> None:
    ran = [engine.result for engine in done.engines if engine.result is not None]
    if not all(result.final.converged and not result.not_reached for result in ran):
        session.exit_code = NOT_CONVERGED


def fields_writer(folder: Path | None, which: str) -> Callable[..., None] | None:
    """Return the function of `pliant_view` that writes the fields, its options checked; None without --fields.

    Raises:
        UserError: wrong options.
        MissingDependencyError: no `pliant_view`, or no meshio.
    """
    if folder is None:
        if which != DEFAULT_WHICH:
            raise UserError("--fields-of selects the states that --fields writes; give --fields DIR, too.")
        return None
    writer: Callable[..., None] = package_function("fields_writer", "pliant_view")(folder, which)
    return writer
