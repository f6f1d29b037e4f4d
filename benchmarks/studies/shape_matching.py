"""The published shape-matching study, repeated: which actuator takes the shape of a helix?

    python -m benchmarks.studies.shape_matching                    every search that is not finished yet, and the bars
    python -m benchmarks.studies.shape_matching --only helix       one of them (may be repeated)
    python -m benchmarks.studies.shape_matching --publish          and docs/studies/shape_matching.*
    python -m benchmarks.studies.shape_matching --small            a taste of a minute, for CI; never touches docs

The searches are the studies of examples/shape_matching; `key=value` after the options changes them all. Finished ones
are in benchmarks/out/studies/shape_matching/NAME.json and are not repeated while their study is unchanged; an
interrupted one continues from its journal in the store.
"""

from __future__ import annotations

import os

# Before numpy; workers inherit it.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"
os.environ["NUMBA_NUM_THREADS"] = "1"

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import make_parser
from benchmarks.studies.command import (
    MOST_POINTS,
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
    spread,
)
from benchmarks.studies.published import SHAPE
from benchmarks.studies.shape_bars import bars, lines

from pliant import api
from pliant.pipeline.study import simulate_study
from pliant_search.evaluate.evaluator import build_search_problem
from pliant_search.records import SearchResult
from pliant_search.verify.direct_fem import direct_studies

NAME = "shape_matching"
EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / NAME
MAIN = "helix"
EVERY_GENERATION = ("search.generations=60",)
# Direct FEM of a winner that leans on extrapolation joins the meta-model's data, and the search goes on.
ROUNDS = ("search.verify.rounds=2",)
ASKED = (
    Asked(MAIN, "81 structures of 60 evaluations, roll fixed", EXAMPLES / "helix.yaml", ROUNDS),
    Asked(
        "polished",
        "as integers with half of its candidates, then polished, roll free",
        EXAMPLES / "polished.yaml",
    ),
    Asked(
        "helix_polished",
        "81 structures of 60 evaluations, the twelve best polished, roll fixed",
        EXAMPLES / "helix.yaml",
        (*ROUNDS, "search.polish={best: 12}"),
    ),
    Asked(
        "helix_generations",
        "81 structures of 60 generations, roll fixed",
        EXAMPLES / "helix.yaml",
        EVERY_GENERATION,
    ),
    Asked("free_roll", "81 structures of 60 evaluations, roll free", EXAMPLES / "free_roll.yaml"),
    Asked(
        "free_roll_generations",
        "81 structures of 60 generations, roll free",
        EXAMPLES / "free_roll.yaml",
        EVERY_GENERATION,
    ),
    Asked("halving", "eight generations, the best third goes on, roll free", EXAMPLES / "halving.yaml"),
    Asked(
        "fixed_roll_halving",
        "the same, roll fixed",
        EXAMPLES / "helix.yaml",
        ("search.generations=8", "search.halving={factor: 3}"),
    ),
    Asked("integers", "one search, modules as integers, roll free", EXAMPLES / "integers.yaml", ROUNDS),
    Asked(
        "axis_along_base",
        "the other reading, its axis along the base's; as integers, no joint outside its law's data",
        EXAMPLES / "axis_along_base.yaml",
    ),
    Asked(
        "per_segment_pressure",
        "a regulator for each segment, roll free",
        EXAMPLES / "per_segment_pressure.yaml",
    ),
)
SMALL = (Asked(MAIN, "three structures of ten evaluations, roll fixed", EXAMPLES / "small.yaml"),)
# Keys of the result's runs that the page does not show.
LEFT_OUT = ("history", "variables", "slopes", "designs", "branches", "structures", "conditions")


def main(given: Sequence[str] | None = None) -> None:
    parser = arguments(make_parser(__doc__), [one.name for one in ASKED])  # fmt: skip
    sys.exit(run_command(lambda: study(given_from_options(parser.parse_args(given), NAME))))


