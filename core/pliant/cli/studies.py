"""The verbs that run a study's stages: run, fem (a design, a sweep; fields for ParaView), simulate, report."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, cast, get_args

import typer

from pliant import __version__
from pliant.cli.options import Overrides, Scheduler, StudyFile, Workers, verb, workers_or_scheduler
from pliant.cli.session import Session, check_writable, plain
from pliant.config.study import Study
from pliant.errors import NotReachedError, UserError, closest
from pliant.formatting import seconds
from pliant.pipeline.fields import SolvedFields, Which, field_targets, solve_fields
from pliant.pipeline.study import (
    StudyRun,
    check_study,
    families_of_study,
    fem_of_study,
    laws_of_study,
    simulate_study,
)
from pliant.pipeline.sweep import sweep_study, write_sweep_table
from pliant.pipeline.workbench import Workbench
from pliant.records.fem import ModuleData
from pliant.report.fem import fem_document, stored_fem_page
from pliant.report.folder import finished, read_folder, table_name, write_folder
from pliant.report.run import run_document, run_json, run_lines, simulation_document, stored_run_page
from pliant.report.search_files import is_search
from pliant.report.sweep import sweep_document
from pliant.report.vtu import require_meshio, write_pvd, write_vtu
from pliant.store.store import Artifact, write_atomically, writing_in
from pliant.tabular.fem_writing import write_table

OutFolder = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Output folder; runs/<name> by default.")
]
NOT_CONVERGED = 3
SWEEP_TABLE, INDEX = "fem.csv", "sweep.json"

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
FIELDS_TABLE = "states.csv"


@verb()
def run(
    here: Session,
    study: StudyFile,
    overrides: Overrides = None,
    out: OutFolder = None,
) -> None:
    """Run the stages that the study declares, from FEM to report; cached stages are not recomputed."""
    loaded = here.study(study, overrides)
    folder = out or Path("runs") / loaded.name
    started = time.perf_counter()
    bench = here.bench()
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


@verb()
def fem(
    here: Session,
    study: StudyFile,
    overrides: Overrides = None,
    out: OutFolder = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    fields: FieldsFolder = None,
    fields_of: FieldsOf = DEFAULT_WHICH,
) -> None:
    """Only the FEM data set with its page, of one design or of the study's sweep; resumes where it was interrupted."""
    loaded = here.study(study, overrides, uses=["sweep"])
    folder = out or Path("runs") / loaded.name
    bench = here.bench()
    loaded.need("family", "FEM")
    request = fields_request(fields, fields_of)
    if loaded.sweep is not None:
        if request is not None:
            raise UserError(f"--fields is for one design; study '{loaded.name}' has a 'sweep'.")
        fem_of_sweep(here, bench, loaded, folder, workers, scheduler)
        return
    if workers is not None or scheduler is not None:
        raise UserError(f"--workers and --scheduler are for a sweep; study '{loaded.name}' has no 'sweep'.")
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


@verb()
def simulate(
    here: Session,
    study: StudyFile,
    overrides: Overrides = None,
) -> None:
    """The chain in the chosen physics under the study's task."""
    loaded = here.study(study, [*(overrides or ()), "cross_check=[]"])
    done = simulate_study(here.bench(), loaded)
    here.show(simulation_document(done))
    _exit_unless_converged(here, done)


@verb(store=False)
def report(
    here: Session,
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="The --out folder of 'pliant run' or 'pliant optimize'.")
    ],
) -> None:
    """A self-contained HTML report of a finished run or search."""
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


def fem_of_sweep(
    here: Session, bench: Workbench, study: Study, folder: Path, workers: int | None, scheduler: str | None
) -> None:
    """Solve the sweep, write its table and index, say what came of it."""
    chosen = workers_or_scheduler(workers, scheduler)
    check_writable(folder)
    run = sweep_study(bench, study, executor=chosen)
    write_sweep_table(run, folder / SWEEP_TABLE)
    here.show(sweep_document(run, study.name, folder / SWEEP_TABLE))
    index = {"pliant": __version__, "study": study.name, **plain(here.result)}
    write_atomically(folder / INDEX, json.dumps(index, indent=1, allow_nan=False))
    here.say(f"table    {folder / SWEEP_TABLE}, designs in {folder / INDEX}")
    if here.result["failed"] or run.failed() or not run.done():
        here.exit_code = NotReachedError.exit_code


