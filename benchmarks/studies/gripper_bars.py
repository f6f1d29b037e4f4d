"""The check of the winners and the baseline, what the co-design study is to reach, and its parts in lines."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from benchmarks.output import Bar
from benchmarks.studies.page import clock, millimetres, number, percent
from benchmarks.studies.published import GRIPPER, GRIPPER_BARS

from pliant.config.study import Study
from pliant.errors import PliantError
from pliant.pipeline.study import simulate_study
from pliant.pipeline.workbench import Workbench
from pliant.search.evaluate.evaluator import measured, numbers, problem_of
from pliant.search.problem.study_setter import StudySetter, changed
from pliant.search.verify.direct_fem import direct_studies, solvable


def baseline(bench: Workbench, study: Study) -> dict[str, Any]:
    """The study's own gripper, no variable set, in all its tasks and engines, `verify.change` on top.

    Returns:
        `engines`: engine → task → metrics; `design`: variable → the study's own value, SI; `laws`: direct FEM, or
        those of the search where the study says so; `notes`; `wall_s`.

    Raises:
        UserError: the study is wrong; an engine's own failure is a note.
    """
    begun, notes = time.perf_counter(), list[str]()
    problem = problem_of(bench, study)
    setter = StudySetter(study, bench.registry)
    verify = problem.config.verify
    change = verify.change if verify is not None else {}
    own = [changed(bench.registry, setter.study(dict(c.changes)), change) for c in problem.conditions]
    solved = solvable(study)
    cases = direct_studies(bench, own)[0] if solved else own
    engines: dict[str, dict[str, Any]] = {}
    for condition, case in zip(problem.conditions, cases, strict=True):
        for engine in (case.physics, *case.cross_check):
            kind = engine.kind if engine is not None else ""
            alone = case.model_copy(update={"physics": engine, "cross_check": (), "uncertainty": None})
            try:
                run = simulate_study(bench, alone).engines[0]
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


def engines_of(part: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Engine → task → verified metrics of a search's winner or of the baseline."""
    if "engines" in part:
        return dict(part["engines"])
    return dict((part.get("verified") or {}).get("conditions", {}))


def stable(tasks: Mapping[str, Mapping[str, float]]) -> tuple[int, int]:
    """Stable grasps and trials over tasks."""
    counts = [round(one["trials"]) for one in tasks.values()]
    held = [round(one["success_share"] * n) for one, n in zip(tasks.values(), counts, strict=True)]
    return sum(held), sum(counts)


def rise_m(tasks: Mapping[str, Mapping[str, float]]) -> float:
    """Mean of `z_max` over tasks."""
    return sum(one["z_max_m"] for one in tasks.values()) / len(tasks)


MAIN = "ppo"
ENGINES = 2


def bars(result: Mapping[str, Any]) -> list[Bar]:
    """Time, stable grasps in every engine, the law of the winner, seeds of the comparison."""
    run = result["runs"].get(MAIN)
    found = [
        Bar(
            f"{MAIN}: {run['simulations'] if run else GRIPPER['grasps']} runs of a grasp, wall time",
            run["wall_s"] if run else None,
            float(GRIPPER_BARS["wall_s"]),
            "min",
            scale=1 / 60,
            published=f"about {clock(GRIPPER['our_estimates']['wall_s'])} (our estimate)",
        )
    ]
    checked = engines_of(run) if run else {}
    shares = {engine: stable(tasks) for engine, tasks in checked.items()}
    for engine, (held, trials) in shares.items():
        found.append(_held(f"{MAIN}: stable grasps in {engine}, of {trials}, verified", held / trials))
    missing = ENGINES - len(shares)
    found += [_held(f"{MAIN}: stable grasps, verified, one more engine", None)] * missing
    found.append(
        Bar(
            f"{MAIN}: law of the winner against direct FEM, RMS of the largest torque",
            worst_law(run),
            float(GRIPPER_BARS["law_rmse_of_largest"]),
            "%",
            scale=100.0,
            published=percent(GRIPPER["law_rmse_of_largest"], 3),
        )
    )
    seeds = min((len(parts) for parts in result["seeds"].values()), default=0)
    wanted = float(GRIPPER_BARS["seeds"])
    found.append(
        Bar("seeds of every optimizer at equal grasps", float(seeds) or None, wanted, "", at_most=False)
    )
    return found


def _held(what: str, share: float | None) -> Bar:
    words = f"{GRIPPER['stable']}/{GRIPPER['trials']} in one engine"
    return Bar(
        what, share, float(GRIPPER_BARS["stable_share"]), "%", scale=100.0, at_most=False, published=words
    )


def worst_law(run: Mapping[str, Any] | None) -> float | None:
    """Of the laws of a winner's designs, the worst RMS as a share of the largest effort."""
    laws = ((run or {}).get("verified") or {}).get("laws", ())
    return max((law["rmse_of_largest"] for law in laws if "rmse_of_largest" in law), default=None)


def of_seeds(parts: list[dict[str, Any]]) -> dict[str, float]:
    """Mean, standard deviation, lowest and highest score over seeds."""
    scores = np.array([one["score"] for one in parts], float)
    spread = float(scores.std(ddof=1)) if len(scores) > 1 else float("nan")
    return {
        "mean": float(scores.mean()),
        "sd": spread,
        "low": float(scores.min()),
        "high": float(scores.max()),
    }


def lines(result: Mapping[str, Any]) -> Iterator[str]:
    """For people: searches, grasps of every gripper, seeds, bars."""
    for name, run in result["runs"].items():
        stored = "; searched before, kernel timed now" if run["from_store"] else ""
        yield (
            f"{name:<10} {run['simulations']} runs of a grasp in {clock(run['wall_s'])} ({run['wall_in_kernels']:.0f} "
            f"kernels of {1e3 * run['reference_kernel_s']:.0f} ms{stored}): score {run['score']:.3f}, "
            f"stable in {run['stable_tasks']} of {len(run['tasks'])} tasks"
        )
        yield from (f"{'':<10} note: {note}" for note in (run["verified"] or {}).get("notes", ()))
    for name, part in {"baseline": result["baseline"], **result["runs"]}.items():
        for engine, tasks in engines_of(part).items() if part else ():
            held, trials = stable(tasks)
            yield f"{name:<10} {engine}: {held}/{trials} stable, z_max {millimetres(rise_m(tasks), 1)}"
    for name, parts in result["seeds"].items():
        if parts:
            found = of_seeds(parts)
            yield (
                f"{name:<10} {len(parts)} seeds of {parts[0]['simulations']} runs of a grasp: "
                f"score {found['mean']:.3f} ± {number(found['sd'])} ({found['low']:.3f} to {found['high']:.3f})"
            )
    for one in result["bars"]:
        yield str(Bar.of(one))
