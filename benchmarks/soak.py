"""Mixed work on one store under kills, full disks, clock jumps and a read-only phase: results must not change.

    python -m benchmarks.soak [--minutes 60] [--seed 0]       prints, and writes benchmarks/out/soak.json

Two sweeps, a search and a diagnosis, each in a separate process, alternate on one store, disturbed by seed:

- killed: kill -9 for the whole process group at a random moment;
- full: no file can grow beyond a few kB, as on a full disk (RLIMIT_FSIZE);
- clock: `time.time` of the process and of its workers is months off, back or forth;
- read-only: the store cannot be written (permissions; as root a read-only bind mount in a mount namespace);
- calm: no disturbance.

A disturbed command may succeed with the undisturbed answer, be killed, or refuse with exit code 2 and a message. After
a calm one has succeeded, its store is emptied one time in three. In the end every command runs once more undisturbed,
its answer is compared with that of a separate store, and every artifact is verified.
"""

from __future__ import annotations

import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.families.kill import SPRINGS
from benchmarks.output import ROOT, make_parser, write
from tests.cli.search_study import STUDY

PLIANT = (sys.executable, "-m", "pliant")
DISTURBED = ("killed", "killed", "killed", "full", "clock", "read-only", "calm")
EMPTIED = 1 / 3
LONGEST_S = 300.0
FULL_BYTES = (2_000, 200_000)
JUMP_S = 2e7
# Keys of a result for its duration, whether it was cached, and its location.
APART = {"wall_s", "fem_wall_s", "cached", "out", "csv", "report", "best_study"}
CLOCK = """\
import os, time
_off, _time, _time_ns = float(os.environ["SOAK_CLOCK"]), time.time, time.time_ns
time.time = lambda: _time() + _off
time.time_ns = lambda: _time_ns() + int(1e9 * _off)
"""
# The toy search of the tests, made longer.
LONGER = ("chain.modules=8", "task.steps=4", "search.budget=400")


@dataclass(frozen=True)
class Work:
    """A command: verb, study and options."""

    name: str
    command: tuple[str, ...]


@dataclass
class SoakCounts:
    """Counts of each disturbance, of each outcome, and of errors."""

    disturbances: Counter[str] = field(default_factory=Counter)
    ends: Counter[str] = field(default_factory=Counter)
    stores_emptied: int = 0
    wrong: list[str] = field(default_factory=list)
    artifacts: int = 0
    damaged: int = 0
    wall_s: float = 0.0


def works(folder: Path) -> list[Work]:
    """Return the commands, their studies written into the folder."""
    texts = {
        "springs": SPRINGS.replace("delay_s: 0.05", "delay_s: 0.01"),
        "other-springs": SPRINGS.replace("delay_s: 0.05", "delay_s: 0.01").replace("12 mm]", "11 mm]"),
        "search": STUDY,
    }
    paths = {name: folder / f"{name}.yaml" for name in texts}
    for name, text in texts.items():
        paths[name].write_text(text, encoding="utf-8")
    bench = str(ROOT / "examples" / "hidden_effect" / "finger.yaml")
    few = ("--effect", "viscoelastic", "--effect", "stiffness", "--effect", "sensor_lag")
    return [
        Work("springs", ("fem", str(paths["springs"]), "--workers", "2")),
        Work("other-springs", ("fem", str(paths["other-springs"]), "--workers", "2")),
        Work("search", ("optimize", str(paths["search"]), *LONGER)),
        Work("diagnosis", ("diagnose", bench, *few)),
    ]


