"""The published co-design study, repeated: a gripper and how it is used, found together for six tasks.

    python -m benchmarks.studies.gripper_codesign                    every part that is not finished yet, and the bars
    python -m benchmarks.studies.gripper_codesign --only ppo         one of them (may be repeated)
    python -m benchmarks.studies.gripper_codesign --seeds 5 --seed-grasps 3600    seeds at a smaller budget
    python -m benchmarks.studies.gripper_codesign --publish          and docs/studies/gripper_codesign.*
    python -m benchmarks.studies.gripper_codesign --small            a taste of a minute, for CI; never touches docs

The searches are the studies of examples/gripper_codesign (make.py there comes first: the table of its meta-model);
`key=value` after the options changes them all. Finished parts are in benchmarks/out/studies/gripper_codesign/NAME.json
and are not repeated while their study is unchanged; an interrupted one continues from its journal in the store.
"""

from __future__ import annotations

import os

# Before numpy; workers inherit it.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"
os.environ["NUMBA_NUM_THREADS"] = "1"

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.output import make_parser
from benchmarks.studies.command import (
    Asked,
    Given,
    Part,
    Parts,
    arguments,
    conclude,
    given_from_options,
    run_command,
    searched,
    study_digest,
)
from benchmarks.studies.gripper_bars import (
    acting,
    bars,
    baseline,
    curve,
    lines,
    policy,
    score,
    stable_tasks,
)
from benchmarks.studies.published import GRIPPER

from pliant import api
from pliant.config.study import Study
from pliant_search.evaluate.evaluator import build_search_problem

NAME = "gripper_codesign"
EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / NAME
MAIN, BASELINE, SEEDS = "ppo", "baseline", "seeds"
ASKED = (
    Asked(MAIN, "a policy: a gripper for each task, by PPO", EXAMPLES / "gripper.yaml"),
    Asked("cmaes", "one gripper for all tasks, by CMA-ES", EXAMPLES / "cmaes.yaml"),
    Asked("optuna", "one gripper for all tasks, by Optuna's TPE", EXAMPLES / "optuna.yaml"),
)
# It has a separate budget and effects that the others lack: in no table over seeds. Its slopes, which cost
# as much as the search, are on no page.
ROBUST = Asked(
    "robust",
    "one gripper for all tasks and eight scenarios, by CMA-ES",
    EXAMPLES / "robust.yaml",
    ("search.sensitivity=false",),
)
FULL_SEEDS, SMALL_SEEDS = 5, 1
SMALL_GRASPS, SMALL_SEED_GRASPS = 32, 8
# The evaluation of a winner costs more grasps than a short search has: only a few repetitions.
SEED_CONFIRM = "search.confirm={best: 4, change: {task.trials: 10, task.seed: 500}}"
SEED_CHANGES = ("search.verify=null", "search.sensitivity=false")
OF_SEEDS = ("seed", "evaluations", "simulations", "failed", "wall_s", "reference_kernel_s", "from_store")
LEFT_OUT = ("history", "variables", "slopes", "branches", "policy", "curve")


def main(given: Sequence[str] | None = None) -> None:
    parser = arguments(make_parser(__doc__), [*(one.name for one in (*ASKED, ROBUST)), BASELINE, SEEDS])  # fmt: skip
    parser.add_argument(
        "--seeds", type=int, help=f"seeds of each optimizer in their table; {FULL_SEEDS}; 0: none"
    )
    parser.add_argument(
        "--seed-grasps",
        type=int,
        help="grasps of each search of that table; by default as many as the main ones",
    )
    sys.exit(run_command(lambda: study(given_from_options(parser.parse_args(given), NAME))))


def study(given: Given) -> dict[str, Any]:
    """Run, print, publish; returns the result. Raises `UserError` and `NotReachedError`."""
    parts = given.parts(MAIN)
    asked = small() if given.small else ASKED
    runs = {one.name: _search(parts, one, given) for one in (asked if given.small else (*asked, ROBUST))}
    kept = {name: part for name, part in runs.items() if part is not None}
    result = assembled(kept, _baseline(parts, asked[0], given), _seeds(parts, asked, given), given.stated())
    conclude(given, result, lines(result), MAIN, "benchmarks.studies.gripper_page")
    return result


def small() -> tuple[Asked, ...]:
    """Return the three optimizers on the study that CI runs."""
    file = EXAMPLES / "small.yaml"
    return tuple(replace(one, file=file, overrides=(f"optimizer.kind={one.name}",)) for one in ASKED)


