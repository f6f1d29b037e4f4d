"""`pliant optimize`: the study's search, then the check of its winner by direct FEM."""

from __future__ import annotations

import re
from dataclasses import dataclass
from json import dumps
from pathlib import Path

from pliant.cli.best_study import write_best
from pliant.cli.drawn_designs import drawn_designs
from pliant.cli.options import (
    DEFAULT_STORE,
    JsonFile,
    Overrides,
    Quiet,
    Scheduler,
    StoreFolder,
    StudyFile,
    Workers,
    workers_or_scheduler,
)
from pliant.cli.session import Session, check_writable, plain, session
from pliant.cli.studies import OutFolder
from pliant.config.study import OF_OPTIMIZE, Study
from pliant.errors import NotReachedError, UserError
from pliant.pipeline.study import physics_of_study
from pliant.pipeline.workbench import Workbench
from pliant.records.search import FoundDesign, SearchResult
from pliant.registry.discovery import Registry
from pliant.report.search import best_said, search_document, write_search_page
from pliant.report.search_files import BEST, HISTORY, RESULT, copy_exported, write_history
from pliant.search.evaluate.evaluator import problem_of
from pliant.search.problem.search_problem import SearchProblem
from pliant.search.run.search import nothing_found
from pliant.search.stage import files_folder, search_study
from pliant.search.verify.check import converged
from pliant.store.store import Artifact, write_atomically

UNFIT = re.compile(r"[^\w.-]")  # in the name of a file
WRITTEN = re.compile(r"best(-.*)?\.yaml")  # studies of found designs


def optimize(
    study: StudyFile,
    overrides: Overrides = None,
    out: OutFolder = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    store: StoreFolder = DEFAULT_STORE,
    json: JsonFile = None,
    quiet: Quiet = False,
) -> None:
    """The study's search, then the check of the winner by direct FEM; goes on where it was interrupted."""
    with session("optimize", json, quiet) as here:
        installed = here.registry
        loaded = here.study(study, overrides, uses=OF_OPTIMIZE)
        loaded.need("search", "'pliant optimize'")
        chosen = workers_or_scheduler(workers, scheduler)
        folder = out or Path("runs") / loaded.name
        check_writable(folder)
        if folder.resolve() == study.resolve().parent and WRITTEN.fullmatch(study.name):
            raise UserError(f"the best design would be written over {study}; give another --out.")
        bench = here.bench(store)
        made = search_study(bench, loaded, executor=chosen)
        here.result["study"], here.result["out"] = loaded.name, str(folder)
        here.result["stages"] = [{"stage": "search", "key": made.key, "cached": made.cached}]
        _write(here, bench, made, loaded, folder, _Source(study, tuple(overrides or ()), installed))
        if not made.value.best:
            raise nothing_found(made.value)


@dataclass(frozen=True)
class _Source:
    """The study's file, how it was read, and the plugins that were known before."""

    path: Path
    overrides: tuple[str, ...]
    registry: Registry


def _write(
    here: Session, bench: Workbench, made: Artifact, study: Study, folder: Path, source: _Source
) -> None:
    """Everything that the folder of a search holds, and the lines for people; an earlier search's files go."""
    result: SearchResult = made.value
    problem = problem_of(bench, study)
    engine: str = physics_of_study(bench, study).kind
    here.show(search_document(study.canonical(), result, engine=engine))
    write_history(result, folder / HISTORY)
    exported = copy_exported(result.files, files_folder(bench, made), folder)
    here.result["files"] = [str(file) for file in exported]
    for old in (folder / BEST, *folder.glob("best-*.yaml")):
        old.unlink(missing_ok=True)
    if result.best:
        _write_designs(source, folder, study, problem, result)
        here.result["best_study"] = str(folder / BEST)
        here.say(f"study    {folder / BEST}, every candidate in {folder / HISTORY}")
        if not converged(result, study, engine):
            here.exit_code = NotReachedError.exit_code
    _write_page(here, bench, folder, study, problem, result)
    write_atomically(folder / RESULT, dumps(plain(here.result), indent=1, allow_nan=False))


def _write_designs(
    source: _Source, folder: Path, study: Study, problem: SearchProblem, result: SearchResult
) -> None:
    """best.yaml, and where there are conditions one study for each of them."""
    named = len(problem.conditions) > 1
    stems = [UNFIT.sub("_", condition.name) for condition in problem.conditions]
    for design, condition in reversed(_each(problem, result)):
        name = problem.conditions[condition].name
        winner = problem.apply(design.values, condition)
        keys = list(problem.changes(design.values, condition))
        said = (
            f"Found by 'pliant optimize' ({result.optimizer}, seed {result.seed}, {result.evaluations} evaluations) in "
            f"study '{study.name}': {best_said(result, design)}{f'; condition {name}' if named else ''}."
        )
        alike = f"-{condition + 1}" if stems.count(stems[condition]) > 1 else ""
        targets = [folder / f"best-{stems[condition]}{alike}.yaml"] if named else []
        targets += [folder / BEST] if condition == 0 or design.context >= 0 else []
        for target in targets:
            write_best(source.path, target, winner, keys, said, source.overrides, source.registry)


def _each(problem: SearchProblem, result: SearchResult) -> list[tuple[FoundDesign, int]]:
    """The designs with the conditions that they are written in; of a front its first."""
    if result.best[0].context >= 0:
        return [(design, design.context) for design in result.best]
    return [(result.best[0], condition) for condition in range(len(problem.conditions))]


def _write_page(
    here: Session, bench: Workbench, folder: Path, study: Study, problem: SearchProblem, result: SearchResult
) -> None:
    page = write_search_page(folder, study, result, drawn_designs(bench, study, problem, result))
    here.result["report"] = str(page)
    here.say(f"report   {page}")
