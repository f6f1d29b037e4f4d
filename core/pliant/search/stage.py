"""A study's search and the check of its winner, through the store."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path

from pliant.config.study import Study
from pliant.config.study_keys import KeyPath
from pliant.errors import PliantError, UserError
from pliant.execution.executors import Executor, Workers, either, executor_for
from pliant.execution.progress import Once
from pliant.pipeline.engine_checks import check_engines
from pliant.pipeline.meta_model.stage import meta_model_stage
from pliant.pipeline.study import physics_of_study
from pliant.pipeline.workbench import Workbench
from pliant.records.search import SearchResult
from pliant.search.evaluate.evaluator import OF_EVERY_TASK, evaluator_of_study, problem_of
from pliant.search.evaluate.scenarios import tolerance_notes
from pliant.search.problem.feasibility import require_feasible, require_reachable
from pliant.search.problem.search_problem import SearchProblem, reevaluation_problem
from pliant.search.run.journal import keep_journals, take_journals
from pliant.search.run.search import EXPORT, Search, warm_started
from pliant.search.stage_keys import ENDS, MODULES, components_of, content_of
from pliant.search.verify.check import checked
from pliant.search.verify.direct_fem import check_verifiable
from pliant.store.fingerprint import code_fingerprint
from pliant.store.store import Artifact

DEFAULT_OPTIMIZER = "cmaes"
STAGE, JOURNALS, FILES = "search", "search_journals", "search_files"


def search_study(
    bench: Workbench, study: Study, executor: Workers = None, workers: int | None = None
) -> Artifact:
    """Search, look about the best design, check it by direct FEM.

    Args:
        bench: plugins, store, progress. Workers other than this process open the same store by its path.
        study: has `search`, `chain` and `task`; `optimizer` is cmaes by default.
        executor: any `concurrent.futures.Executor`, which is not shut down; or the address of a dask scheduler.
        workers: processes of our own instead; 1 evaluates in this process. By default the study's, or one for each
            CPU.

    Returns:
        An artifact whose value is the `SearchResult`; `best` is empty where nothing feasible was found.

    Raises:
        UserError: the study cannot be searched.
        NotReachedError: the executor broke, or processes cannot be started.
    """
    chosen = study.who_works(either(executor, workers, "a search"))
    bench = replace(bench, progress=Once(bench.progress))
    study.need("search", "'pliant optimize'")
    if study.optimizer is None:
        config = bench.registry.get("optimizer", DEFAULT_OPTIMIZER).config_model()(kind=DEFAULT_OPTIMIZER)
        study = study.model_copy(update={"optimizer": config})
    problem = _checked(bench, study)
    space = require_feasible(problem, problem.config.seed)
    # What cannot be varied, or leaves the meta-model's range, shows before the nominal search beside a robust one.
    robust = problem.config.robust is not None
    tolerances = tolerance_notes(bench, problem, evaluator_of_study(bench, study).scenarios) if robust else []
    for note in (*problem.start_notes(), space.note(), *tolerances):
        if note:
            bench.progress.note(note)
    with executor_for(chosen) as running:
        made = _searched(bench, study, running)
        result: SearchResult = made.value
        if problem.config.verify is None or not result.best:
            return made
        verification = checked(bench, study, problem, result, made.key, running)
    return replace(made, value=replace(result, verification=verification))


def files_folder(bench: Workbench, artifact: Artifact) -> Path:
    """Where the files lie that the optimizer exported (`SearchResult.files`)."""
    return bench.store.root / FILES / artifact.key


def _checked(bench: Workbench, study: Study) -> SearchProblem:
    """The problem, with everything tried that would fail only after hours."""
    study.need("chain", "a search")
    study.need("task", "a search")
    for key in ("optimizer", "physics", "task"):
        if getattr(study, key) is not None:
            bench.build(key, getattr(study, key))
    problem = problem_of(bench, study)
    if not {("task", "kind"), ("physics", "kind")} & set_by_search(problem):
        check_engines(bench, study, physics_of_study(bench, study))
    _require_measured(bench, problem)
    _require_choosable(bench, study, problem)
    check_verifiable(study, problem.registry)
    require_reachable(problem, bench)
    return problem


def set_by_search(problem: SearchProblem) -> set[KeyPath]:
    """Keys of the study in whose place variables and conditions put something else."""
    conditions = {key for condition in problem.conditions for key in condition.changes}
    return {key for one in problem.variables for key in one.keys} | conditions


def _require_measured(bench: Workbench, problem: SearchProblem) -> None:
    """Raise `UserError` where a formula names what the task, as far as it says so, does not measure."""
    if ("task", "kind") not in set_by_search(problem):
        measured = bench.build("task", problem.study.need("task", "a search")).measures()
        if measured:
            problem.require_metrics(dict.fromkeys((*measured, *OF_EVERY_TASK), 0.0))


def _require_choosable(bench: Workbench, study: Study, problem: SearchProblem) -> None:
    """Raise `UserError` where the optimizer, `confirm` or `halving` cannot choose among candidates or searches."""
    config, kind = problem.config, study.need("optimizer", "a search").kind
    several = len(problem.objective_names) > 1
    capabilities = bench.registry.get("optimizer", kind).implementation_class().capabilities
    if several and not capabilities.several_objectives:
        able = []
        for one in bench.registry.of("optimizer"):
            try:
                if not one.missing() and one.implementation_class().capabilities.several_objectives:
                    able.append(one.kind)
            except PliantError:
                continue
        others = f"use {' or '.join(able)}, or " if able else ""
        raise UserError(
            f"optimizer '{kind}' minimises one objective and search.objective lists several; {others}write one "
            "expression of them."
        )
    if config.confirm is not None and several:
        raise UserError(
            "search.confirm chooses by one objective, and search.objective lists several; leave confirm out, or write "
            "one expression of them."
        )
    if config.confirm is not None:
        reevaluation_problem(problem)
    if config.halving is not None and len(problem.branches()) == 1:
        raise UserError(
            "search.halving chooses among the searches of 'each' variables, and this study has one search; leave it "
            "out, or give a variable of whole numbers or choices 'each: true'."
        )
    if config.halving is not None and several:
        raise UserError(
            "search.halving ranks searches by one objective, and search.objective lists several; leave halving out, "
            "or write one expression of them."
        )
    if config.halving is not None and capabilities.contexts and config.conditions:
        raise UserError(
            f"search.halving ranks searches by one score, and optimizer '{kind}' has one for each condition; leave "
            "halving out, or use an optimizer that tries a candidate in all conditions."
        )


def _searched(bench: Workbench, study: Study, executor: Executor) -> Artifact:
    """The search as an artifact; of a robust one the nominal search comes first."""
    config = study.need("search", "a search")
    inputs: dict[str, str] = {}
    if study.meta_model is not None and study.family is not None:
        inputs["meta_model"] = meta_model_stage(bench, study).artifact.key
    continued, before = dict(inputs), None
    if config.robust is not None and config.robust.compare:
        plain = study.model_copy(update={"search": config.model_copy(update={"robust": None})})
        nominal = _searched(bench, plain, executor)
        before, inputs["nominal"] = nominal.value, nominal.key
    problem, components = problem_of(bench, study), components_of(bench, study)
    # What it may be continued from. The nominal search has a budget of its own; what the robust one depends on is
    # where it begins.
    begun = warm_started(before, problem, problem.space()).start if before else {}
    places = [place.partition(":")[0] for c in components for place in (c.config, c.implementation)]
    parts = [content_of(study, ENDS), continued, begun, code_fingerprint([*MODULES, *places])]
    digest = hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:32]
    kept = bench.store.root / JOURNALS / digest

    def compute(partial: Path) -> SearchResult:
        if take_journals(kept, partial):
            bench.progress.note("going on from the journal of the same search with another budget.")
        result = Search(bench, study, problem, executor, partial, before).result()
        exported, files = partial / EXPORT, bench.store.root / FILES / partial.name.removesuffix(".partial")
        names = sorted(
            file.relative_to(exported).as_posix() for file in exported.rglob("*") if file.is_file()
        )
        shutil.rmtree(files, ignore_errors=True)
        if names:
            files.parent.mkdir(parents=True, exist_ok=True)
            shutil.copytree(exported, files)
        keep_journals(partial, kept)
        return replace(result, files=tuple(names))

    return bench.make(
        STAGE,
        compute,
        components=components,
        modules=MODULES,
        config=content_of(study, ("verify",)),
        inputs=inputs,
    )
