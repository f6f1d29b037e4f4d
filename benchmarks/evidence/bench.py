"""Sets are made, asked about and judged by three kinds of processes.

A maker draws truths, measures them and seals the labels; diagnosers get the paths of a study and a CSV, no more;
the calling process, the judge, holds the key and opens labels when all is done. Results are appended line by line,
so that a killed bench goes on where it was.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import threading
import time
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.evidence import diagnosers, results, seal
from benchmarks.evidence.judge import Judged, judge
from benchmarks.evidence.tasks import Plan, Task, digest

# Sets made ahead of the diagnosers.
AHEAD = 4
EVERY_S = 20.0
KEPT = ("verdict", "selected", "hypotheses", "credible_set", "not_excited", "indistinguishable", "steps")


@dataclass(frozen=True)
class Bench:
    """Where a bench keeps its files: sets and results in `folder`, the key beside them."""

    folder: Path
    name: str
    diagnoser: str = diagnosers.DEFAULT
    workers: int = 2

    @property
    def results(self) -> Path:
        return self.folder / f"{self.name}.jsonl"

    @property
    def sets(self) -> Path:
        return self.folder / "sets"

    def key(self) -> bytes:
        return seal.judge_key(self.folder / "judge.key")


def make(task: Task, name: str, folder: Path, key: bytes) -> str:
    """In a maker's process: write NAME.csv, NAME_study.yaml and NAME.sealed; the set's name."""
    from benchmarks.evidence.sets import make_set

    sealed = folder / f"{name}{seal.SUFFIX}"
    if sealed.exists():  # written last, so the set is complete
        return name
    folder.mkdir(parents=True, exist_ok=True)
    made = make_set(task.spec, name=f"set-{name}")
    write(folder / f"{name}.csv", made.csv)
    write(folder / f"{name}_study.yaml", made.study)
    write(sealed, seal.seal(made.label, key))
    return name


def ask(verb: str, module: str, name: str, folder: Path) -> dict[str, Any]:
    """In a diagnoser's process: the line of results of one set. It knows paths of a study and a CSV, no more."""
    study, csv = folder / f"{name}_study.yaml", folder / f"{name}.csv"
    seed = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4])
    start = time.perf_counter()
    line: dict[str, Any] = {"id": name, "verb": verb}
    try:
        result = diagnosers.load(module, verb)(str(study), str(csv), seed)
        line["result"] = {key: result[key] for key in KEPT if key in result}
    except Exception as error:  # one set that fails must not end the bench
        line["error"] = f"{type(error).__name__}: {error}"[:2000]
    return line | {"wall_s": time.perf_counter() - start}


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


def run(bench: Bench, plan: Plan) -> None:
    """All tasks of the plan that have no result yet."""
    key, code = bench.key(), diagnoser_digest()
    found = results.read(bench.results)
    others = sum(line.get("code") != code for line in found.values())
    if others:
        print(f"{others} results are by other code of pliant; --fresh forgets them", flush=True)
    done = {name for name, line in found.items() if "error" not in line}
    named = [(task.secret_id(key), task) for task in plan.tasks()]
    waiting = [(name, task) for name, task in named if name not in done]
    print(f"{len(named)} sets, {len(named) - len(waiting)} done before", flush=True)
    pool = partial(
        ProcessPoolExecutor,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=end_with,
        initargs=(os.getpid(),),
    )
    progress = _Progress(len(waiting))
    with (
        pool(1) as makers,
        pool(bench.workers) as askers,
    ):
        making: dict[Future[Any], tuple[str, Task]] = {}
        asking: dict[Future[Any], tuple[str, Task]] = {}
        while waiting or making or asking:
            while waiting and len(making) + len(asking) < bench.workers + AHEAD:
                name, task = waiting.pop(0)
                making[makers.submit(make, task, name, bench.sets, key)] = (name, task)
            finished, _ = wait([*making, *asking], return_when=FIRST_COMPLETED)
            for future in finished:
                if future in making:
                    name, task = making.pop(future)
                    future.result()
                    asked = askers.submit(ask, task.mode, bench.diagnoser, name, bench.sets)
                    asking[asked] = (name, task)
                else:
                    name, task = asking.pop(future)
                    results.append(bench.results, {**_answer(future, name), "code": code})
                    progress.one_more()


def _answer(future: Future[Any], name: str) -> dict[str, Any]:
    """The line of results; where the process was killed, by the kernel or by hand, the bench ends and says so."""
    try:
        line: dict[str, Any] = future.result()
    except BrokenProcessPool as error:
        raise SystemExit(f"a diagnoser was killed at set {name}; run again to go on") from error
    return line


def judged(bench: Bench, plan: Plan) -> list[Judged]:
    """The plan's results beside their opened labels, in the order of the plan."""
    key, lines = bench.key(), results.read(bench.results)
    named = ((task.secret_id(key), task) for task in plan.tasks())
    return [
        judge(task.group, seal.unseal((bench.sets / f"{name}{seal.SUFFIX}").read_text(), key), lines[name])
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


def write(path: Path, text: str) -> None:
    temporary = path.with_suffix(path.suffix + ".part")
    temporary.write_text(text)
    temporary.replace(path)
