"""Targets of the shape-matching study, and its runs in lines and rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.output import Bar
from benchmarks.studies.page import clock, millimetres, percent
from benchmarks.studies.published import SHAPE, SHAPE_BARS

Runs = Mapping[str, dict[str, Any]]
METRICS = {"rmse_m": "RMSE", "e_max_m": "e_max"}
PROTOCOL = "helix_generations"  # the published one
EVALUATIONS, GENERATIONS = "evaluations_wall_s", "generations_wall_s"
TIMED = {
    "helix": EVALUATIONS,
    "free_roll": EVALUATIONS,
    "helix_generations": GENERATIONS,
    "free_roll_generations": GENERATIONS,
}
# Accuracy is required of long searches; those of 60 evaluations per structure have bars on their time and are listed in
# the table of all. All are of the published problem: one supply.
JUDGED = {
    "polished": "polished",
    "halving": "free",
    "integers": "free",
    "free_roll_generations": "free",
    "fixed_roll_halving": "fixed",
    "helix_generations": "fixed",
}


def bars(runs: Runs) -> list[Bar]:
    """Return bars on accuracy, agreement and time of the runs that the task names; missing ones are not run."""
    found, given = [], SHAPE["verified"]
    for name, roll in JUDGED.items():
        run = runs.get(name)
        for metric, words in METRICS.items():
            what, limit = f"{name}: {words}, verified", SHAPE_BARS[roll][metric]
            published = millimetres(given[metric]) if roll == "fixed" else ""
            found.append(Bar(what, verified_metric(run, metric), limit, "mm", scale=1e3, published=published))
        what, published = (
            f"{name}: RMSE, verified against predicted",
            millimetres(given["rmse_m"] - SHAPE["rmse_m"]),
        )
        found.append(Bar(what, apart(run), SHAPE_BARS["apart_m"], "mm", scale=1e3, published=published))
        what = f"{name}: a law against direct FEM of the winner, at worst"
        found.append(Bar(what, worst_law(run), SHAPE_BARS["law_worst"], "% of its range", scale=100))
    predicted = verified_metric(runs.get(PROTOCOL), "rmse_m", what="predicted")
    published = millimetres(SHAPE["rmse_m"])
    what = f"{PROTOCOL}: RMSE, predicted"
    found.append(Bar(what, predicted, SHAPE_BARS["predicted_rmse_m"], "mm", scale=1e3, published=published))
    for name, key in TIMED.items():
        wall_s = runs[name]["wall_s"] if name in runs else None
        what, estimate = (
            f"{name}: search, wall time",
            f"about {clock(SHAPE['our_estimates'][key])} (our estimate)",
        )
        found.append(Bar(what, wall_s, SHAPE_BARS[key], "min", scale=1 / 60, published=estimate))
    return found


def worst_law(run: Mapping[str, Any] | None) -> float | None:
    """Return the largest error of a search's laws against FEM of its winner, as a share of the law's range."""
    laws = ((run or {}).get("verified") or {}).get("laws", ())
    return max((float(law["worst_of_range"]) for law in laws if "worst_of_range" in law), default=None)


def verified_metric(
    run: Mapping[str, Any] | None, metric: str, engine: str = "", what: str = "engines"
) -> float | None:
    """Return a metric of the winner's check, in the study's engine by default; `what` may be `predicted`."""
    check = (run or {}).get("verified") or {}
    value = check.get(what, {}).get(engine or (run or {}).get("engine", ""), {}).get(metric)
    return None if value is None else float(value)


def apart(run: Mapping[str, Any] | None) -> float | None:
    """Return the difference of the verified and the predicted RMSE."""
    verified, predicted = verified_metric(run, "rmse_m"), verified_metric(run, "rmse_m", what="predicted")
    return None if verified is None or predicted is None else abs(verified - predicted)


def lines(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield lines to print: every run, the error of its law, the bars."""
    for name, run in result["runs"].items():
        kernels = f"{run['wall_in_kernels']:.0f} kernels of {1e3 * run['reference_kernel_s']:.0f} ms"
        stored = "; searched before, kernel timed now" if run["from_store"] else ""
        yield (
            f"{name:<22} {run['evaluations']} evaluations in {clock(run['wall_s'])} ({kernels}{stored}): "
            f"{millimetres(run['objective'])}"
        )
        for engine in engines(run):
            verified = pair(run, engine, "engines")
            yield f"{'':<22} {engine}: {pair(run, engine, 'predicted')} predicted, {verified} verified"
        for law in (run["verified"] or {}).get("laws", ()):
            if "rmse_of_range" in law:
                yield f"{'':<22} law {law['name']}: misses FEM by {percent(law['rmse_of_range'])} of the range (rms)"
        for note in (run["verified"] or {}).get("notes", ()):
            yield f"{'':<22} note: {note}"
    for one in result["bars"]:
        yield str(Bar.from_result(one))


def engines(run: Mapping[str, Any]) -> list[str]:
    """Return the engines of a run's check, the study's own first."""
    check = run.get("verified") or {}
    return list(dict.fromkeys((*check.get("predicted", {}), *check.get("engines", {}))))


def pair(run: Mapping[str, Any], engine: str, what: str) -> str:
    return " / ".join(millimetres(verified_metric(run, metric, engine, what)) for metric in METRICS)
