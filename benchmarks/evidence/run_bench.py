"""Diagnose many hidden effects and count how often the answer is right.

    python -m benchmarks.evidence.run_bench --sealed --share 0.4   judged sets that are drawn for this code; resumable,
                                                               also from the stored answers of the same code
    python -m benchmarks.evidence.run_bench                    calibration sets, on which thresholds may be tuned
    python -m benchmarks.evidence.run_bench --small            a handful of them, for CI
    python -m benchmarks.evidence.run_bench --bed law_off      sets whose joint law is off by 0.3 to 3 % in shape
    python -m benchmarks.evidence.run_bench --seeds 3 --kinds mullins none
    python -m benchmarks.evidence.run_bench --summarise        the tables of the existing results
    python -m benchmarks.evidence.run_bench --shard 2/4        every fourth set from the second on, in parallel with
    other shards python -m benchmarks.evidence.run_bench --scheduler tcp://host:8786   diagnosers on a dask cluster

A sealed run is written to the ledger when it begins and when it ends, whatever its result, and stores its answers for
the page (`python -m benchmarks.evidence.publish`). A change of the diagnosis code changes its sets.

Results are in benchmarks/out/evidence/NAME.jsonl, one line per set, and the tables in benchmarks/out/evidence.json.

Sets are made and judged by this process, which has the key: it draws truths, measures them, seals the labels, and opens
them at the end. Diagnosers, worker processes or those of a dask cluster that see the folder, get only the paths of a
study and a CSV. Results are appended as lines of JSON that survive kill -9: a killed bench is continued.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol, cast

# Before numpy; child processes inherit it. Two diagnosers on two cores must not fight for them.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"
os.environ["NUMBA_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from benchmarks.evidence import diagnosers, ledger, seal
from benchmarks.evidence.bench_errors import MISTAKES
from benchmarks.evidence.counting import summary
from benchmarks.evidence.judge import ERROR
from benchmarks.evidence.protocols import NAMES
from benchmarks.evidence.publish import as_text, expected_time
from benchmarks.evidence.tasks import BEDS, PLAN_OF, PLANS, Task, planned, small_plan
from benchmarks.evidence.truths import CLEAN, KINDS, UNKNOWN
from benchmarks.evidence.workers import ANY, Question, add_runs, ask, make
from benchmarks.output import OUT, make_parser

from pliant.execution.executors import ProcessExecutor, executor_for
from pliant.execution.jobs import JobQueue
from pliant.execution.progress import LogBar
from pliant.store.store import write_atomically

COUNTS = {
    "seeds": "sets per effect",
    "clean": "clean sets",
    "unknown": "sets per unknown form",
    "pairs": "sets with two effects",
    "weak": "sets per effect at 0.5 and at 1 σ",
    "poor": "sets per effect under the poor protocol",
    "noload": "sets per effect without load steps",
    "quick": "sets per quick effect under midway and coarse",
    "rods": "sets per effect of a rod",
    "missed": "sets per unknown form that cancelling effects imitate",
    "payload": "sets with payloads that are written down wrongly",
    "clock": "sets with clocks that disagree",
    "gravity": "sets whose study has no gravity or a turned one",
    "interval": "sets per effect that has the candidate's own equation",
    "plan": "poor sets that get two more runs, proposed and random",
    "improve": "sets per effect that are improved",
    "other_every": "every this many-th set is made of the kind's other robot; 0: none",
}


# Sets made ahead of the diagnosers.
AHEAD = 4
# Runs that are added to a poor set.
ADDED = 2


class Planned(Protocol):
    """The plan of a bed: a frozen dataclass with tasks, the draw of its sets, and the share that is done."""

    @property
    def draw(self) -> str: ...
    @property
    def share(self) -> float: ...
    def tasks(self) -> list[Task]: ...


@dataclass(frozen=True)
class Bench:
    """Files of a bench: sets and results in `folder`, the key next to it.

    `shard` (part, number of parts) selects every n-th task; shards share the folder, or a copy of its key. `stored` are
    answers of the same code that an earlier run published, by the `public_id` of their tasks. `maker` writes the files
    of a set, `parts` is the code that determines a diagnosis; other beds have their own.
    """

    folder: Path
    name: str
    diagnoser: str = diagnosers.DEFAULT
    workers: int = 2
    shard: tuple[int, int] = (1, 1)
    stored: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    maker: Callable[..., None] | None = None
    parts: tuple[str, ...] = ledger.CODE

    @property
    def results(self) -> Path:
        """The file that this call writes to; shards have one each."""
        part, count = self.shard
        return self.folder / (f"{self.name}.jsonl" if count == 1 else f"{self.name}.{part}-of-{count}.jsonl")

    def shard_tasks(self, tasks: list[Task]) -> list[Task]:
        """Return the tasks of this shard: every `count`-th one."""
        part, count = self.shard
        return tasks[part - 1 :: count]

    def lines(self) -> dict[str, dict[str, Any]]:
        """Return all results of this name, of every shard."""
        files = [self.folder / f"{self.name}.jsonl", *sorted(self.folder.glob(f"{self.name}.*-of-*.jsonl"))]
        return {name: line for file in files for name, line in read(file).items()}

    @property
    def sets(self) -> Path:
        return self.folder / "sets"

    def label(self, name: str, key: bytes) -> dict[str, Any]:
        """Open the label of a set."""
        return seal.unseal((self.sets / f"{name}{seal.SUFFIX}").read_text(), key)

    def key(self) -> bytes:
        return seal.judge_key(self.folder / "judge.key")


def append(path: Path, line: dict[str, Any]) -> None:
    """Append one line in one write at the end of the file, on the disk on return.

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
    """Return lines by their `id`, the last one of each; other lines are skipped."""
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
        """Return the run to add after this answer; None if the task is done."""
        if self.task.mode not in PLANS or len(self.runs) == ADDED or "error" in line:
            return None
        if self.task.mode == "random":
            return ANY
        proposed = line["result"].get("next_experiment") or {}
        return proposed.get("name") or None