def study(given: Given) -> dict[str, Any]:
    """Run, print, publish; returns the result. Raises `UserError` and `NotReachedError`."""
    parts = given.parts(MAIN)
    found = {one.name: _part(parts, one, given) for one in (SMALL if given.small else ASKED)}
    result = assembled({name: part for name, part in found.items() if part is not None}, given.stated())
    conclude(given, result, lines(result), MAIN, "benchmarks.studies.shape_page")
    return result


def _part(parts: Parts, asked: Asked, given: Given) -> Part | None:
    """Return a search's part; existing results only if it was not requested."""
    opened = asked.opened(given.part_store(asked.name), given.overrides, given.quiet)

    def make() -> dict[str, Any]:
        part, record = searched(asked, opened, given.workers)
        return {**part, "structures": structures(record), "lines": brief(winner_lines(opened, record))}

    return given.part(parts, asked.name, opened.study, make)


def assembled(parts: Mapping[str, Part], stated: Mapping[str, Any]) -> dict[str, Any]:
    """Return the `optimize` result of the main search, with all runs, targets and published figures."""
    runs = {
        name: {**{k: v for k, v in part.items() if k not in LEFT_OUT}, "units": _units(part)}
        for name, part in parts.items()
    }
    whole: dict[str, Any] = {k: v for k, v in parts.get(MAIN, {}).items() if k != "made_of"}
    for shown_elsewhere in ("lines", "units"):
        whole.pop(shown_elsewhere, None)
    found = {**whole, **stated, "published": SHAPE, "asked": [one.name for one in ASKED], "runs": runs}
    return {**found, "bars": [] if stated["small"] else [bar.json() for bar in bars(runs)]}


def _units(part: Part) -> dict[str, str]:
    """Return the units of the variables, from the search or from a published part."""
    return part.get("units") or {one["name"]: one["unit"] for one in part.get("variables", ())}


def winner_lines(opened: api.OpenStudy, result: SearchResult) -> dict[str, Any]:
    """Return backbone and target of the winner in the base's frame, x along the chain.

    Returns:
        `backbone_m`, `target_m`: (n, 3); `joints_m`: (k, 3); `laws`: "direct FEM", or "the search" where the check
        did not come to laws of FEM.
    """
    bench, study = opened.context, opened.study
    winner = build_search_problem(bench, study).apply(result.best[0].values, 0)
    winner = winner.model_copy(update={"cross_check": (), "uncertainty": None})
    engine, check = (study.physics.kind if study.physics else ""), result.verification
    solved = check is not None and engine in check.verified
    if solved:
        (winner,), _ = direct_studies(bench, [winner])
    run = simulate_study(bench, winner)
    found = run.engines[0].result
    origin, frame = np.asarray(run.chain.base_position_m, float), np.asarray(run.chain.base_rotation, float)
    lines = {
        "backbone_m": found.metrics["backbone_points_m"],
        "target_m": found.metrics["target_points_m"],
        "joints_m": found.final.markers_m[1:-1],
    }
    own = {name: ((np.asarray(points, float) - origin) @ frame).tolist() for name, points in lines.items()}
    return {**own, "laws": "direct FEM" if solved else "the search"}


def structures(result: SearchResult) -> list[dict[str, Any]]:
    """Return the best of every search of the study, best first: its structure, best objective, and best so far."""
    history, found = result.history, []
    for index, values in enumerate(result.branches):
        scores = history.objectives[history.branch == index, 0]
        best = np.fmin.accumulate(scores) if len(scores) else scores
        if not len(best) or not np.isfinite(best[-1]):
            continue
        at = spread(len(best), MOST_POINTS)
        curve = {"at": [k + 1 for k in at], "best_so_far": brief(best[at])}
        found.append({"values": dict(values), "best": brief(best[-1]), "candidates": len(best), **curve})
    return sorted(found, key=lambda one: float(one["best"]))


if __name__ == "__main__":
    main()
