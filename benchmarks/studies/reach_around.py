"""A study of our own, end to end: which three-chamber arm reaches around a post and under a shelf, and its 3MF file.

    python -m benchmarks.studies.reach_around                    every part that is not finished yet, and the bars
    python -m benchmarks.studies.reach_around --only cmaes       one of them (may be repeated)
    python -m benchmarks.studies.reach_around --publish          and docs/studies/reach_around.*
    python -m benchmarks.studies.reach_around --small            a taste of a minute, for CI; never touches docs

The studies are those of examples/three_chamber_arm; `key=value` after the options changes them all. Every winner is
exported as `pliant export` does: its 3MF file and bill lie in a folder beside the parts. The protocol of its first run
on a bench takes minutes, and is written by `pliant export … --protocol` alone.
"""

from __future__ import annotations

import os

# Before numpy; workers inherit it.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"
os.environ["NUMBA_NUM_THREADS"] = "1"

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.output import make_parser
from benchmarks.studies.command import (
    Asked,
    Given,
    Part,
    Parts,
    arguments,
    brief,
    conclude,
    given_from_options,
    run_command,
    searched,
)
from benchmarks.studies.reach_bars import bars, lines, printed_figures

from pliant import api
from pliant.config.study import Study
from pliant.pipeline.study import simulate_study
from pliant_print.bill import write_bill
from pliant_print.export import solid_bill, write_solid
from pliant_print.solids import printed_chain
from pliant_search.evaluate.evaluator import build_search_problem
from pliant_search.verify.direct_fem import direct_studies

NAME = "reach_around"
EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "three_chamber_arm"
MAIN, OTHER, BASELINE = "cmaes", "optuna", "baseline"
SEARCH = EXAMPLES / "search.yaml"
ASKED = (
    Asked(MAIN, "CMA-ES", SEARCH),
    Asked(OTHER, "Optuna's TPE", SEARCH, (f"optimizer={{kind: {OTHER}}}",)),
)
HAND = Asked(BASELINE, "CMA-ES of the pressures alone", EXAMPLES / "pressures.yaml")
FEW = ("search.budget=12", "search.verify=null", "search.confirm=null")
KEPT_OF_BASELINE = ("words", "evaluations", "wall_s", "objective", "best")
LEFT_OUT = ("history", "variables", "slopes", "designs", "branches", "conditions")


def main(given: Sequence[str] | None = None) -> None:
    parser = arguments(make_parser(__doc__), [*(one.name for one in ASKED), BASELINE])
    sys.exit(run_command(lambda: study(given_from_options(parser.parse_args(given), NAME))))


def study(given: Given) -> dict[str, Any]:
    """Run, print, publish; returns the result. Raises `UserError` and `NotReachedError`."""
    parts = given.parts(MAIN)
    asked = [replace(one, overrides=(*one.overrides, *FEW)) for one in ASKED] if given.small else ASKED
    runs = {one.name: _search(parts, one, given) for one in asked}
    kept = {name: part for name, part in runs.items() if part is not None}
    hand = replace(HAND, overrides=FEW) if given.small else HAND
    base = _baseline(parts, hand, given)
    result = assembled(
        kept, base, {**given.stated(), "scene": scene(asked[0].opened(given.part_store(MAIN)).study)}
    )
    conclude(given, result, lines(result), MAIN, "benchmarks.studies.reach_page")
    return result


def _search(parts: Parts, asked: Asked, given: Given) -> Part | None:
    """Return a search's part: the check of its winner, its pose and its solid."""
    opened = asked.opened(given.part_store(asked.name), given.overrides, given.quiet)

    def make() -> dict[str, Any]:
        part, record = searched(asked, opened, given.workers)
        winner = build_search_problem(opened.context, opened.study).apply(record.best[0].values, 0)
        solid = {} if given.small else printed(opened, winner, given.folder / asked.name / "arm.3mf")
        return {**part, **pose(opened, winner, fem=not given.small), "printed": solid}

    return given.part(parts, asked.name, opened.study, make)


def _baseline(parts: Parts, asked: Asked, given: Given) -> Part | None:
    """Return the hand-made arm with pressures searched by the same objective, and with those of inverse statics."""
    # The store of the main search, which has the same meta-model: the times of this part are not compared.
    opened = asked.opened(given.part_store(MAIN), given.overrides, given.quiet)

    def make() -> dict[str, Any]:
        part, record = searched(asked, opened, given.workers)
        winner = build_search_problem(opened.context, opened.study).apply(record.best[0].values, 0)
        kept = {name: part[name] for name in KEPT_OF_BASELINE}
        statics = pose(opened, opened.study, fem=not given.small)
        return {"part": BASELINE, **kept, **pose(opened, winner, fem=not given.small), "statics": statics}

    return given.part(parts, BASELINE, opened.study, make)


def pose(opened: api.OpenStudy, arm: Study, fem: bool) -> dict[str, Any]:
    """Return joints (m, world), metrics and objective of an arm where it ends, by laws of direct FEM if asked."""
    problem = build_search_problem(opened.context, opened.study)
    alone = arm.model_copy(update={"cross_check": (), "uncertainty": None})
    if fem:
        (alone,), _ = direct_studies(opened.context, [alone])
    run = simulate_study(opened.context, alone).engines[0].result
    assert run is not None
    metrics = {name: value for name, value in run.metrics.items() if isinstance(value, float)}
    stated = {one.name: one.stated for one in problem.variables if one.stated is not None}
    (objective,) = problem.objective_values(stated, metrics)
    return {"markers_m": brief(run.final.markers_m), "reached": metrics, "reached_objective": objective}


def printed(opened: api.OpenStudy, winner: Study, file: Path) -> dict[str, Any]:
    """Write the 3MF file of an arm and its bill, and return the solid's figures."""
    file.parent.mkdir(parents=True, exist_ok=True)
    made = printed_chain(opened.context, winner)
    write_solid(made, file, "3mf", 1.0, winner.name)
    write_bill(solid_bill(made, winner), file.with_suffix(".bill.csv"))
    return printed_figures(made, winner)


def assembled(runs: Mapping[str, Part], base: Part | None, stated: Mapping[str, Any]) -> dict[str, Any]:
    """Return the `optimize` result of the main search, with all parts and targets."""
    short = {
        name: {**{k: v for k, v in part.items() if k not in LEFT_OUT}, "units": _units(part)}
        for name, part in runs.items()
    }
    whole: dict[str, Any] = {k: v for k, v in runs.get(MAIN, {}).items() if k != "made_of"}
    found = {**whole, **stated, "published": {}, "runs": short, "baseline": base}
    return {**found, "bars": [] if stated["small"] else [bar.json() for bar in bars(found)]}


def scene(arm: Study) -> dict[str, Any]:
    """Return target, its direction, and boxes (edges and centres) of the task."""
    task: Any = arm.need("task", "a scene")
    boxes = [{"edges_m": one.box_m, "centre_m": one.position_m} for one in task.obstacles]
    return {"tip_m": task.arms[0].tip_m, "direction": task.arms[0].direction, "boxes": boxes}


def _units(part: Part) -> dict[str, str]:
    """Return the units of the variables, from the search or from a published part."""
    return part.get("units") or {one["name"]: one["unit"] for one in part.get("variables", ())}


if __name__ == "__main__":
    main()