@contextlib.contextmanager
def unmade(bench: Bench, name: str) -> Iterator[None]:
    """Record a truth that its engine cannot follow as not made instead of failing."""
    try:
        yield
    except (RuntimeError, np.linalg.LinAlgError) as error:
        append(bench.results, {"id": name, "unmade": f"{error}"})


def run(bench: Bench, plan: Planned, scheduler: str | None = None) -> None:
    """Run all tasks of the plan without a result: sets are made in this process, which has the key, and diagnosed in
    others.

    Args:
        scheduler: address or file of a dask cluster for the diagnoses, whose workers see the folder under the same
            path. By default processes of this machine are used.
    """
    key, code = bench.key(), ledger.code_digest(parts=bench.parts)
    found = read(bench.results)
    others = sum(line.get("code", code) != code for line in found.values())
    if others:
        print(f"{others} results are by other code of pliant; --fresh forgets them", flush=True)
    done = {name for name, line in found.items() if "error" not in line}
    named = [Job(task.secret_id(key), task) for task in bench.shard_tasks(plan.tasks())]
    waiting = [job for job in named if job.name not in done and job.task.public_id not in bench.stored]
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
                with unmade(bench, job.name):
                    (bench.maker or make)(job.task, job.name, bench.sets, key)
                    put(job)
            for one in asking.completed():
                job = asked.pop(one.item.name)
                line = one.result or {"id": job.name, "error": f"{one.failure}", "wall_s": 0.0, "cpu_s": 0.0}
                if more := job.next_run(line):
                    job.before.append(line)
                    chosen = [ANY] * (len(job.runs) + 1) if more == ANY else [*job.runs, more]
                    with unmade(bench, job.name):
                        job.runs = add_runs(job.task, job.name, bench.sets, chosen)
                        put(job)
                    continue
                if job.before:  # the runs that led to the last answer, and the answer before them
                    spent = {key: sum(one[key] for one in (line, *job.before)) for key in ("wall_s", "cpu_s")}
                    line |= {**spent, "added": job.runs, "first": job.before[0]}
                append(bench.results, {**line, "code": code})
                bar.advance()
    bar.finish()


def answers(bench: Bench, plan: Planned) -> list[dict[str, Any]]:
    """Return the plan's results with their opened labels, in the order of the plan."""
    key, lines = bench.key(), bench.lines()
    found = []
    for task in plan.tasks():
        name = task.secret_id(key)
        if name in lines and "unmade" not in lines[name]:
            found.append(ledger.compact(task, bench.label(name, key), lines[name]))
        elif task.public_id in bench.stored:
            found.append(bench.stored[task.public_id])
    return found


def figures(found: Sequence[dict[str, Any]]) -> dict[str, list[int]]:
    """Return the figures of a ledger's line."""
    return ledger.headline(summary(ledger.judged(found)))


