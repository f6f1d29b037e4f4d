"""The verbs that run a study's stages: run, fem, simulate, report."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from pliant.cli import summaries
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
from pliant.formatting import quantity
from pliant.pipeline.study import (
    StudyRun,
    check_study,
    fem_of_study,
    laws_of_study,
    simulate_study,
)
from pliant.report.folder import read_folder, table_name, write_folder
from pliant.report.search_folder import is_search
from pliant.report.stage import fem_report_stage, report_stage, write_page
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
        here.result.update(_run_result(done, folder))
        write_folder(folder, done, plain(here.result))
        page = report_stage(bench, done, plain(here.result), folder)
        _say_run(here, done)
        here.result["wall_s"] = time.perf_counter() - started
        here.say(f"report   {page}   ({here.result['wall_s']:.1f} s in all)")
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
        here.result.update(summaries.fem(artifacts, [str(t) for t in tables]))
        for line in summaries.fem_lines(artifacts):
            here.say(line)
        here.say(f"table    {', '.join(map(str, tables))}")
        if request is not None:
            write_fields(here, bench, loaded, artifacts, request)
        here.result["report"] = fem_report_stage(bench, loaded, artifacts, folder)
        here.say(f"report   {here.result['report']}")
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
        here.result.update(summaries.simulation(done.engines[0]))
        for line in summaries.simulation_lines(done.engines[0]):
            here.say(line)
        if done.uncertainty is not None:
            here.result["uncertainty"] = summaries.uncertainty(done.uncertainty)
            here.say(summaries.uncertainty_line(done.uncertainty))
        for line in summaries.metric_lines(done.engines[0].result.metrics if done.engines[0].result else {}):
            here.say(line)
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
            from pliant.report.search_page import rebuild_search_page  # matplotlib takes a second to import

            check_writable(folder)
            here.result["report"] = rebuild_search_page(folder)
            here.say(f"report   {here.result['report']}")
            return
        from pliant.report.page import render

        run_read = read_folder(folder, here.registry)
        check_writable(folder)
        made = render(run_read)
        page = write_page(folder, made.html, made.pictures)
        here.result["report"] = page
        here.say(f"report   {page}")


def _run_result(done: StudyRun, folder: Path) -> dict[str, Any]:
    result: dict[str, Any] = {"study": done.study.name, "out": str(folder)}
    artifacts = [d.fem for d in done.designs if d.fem is not None]
    if artifacts:
        tables = [str(folder / table_name(n)) for n, d in enumerate(done.designs) if d.fem is not None]
        result["fem"] = summaries.fem(artifacts, tables)
    fits = [summaries.fit(design) for design in done.designs]
    result["fit"] = fits[0] if len(fits) == 1 else fits
    if done.engines:
        result["simulate"] = summaries.simulation(done.engines[0])
        result["cross_check"] = [summaries.simulation(engine) for engine in done.engines[1:]]
        result["largest_marker_distance_m"] = summaries.largest_distance_m(done.engines)
    if done.uncertainty is not None:
        result["uncertainty"] = summaries.uncertainty(done.uncertainty)
    result["unused"] = list(done.unused)
    return result


def _say_run(here: Session, done: StudyRun) -> None:
    for design in done.designs:
        lines = summaries.fem_lines([design.fem]) if design.fem else []
        for line in lines + summaries.fit_lines(design):
            here.say(line)
    for engine in done.engines:
        for line in summaries.simulation_lines(engine):
            here.say(line)
    if done.uncertainty is not None:
        here.say(summaries.uncertainty_line(done.uncertainty))
    distance = summaries.largest_distance_m(done.engines)
    if distance is not None:
        here.say(f"engines  agree within {quantity(distance, 'm', 3)}")


def _exit_unless_converged(here: Session, done: StudyRun) -> None:
    ran = [engine.result for engine in done.engines if engine.result is not None]
    if not all(result.final.converged and not result.not_reached for result in ran):
        here.exit_code = NOT_CONVERGED