def few(study: Study) -> Study:
    """Return the study with its first and last task, and the variables with `only`; without constraints.

    The evaluation of a search's winner costs grasps for every variable and task; so there are few.
    """
    search = study.need("search", "a small study")
    tasks = list(search.conditions)
    changes = {
        "variables": {name: one for name, one in search.variables.items() if one.only},
        "conditions": {name: search.conditions[name] for name in (tasks[0], tasks[-1])},
        "constraints": (),
    }
    return study.model_copy(update={"search": search.model_copy(update=changes)})


def candidates(opened: api.OpenStudy, grasps: int) -> int:
    """Return the budget for a number of grasps: an optimizer with contexts tries a candidate in one task only."""
    config, optimizer = opened.study.need("search", "a study"), opened.study.block("optimizer")
    component = opened.context.registry.get("optimizer", optimizer.kind)
    one_each = component.implementation_class().capabilities.contexts
    return grasps if one_each else max(1, grasps // max(1, len(config.conditions)))


def _opened(
    asked: Asked, given: Given, grasps: int | None, more: Sequence[str] = (), part: str = ""
) -> api.OpenStudy:
    """Open the study of a part, by default the main one, with a budget of `grasps`; None: that of the study."""
    store = given.part_store(part or asked.name)

    def read(*budget: str) -> api.OpenStudy:
        found = asked.opened(store, (*more, *budget, *given.overrides), given.quiet)
        return replace(found, study=few(found.study)) if given.small else found

    opened = read()
    return opened if grasps is None else read(f"search.budget={candidates(opened, grasps)}")


def _search(parts: Parts, asked: Asked, given: Given) -> Part | None:
    opened = _opened(asked, given, SMALL_GRASPS if given.small else None)

    def make() -> dict[str, Any]:
        part, record = searched(asked, opened, given.workers)
        acts = acting(build_search_problem(opened.context, opened.study))
        tasks = {"tasks": list(record.conditions), "acting": acts, "stable_tasks": stable_tasks(record)}
        return {**part, **tasks, "score": score(record), "policy": policy(record), "curve": curve(record)}

    return given.part(parts, asked.name, opened.study, make)


def _baseline(parts: Parts, asked: Asked, given: Given) -> Part | None:
    """Run the study's initial gripper in the same check as the winners."""
    opened = _opened(asked, given, None)
    make = partial(baseline, opened.context, opened.study)
    return given.part(parts, BASELINE, opened.study, lambda: {"part": BASELINE, **make()})


def _seeds(parts: Parts, asked: Sequence[Asked], given: Given) -> dict[str, list[Part]]:
    """Run every optimizer at every seed without the check of its winner; published runs count as finished."""
    count = given.seeds if given.seeds is not None else SMALL_SEEDS if given.small else FULL_SEEDS
    grasps = given.seed_grasps or (SMALL_SEED_GRASPS if given.small else None)
    if grasps is None and not given.wants(SEEDS):  # the budget of the searches in the published table
        budgets = [name.rpartition("_")[2] for name in parts.published if name.startswith("seed_")]
        grasps = next((int(budget) for budget in budgets if budget.isdecimal()), None)
    found: dict[str, list[Part]] = {}
    for seed in range(1, count + 1):
        for one in asked:
            more = (f"search.seed={seed}", *SEED_CHANGES, *(() if given.small else (SEED_CONFIRM,)))
            opened = _opened(one, given, grasps, more, SEEDS)
            name = f"seed_{one.name}_{seed}_{grasps or 'full'}"
            make = partial(_seed, one, opened, given.workers, name)
            of = study_digest(opened.study)
            part = parts.known(name, of)
            if given.wants(SEEDS) and (part is None or parts.fresh):
                part = parts.get(name, of, make)
            found.setdefault(one.name, []).extend([part] if part is not None else [])
    return found


def _seed(asked: Asked, opened: api.OpenStudy, workers: int | None, name: str) -> Part:
    """Run a search; return its entries of the table over seeds."""
    part, record = searched(asked, opened, workers)
    found = {"score": score(record), "stable_tasks": stable_tasks(record), "curve": curve(record)}
    return {"part": name, **{key: part[key] for key in OF_SEEDS}, **found}


def assembled(
    runs: dict[str, Part], base: Part | None, seeds: dict[str, list[Part]], stated: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the `optimize` result of the main search, with all parts, targets and published figures."""
    short = {name: {k: v for k, v in part.items() if k not in LEFT_OUT} for name, part in runs.items()}
    whole: dict[str, Any] = {k: v for k, v in runs.get(MAIN, {}).items() if k != "made_of"}
    found = {**whole, **stated, "published": GRIPPER, "runs": short, "baseline": base, "seeds": seeds}
    return {**found, "bars": [] if stated["small"] else [bar.json() for bar in bars(found)]}


if __name__ == "__main__":
    main()
