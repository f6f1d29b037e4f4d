"""Searches and diagnoses killed at random moments: python -m benchmarks.kill_searches [--searches 100] [--diagnoses 50]

As in `benchmarks.families.kill` for sweeps: the command runs in two worker processes, kill -9 ends the whole process
group at a time drawn by seed (one in five during its start, the others while it evaluates), the same command runs
again; if it is complete before all kills are made, the next round starts with an empty store. Counted for a search,
whose engine in this module writes a line for each candidate that it loads:

- saved: entries of the journal in the store after the kill;
- evaluated twice: a saved candidate that was loaded again. There must be none; candidates of an incomplete generation
  may be, and are counted separately, and so are evaluations of the winner, which each call that ends simulates again
  for its report;
- another answer: a round whose result differs from the undisturbed one in any number. There must be none.

A diagnosis stores no intermediate results, so that only its answers and its store are checked. Prints the figures and
writes them to benchmarks/out/kill_searches.json.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.output import ROOT, make_parser, write
from benchmarks.soak import differences
from benchmarks.solved_log import candidate, noted
from tests.cli.search_study import STUDY

from pliant_search.run.journal import Journal

SEARCH = STUDY.replace("physics: quasistatic", "physics: counted_quasistatic").replace(
    "name: toy\n", f"name: killed-search\nplugins: ['{ROOT}/benchmarks/counted_engine.py']\n"
)
FEW = ("--effect", "viscoelastic", "--effect", "stiffness", "--effect", "sensor_lag")
WORKERS = 2
STARTING = 0.2  # share of the kills of a search that come before its first candidate


@dataclass
class SearchKillCounts:
    """The effect of the kills."""

    kills: int = 0
    rounds: int = 0
    candidates_begun: int = 0
    saved_at_kills: int = 0
    of_open_generations_again: int = 0
    looks_at_the_winner: int = 0
    saved_and_evaluated_twice: int = 0
    artifacts: int = 0
    damaged: int = 0
    wrong: list[str] = field(default_factory=list)
    wall_s: float = 0.0

    @property
    def sound(self) -> bool:
        """Return whether answers are the same, no artifact is damaged and no saved candidate was evaluated twice."""
        return not self.wrong and self.damaged == self.saved_and_evaluated_twice == 0


class KilledSearch:
    """One command, killed again and again."""

    def __init__(self, command: Sequence[str], folder: Path, seed: int) -> None:
        self.command, self.folder, self.random = list(command), folder, random.Random(seed)
        self.log, self.count, self._winner = folder / "loaded.log", SearchKillCounts(), ""

    def run(self, kills: int) -> SearchKillCounts:
        """Make all kills; complete every round and compare its answer with an undisturbed one."""
        begun = time.monotonic()
        wanted = self._finished("whole")
        whole_s, once = time.monotonic() - begun, Counter(self._loaded())
        if best := wanted.get("best"):
            self._winner = _named(best["values"])
        while self.count.kills < kills:
            store = f"killed{self.count.rounds}"
            self.log.unlink(missing_ok=True)
            saved: list[
                tuple[int, set[str]]
            ] = []  # after each kill: number of lines, and entries of the journal
            while self.count.kills < kills and self._killed(store, whole_s, once):
                saved.append((len(self._loaded()), self._saved(store)))
            found = self._finished(store)
            different = list(differences(wanted, found))
            if different:
                self.count.wrong.append(f"round {self.count.rounds}: {'; '.join(different[:4])}")
            self._judge(saved, once)
            self._verify(store)
            self.count.rounds += 1
            shutil.rmtree(self.folder / store, ignore_errors=True)
        self.count.wall_s = time.monotonic() - begun
        return self.count

    def _start(self, store: str, *options: str) -> subprocess.Popen[str]:
        place = ("--store", str(self.folder / store), "--out", str(self.folder / "out"), "--quiet")
        return subprocess.Popen(
            [sys.executable, "-m", "pliant", *self.command, *place, *options],
            start_new_session=True,
            env={**os.environ, "SPRINGS_LOG": str(self.log)},
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )

    def _finished(self, store: str) -> dict[str, Any]:
        """Return the answer of the undisturbed command."""
        out = self.folder / "answer.json"
        running = self._start(store, "--json", str(out))
        _, said = running.communicate(timeout=3600)
        if running.returncode != 0:
            raise RuntimeError(f"{self.command[0]} ended with {running.returncode}: {said[-2000:]}")
        found: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
        return found

    def _killed(self, store: str, whole_s: float, once: Counter[str]) -> bool:
        """Start, wait for a moment by the clock or for a number of candidates, kill; False: it was complete before."""
        running = self._start(store)
        moment_s, before = time.monotonic() + self.random.uniform(0.0, 0.6 * whole_s), len(self._loaded())
        more = self.random.randint(1, 1 + once.total() // 3)
        by_clock = not once or self.random.random() < STARTING
        while running.poll() is None:
            if time.monotonic() >= moment_s if by_clock else len(self._loaded()) >= before + more:
                os.killpg(running.pid, signal.SIGKILL)
                running.communicate()
                self.count.kills += 1
                return True
            time.sleep(0.005)
        said = running.communicate()[1]
        if running.returncode != 0:
            self.count.wrong.append(f"exit {running.returncode}: {said[-600:]}")
        return False

    def _loaded(self) -> list[str]:
        """Return candidates in the order of loading."""
        return [loaded for _, _, loaded in noted(self.log)]

    def _saved(self, store: str) -> set[str]:
        """Return candidates in the store's journals."""
        folders = {file.parent for file in (self.folder / store).rglob("branch-0000.jsonl")}
        found = {
            _named(trial.values)
            for folder in folders
            for generation in Journal(folder, "branch-0000").read()
            for trial in generation.trials
        }
        self.count.saved_at_kills += len(found)
        return found

    def _judge(self, saved: Sequence[tuple[int, set[str]]], once: Counter[str]) -> None:
        """Walk through the log, kill by kill."""
        loaded, begun, known = self._loaded(), Counter[str](), set[str]()
        ends = [*saved, (len(loaded), set())]
        first = 0
        for last, then in ends:
            for one in loaded[first:last]:
                begun[one] += 1
                if one == self._winner:
                    self.count.looks_at_the_winner += 1
                elif begun[one] > once[one]:
                    self.count.saved_and_evaluated_twice += one in known
                    self.count.of_open_generations_again += one not in known
            first, known = last, known | then
        self.count.candidates_begun += len(loaded)

    def _verify(self, store: str) -> None:
        if not (self.folder / store).exists():
            return
        command = [sys.executable, "-m", "pliant", "store", "--store", str(self.folder / store), "--verify"]
        done = subprocess.run([*command, "--json", "-"], capture_output=True, text=True, check=False)
        found = json.loads(done.stdout)
        self.count.artifacts += found["artifacts"]
        self.count.damaged += len(found["damaged"])


def _named(values: Mapping[str, Any]) -> str:
    return candidate(float(values["chain.module_length"]), float(values["task.pressure"]))


def main() -> int:
    parser = make_parser(__doc__)
    parser.add_argument("--searches", type=int, default=100, help="kills of a search")
    parser.add_argument("--diagnoses", type=int, default=50, help="kills of a diagnosis")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="pliant-kill-"))
    study, bench = folder / "search.yaml", ROOT / "examples" / "hidden_effect" / "finger.yaml"
    study.write_text(SEARCH, encoding="utf-8")
    works = {
        "searches": (
            arguments.searches,
            ("optimize", str(study), "search.budget=120", "--workers", f"{WORKERS}"),
        ),
        "diagnoses": (arguments.diagnoses, ("diagnose", str(bench), *FEW)),
    }
    results, sound = {}, True
    try:
        for name, (kills, command) in works.items():
            count = KilledSearch(command, folder, arguments.seed).run(kills) if kills else SearchKillCounts()
            results[name] = {**asdict(count), "seed": arguments.seed, "sound": count.sound}
            print(name, json.dumps(results[name], indent=1), flush=True)
            sound &= count.sound
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    write("kill_searches", results)
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
