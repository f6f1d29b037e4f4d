"""Comparison of all meta-models on left-out designs: python -m benchmarks.surrogates.designs

    python -m benchmarks.surrogates.designs --only helical --kinds regression "coefficients, published form"

Fits every installed kind to examples/designs/{bending,helical,chambers}_grid.csv and scores torque and free angle of
whole designs: left out of the grid in eight seeded parts (inside its range and on its border apart), between those
of the grid (the test tables, which no fit sees), and on the designs that were fitted, as the published study scored
its own. For several chambers they are compared with the law fitted to each test design's states: both at left-out
states. Nine designs of three chambers and three between them have no table: their FEM, nine minutes of one processor,
is solved on request, and kept in benchmarks/out. Writes benchmarks/out/designs_GRID.json.
"""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np
from benchmarks.families.several_chambers import OF_THREE
from benchmarks.output import OUT, Bar, component, make_parser, registry, time_calls, write
from benchmarks.surrogates.kinds import as_json, left_out, line, scored, table

from pliant import api
from pliant_designs.records import SolvedDesigns
from pliant_designs.solved_designs import from_table
from pliant_designs.sweep_table import write_sweep_table
from pliant_plugins.families.reference import THREE_CHAMBER

FOLDS = 8
# Kind and keys of each contender.
CONTENDERS: dict[str, dict[str, Any]] = {
    "regression": {"kind": "regression"},
    "regression, gaussian_process": {"kind": "regression", "regressor": "gaussian_process"},
    "regression, kernel_ridge": {"kind": "regression", "regressor": "kernel_ridge"},
    "regression, polynomial": {"kind": "regression", "regressor": "polynomial"},
    "coefficients": {"kind": "coefficients"},
    "coefficients, published form": {"kind": "coefficients", "form": "study"},
    "neural": {"kind": "neural"},
}
MAIN = "regression"
GRIDS, THREE = ("bending", "helical", "chambers"), "three_chambers"
WORST = {"chambers": 0.5, THREE: 1.0}  # % of the range
SWEEPS = {
    "grid": {"radius": ["9 mm", "10 mm", "11 mm"], "wall": ["1.3 mm", "1.6 mm", "1.9 mm"]},
    "between": {"radius": ["9.4 mm", "10.7 mm"], "wall": ["1.43 mm", "1.77 mm"]},
}
FEM: dict[str, Any] = {
    "material": {"kind": "neo_hookean", "shear_modulus": "240 kPa", "density": "1150 kg/m^3"},
    "fem": {"kind": "skfem", **OF_THREE},
}


def contest(grid: str, kinds: list[str] | None) -> None:
    """Score all meta-models on one grid."""
    if grid == THREE:
        solved, test = (solved_three(name, sweep) for name, sweep in SWEEPS.items())
    else:
        solved, test = table(f"{grid}_grid"), table(f"{grid}_test")
    print(f"{grid}: {len(solved)} designs of {', '.join(solved.names)}; {len(test)} between them")
    results: dict[str, Any] = {}
    for name, keys in CONTENDERS.items():
        if keys["kind"] not in registry().kinds("meta_model") or (kinds and name not in kinds):
            continue
        results[name] = _contender(name, keys, solved, test)
    bars = _bars(grid, results[MAIN]) if "scores" in results.get(MAIN, {}) else []
    beside = _beside_direct(solved, test) if "chambers" in grid else {}
    write(f"designs_{grid}", {"contenders": results, "folds": FOLDS, **beside}, bars)


def solved_three(name: str, sweep: dict[str, list[str]]) -> SolvedDesigns:
    """Return designs of three chambers, solved by FEM if needed."""
    folder = OUT / THREE
    folder.mkdir(parents=True, exist_ok=True)
    study = {
        "pliant": 1,
        "name": name,
        "family": {"kind": "three_chamber", **THREE_CHAMBER},
        **FEM,
        "sweep": sweep,
    }
    file = folder / f"{name}.yaml"
    file.write_text(json.dumps(study))  # JSON is YAML
    run = api.sweep(api.open_study(file, store=folder / "store"), workers=1)
    write_sweep_table(run, folder / f"{name}.csv")
    return from_table(folder / f"{name}.csv", "three_chamber").designs


def _beside_direct(solved: Any, test: Any) -> dict[str, Any]:
    """Return errors at check states of the test designs / torque range, of the meta-model and of direct laws."""
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
        # A kind that cannot fit this grid reports the reason; the others continue.
        print(f"  {name:30} not fitted: {error}")
        return {"not_fitted": str(error)}
    wall_s = time.perf_counter() - started
    groups = {f"left out, {place}": one for place, one in left_out(model, solved, FOLDS).items()}
    groups["between the designs"] = scored(fitted.laws, test)
    groups["its own designs"] = scored(fitted.laws, solved)
    print(f"{name}: fitted in {wall_s:.1f} s")
    rounds = time_calls(lambda: [fitted.laws.law(values) for values in test.values], 10, time.perf_counter)
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
    for place in ("left out, all", "between the designs") if "chambers" in grid else ():
        worst = 100 * scores[place]["worst_of_range"]
        bars.append(Bar(f"{grid}: worst torque, {place}", worst, WORST[grid], "% of range", True))
    return bars


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--only", choices=[*GRIDS, THREE])
    parser.add_argument("--kinds", nargs="*")
    asked = parser.parse_args()
    for grid in [asked.only] if asked.only else GRIDS:
        contest(grid, asked.kinds)


if __name__ == "__main__":
    main()
