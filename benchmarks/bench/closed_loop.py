"""Count how often the closed loop of experiments is right, and how many minutes of a bench it takes.

    python -m benchmarks.bench.closed_loop                     calibration truths, on which the planner may be tuned
    python -m benchmarks.bench.closed_loop --share 0.1         the first truths of every group
    python -m benchmarks.bench.closed_loop --sealed            judged truths, drawn for this code; answers are kept
    python -m benchmarks.bench.closed_loop --summarise         the table of the results that are there

Every truth is met by two planners with the same bench, budget and rules for an end: chosen runs, and random runs of the
same space. Minutes contain motion, setting up and a person's work. The whole rich protocol, as it is recorded without a
loop, is compared too. Results survive a kill and are continued.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = os.environ["NUMBA_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.bench.arms import ARMS, RandomRuns, rich_minutes
from benchmarks.bench.bed_bench import BedBench
from benchmarks.bench.loop_answers import Answer, as_text, store, summary
from benchmarks.bench.loop_tasks import LoopPlan, experiment
from benchmarks.evidence import ledger, seal
from benchmarks.evidence.judge import Judged, judge
from benchmarks.evidence.run_bench import append, read
from benchmarks.evidence.sets import make_set
from benchmarks.evidence.tasks import Task
from benchmarks.output import OUT, make_parser

from pliant import api
from pliant.errors import interrupted
from pliant.store.store import write_atomically
from pliant_bench.loop.experiment import Experiment, Planner
from pliant_bench.loop.folder import ExperimentFolder
from pliant_bench.loop.person import Nobody
from pliant_bench.loop.planner import TellingPlanner, model_inputs
from pliant_bench.loop.rounds import run_rounds

LEDGER = Path(__file__).with_name("ledger.jsonl")
# Code that determines the result, besides that of the diagnosis.
CODE = (*ledger.CODE, "core/pliant/experiments", "plugins/pliant_bench", "benchmarks/bench")


def make(task: Task, name: str, folder: Path, key: bytes) -> Path:
    """Write the study of a truth and its sealed label; return the study."""
    study, label = folder / f"{name}.yaml", folder / f"{name}{seal.SUFFIX}"
    if not label.exists():
        folder.mkdir(parents=True, exist_ok=True)
        made = make_set(task.spec, name)
        write_atomically(study, made.study)
        write_atomically(label, seal.seal(made.label, key))
    return study


def perform(arm: str, study: Path, label: Mapping[str, Any], seed: int, folder: Path) -> dict[str, Any]:
    """Run the loop with one planner until it ends, and return its verdict and its minutes."""
    opened = api.open_study(study, store=folder / "store")
    bench = BedBench.from_label(label, seed)
    settings = experiment(bench.robot)

    chosen = TellingPlanner(opened, settings, bench)
    planner: Planner = chosen if arm == "chosen" else RandomRuns(chosen, settings, bench)
    experiments = ExperimentFolder(folder / "experiment")
    started, cpu = time.perf_counter(), time.process_time()
    ended = run_rounds(
        Experiment(
            opened,
            settings,
            bench,
            experiments,
            model_inputs(opened),
            api.candidates(opened),
            planner,
            Nobody(),
        )
    )
    rounds = experiments.rounds()
    verdicts = [(one.number, found) for one in rounds if (found := one.read("verdict")) is not None]
    plans = [one.read("plan") or {} for one in rounds]
    return {
        "ended": ended.why,
        "minutes": [plan["minutes"] for plan in plans],
        "words": [plan["words"] for plan in plans],
        "conditions": [plan["conditions"] for plan in plans],
        "expected_nats": [plan.get("expected_nats") for plan in plans],
        "obtained_nats": [found.get("obtained_nats") for _, found in verdicts],
        "verdicts": [_short(number, found) for number, found in verdicts],
        "result": verdicts[-1][1],
        "rich_minutes": rich_minutes(bench, settings),
        "wall_s": time.perf_counter() - started,
        "cpu_s": time.process_time() - cpu,
    }


def _short(number: int, verdict: Mapping[str, Any]) -> dict[str, Any]:
    """Return a round's verdict with its most probable hypotheses."""
    top = sorted(verdict["hypotheses"], key=lambda one: -one["probability"])[:4]
    return {
        "run": number,
        "verdict": verdict["verdict"],
        "class": verdict.get("selected_class"),
        "top": [[" + ".join(one["kinds"]), round(one["probability"], 3)] for one in top],
    }


