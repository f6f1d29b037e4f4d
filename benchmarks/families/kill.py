"""Sweeps killed at random moments: python -m benchmarks.families.kill [--kills 50] [--only springs|skfem]

`pliant fem` of a small sweep runs in two worker processes; kill -9 ends the whole process group at a time drawn by seed
(one in five during its start, the others while it solves); then the same command runs again. If a sweep is complete
before all kills are made, the next round starts with an empty store. A wrapper around the solver, in this module only,
writes a line at the start and end of each solve. Counted:

- saved: the process that solved the state had started another one, so the sampling had stored it;
- cut off: the solve began and did not end; unsure: it ended, and the kill came before the next began, so it may or may
  not have been stored. Only these two may be solved again, at most one for each worker and kill;
- solved twice: a saved state that was begun again. There must be none;
- lost: states of an undisturbed sweep that the killed one lacks or has with other bits. There must be none.

Prints the figures and writes them to benchmarks/out/kill.json.
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
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import ROOT, make_parser, read, write
from benchmarks.solved_log import noted

from pliant import api

WORKERS = 2
STARTING = 0.2  # share of the kills that come before the first solve
SPRINGS = f"""\
pliant: 1
name: killed-springs
plugins: ['{ROOT}/tests/pliant_designs/springs_plugin.py']
family: {{kind: springs, radius: 5 mm, length: 11 mm}}
material: {{kind: neo_hookean, shear_modulus: 240 kPa}}
fem: {{kind: springs_fem, pressure_max: 15 kPa, sampling: grid, delay_s: 0.05}}
sweep: {{radius: [4 mm, 5 mm, 6 mm, 12 mm], length: [9 mm, 11 mm]}}
"""
SKFEM = f"""\
pliant: 1
name: killed-bellows
plugins: ['{ROOT}/benchmarks/families/counted_plugin.py']
family: {{kind: bellow_bending, inner_radius: 2 mm, average_radius: 6 mm, wall: 1.5 mm, module_length: 11 mm}}
material: {{kind: neo_hookean, shear_modulus: 240 kPa}}
fem: {{kind: counted_skfem, pressure_max: 8 kPa, pressures: 3, angles: 3, check_states: 1}}
sweep: {{inner_radius: [2 mm, 2.5 mm], average_radius: [6 mm], module_length: [5 mm, 10 mm, 11 mm]}}
"""


@dataclass
class Count:
    """The effect of the kills: the number of each kind of solve."""

    kills: int = 0
    kills_while_starting: int = 0
    sweeps_completed: int = 0
    solves_begun: int = 0
    states: int = 0
    cut_off: int = 0
    unsure: int = 0
    solved_again_after_cut_off_or_unsure: int = 0
    saved_and_solved_twice: int = 0
    lost: int = 0
    largest_difference: float = 0.0
    complaints: list[str] = field(default_factory=list)
    wall_s: float = 0.0

    @property
    def sound(self) -> bool:
        """Return whether no state was lost and no saved one was solved twice."""
        may_repeat = self.cut_off + self.unsure
        bounded = self.solved_again_after_cut_off_or_unsure <= may_repeat <= WORKERS * self.kills
        return bounded and self.lost == self.saved_and_solved_twice == 0


class Killing:
    """One study, killed again and again."""

    def __init__(self, text: str, folder: Path, seed: int, window_s: float, workers: int = WORKERS) -> None:
        self.folder, self.random, self.window_s = folder, random.Random(seed), window_s
        self.study, self.log = folder / "study.yaml", folder / "solved.log"
        self.command = [sys.executable, "-m", "pliant", "fem", str(self.study), "--workers", str(workers)]
        self.study.write_text(text, encoding="utf-8")
        self.count = Count()

    def run(self, kills: int) -> Count:
        """Make all kills, complete the last sweep and compare its data with an undisturbed sweep."""
        started = time.perf_counter()
        self._finish("whole")
        expected, once = self._data("whole"), Counter(s for w, _, s in noted(self.log) if w == "begin")
        while self.count.kills < kills:
            store = f"killed{self.count.sweeps_completed}"
            self.log.unlink(missing_ok=True)
            rounds = []
            while self.count.kills < kills and self._killed(store):
                rounds.append(len(noted(self.log)))
            self._finish(store)
            self._judge(rounds, once)
            self._compare(expected, self._data(store))
            self.count.sweeps_completed += 1
        self.count.wall_s = time.perf_counter() - started
        return self.count

    def _start(self, store: str) -> subprocess.Popen[str]:
        environment = {**os.environ, "SPRINGS_LOG": str(self.log)}
        place = ["--store", str(self.folder / store), "--out", str(self.folder / "out")]
        pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
        command = [*self.command, *place]
        return subprocess.Popen(command, start_new_session=True, env=environment, cwd=ROOT, **pipes)

    def _finish(self, store: str) -> None:
        running = self._start(store)
        _, said = running.communicate(timeout=3600)
        self._listen(said)
        if running.returncode != 0:
            raise RuntimeError(f"the sweep ended with {running.returncode}: {said[-2000:]}")

    def _killed(self, store: str) -> bool:
        """Start, wait for the moment, kill; False where the sweep was complete before."""
        running = self._start(store)
        before = len(noted(self.log))
        starting = self.random.random() < STARTING
        began = None if not starting else time.monotonic()
        moment = self.random.uniform(0, self.window_s)
        while running.poll() is None:
            if began is None and len(noted(self.log)) > before:
                began = time.monotonic()
            if began is not None and time.monotonic() - began >= moment:
                break
            time.sleep(0.005)
        if running.poll() is not None:
            self._listen(running.communicate()[1])
            return False
        os.killpg(running.pid, signal.SIGKILL)
        self._listen(running.communicate()[1])
        self.count.kills += 1
        self.count.kills_while_starting += len(noted(self.log)) == before
        return True

    def _listen(self, said: str) -> None:
        """Collect messages on damage; there should be none."""
        words = ("damaged", "corrupted", "Traceback", "error")
        self.count.complaints += [line for line in said.splitlines() if any(w in line for w in words)]

    def _judge(self, rounds: Sequence[int], once: Counter[str]) -> None:
        """Walk through the log, kill by kill."""
        lines, begun, saved, loose = noted(self.log), Counter[str](), set[str](), set[str]()
        for first, last in zip([0, *rounds], [*rounds, len(lines)], strict=True):
            present: dict[str, tuple[str, str]] = {}  # process → its last line
            for what, pid, state in lines[first:last]:
                if what == "begin":
                    if pid in present:
                        saved.add(present[pid][1])
                    begun[state] += 1
                    again = begun[state] > once[state]
                    self.count.saved_and_solved_twice += again and state in saved
                    self.count.solved_again_after_cut_off_or_unsure += again and state in loose - saved
                present[pid] = (what, state)
            if last == len(lines):
                break
            self.count.cut_off += sum(what == "begin" for what, _ in present.values())
            self.count.unsure += sum(what == "end" for what, _ in present.values())
            loose |= {state for _, state in present.values()}
        self.count.solves_begun += sum(begun.values())
        self.count.states += len(begun)
        self.count.lost += len(set(once) - set(begun))

    def _data(self, store: str) -> dict[int, dict[str, np.ndarray]]:
        run = api.sweep(api.open_study(self.study, store=self.folder / store), workers=1)
        names = ("actuation", "deformation", "tau", "dtau_dp", "dtau_du", "energy_j")
        return {o.design.number: {n: getattr(o.data(), n) for n in names} for o in run.done()}

    def _compare(self, expected: dict[int, dict[str, Any]], found: dict[int, dict[str, Any]]) -> None:
        self.count.lost += sum(len(expected[n]["actuation"]) for n in set(expected) - set(found))
        for number in set(expected) & set(found):
            for name, array in expected[number].items():
                other = found[number][name]
                if other.shape != array.shape:
                    self.count.lost += abs(len(array) - len(other)) or 1
                    continue
                difference = float(np.abs(other - array).max() / (np.abs(array).max() or 1.0))
                self.count.largest_difference = max(self.count.largest_difference, difference)


def main() -> int:
    parser = make_parser(__doc__)
    parser.add_argument("--kills", type=int, default=50, help="of each solver")
    parser.add_argument("--only", choices=["springs", "skfem"])
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    results, sound = read("kill"), True
    for name, text, window_s in (("springs", SPRINGS, 3.0), ("skfem", SKFEM, 10.0)):
        if arguments.only not in (None, name):
            continue
        folder = Path(tempfile.mkdtemp(prefix="pliant-kill-"))
        try:
            count = Killing(text, folder, arguments.seed, window_s).run(arguments.kills)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        results[name] = {**asdict(count), "workers": WORKERS, "seed": arguments.seed, "sound": count.sound}
        print(name, json.dumps(results[name], indent=1))
        sound &= count.sound
        write("kill", results)
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
