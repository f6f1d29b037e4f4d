"""`pliant optimize`: the study's search, then the check of the best design by direct FEM."""

from __future__ import annotations

import re
import shutil
from collections.abc import Mapping, Sequence
from json import dumps
from pathlib import Path
from typing import Any

from pliant.cli.options import Full, Overrides, Scheduler, StudyFile, Workers, verb, workers_or_scheduler
from pliant.cli.session import Session, check_writable, plain
from pliant.cli.studies import OutFolder
from pliant.config.study import Study
from pliant.config.writing import StudyDraft
from pliant.errors import NotReachedError, PliantError, UserError
from pliant.interfaces.task import SceneTask
from pliant.pipeline.study import study_physics
from pliant.pipeline.workbench import RunContext
from pliant.registry.discovery import Registry
from pliant.store.store import Artifact, write_atomically, writing_in
from pliant.units import parse_quantity, si_unit, strip_unit_suffix
from pliant_search.evaluate.evaluator import build_search_problem
from pliant_search.evaluate.fast_path import FastPath
from pliant_search.problem.search_problem import SearchProblem
from pliant_search.records import FoundDesign, SearchResult
from pliant_search.report.document import best_said, broken_said, search_document, write_search_page
from pliant_search.report.folder import (
    BEST,
    DESIGNS,
    HISTORY,
    RESULT,
    DrawnDesign,
    copy_exported,
    write_history,
)
from pliant_search.report.view import evenly_spaced
from pliant_search.run.search import nothing_found
from pliant_search.stage import files_folder, last_round, search_study
from pliant_search.verify.check import converged

UNFIT = re.compile(r"[^\w.-]")  # in a file name
OWN_BLOCKS = ("search", "optimizer")  # of a study; that of a found design has none of them
WRITTEN = re.compile(r"best(-.*)?\.yaml")  # studies of found designs


@verb()
def optimize(
    session: Session,
    study: StudyFile,
    overrides: Overrides = None,
    out: OutFolder = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    full: Full = False,
) -> None:
    """Run the study's search, then check the best design by direct FEM; resumes where it was interrupted."""
    loaded = session.study(study, overrides)
    loaded.need("search", "'pliant optimize'")
    chosen = workers_or_scheduler(workers, scheduler)
    folder = out or Path("runs") / loaded.name
    check_writable(folder)
    if folder.resolve() == study.resolve().parent and WRITTEN.fullmatch(study.name):
        raise UserError(f"the best design would be written over {study}; give another --out.")
    context = session.context()
    made = search_study(context, loaded, executor=chosen)
    session.result["study"], session.result["out"] = loaded.name, str(folder)
    session.result["stages"] = [{"stage": "search", "key": made.key, "cached": made.cached}]
    _write_folder(session, context, made, loaded, folder, full)
    if not made.value.best:
        raise nothing_found(made.value)


def _write_folder(
    session: Session, context: RunContext, made: Artifact, study: Study, folder: Path, full: bool
) -> None:
    """Write all files of a search's folder and print the summary; the files of an earlier search are removed."""
    result: SearchResult = made.value
    searched = _last_round(study, result, folder)
    problem = build_search_problem(context, searched)
    engine: str = study_physics(context, study).kind
    session.show(search_document(study.canonical(), result, engine=engine))
    write_history(result, folder / HISTORY)
    exported = copy_exported(result.files, files_folder(context, made), folder)
    session.result["files"] = [str(file) for file in exported]
    for old in (folder / BEST, *folder.glob("best-*.yaml")):
        old.unlink(missing_ok=True)
    if result.best:
        _write_designs(session, folder, study, problem, result, full)
        session.result["best_study"] = str(folder / BEST)
        session.say(f"study    {folder / BEST}, every candidate in {folder / HISTORY}")
        if not converged(result, study, engine):
            session.exit_code = NotReachedError.exit_code
    page = write_search_page(folder, study, result, drawn_designs(context, searched, problem, result))
    session.result["report"] = str(page)
    session.say(f"report   {page}")
    write_atomically(folder / RESULT, dumps(plain(session.result), indent=1, allow_nan=False))


def _last_round(study: Study, result: SearchResult, folder: Path) -> Study:
    """Return the study that was searched last; its meta-model's data are copied into the folder if FEM was added."""
    searched, target = last_round(study, result), folder / DESIGNS
    with writing_in(folder):
        target.unlink(missing_ok=True)
        if searched is study or searched.block("meta_model") is None:
            return study
        shutil.copyfile(result.rounds[-1].table, target)
    model = searched.block("meta_model").model_copy(update={"data": target.resolve()})
    return searched.model_copy(update={"meta_model": model})


