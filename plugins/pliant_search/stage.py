"""Search of a study and check of its best design, through the store."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import islice
from math import nan
from pathlib import Path

from pliant.config.study import Study
from pliant.config.study_keys import KeyPath
from pliant.errors import PliantError, UserError
from pliant.execution.executors import Executor, Workers, either, executor_for
from pliant.execution.progress import Once
from pliant.pipeline.engine_checks import check_engines
from pliant.pipeline.study import study_physics
from pliant.pipeline.workbench import RunContext
from pliant.store.fingerprint import code_fingerprint
from pliant.store.store import Artifact
from pliant_designs.stage import meta_model_stage
from pliant_search.evaluate.evaluator import OF_EVERY_TASK, build_search_problem, evaluator_from_study
from pliant_search.evaluate.scenarios import tolerance_notes
from pliant_search.evaluate.solid_metrics import named_of_solids
from pliant_search.problem.feasibility import require_feasible, require_reachable
from pliant_search.problem.search_problem import SearchProblem, reevaluation_problem
from pliant_search.records import FoundDesign, SearchResult, SearchRound
from pliant_search.run.journal import keep_journals, take_journals
from pliant_search.run.polishing import require_polishable
from pliant_search.run.search import EXPORT, Search, warm_started
from pliant_search.stage_keys import ENDS, MODULES, search_components, search_content
from pliant_search.verify.check import checked
from pliant_search.verify.direct_fem import check_verifiable
from pliant_search.verify.extrapolation import leaning
from pliant_search.verify.next_best import next_best
from pliant_search.verify.rounds import with_checked

DEFAULT_OPTIMIZER = "cmaes"
# Number of designs of a round, besides the refused one, that take part in the choice of the next round.
EARLIER = 5
STAGE, JOURNALS, FILES = "search", "search_journals", "search_files"


def search_study(
    context: RunContext, study: Study, executor: Workers = None, workers: int | None = None
) -> Artifact:
    """Run a study's search, analyse the best design and check it by direct FEM.

    Args:
        context: plugins, store, progress. Workers other than this process open the same store by its path.
        study: has `search`, `chain` and `task`; `optimizer` is cmaes by default.
        executor: any `concurrent.futures.Executor`, which is not shut down; or the address of a dask scheduler.
        workers: number of local processes instead; 1 evaluates in this process. By default the study's number, or
            one for each CPU.

    Returns:
        An artifact whose value is the `SearchResult`; `best` is empty where nothing feasible was found.

    Raises:
        UserError: the study cannot be searched.
        NotReachedError: the executor broke, or processes cannot be started.
    """
    chosen = study.resolve_workers(either(executor, workers, "a search"))
    context = replace(context, progress=Once(context.progress))
    study.need("search", "'pliant optimize'")
    if study.block("optimizer") is None:
        config = context.registry.get("optimizer", DEFAULT_OPTIMIZER).config_model()(kind=DEFAULT_OPTIMIZER)
        study = study.model_copy(update={"optimizer": config})
    problem = _checked(context, study)
    space = require_feasible(problem, problem.config.seed)
    # Keys that cannot be varied, or leave the meta-model's range, are reported before the nominal search.
    robust = problem.config.robust is not None
    tolerances = (
        tolerance_notes(context, problem, evaluator_from_study(context, study).scenarios) if robust else []
    )
    for note in (*problem.start_notes(), space.note(), *tolerances, *_optimizer_remarks(context, problem)):
        if note:
            context.progress.note(note)
    with executor_for(chosen) as running:
        made = _searched(context, study, running)
        result: SearchResult = made.value
        if problem.config.verify is None or not result.best:
            return made
        engine, first = study_physics(context, study).kind, made
        made, problem, result = _rounds(context, problem, made, engine, running)

        def check(one: SearchResult) -> SearchResult:
            return replace(one, verification=checked(context, problem.study, problem, one, made.key, running))

        result = _that_holds(check, problem, result, engine)
    return replace(made, value=result, cached=first.cached and made.cached)


def _optimizer_remarks(context: RunContext, problem: SearchProblem) -> Sequence[str]:
    """Return what the optimizer says on its keys and on the variables before a search of this length."""
    optimizer = context.build("optimizer", problem.study.need("optimizer", "a search"))
    config = problem.config
    of_keys = optimizer.remarks(None if config.generations is not None else config.budget)
    return [*of_keys, *optimizer.space_remarks(problem.space())]


def _rounds(
    context: RunContext, problem: SearchProblem, made: Artifact, engine: str, running: Executor
) -> tuple[Artifact, SearchProblem, SearchResult]:
    """Search again with FEM of the last best design, up to `verify.rounds` times; return the last checked search.

    It goes on while the best design breaks a constraint by FEM or leans on extrapolation.
    """
    rounds: list[SearchRound] = []
    verify = problem.config.verify
    most, law_error = (verify.rounds, verify.law_error) if verify else (0, None)
    while True:
        result: SearchResult = made.value
        check = checked(context, problem.study, problem, result, made.key, running)
        result = replace(result, verification=check, rounds=tuple(rounds))
        broken = check.broken.get(engine, {}) if check is not None else {}
        if check is None or not check.laws or not _one_best(result):
            return made, problem, result
        causes = leaning(result.best[0], check, law_error)
        if causes:
            said = f"The best design leans on extrapolation: {', '.join(causes)}."
            result = replace(result, verification=replace(check, notes=(*check.notes, said)))
        if not (broken or causes) or len(rounds) == most:
            return made, problem, result
        following = with_checked(context, problem, result.best)
        if following is None or following.block("meta_model") is None:
            context.progress.note("no further round: the meta-model has the FEM of this design already.")
            return made, problem, result
        worst = max(float(law.get("worst_of_range", nan)) for law in check.laws)
        table = str(following.block("meta_model").data)
        rounds.append(SearchRound(result.best[0], broken, worst, result.evaluations, table, causes))
        cause = (
            f"by direct FEM the best design breaks {', '.join(broken)}"
            if broken
            else "its laws are uncertain"
        )
        context.progress.note(
            f"round {len(rounds)} of {most}: {cause}; searching on with its FEM among the meta-model's data."
        )
        earlier = (result.best[0], *islice(next_best(problem, result, check, engine), EARLIER))
        again = _searched(context, following, running, earlier, made.key)
        if not again.value.best:
            context.progress.note(
                "the round found no design that keeps the constraints; the search before it stands."
            )
            return made, problem, result
        made, problem = again, build_search_problem(context, following)


def _that_holds(
    check: Callable[[SearchResult], SearchResult], problem: SearchProblem, result: SearchResult, engine: str
) -> SearchResult:
    """Return the result with the best design that satisfies its constraints by FEM, if one of the next ones does.

    The result is unchanged if the best design satisfies them, if it is not one design of one objective, or if none of
    the `others` that are checked satisfies them.
    """
    first, most = result.verification, problem.config.verify.others if problem.config.verify else 0
    if first is None or not first.broken.get(engine) or not _one_best(result) or not first.laws:
        return result
    refused = [result.best[0]]
    for design in islice(next_best(problem, result, first, engine), most):
        again = check(replace(result, best=(design,)))
        if again.verification is not None and not again.verification.broken.get(engine):
            # slopes and limits were those of the refused design
            return replace(again, slopes=(), limits=(), refused_by_check=tuple(refused))
        refused.append(design)
    return result


def _one_best(result: SearchResult) -> bool:
    """Return whether the search found one design of one objective, evaluated in all conditions."""
    return len(result.best) == 1 and result.best[0].context < 0 and len(result.objectives) == 1


def last_round(study: Study, result: SearchResult) -> Study:
    """Return the last searched study, with the FEM of refused designs among the meta-model's data."""
    if not result.rounds or study.block("meta_model") is None:
        return study
    model = study.block("meta_model").model_copy(update={"data": Path(result.rounds[-1].table)})
    return study.model_copy(update={"meta_model": model, "sweep": None})