@contextlib.contextmanager
def in_the_ledger(
    bench: Bench,
    plan: Planned,
    path: Path = ledger.LEDGER,
    kept: Path = ledger.ANSWERS,
    headline: Callable[[Sequence[dict[str, Any]]], dict[str, list[int]]] = figures,
) -> Iterator[None]:
    """Write a line of the ledger at the start and at the end or stop of a sealed run, with the answers by then."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    any_plan = cast(Any, plan)  # a frozen dataclass
    sets = len(replace(any_plan, share=1.0).tasks())
    began: dict[str, Any] = {
        "run": f"{plan.draw} {ledger.now()}",
        "began": ledger.now(),
        "commit": ledger.commit(bench.parts),
        "code": plan.draw,
    }
    began |= {"plan": asdict(any_plan), "share": plan.share, "planned": sets}
    ledger.note(began, path)
    try:
        yield
    finally:
        found = answers(bench, plan)
        missing = sum("unmade" in line for line in bench.lines().values())
        finished = len(found) + missing == len(plan.tasks()) and not any("error" in one for one in found)
        ended = {"run": began["run"], "ended": ledger.now(), "done": len(found), "unmade": missing}
        ended["finished"] = finished
        if found:
            ledger.write_answers({**began, **ended}, found, kept)
            ended["figures"] = headline(found)
        ledger.note(ended, path)


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = make_parser(__doc__)
    parser.add_argument("--name", help="of the results file; full or small by default")
    parser.add_argument("--small", action="store_true", help="a few of every group, for CI")
    parser.add_argument("--summarise", action="store_true", help="only the tables of what is there")
    parser.add_argument(
        "--sealed", action="store_true", help="judge this code, on sets drawn for it; in the ledger"
    )
    parser.add_argument("--digest", action="store_true", help="only which code of the diagnosis this is")
    parser.add_argument(
        "--plan-only", action="store_true", help="how many sets of what, and the expected time"
    )
    parser.add_argument("--kinds", nargs="+", choices=(*KINDS, CLEAN, *UNKNOWN, *MISTAKES), metavar="KIND")
    parser.add_argument("--bed", choices=BEDS, default="exact", help="laws that are exact, or off in shape")
    for name, words in COUNTS.items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=int, help=words)
    parser.add_argument(
        "--share",
        type=_share,
        metavar="0..1",
        help="this part of every group, the first seeds; all by default",
    )
    parser.add_argument("--protocol", choices=NAMES)
    parser.add_argument("--workers", type=int, default=2, help="diagnosers at a time")
    parser.add_argument("--scheduler", help="ask on a dask cluster instead: its address or its file")
    parser.add_argument("--shard", type=_shard, default=(1, 1), metavar="I/N", help="only every N-th set")
    parser.add_argument("--diagnoser", default=diagnosers.DEFAULT, help="module with diagnose and improve")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of evidence.json and evidence/")
    parser.add_argument("--fresh", action="store_true", help="forget the results that are there")
    return parser.parse_args(arguments)


def _share(text: str) -> float:
    share = float(text)
    if not 0.0 < share <= 1.0:
        raise ValueError(text)
    return share


def _shard(text: str) -> tuple[int, int]:
    part, count = (int(word) for word in text.split("/"))
    if not 1 <= part <= count:
        raise ValueError(text)
    return part, count


def main(arguments: Sequence[str] | None = None) -> None:
    given = _arguments(arguments)
    code = ledger.code_digest()
    if given.digest:
        print(code)
        return
    chosen = {name: getattr(given, name) for name in (*COUNTS, "protocol", "share")}
    chosen["kinds"] = tuple(given.kinds) if given.kinds else None
    changes = {name: value for name, value in chosen.items() if value is not None}
    plan = replace(small_plan(given.bed) if given.small else PLAN_OF[given.bed], **changes)
    of_bed = "" if given.bed == "exact" else f"{given.bed}-"
    name = given.name or of_bed + ("small" if given.small else "full")
    if given.sealed:
        if changes.keys() - {"share"} or given.small or given.fresh or given.name or given.shard != (1, 1):
            raise SystemExit(
                "a sealed run is the whole plan or a --share of it, once: leave the other options out"
            )
        plan, name = replace(plan, split="judged", draw=code), f"{of_bed}sealed-{code}"
    stored = ledger.stored_answers(code, ledger.ANSWERS_OF[plan.bed]) if given.sealed else {}
    bench = Bench(
        (given.out / "evidence").resolve(), name, given.diagnoser, given.workers, given.shard, stored
    )
    if given.plan_only:
        print(expected_time(plan))
        return
    if given.fresh:
        bench.results.unlink(missing_ok=True)
    if not given.summarise:
        kept = ledger.ANSWERS_OF[plan.bed]
        with in_the_ledger(bench, plan, kept=kept) if given.sealed else contextlib.nullcontext():
            run(bench, plan, given.scheduler)
    items = ledger.judged(answers(bench, plan))
    data = {**summary(items), "planned": planned(plan)}
    print(as_text(data))
    target = given.out / ("evidence.json" if name == "full" else f"evidence_{name}.json")
    write_atomically(target, json.dumps(data, indent=1))
    if any(item.outcome == ERROR for item in items):
        sys.exit(1)  # errors are no answers


if __name__ == "__main__":
    main()
