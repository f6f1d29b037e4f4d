"""Searches for grippers: scores and policies, the check of winners and baseline, targets, printed lines."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from benchmarks.output import Bar
from benchmarks.studies.command import brief, spread
from benchmarks.studies.page import clock, millimetres, number, percent
from benchmarks.studies.published import GRIPPER, GRIPPER_BARS

from pliant.config.study import Study
from pliant.errors import PliantError
from pliant.pipeline.study import simulate_study
from pliant.pipeline.workbench import RunContext
from pliant.records.design import Array
from pliant_search.evaluate.evaluator import build_search_problem, measured, numbers
from pliant_search.problem.study_setter import StudySetter, changed
from pliant_search.records import STATUSES, SearchResult
from pliant_search.verify.direct_fem import direct_studies, solvable

LAST, MOST_DRAWS, MOST_POINTS = 0.25, 60, 60


def score(result: SearchResult) -> float:
    """Return the first objective of the best design, as stated; the mean over tasks if each task has a design."""
    values = [next(iter(design.objectives.values())) for design in result.best]
    return float(np.mean(values)) if result.best[0].context >= 0 else float(values[0])


def stable_tasks(result: SearchResult) -> int:
    """Return tasks whose grasp is stable, with their best design and the noise of the search."""
    found = {task: metrics for design in result.best for task, metrics in design.conditions.items()}
    return sum(metrics.get("success_share", 0.0) == 1.0 for metrics in found.values())


def curve(result: SearchResult) -> dict[str, list[Any]]:
    """Score of the best so far against the grasps made: `grasps`, `score` (None before every task has one)."""
    history, sign = result.history, -1.0 if result.maximised[0] else 1.0
    contexts = sorted({int(k) for k in history.context})
    scores = (np.where(history.context == one, history.objectives[:, 0], np.nan) for one in contexts)
    columns = [np.fmin.accumulate(one) for one in scores]
    best: Array = sign * np.mean(columns, axis=0) if columns else np.zeros(0)
    tried = max(1, len(result.conditions)) if contexts == [-1] else 1
    grasps = tried * np.cumsum(history.status != STATUSES.index("refused"))
    at = spread(len(best), MOST_POINTS)
    return {"grasps": [int(grasps[k]) for k in at], "score": brief(best[at])}


def acting(problem: Any) -> dict[str, list[str]]:
    """Return task → the variables of a `SearchProblem` that set a key in it."""
    return {
        condition.name: [one.name for one in problem.variables if index in one.conditions]
        for index, condition in enumerate(problem.conditions)
    }


def policy(result: SearchResult) -> dict[str, dict[str, list[Any]]]:
    """Return task → variable → values proposed in the last quarter of a search with contexts; else empty.

    Variables that are one for several tasks stand under its name, with the value that they have in the task.
    """
    history = result.history
    if not (history.context >= 0).any():
        return {}
    late = np.arange(len(history)) >= (1 - LAST) * len(history)
    found = {}
    for index, task in enumerate(result.conditions):
        rows = np.flatnonzero((history.context == index) & late & (history.status == STATUSES.index("ok")))
        few = [rows[k] for k in spread(len(rows), MOST_DRAWS)]
        columns = {name: np.asarray(values)[few] for name, values in history.values.items()}
        found[task] = {name: brief(own) for name, own in columns.items() if np.isfinite(own).all()}
    return found


def baseline(context: RunContext, study: Study) -> dict[str, Any]:
    """Return the study's gripper, no variable set, in all its tasks and engines, with `verify.change`.

    Returns:
        `engines`: engine → task → metrics; `design`: variable → the study's own value, SI; `laws`: direct FEM, or
        those of the search where the study says so; `notes`; `wall_s`.

    Raises:
        UserError: the study is wrong; an engine's own failure is a note.
    """
    begun, notes = time.perf_counter(), list[str]()
    problem = build_search_problem(context, study)
    setter = StudySetter(study, context.registry)
    verify = problem.config.verify
    change = verify.change if verify is not None else {}
    own = [changed(context.registry, setter.study(dict(c.changes)), change) for c in problem.conditions]
    solved = solvable(study)
    cases = direct_studies(context, own)[0] if solved else own
    engines: dict[str, dict[str, Any]] = {}
    for condition, case in zip(problem.conditions, cases, strict=True):
        for engine in (case.physics, *case.cross_check):
            kind = engine.kind if engine is not None else ""
            alone = case.model_copy(update={"physics": engine, "cross_check": (), "uncertainty": None})
            try:
                run = simulate_study(context, alone).engines[0]
            except PliantError as error:
                notes.append(f"{kind}, {condition.name}: {error}")
                continue
            trials = {"trials": float(getattr(case.task, "trials", 1))}
            engines.setdefault(run.kind, {})[condition.name] = numbers(measured(run.result)) | trials
    return {
        "engines": engines,
        "design": {v.name: v.stated for v in problem.variables if v.stated is not None and not v.each},
        "laws": "direct FEM" if solved else "the search",
        "notes": list(dict.fromkeys(notes)),
        "wall_s": time.perf_counter() - begun,
    }


def engine_metrics(part: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return engine → task → verified metrics of a search's winner or of the baseline."""
    if "engines" in part:
        return dict(part["engines"])
    return dict((part.get("verified") or {}).get("conditions", {}))