def files_folder(context: RunContext, artifact: Artifact) -> Path:
    """Return the folder of the files that the optimizer exported (`SearchResult.files`)."""
    return context.store.root / FILES / artifact.key


def _checked(context: RunContext, study: Study) -> SearchProblem:
    """Return the problem after checks of everything that would otherwise fail only after hours."""
    study.need("chain", "a search")
    study.need("task", "a search")
    for key in ("optimizer", "physics", "task"):
        if getattr(study, key) is not None:
            context.build(key, getattr(study, key))
    problem = build_search_problem(context, study)
    if not {("task", "kind"), ("physics", "kind")} & set_by_search(problem):
        check_engines(context, study, study_physics(context, study))
    _require_measured(context, problem)
    _require_choosable(context, study, problem)
    check_verifiable(study, problem.registry)
    require_reachable(problem, context)
    return problem


def set_by_search(problem: SearchProblem) -> set[KeyPath]:
    """Return the paths of the study's keys that variables and conditions replace."""
    conditions = {key for condition in problem.conditions for key in condition.changes}
    return {key for one in problem.variables for key in one.keys} | conditions


def _require_measured(context: RunContext, problem: SearchProblem) -> None:
    """Raise `UserError` if a formula names a metric that the task, as far as it declares its metrics, lacks."""
    if ("task", "kind") not in set_by_search(problem):
        measured = context.build("task", problem.study.need("task", "a search")).measures()
        if measured:
            problem.require_metrics(
                dict.fromkeys((*measured, *OF_EVERY_TASK, *named_of_solids(problem)), 0.0)
            )


