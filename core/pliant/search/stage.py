"""A study's search and the check of its winner, through the store."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pliant.config.study import BLOCK_LISTS, BLOCKS, Study
from pliant.errors import MissingDependencyError, PliantError, UserError
from pliant.pipeline.meta_model.stage import meta_model_stage
from pliant.pipeline.progress import Once
from pliant.pipeline.study import DEFAULT_PHYSICS, DEFAULT_SURROGATE
from pliant.pipeline.workbench import Workbench, content
from pliant.records.search import FoundDesign, SearchResult, Verification
from pliant.registry.component import Component
from pliant.search.searching import MODULES, Hands, Search, evaluator_of_study, problem_of
from pliant.store.fingerprint import code_fingerprint
from pliant.store.store import Artifact

DEFAULT_OPTIMIZER = "cmaes"
STAGE, CHECK, JOURNALS, FILES = "search", "verify", "search_journals", "search_files"
# What does not change what a search finds.
APART = ("pliant", "name", "cross_check", "measurements", "uncertainty", "protocols", "plugins")
# What a search may be continued beyond.
ENDS = ("budget", "generations", "until", "verify")


def search_study(
    bench: Workbench, study: Study, executor: Executor | None = None, workers: int | None = None
) -> Artifact:
    """Search, look about the best design, check it by direct FEM.

    Args:
        bench: plugins, store, progress. Workers other than this process open the same store by its path.
        study: has `search`, `chain` and `task`; `optimizer` is cmaes by default.
        executor: any `concurrent.futures.Executor`; it is not shut down.
        workers: processes of our own instead; 1 evaluates in this process. By default one for each CPU.

    Returns:
        An artifact whose value is the `SearchResult`; `best` is empty where nothing feasible was found.

    Raises:
        UserError: the study cannot be searched.
        NotReachedError: the executor broke, or processes cannot be started.
    """
    from pliant.search.feasibility import require_feasible

    if executor is not None and workers is not None:
        raise UserError("a search takes an executor or a number of workers, not both.")
    bench = replace(bench, progress=Once(bench.progress))
    study = with_optimizer(bench, study)
    problem = _checked(bench, study)
    require_feasible(problem, study.need("search", "a search").seed)
    made = _searched(bench, study, Hands(executor, workers))
    result: SearchResult = made.value
    if study.need("search", "a search").verify is None or not result.best:
        return made
    verification = _verified(bench, study, problem, result, made.key)
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


def converged(result: SearchResult) -> bool:
    """Whether the check of the winner, where there was one, came to numbers in every engine."""
    check = result.verification
    if check is None:
        return True
    numbers = [v for metrics in check.verified.values() for v in metrics.values()]
    return bool(numbers) and all(
        metrics and any(np.isfinite(value) for value in metrics.values())
        for metrics in check.verified.values()
    )


def _checked(bench: Workbench, study: Study) -> Any:
    """The problem, with everything tried that would fail only after hours."""
    from pliant.search.direct_fem import check_verifiable

    study.need("chain", "a search")
    study.need("task", "a search")
    for key in ("optimizer", "physics", "task"):
        if getattr(study, key) is not None:
            bench.build(key, getattr(study, key))
    problem = problem_of(bench, study)
    if len(problem.objective_names) > 1:
        _require_several(bench, study)
    check_verifiable(study)
    return problem


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


def _searched(bench: Workbench, study: Study, hands: Hands) -> Artifact:
    """The search as an artifact; of a robust one the nominal search comes first."""
    config = study.need("search", "a search")
    inputs: dict[str, str] = {}
    if study.meta_model is not None and study.family is not None:
        inputs["meta_model"] = meta_model_stage(bench, study).artifact.key
    nominal = None
    if config.robust is not None and config.robust.compare:
        plain = study.model_copy(update={"search": config.model_copy(update={"robust": None})})
        nominal = _searched(bench, plain, hands)
        inputs["nominal"] = nominal.key
    problem = problem_of(bench, study)
    components = components_of(bench, study)
    kept = bench.store.root / JOURNALS / _digest(_content(study, ENDS), inputs, components)

    def compute(partial: Path) -> SearchResult:
        optimizer = bench.build("optimizer", study.optimizer)  # type: ignore[arg-type]
        search = Search(
            bench,
            study,
            problem,
            evaluator_of_study(bench, study),
            hands,
            contextual=bool(type(optimizer).capabilities.contexts and config.conditions),
            nominal=nominal.value if nominal else None,
        )
        files = bench.store.root / FILES / partial.name.removesuffix(".partial")
        return search.run(partial, kept, files)

    return bench.make(
        STAGE,
        compute,
        components=components,
        modules=[*MODULES, "pliant.search.sensitivity", "pliant.search.limits"],
        config=_content(study, ("verify",)),
        inputs=inputs,
    )


def _content(study: Study, without: Sequence[str]) -> dict[str, Any]:
    """What a search depends on, without some keys of `search`."""
    plain = {key: value for key, value in content(study).items() if key not in APART}
    plain["search"] = {key: value for key, value in plain["search"].items() if key not in without}
    return plain


def _digest(config: Mapping[str, Any], inputs: Mapping[str, str], components: Sequence[Component]) -> str:
    """Names what a search may be continued from."""
    code = code_fingerprint([*MODULES, *_places(components)])
    # The nominal search beside a robust one has a budget of its own, which the robust one does not depend on.
    inputs = {name: key for name, key in inputs.items() if name != "nominal"}
    text = json.dumps([config, inputs, code], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _places(components: Sequence[Component]) -> list[str]:
    return [place.partition(":")[0] for c in components for place in (c.config, c.implementation)]


def components_of(bench: Workbench, study: Study, also: Sequence[str] = ()) -> list[Component]:
    """The plugins whose code the search depends on; `also` are engines beside the study's own."""
    wanted = {
        (interface, block.kind)
        for key, interface in BLOCKS.items()
        if (block := getattr(study, key)) is not None
    }
    wanted |= {("effect", effect.kind) for effect in study.effects}
    segments = study.chain.segments if study.chain is not None else ()
    wanted |= {("surrogate", s.surrogate.kind) for s in segments if s.surrogate is not None}
    wanted |= {("physics", kind) for kind in also}
    if study.physics is None:
        wanted.add(("physics", DEFAULT_PHYSICS))
    if study.surrogate is None and study.family is not None:
        wanted.add(("surrogate", DEFAULT_SURROGATE))
    return [bench.registry.get(interface, kind) for interface, kind in sorted(wanted)]