@dataclass(frozen=True)
class FieldsRequest:
    """Where fields go, and of which states."""

    folder: Path
    which: Which


def fields_request(folder: Path | None, which: str) -> FieldsRequest | None:
    """The options, checked before any work is done. Raises `UserError`, `MissingDependencyError`."""
    if which not in get_args(Which):
        known = get_args(Which)
        raise UserError(
            f"--fields-of {which}: give {', '.join(known[:-1])} or {known[-1]}{closest(which, known)}"
        )
    if folder is None:
        if which != DEFAULT_WHICH:
            raise UserError("--fields-of tells which states --fields writes; give --fields DIR too.")
        return None
    require_meshio()
    check_writable(folder)
    return FieldsRequest(folder, cast(Which, which))


def write_fields(
    here: Session, bench: Workbench, study: Study, artifacts: Sequence[Artifact], request: FieldsRequest
) -> None:
    """Solve the states again and write their files; several designs get a folder each."""
    families = families_of_study(study)
    made: list[Path] = []
    for number, (family, artifact) in enumerate(zip(families, artifacts, strict=True)):
        folder = request.folder if len(families) == 1 else request.folder / f"design_{number + 1}"
        check_writable(folder)
        data: ModuleData = artifact.value
        targets = field_targets(data, request.which)
        solved = solve_fields(bench, family, study.need("material", "FEM"), study.need("fem", "FEM"), targets)
        with closing(solved), writing_in(folder):  # type: ignore[type-var]
            made += _write_states(folder, data, solved)
    here.result["fields"] = [str(path) for path in made]
    here.say(
        f"fields   {sum(p.suffix == '.vtu' for p in made)} states in {request.folder}; open free.pvd in ParaView"
    )


def _write_states(folder: Path, data: ModuleData, solved: Any) -> list[Path]:
    """One VTU file for each state, a PVD for each branch, and a table of what is what."""
    names: dict[str, list[tuple[float, str]]] = {"free": [], "held": []}
    rows: list[Mapping[str, Any]] = []
    for one in solved:
        branch = "held" if one.held else "free"
        name = f"{branch}_{len(names[branch]):03d}.vtu"
        write_vtu(folder / name, one.fields)
        # Time is the actuation where nothing is held, else the place in the row.
        time = one.state.actuation if branch == "free" else float(len(names[branch]))
        names[branch].append((time, name))
        rows.append(_row(name, one, data))
    paths = [folder / name for files in names.values() for _, name in files]
    for branch, files in names.items():
        if files:
            write_pvd(folder / f"{branch}.pvd", files)
            paths.append(folder / f"{branch}.pvd")
    with (folder / FIELDS_TABLE).open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(key for row in rows for key in row)), restval="")
        writer.writeheader()
        writer.writerows(rows)
    return [*paths, folder / FIELDS_TABLE]


def _row(name: str, one: SolvedFields, data: ModuleData) -> dict[str, Any]:
    """A state in the table, SI, one column for each coordinate and effort."""
    slides = data.joint == "prismatic"
    u, tau = ("extension_m", "force_n") if slides else ("angle_rad", "moment_n_m")
    several = len(data.axes) > 1
    row: dict[str, Any] = {"file": name, "branch": one.state.branch, "status": one.state.status}
    row[data.actuation_name] = one.state.actuation
    for axis in data.axes:
        end = f"_{axis}" if several else ""
        known = axis in one.axes  # a piece of the main axis alone has no others
        k = one.axes.index(axis) if known else 0
        row[u + end] = float(one.state.deformation[k]) if known else ""
        row[tau + end] = float(one.state.tau[k]) if known else ""
    row["held"] = " ".join(one.held)
    return row
