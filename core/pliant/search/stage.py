"""A study's search and the check of its winner, through the store."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pliant.config.study import Study
from pliant.errors import PliantError, UserError
from pliant.execution.executors import Executor, Workers, either, executor_for
from pliant.execution.progress import Once
from pliant.pipeline.meta_model.stage import meta_model_stage
from pliant.pipeline.workbench import Workbench
from pliant.records.search import SearchResult
from pliant.registry.component import Component
from pliant.search.evaluate.evaluator import OF_EVERY_TASK, evaluator_of_study, problem_of
from pliant.search.evaluate.scenarios import tolerance_notes
from pliant.search.problem.feasibility import require_feasible, require_reachable
from pliant.search.problem.reevaluation_problem import require_reevaluation
from pliant.search.problem.search_problem import SearchProblem
from pliant.search.run.halving import require_halving
from pliant.search.run.search import Search
from pliant.search.run.warm_start import warm_started
from pliant.search.stage_keys import ENDS, MODULES, components_of, content_of
from pliant.search.verify.check import checked
from pliant.search.verify.direct_fem import check_verifiable
from pliant.store.fingerprint import code_fingerprint
from pliant.store.store import Artifact

DEFAULT_OPTIMIZER = "cmaes"
STAGE, JOURNALS, FILES = "search", "search_journals", "search_files"
# What is found out when the search has ended: not what candidates come to.
AFTERWARDS = ("pliant.search.run.reevaluation", "pliant.search.analyse.post_analysis")


def search_study(
    bench: Workbench, study: Study, executor: Workers = None, workers: int | None = None
) -> Artifact:
    """Search, look about the best design, check it by direct FEM.

    Args:
        bench: plugins, store, progress. Workers other than this process open the same store by its path.
        study: has `search`, `chain` and `task`; `optimizer` is cmaes by default.
        executor: any `concurrent.futures.Executor`, which is not shut down; or the address of a dask scheduler.
        workers: processes of our own instead; 1 evaluates in this process. By default one for each CPU.

    Returns:
        An artifact whose value is the `SearchResult`; `best` is empty where nothing feasible was found.

    Raises:
        UserError: the study cannot be searched.
        NotReachedError: the executor broke, or processes cannot be started.
    """
    chosen = either(executor, workers, "a search")
    bench = replace(bench, progress=Once(bench.progress))
    study = with_optimizer(bench, study)
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


def with_optimizer(bench: Workbench, study: Study) -> Study:
    """The study with the default optimizer where it names none."""
    study.need("search", "'pliant optimize'")
    if study.optimizer is not None:
        return study
    config = bench.registry.get("optimizer", DEFAULT_OPTIMIZER).config_model()(kind=DEFAULT_OPTIMIZER)
    return study.model_copy(update={"optimizer": config})


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
    _require_measured(bench, problem)
    if len(problem.objective_names) > 1:
        _require_several(bench, study)
    require_reevaluation(problem)
    require_halving(problem, bench.build("optimizer", study.optimizer))  # type: ignore[arg-type]
    check_verifiable(study, problem.registry)
    require_reachable(problem, bench)
    return problem


def _require_measured(bench: Workbench, problem: SearchProblem) -> None:
    """Raise `UserError` where a formula names what the task, as far as it says so, does not measure."""
    set_by_search = {key for one in problem.variables for key in one.keys}
    set_by_search |= {key for condition in problem.conditions for key in condition.changes}
    if ("task", "kind") in set_by_search:
        return
    measured = bench.build("task", problem.study.need("task", "a search")).measures()
    if measured:
        problem.require_metrics(dict.fromkeys((*measured, *OF_EVERY_TASK), 0.0))


def _require_several(bench: Workbench, study: Study) -> None:
    """Raise `UserError` where the optimizer knows one objective only."""
    kind = study.optimizer.kind if study.optimizer else ""
    if bench.registry.get("optimizer", kind).implementation_class().capabilities.several_objectives:
        return
    able = [c.kind for c in bench.registry.of("optimizer") if _several(c)]
    others = f"use {' or '.join(able)}, or " if able else ""
    raise UserError(
        f"optimizer '{kind}' minimises one objective and search.objective lists several; {others}write one "
        "expression of them."
    )


def _several(component: Component) -> bool:
    try:
        return bool(
            not component.missing() and component.implementation_class().capabilities.several_objectives
        )
    except PliantError:
        return False


def _searched(bench: Workbench, study: Study, executor: Executor) -> Artifact:
    """The search as an artifact; of a robust one the nominal search comes first."""
    config = study.need("search", "a search")
    inputs: dict[str, str] = {}
    if study.meta_model is not None and study.family is not None:
        inputs["meta_model"] = meta_model_stage(bench, study).artifact.key
    nominal = None
    if config.robust is not None and config.robust.compare:
        plain = study.model_copy(update={"search": config.model_copy(update={"robust": None})})
        nominal = _searched(bench, plain, executor)
        inputs["nominal"] = nominal.key
    problem = problem_of(bench, study)
    components = components_of(bench, study)
    before = nominal.value if nominal else None
    # The nominal search has a budget of its own; what the robust one depends on is where it begins.
    begun = warm_started(before, problem, problem.space()).start if before else {}
    continued = {name: key for name, key in inputs.items() if name != "nominal"}
    kept = bench.store.root / JOURNALS / _digest([content_of(study, ENDS), continued, begun], components)

    def compute(partial: Path) -> SearchResult:
        optimizer = bench.build("optimizer", study.optimizer)  # type: ignore[arg-type]
        search = Search(
            bench,
            study,
            problem,
            evaluator_of_study(bench, study),
            executor,
            contextual=bool(type(optimizer).capabilities.contexts and config.conditions),
            nominal=before,
        )
        files = bench.store.root / FILES / partial.name.removesuffix(".partial")
        return search.run(partial, kept, files)

    return bench.make(
        STAGE,
        compute,
        components=components,
        modules=[*MODULES, *AFTERWARDS],
        config=content_of(study, ("verify",)),
        inputs=inputs,
    )


def _digest(content: Sequence[Any], components: Sequence[Component]) -> str:
    """Names what a search may be continued from."""
    code = code_fingerprint([*MODULES, *_places(components)])
    text = json.dumps([*content, code], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _places(components: Sequence[Component]) -> list[str]:
    return [place.partition(":")[0] for c in components for place in (c.config, c.implementation)]
