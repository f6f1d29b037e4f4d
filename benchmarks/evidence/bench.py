"""Sets are made and judged by one process, and asked about by others.

The calling process holds the key: it draws truths, measures them, seals the labels, and opens them when all is done.
Diagnosers, worker processes or those of a dask cluster that see the folder, get the paths of a study and a CSV, no
more. Results are appended as lines of JSON that survive kill -9: a killed bench goes on where it was.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.evidence import diagnosers, seal
from benchmarks.evidence.judge import Judged, judge
from benchmarks.evidence.tasks import PLANS, Plan, Task, digest
from benchmarks.evidence.workers import ANY, Question, add_runs, ask, make
from benchmarks.output import ROOT

from pliant.execution.executors import ProcessExecutor, executor_for
from pliant.execution.jobs import JobQueue
from pliant.execution.progress import LogBar

# Sets made ahead of the diagnosers.
AHEAD = 4
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
        return {name: line for file in files for name, line in read(file).items()}

    @property
    def sets(self) -> Path:
        return self.folder / "sets"

    def label(self, name: str, key: bytes) -> dict[str, Any]:
        """The opened label of a set."""
        return seal.unseal((self.sets / f"{name}{seal.SUFFIX}").read_text(), key)

    def key(self) -> bytes:
        return seal.judge_key(self.folder / "judge.key")


def append(path: Path, line: dict[str, Any]) -> None:
    """One line in one write at the end of the file, on the disk when this returns.

    A piece of a line that a killed process left behind is closed off first and ignored by `read`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    text = (json.dumps(line) + "\n").encode()
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        size = os.fstat(handle).st_size
        if size and os.pread(handle, 1, size - 1) != b"\n":
            text = b"\n" + text
        os.write(handle, text)
        os.fsync(handle)
    finally:
        os.close(handle)


def read(path: Path) -> dict[str, dict[str, Any]]:
    """Lines by their `id`, the last one of each; what is no line of results is passed over."""
    lines: dict[str, dict[str, Any]] = {}
    for text in path.read_text(errors="replace").splitlines() if path.exists() else ():
        try:
            line = json.loads(text)
        except json.JSONDecodeError:
            continue
        if isinstance(line, dict) and "id" in line:
            lines[line["id"]] = line
    return lines


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


def run(bench: Bench, plan: Plan, scheduler: str | None = None) -> None:
    """All tasks of the plan that have no result yet: sets are made here, where the key is, and asked about elsewhere.

    Args:
        scheduler: of a dask cluster that asks, its address or file: its workers see the folder under the same path. By
            default processes of this machine ask.
    """
    tested = (ROOT / room for room in ("core", "plugins"))
    key, code = bench.key(), digest(sorted(file for room in tested for file in room.rglob("*.py")))
    found = read(bench.results)
    others = sum(line.get("code") != code for line in found.values())
    if others:
        print(f"{others} results are by other code of pliant; --fresh forgets them", flush=True)
    done = {name for name, line in found.items() if "error" not in line}
    named = [Job(task.secret_id(key), task) for task in bench.share_of(plan.tasks())]
    waiting = [job for job in named if job.name not in done]
    print(f"{len(named)} sets, {len(named) - len(waiting)} done before", flush=True)
    bar = LogBar(partial(print, flush=True), "sets", len(waiting), 0)
    asked: dict[str, Job] = {}
    workers = scheduler or ProcessExecutor(bench.workers)
    with executor_for(workers) as executor, JobQueue[Question, dict[str, Any]](executor, ask) as asking:

        def put(job: Job) -> None:
            verb = "improve" if job.task.mode == "improve" else "diagnose"
            asked[job.name] = job
            asking.submit([Question(verb, bench.diagnoser, job.name, bench.sets, bool(job.runs))])

        while waiting or asking.waiting:
            while waiting and asking.waiting < bench.workers + AHEAD:
                job = waiting.pop(0)
                make(job.task, job.name, bench.sets, key)
                put(job)
            for one in asking.completed():
                job = asked.pop(one.item.name)
                line = one.result or {"id": job.name, "error": f"{one.failure}", "wall_s": 0.0, "cpu_s": 0.0}
                if more := job.next_run(line):
                    job.before.append(line)
                    chosen = [ANY] * (len(job.runs) + 1) if more == ANY else [*job.runs, more]
                    job.runs = add_runs(job.task, job.name, bench.sets, chosen)
                    put(job)
                    continue
                if job.before:  # the runs that led to the last answer, and the answer before them
                    spent = {key: sum(one[key] for one in (line, *job.before)) for key in ("wall_s", "cpu_s")}
                    line |= {**spent, "added": job.runs, "first": job.before[0]}
                append(bench.results, {**line, "code": code})
                bar.advance()
    bar.finish()


def judged(bench: Bench, plan: Plan) -> list[Judged]:
    """The plan's results beside their opened labels, in the order of the plan."""
    key, lines = bench.key(), bench.lines()
    named = ((task, task.secret_id(key)) for task in plan.tasks())
    there = [(task, name) for task, name in named if name in lines]
    return [judge(task.group, bench.label(name, key), lines[name], task.mode) for task, name in there]