def _write_designs(
    session: Session, folder: Path, study: Study, problem: SearchProblem, result: SearchResult, full: bool
) -> None:
    """Write best.yaml and, where there are conditions, one study for each of them."""
    named = len(problem.conditions) > 1
    stems = [UNFIT.sub("_", condition.name) for condition in problem.conditions]
    best, every = result.best, range(len(problem.conditions))
    # The first of a front.
    each = [(d, d.context) for d in best] if best[0].context >= 0 else [(best[0], k) for k in every]
    for design, condition in reversed(each):
        name = problem.conditions[condition].name
        winner = problem.apply(design.values, condition)
        keys = list(problem.changes(design.values, condition))
        keys += [("meta_model", "data")] if result.rounds else []
        said = (
            f"Found by 'pliant optimize' ({result.optimizer}, seed {result.seed}, {result.evaluations} evaluations) in "
            f"study '{study.name}': {best_said(result, design)}{f'; condition {name}' if named else ''}."
        )
        if result.verification is not None and result.verification.broken:
            said += f" By direct FEM it breaks {broken_said(result.verification)}."
        alike = f"-{condition + 1}" if stems.count(stems[condition]) > 1 else ""
        targets = [folder / f"best-{stems[condition]}{alike}.yaml"] if named else []
        targets += [folder / BEST] if condition == 0 or design.context >= 0 else []
        for target in targets:
            write_best(session.path, target, winner, keys, said, session.overrides, session.installed, full)


OF_A_FRONT = 4
OF_CONDITIONS = 6


def drawn_designs(
    context: RunContext, study: Study, problem: SearchProblem, result: SearchResult
) -> list[DrawnDesign]:
    """Return the best design of each condition, of the search, or a selection from a front; empty without a design.

    A design that cannot be simulated again is left out, and a note gives the reason.
    """
    path, found = FastPath(context, study), []
    for label, design, condition in _chosen(problem, result):
        winner = problem.apply(design.values, condition)
        scene = isinstance(context.build("task", winner.noisy_task()), SceneTask)
        try:
            answer = path.result(winner)
            chain = None if scene else path.chain(winner, shapes=True)
        except PliantError as error:
            context.progress.note(f"the picture of '{label}' is missing: {error}")
            continue
        found.append(DrawnDesign.from_result(label, chain, answer))
    return found


def _chosen(problem: SearchProblem, result: SearchResult) -> list[tuple[str, FoundDesign, int]]:
    """Return label, design and condition index of each design to draw."""
    names = [condition.name for condition in problem.conditions]
    best = result.best
    if not best:
        return []
    if best[0].context >= 0:
        return [(names[design.context], design, design.context) for design in best[:OF_CONDITIONS]]
    if len(best) > 1:
        return [(f"design {k + 1}", best[k], 0) for k in evenly_spaced(len(best), OF_A_FRONT)]
    return [(name or "best", best[0], condition) for condition, name in enumerate(names[:OF_CONDITIONS])]


# Units of a study's text, which is parsed again: not those of `pliant.formatting`.
TEXT_UNITS = {"m": (1e3, "mm"), "Pa": (1e-3, "kPa"), "kg": (1e3, "g"), "N": (1.0, "N"), "s": (1.0, "s")}


def write_best(
    source: Path,
    target: Path,
    winner: Study,
    keys: Sequence[Sequence[str | int]],
    said: str,
    overrides: Sequence[str],
    registry: Registry,
    full: bool = False,
) -> None:
    """Write the study of a found design.

    Args:
        source: the searched study.
        target: the new file.
        winner: the study with the design in it.
        keys: what differs from `source`.
        said: the origin of the design, for the first line.
        overrides: with which `source` was read.
        registry: without the study's own plugin files.
        full: whether the file shall be complete without `extends`.

    Raises:
        UserError: it cannot be written.
    """
    meant = {**winner.canonical(), **dict.fromkeys(OWN_BLOCKS)}
    draft = StudyDraft(source, overrides)
    for block in OWN_BLOCKS:
        draft.drop(block)
    for key in keys:
        draft.set(tuple(key), _as_written(meant, key))
    draft.write(target, meant, registry, full, head=" ".join(said.split()))


def _as_written(canonical: Mapping[str, Any], path: Sequence[str | int]) -> Any:
    """Return the exact value at a path in the notation of a study."""
    node: Any = canonical
    name = ""
    for key in path:
        if isinstance(node, list):
            node = node[int(key)]
            continue
        name = next(n for n in node if strip_unit_suffix(n) == strip_unit_suffix(str(key)))
        node = node[name]
    unit = si_unit(name)
    if not (isinstance(node, float) and unit in TEXT_UNITS):
        return node
    factor, short = TEXT_UNITS[unit]
    for text in (f"{float(f'{factor * node:.12g}')!r} {short}", f"{factor * node!r} {short}"):
        if parse_quantity(text, unit) == node:
            return text
    return f"{node!r} {unit}"