def _require_choosable(context: RunContext, study: Study, problem: SearchProblem) -> None:
    """Raise `UserError` where the optimizer, `confirm` or `halving` cannot choose among candidates or searches."""
    config, kind = problem.config, study.need("optimizer", "a search").kind
    several = len(problem.objective_names) > 1
    capabilities = context.registry.get("optimizer", kind).implementation_class().capabilities
    if several and not capabilities.several_objectives:
        able = []
        for one in context.registry.by_interface("optimizer"):
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
    if config.polish is not None:
        require_polishable(context, problem, bool(capabilities.contexts and config.conditions))
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


def _searched(
    context: RunContext,
    study: Study,
    executor: Executor,
    earlier: Sequence[FoundDesign] = (),
    after: str = "",
) -> Artifact:
    """Return the search as an artifact; a robust search runs the nominal search first.

    Args:
        context, study, executor: as for `search_study`.
        earlier: of a later round: designs of the previous round, which is the artifact `after`.
        after: its key.
    """
    config = study.need("search", "a search")
    inputs: dict[str, str] = {"round_before": after} if after else {}
    if study.block("meta_model") is not None and study.family is not None:
        inputs["meta_model"] = meta_model_stage(context, study).artifact.key
    continued, before = dict(inputs), None
    if config.robust is not None and config.robust.compare:
        plain = study.model_copy(update={"search": config.model_copy(update={"robust": None})})
        nominal = _searched(context, plain, executor)
        before, inputs["nominal"] = nominal.value, nominal.key
    problem, components = build_search_problem(context, study), search_components(context, study)
    # What it may be continued from. The nominal search has its own budget; the robust one depends only on its
    # starting point.
    known = (*(before.best if before is not None else ()), *earlier)
    begun = warm_started(known, problem, problem.space()).start if known else {}
    places = [place.partition(":")[0] for c in components for place in (c.config, c.implementation)]
    parts = [search_content(study, ENDS), continued, begun, code_fingerprint([*MODULES, *places])]
    digest = hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:32]
    kept = context.store.root / JOURNALS / digest

    def compute(partial: Path) -> SearchResult:
        if take_journals(kept, partial):
            context.progress.note("going on from the journal of the same search with another budget.")
        result = Search(context, study, problem, executor, partial, before, earlier).result()
        exported, files = partial / EXPORT, context.store.root / FILES / partial.name.removesuffix(".partial")
        names = sorted(
            file.relative_to(exported).as_posix() for file in exported.rglob("*") if file.is_file()
        )
        shutil.rmtree(files, ignore_errors=True)
        if names:
            files.parent.mkdir(parents=True, exist_ok=True)
            shutil.copytree(exported, files)
        keep_journals(partial, kept)
        return replace(result, files=tuple(names))

    return context.make(
        STAGE,
        compute,
        components=components,
        modules=MODULES,
        config=search_content(study, ("verify",)),
        inputs=inputs,
    )