def _verified(
    bench: Workbench, study: Study, problem: Any, result: SearchResult, key: str
) -> Verification | None:
    """The check of the best design, or of the best design of each condition; a failed check is one with a note."""
    contextual = len(result.best) > 1 and all(design.context >= 0 for design in result.best)
    checks = []
    for design in result.best if contextual else result.best[:1]:
        try:
            checks.append(_check(bench, study, problem, design, key))
        except MissingDependencyError:
            raise
        except PliantError as error:
            bench.progress.note(f"the check of the best design failed: {error}")
            checks.append(Verification({}, {}, {}, (), 0.0, 0.0, (str(error),)))
    return merged(checks)


def _check(bench: Workbench, study: Study, problem: Any, design: FoundDesign, key: str) -> Verification:
    """The check of one design as a stage of its own, so that it can be repeated without the search."""

    def compute(partial: Path) -> Verification:
        from pliant.search.verification import verify

        return verify(bench, problem, design)

    config = study.need("search", "a search")
    made = bench.make(
        CHECK,
        compute,
        components=components_of(bench, study, [engine.kind for engine in study.cross_check]),
        modules=["pliant.search.verification"],
        config={
            "study": _content(study, ()),
            "cross_check": [content(engine) for engine in study.cross_check],
            "verify": content(config.verify),
            "values": dict(design.values),
            "context": design.context,
        },
        inputs={"search": key},
    )
    value: Verification = made.value
    return value


def merged(checks: Sequence[Verification]) -> Verification | None:
    """The checks of the best designs of several conditions as one: metrics are means over conditions."""
    if len(checks) < 2:
        return checks[0] if checks else None
    by_engine: dict[str, dict[str, Mapping[str, float]]] = {}
    for check in checks:
        for engine, conditions in check.conditions.items():
            by_engine.setdefault(engine, {}).update(conditions)
    return Verification(
        _mean([check.predicted for check in checks]),
        _mean([check.verified for check in checks]),
        by_engine,
        tuple(law for check in checks for law in check.laws),
        sum(check.fem_wall_s for check in checks),
        sum(check.wall_s for check in checks),
        tuple(dict.fromkeys(note for check in checks for note in check.notes)),
    )


def _mean(checks: Sequence[Mapping[str, Mapping[str, float]]]) -> dict[str, dict[str, float]]:
    """Engine → metric → mean over those that have it."""
    engines = dict.fromkeys(engine for check in checks for engine in check)
    found: dict[str, dict[str, float]] = {}
    for engine in engines:
        metrics = [check[engine] for check in checks if engine in check]
        names = dict.fromkeys(name for one in metrics for name in one)
        found[engine] = {
            name: float(np.mean([one[name] for one in metrics if name in one])) for name in names
        }
    return found