class Soak:
    """One store, disturbed for some time."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.random, self.count = folder, random.Random(seed), SoakCounts()
        self.works, self.store = works(folder), folder / "store"
        self.wanted: dict[str, Any] = {}
        (folder / "clock").mkdir()
        (folder / "clock" / "sitecustomize.py").write_text(CLOCK)

    def run(self, minutes: float) -> SoakCounts:
        """Run undisturbed commands, disturbances until the time is up, and the final checks."""
        begun = time.monotonic()
        for work in self.works:
            self.wanted[work.name] = self._read_answer(work, self.folder / "apart" / work.name)
        while time.monotonic() - begun < 60.0 * minutes:
            work, how = self.random.choice(self.works), self.random.choice(DISTURBED)
            self.count.disturbances[how] += 1
            self._disturbed(work, how)
        for work in self.works:
            self._judge(work, self._read_answer(work, self.store))
        self._verify()
        self.count.wall_s = time.monotonic() - begun
        return self.count

    def _disturbed(self, work: Work, how: str) -> None:
        out = self.folder / "out.json"
        out.unlink(missing_ok=True)
        environment, prepare = dict(os.environ), None
        command = self._command(work, self.store, out)
        if how == "clock":
            environment["SOAK_CLOCK"] = str(self.random.uniform(-JUMP_S, JUMP_S))
            environment["PYTHONPATH"] = os.pathsep.join(
                filter(None, [str(self.folder / "clock"), environment.get("PYTHONPATH")])
            )
        if how == "full":
            prepare = partial(_limit_files, self.random.randint(*FULL_BYTES))
        moment = self.random.uniform(0.0, 8.0) if how == "killed" else LONGEST_S
        with _read_only(self.store, how == "read-only") as around:
            running = _start([*around, *command], environment, prepare)
            try:
                _, said = running.communicate(timeout=moment)
            except subprocess.TimeoutExpired:
                os.killpg(running.pid, signal.SIGKILL)
                running.communicate()
                self.count.ends["killed"] += 1
                if how != "killed":
                    self.count.wrong.append(f"{work.name}, {how}: still running after {LONGEST_S:.0f} s")
                return
        self._ended(work, how, running.returncode, said, out)

    def _ended(self, work: Work, how: str, code: int, said: str, out: Path) -> None:
        self.count.ends[f"exit {code}"] += 1
        if "Traceback" in said or code not in (0, 2) or (code == 2 and how in ("calm", "killed", "clock")):
            self.count.wrong.append(f"{work.name}, {how}: exit {code}: {said[-600:]}")
        if code == 0:
            self._judge(work, _read(out))
            if how == "calm" and self.random.random() < EMPTIED:
                # A diagnosis of a stated law stores nothing there.
                shutil.rmtree(self.store, ignore_errors=True)
                self.count.stores_emptied += 1

    def _command(self, work: Work, store: Path, out: Path) -> list[str]:
        place = ("--store", str(store), "--out", str(self.folder / "out" / work.name), "--json", str(out))
        return [*PLIANT, *work.command, *place, "--quiet"]

    def _read_answer(self, work: Work, store: Path) -> Any:
        out = self.folder / "answer.json"
        running = _start(self._command(work, store, out), dict(os.environ), None)
        _, said = running.communicate(timeout=LONGEST_S)
        if running.returncode != 0:
            raise RuntimeError(f"{work.name} ended with {running.returncode}: {said[-2000:]}")
        return _read(out)

    def _judge(self, work: Work, found: Any) -> None:
        different = list(differences(self.wanted[work.name], found))
        if different:
            self.count.wrong.append(f"{work.name}: another answer: {'; '.join(different[:4])}")

    def _verify(self) -> None:
        done = subprocess.run(
            [*PLIANT, "store", "--store", str(self.store), "--verify", "--json", "-"],
            capture_output=True,
            text=True,
            check=False,
        )
        found = json.loads(done.stdout)
        self.count.artifacts, self.count.damaged = found["artifacts"], len(found["damaged"])


def _read(out: Path) -> dict[str, Any]:
    """Return a command's result, with the table of states if it wrote one."""
    found: dict[str, Any] = json.loads(out.read_text())
    return {**found, "states": Path(found["csv"]).read_text()} if "csv" in found else found


def _start(
    command: list[str], environment: Mapping[str, str], prepare: Callable[[], None] | None
) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command,
        start_new_session=True,
        env=environment,
        cwd=ROOT,
        preexec_fn=prepare,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def _limit_files(size: int) -> None:
    """Limit files in the child: writing beyond the size fails, as on a full disk, instead of ending the process."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


class _read_only:  # noqa: N801 - a context
    """A context in which a store is read-only; it returns the prefix of commands for it."""

    def __init__(self, store: Path, wanted: bool) -> None:
        self.store, self.wanted = store, wanted and store.is_dir()

    def __enter__(self) -> list[str]:
        if not self.wanted:
            return []
        if os.geteuid() == 0:  # permissions do not bind root
            mount = 'mount --bind "$0" "$0" && mount -o remount,ro,bind "$0" && exec "$@"'
            return ["unshare", "--mount", "sh", "-c", mount, str(self.store)]
        self._allow(0o555)
        return []

    def __exit__(self, *error: object) -> None:
        if self.wanted and os.geteuid() != 0:
            self._allow(0o755)

    def _allow(self, mode: int) -> None:
        for folder in [self.store, *(path for path in self.store.rglob("*") if path.is_dir())]:
            folder.chmod(mode)


def differences(wanted: Any, found: Any, place: str = "") -> Any:
    """Yield the differences of two results, except for the keys in `APART`."""
    if isinstance(wanted, dict) and isinstance(found, dict):
        for key in sorted({*wanted, *found} - APART):
            yield from differences(wanted.get(key), found.get(key), f"{place}.{key}")
    elif isinstance(wanted, list) and isinstance(found, list) and len(wanted) == len(found):
        for number, pair in enumerate(zip(wanted, found, strict=True)):
            yield from differences(*pair, f"{place}[{number}]")
    elif wanted != found:
        yield f"{place}: {str(found)[:80]}, undisturbed {str(wanted)[:80]}"


def main() -> int:
    parser = make_parser(__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="pliant-soak-"))
    try:
        count = Soak(folder, arguments.seed).run(arguments.minutes)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(json.dumps(vars(count), indent=1))
    write("soak", {**vars(count), "minutes": arguments.minutes, "seed": arguments.seed})
    return 1 if count.wrong or count.damaged else 0


if __name__ == "__main__":
    sys.exit(main())
