"""Meta-models on designs left out, all kinds side by side: python -m benchmarks.surrogates.designs

    python -m benchmarks.surrogates.designs --only helical --kinds regression "coefficients, study's form"

Fits every installed kind to examples/designs/{bending,helical,chambers}_grid.csv and scores torque and free angle of
whole designs: left out of the grid in eight seeded parts (inside its range and on its border apart), between those
of the grid (the test tables, which no fit sees), and on the designs that were fitted, as the published study scored
its own. Of two chambers, the law that is fitted to each test design's own states stands beside: both at the states
that it has not seen. Writes benchmarks/out/designs_GRID.json.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from benchmarks.output import Bar, component, parser_of, registry, seconds_of, write
from benchmarks.surrogates.kinds import as_json, left_out, line, scored, table

FOLDS = 8
# Kind and keys of each contender.
CONTENDERS: dict[str, dict[str, Any]] = {
    "regression": {"kind": "regression"},
    "regression, gaussian_process": {"kind": "regression", "regressor": "gaussian_process"},
    "regression, kernel_ridge": {"kind": "regression", "regressor": "kernel_ridge"},
    "regression, polynomial": {"kind": "regression", "regressor": "polynomial"},
    "coefficients": {"kind": "coefficients"},
    "coefficients, study's form": {"kind": "coefficients", "form": "study"},
    "neural": {"kind": "neural"},
}
MAIN = "regression"


def contest(grid: str, kinds: list[str] | None) -> None:
    """All contenders on one grid."""
    solved, test = table(f"{grid}_grid"), table(f"{grid}_test")
    print(f"{grid}: {len(solved)} designs of {', '.join(solved.names)}; {len(test)} between them")
    results: dict[str, Any] = {}
    for name, keys in CONTENDERS.items():
        if keys["kind"] not in registry().kinds("meta_model") or (kinds and name not in kinds):
            continue
        results[name] = _contender(name, keys, solved, test)
    bars = _bars(grid, results[MAIN]) if "scores" in results.get(MAIN, {}) else []
    beside = _beside_direct(solved, test) if grid == "chambers" else {}
    write(f"designs_{grid}", {"contenders": results, "folds": FOLDS, **beside}, bars)


def _beside_direct(solved: Any, test: Any) -> dict[str, Any]:
    """Misses at check states of the test designs / torque range: of the meta-model, of laws fitted to each design."""
    laws, direct = component("meta_model", MAIN).fit(solved).laws, component("surrogate", "polynomial")
    found: dict[str, list[Any]] = {"meta_model": [], "direct": []}
    for values, data in zip(test.values, test.data, strict=True):
        check = data.rows(data.role == "check")
        for name, law in (("meta_model", laws.law(values)), ("direct", direct.fit_module(data).law)):
            tau = law.evaluate(check.actuation, check.deformation).tau
            found[name].append(np.abs(tau - check.tau).ravel() / np.ptp(data.tau))
    both = {name: np.concatenate(misses) for name, misses in found.items()}
    scores = {
        name: {"worst_of_range": float(misses.max()), "rms_of_range": float(np.sqrt(np.mean(misses**2)))}
        for name, misses in both.items()
    }
    for name, score in scores.items():
        worst, rms = (100 * value for value in score.values())
        print(
            f"  {name:12} at check states of {len(test)} test designs: worst {worst:.3f}, RMS {rms:.3f} % of range"
        )
    return {"beside_direct": scores}


def _contender(name: str, keys: dict[str, Any], solved: Any, test: Any) -> dict[str, Any]:
    if missing := registry().get("meta_model", keys["kind"]).missing():
        print(f"  {name:30} skipped: {missing}")
        return {"skipped": missing}
    model = component("meta_model", **keys)
    started = time.perf_counter()
    try:
        fitted = model.fit(solved)
    except Exception as error:
        # A kind that cannot do this grid says why; the others go on.
        print(f"  {name:30} not fitted: {error}")
        return {"not_fitted": str(error)}
    wall_s = time.perf_counter() - started
    groups = {f"left out, {place}": one for place, one in left_out(model, solved, FOLDS).items()}
    groups["between the designs"] = scored(fitted.laws, test)
    groups["its own designs"] = scored(fitted.laws, solved)
    print(f"{name}: fitted in {wall_s:.1f} s")
    rounds = seconds_of(lambda: [fitted.laws.law(values) for values in test.values], 10, time.perf_counter)
    law_s = sum(rounds) / (10 * len(test))
    for place, scores in groups.items():
        print(line(place, scores))
    return {"fit_s": wall_s, "law_s": law_s, "scores": as_json(groups)}


def _bars(grid: str, result: dict[str, Any]) -> list[Bar]:
    scores = result["scores"]
    everywhere, inside = scores["left out, all"], scores["left out, interior"]
    bars = [Bar(f"{grid}: torque R² on designs left out", everywhere["r2"], 0.999, "", False)]
    for axis, one in everywhere["axes"].items() if len(everywhere["axes"]) > 1 else ():
        bars.append(Bar(f"{grid}: torque R² on designs left out, {axis}", one["r2"], 0.999, "", False))
    if grid == "bending":
        worst = 100 * inside["worst_of_range"]
        bars.append(Bar("bending: worst torque inside the range", worst, 2.0, "% of range", True))
        median = 100 * everywhere["free_median"]
        bars.append(Bar("bending: free angle on designs left out, median", median, 1.0, "%", True))
    if grid == "chambers":
        for place in ("left out, all", "between the designs"):
            worst = 100 * scores[place]["worst_of_range"]
            bars.append(Bar(f"chambers: worst torque, {place}", worst, 0.5, "% of range", True))
    return bars


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--only", choices=["bending", "helical", "chambers"])
    parser.add_argument("--kinds", nargs="*")
    asked = parser.parse_args()
    for grid in ("bending", "helical", "chambers"):
        if asked.only in (None, grid):
            contest(grid, asked.kinds)


if __name__ == "__main__":
    main()