def run(plan: LoopPlan, folder: Path, results: Path, key: bytes, arms: Sequence[str]) -> None:
    """Do what has no result yet: every truth with every planner."""
    code, done = ledger.code_digest(parts=CODE), read(results)
    tasks = plan.tasks()
    for number, task in enumerate(tasks, 1):
        name = task.secret_id(key)
        for arm in arms:
            if f"{name} {arm}" in done:
                continue
            line: dict[str, Any] = {"id": f"{name} {arm}", "code": code}
            try:
                study = make(task, name, folder / "sets", key)
                label = seal.unseal((folder / "sets" / f"{name}{seal.SUFFIX}").read_text(), key)
                with tempfile.TemporaryDirectory() as scratch:
                    seed = ARMS.index(arm) + 10 * task.spec.seed
                    line |= perform(arm, study, label, seed, Path(scratch))
            except Exception as error:
                if interrupted(error):
                    raise KeyboardInterrupt from error
                line |= {"error": f"{type(error).__name__}: {error}", "wall_s": 0.0}
            append(results, line)
            spent = f"{line.get('cpu_s', 0.0):.0f} s CPU"
            print(f"{number}/{len(tasks)} {arm}: {line.get('ended') or line['error']}, {spent}", flush=True)


def judged(plan: LoopPlan, folder: Path, results: Path, key: bytes) -> list[Answer]:
    """Return every answer that is there, in the order of the plan."""
    lines, found = read(results), []
    for task in plan.tasks():
        name = task.secret_id(key)
        for arm in ARMS:
            line = lines.get(f"{name} {arm}")
            if line is None:
                continue
            label = seal.unseal((folder / "sets" / f"{name}{seal.SUFFIX}").read_text(), key)
            item = judge(task.group, label, line)
            finest = finest_class(task.group, label, lines.get(f"{name} {ARMS[0]}"))
            found.append(Answer.from_judged(arm, item, line, is_right(item, finest)))
    return found


def is_right(item: Judged, finest: int) -> bool:
    """Return whether an answer is right strictly, or by a class no larger than the one that no allowed run splits."""
    return item.is_right or (item.by_class and (item.credible_size or 0) <= finest)


def finest_class(group: str, label: Mapping[str, Any], chosen: Mapping[str, Any] | None) -> int:
    """Return the size of the class at which the chosen runs ended, if it contains the truth; 1 without one."""
    if chosen is None or chosen.get("ended") != "class":
        return 1
    item = judge(group, dict(label), dict(chosen))
    return item.credible_size or 1 if item.by_class else 1


def main(arguments: Sequence[str] | None = None) -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--sealed", action="store_true", help="judge this code, on truths drawn for it")
    parser.add_argument("--summarise", action="store_true", help="only the table of what is there")
    parser.add_argument("--share", type=float, default=1.0, metavar="0..1", help="this part of the truths")
    parser.add_argument("--arms", nargs="+", choices=ARMS, default=ARMS)
    parser.add_argument("--out", type=Path, default=OUT)
    given: argparse.Namespace = parser.parse_args(arguments)
    code, folder = ledger.code_digest(parts=CODE), (given.out / "closed_loop").resolve()
    plan = LoopPlan(share=given.share)
    plan = replace(plan, split="judged", draw=code) if given.sealed else plan
    results = folder / (f"sealed-{code}.jsonl" if given.sealed else "calibration.jsonl")
    key = seal.judge_key(folder / "judge.key")
    begun = {
        "run": f"{code} {ledger.now()}",
        "began": ledger.now(),
        "commit": ledger.commit(CODE),
        "code": code,
    }
    if given.sealed and not given.summarise:
        ledger.note({**begun, "share": given.share, "planned": len(LoopPlan().tasks())}, LEDGER)
    if not given.summarise:
        run(plan, folder, results, key, given.arms)
    answers = judged(plan, folder, results, key)
    data = summary(answers)
    print(as_text(data, answers))
    write_atomically(given.out / "closed_loop.json", json.dumps(data, indent=1))
    if given.sealed and not given.summarise:
        ledger.note({"run": begun["run"], "ended": ledger.now(), "figures": data}, LEDGER)
        store(answers, {**begun, "ended": ledger.now(), "share": given.share})


if __name__ == "__main__":
    main()
