"""Sets are made, asked about and judged by three kinds of processes.

A maker draws truths, measures them and seals the labels; diagnosers get the paths of a study and a CSV, no more;
the calling process, the judge, holds the key and opens labels when all is done. Diagnosers may be the workers of any
`concurrent.futures.Executor`, a cluster's too, as long as they see the folder. Results are appended line by line,
so that a killed bench goes on where it was.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.evidence import diagnosers, results, seal
from benchmarks.evidence.judge import Judged, judge
from benchmarks.evidence.tasks import PLANS, Plan, Task, digest
from benchmarks.evidence.workers import ANY, add_runs, ask, make

# Sets made ahead of the diagnosers.
AHEAD = 4
EVERY_S = 20.0
# Runs that are added to a poor set.
ADDED = 2


@dataclass(frozen=True)
class Bench:
    """Where a bench keeps its files: sets and results in `folder`, the key beside them.

    `shard` (part, of how many) takes every so-many-th task; shards share the folder, or a copy of its key.
    """

    folder: Path
    name: str
    diagnoser: str = diagnosers.DEFAULT
    workers: int = 2
    shard: tuple[int, int] = (1, 1)

    @property
    def results(self) -> Path:
        """The file that this call writes to; shards have one each."""
        part, count = self.shard
        return self.folder / (f"{self.name}.jsonl" if count == 1 else f"{self.name}.{part}-of-{count}.jsonl")

    def share_of(self, tasks: list[Task]) -> list[Task]:
        """The tasks of this shard: every `count`-th one."""
        part, count = self.shard
        return tasks[part - 1 :: count]

    def lines(self) -> dict[str, dict[str, Any]]:
        """All results of this name, those of every shard."""
        files = [self.folder / f"{self.name}.jsonl", *sorted(self.folder.glob(f"{self.name}.*-of-*.jsonl"))]
        return {name: line for file in files for name, line in results.read(file).items()}

    @property
    def sets(self) -> Path:
        return self.folder / "sets"

    def label(self, name: str, key: bytes) -> dict[str, Any]:
        """The opened label of a set."""
        return seal.unseal((self.sets / f"{name}{seal.SUFFIX}").read_text(), key)

    def key(self) -> bytes:
        return seal.judge_key(self.folder / "judge.key")


def diagnoser_digest() -> str:
    """Digest of the code under test."""
    root = Path(__file__).resolve().parents[2]
    return digest(sorted(file for room in ("core", "plugins") for file in (root / room).rglob("*.py")))


def end_with(parent: int) -> None:
    """In a child's process: end when the parent has been killed; a pool's children would wait for ever."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@dataclass
class Job:
    """One task on its way: made, asked, and for plans made and asked again with more runs."""

    name: str
    task: Task
    runs: list[str] = field(default_factory=list)
    before: list[dict[str, Any]] = field(default_factory=list)

    def next_run(self, line: dict[str, Any]) -> str | None:
        """The run to add after this answer; None where the task is done."""
        if self.task.mode not in PLANS or len(self.runs) == ADDED or "error" in line:
            return None
        if self.task.mode == "random":
            return ANY
        proposed = line["result"].get("next_experiment") or {}
        return proposed.get("name") or None


def run(bench: Bench, plan: Plan, executor: Executor | None = None) -> None:
    """All tasks of the plan that have no result yet.

    Args:
        executor: asks the diagnoser, in processes that see the folder under the same path; by default processes of
            this machine. Sets are made on this machine, where the key is.
    """
    key, code = bench.key(), diagnoser_digest()
    found = results.read(bench.results)
    others = sum(line.get("code") != code for line in found.values())
    if others:
        print(f"{others} results are by other code of pliant; --fresh forgets them", flush=True)
    done = {name for name, line in found.items() if "error" not in line}
    named = [Job(task.secret_id(key), task) for task in bench.share_of(plan.tasks())]
    waiting = [job for job in named if job.name not in done]
    print(f"{len(named)} sets, {len(named) - len(waiting)} done before", flush=True)
    pool = partial(
        ProcessPoolExecutor,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=end_with,
        initargs=(os.getpid(),),
    )
    progress = _Progress(len(waiting))
    with pool(1) as makers, nullcontext(executor) if executor else pool(bench.workers) as askers:
        making: dict[Future[Any], Job] = {}
        asking: dict[Future[Any], Job] = {}
        while waiting or making or asking:
            while waiting and len(making) + len(asking) < bench.workers + AHEAD:
                job = waiting.pop(0)
                making[makers.submit(make, job.task, job.name, bench.sets, key)] = job
            finished, _ = wait([*making, *asking], return_when=FIRST_COMPLETED)
            for future in finished:
                if future in making:
                    job, made = making.pop(future), future.result()
                    job.runs = made if isinstance(made, list) else []
                    verb = "improve" if job.task.mode == "improve" else "diagnose"
                    asked = askers.submit(ask, verb, bench.diagnoser, job.name, bench.sets, bool(job.runs))
                    asking[asked] = job
                    continue
                job = asking.pop(future)
                line = _answer(future, job.name)
                if more := job.next_run(line):
                    job.before.append(line)
                    chosen = [ANY] * (len(job.runs) + 1) if more == ANY else [*job.runs, more]
                    making[makers.submit(add_runs, job.task, job.name, bench.sets, chosen)] = job
                    continue
                results.append(bench.results, {**_with_plan(line, job), "code": code})
                progress.one_more()


def _with_plan(line: dict[str, Any], job: Job) -> dict[str, Any]:
    """The last answer, with the runs that led to it and the answer before them."""
    if not job.before:
        return line
    spent = {key: line[key] + sum(other[key] for other in job.before) for key in ("wall_s", "cpu_s")}
    return {**line, **spent, "added": job.runs, "first": job.before[0]}


def _answer(future: Future[Any], name: str) -> dict[str, Any]:
    """The line of results; where the process was killed, by the kernel or by hand, the bench ends and says so."""
    try:
        line: dict[str, Any] = future.result()
    except BrokenExecutor as error:
        raise SystemExit(f"a diagnoser was killed at set {name}; run again to go on") from error
    return line


def judged(bench: Bench, plan: Plan) -> list[Judged]:
    """The plan's results beside their opened labels, in the order of the plan."""
    key, lines = bench.key(), bench.lines()
    named = ((task.secret_id(key), task) for task in plan.tasks())
    return [
        judge(task.group, bench.label(name, key), lines[name], task.mode)
        for name, task in named
        if name in lines
    ]


class _Progress:
    """Now and then a line: how many, how fast, how long still."""

    def __init__(self, total: int) -> None:
        self.total, self.count = total, 0
        self.start = self.said = time.monotonic()

    def one_more(self) -> None:
        self.count += 1
        now = time.monotonic()
        if now - self.said < EVERY_S and self.count < self.total:
            return
        self.said = now
        each = (now - self.start) / self.count
        left = each * (self.total - self.count) / 60
        print(f"  {self.count}/{self.total}  {60 / each:.1f} a minute  {left:.0f} min left", flush=True)