def stable(tasks: Mapping[str, Mapping[str, float]]) -> tuple[int, int]:
    """Return stable grasps and trials over tasks."""
    counts = [round(one["trials"]) for one in tasks.values()]
    held = [round(one["success_share"] * n) for one, n in zip(tasks.values(), counts, strict=True)]
    return sum(held), sum(counts)


def rise_m(tasks: Mapping[str, Mapping[str, float]]) -> float:
    """Return mean of `z_max` over tasks."""
    return sum(one["z_max_m"] for one in tasks.values()) / len(tasks)


MAIN = "ppo"
ENGINES = 2


def bars(result: Mapping[str, Any]) -> list[Bar]:
    """Time, stable grasps in every engine, the law of the winner, seeds of the comparison."""
    run = result["runs"].get(MAIN)
    grasps, estimate = run["simulations"] if run else GRIPPER["grasps"], GRIPPER["our_estimates"]["wall_s"]
    limit, law = GRIPPER_BARS["wall_s"], GRIPPER["law_rmse_of_largest"]
    about = f"about {clock(estimate)} (our estimate)"
    wall_s = run["wall_s"] if run else None
    name = f"{MAIN}: {grasps} runs of a grasp, wall time"
    found = [Bar(name, wall_s, limit, "min", scale=1 / 60, published=about)]
    shares = {engine: stable(tasks) for engine, tasks in engine_metrics(run).items()} if run else {}
    held = {
        f"{MAIN}: stable grasps in {engine}, of {n}, verified": k / n for engine, (k, n) in shares.items()
    }
    wanted: list[tuple[str, float | None]] = [*held.items()]
    wanted += [(f"{MAIN}: stable grasps, verified, one more engine", None)] * (ENGINES - len(shares))
    words, share = f"{GRIPPER['stable']}/{GRIPPER['trials']} in one engine", GRIPPER_BARS["stable_share"]
    found += [Bar(what, reached, share, "%", False, 100.0, words) for what, reached in wanted]
    name = f"{MAIN}: law of the winner against direct FEM, RMS of the largest torque"
    limit = GRIPPER_BARS["law_rmse_of_largest"]
    found.append(Bar(name, worst_law(run), limit, "%", scale=100.0, published=percent(law, 3)))
    seeds = float(min((len(parts) for parts in result["seeds"].values()), default=0))
    name = "seeds of every optimizer at equal grasps"
    return [*found, Bar(name, seeds or None, float(GRIPPER_BARS["seeds"]), "", at_most=False)]


def worst_law(run: Mapping[str, Any] | None) -> float | None:
    """Return the largest RMS of the laws of a winner's designs, as a share of the largest effort."""
    laws = ((run or {}).get("verified") or {}).get("laws", ())
    return max((law["rmse_of_largest"] for law in laws if "rmse_of_largest" in law), default=None)


def seed_statistics(parts: list[dict[str, Any]]) -> dict[str, float]:
    """Return mean, standard deviation, lowest and highest score over seeds."""
    scores = np.array([one["score"] for one in parts], float)
    sd = float(scores.std(ddof=1)) if len(scores) > 1 else float("nan")
    return {"mean": float(scores.mean()), "sd": sd, "low": float(scores.min()), "high": float(scores.max())}


def lines(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield lines to print: searches, grasps of every gripper, seeds, bars."""
    for name, run in result["runs"].items():
        stored = "; searched before, kernel timed now" if run["from_store"] else ""
        yield (
            f"{name:<10} {run['simulations']} runs of a grasp in {clock(run['wall_s'])} ({run['wall_in_kernels']:.0f} "
            f"kernels of {1e3 * run['reference_kernel_s']:.0f} ms{stored}): score {run['score']:.3f}, "
            f"stable in {run['stable_tasks']} of {len(run['tasks'])} tasks"
        )
        yield from (f"{'':<10} note: {note}" for note in (run["verified"] or {}).get("notes", ()))
    for name, part in {"baseline": result["baseline"], **result["runs"]}.items():
        for engine, tasks in engine_metrics(part).items() if part else ():
            held, trials = stable(tasks)
            yield f"{name:<10} {engine}: {held}/{trials} stable, z_max {millimetres(rise_m(tasks), 1)}"
    for name, parts in result["seeds"].items():
        if parts:
            found = seed_statistics(parts)
            yield (
                f"{name:<10} {len(parts)} seeds of {parts[0]['simulations']} runs of a grasp: "
                f"score {found['mean']:.3f} ± {number(found['sd'])} ({found['low']:.3f} to {found['high']:.3f})"
            )
    for one in result["bars"]:
        yield str(Bar.from_result(one))
