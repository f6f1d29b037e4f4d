"""How far work scales with workers, computed from measured costs: python -m benchmarks.scaling [--most 64]

Measured here, in CPU seconds so that a loaded machine gives the same: what a task takes in its worker (the FEM of the
first finger's module, a candidate of a small search, a fit of a diagnosis), and what it costs the driver (a job out and
a result back through dask). Computed: the driver serves workers in turn, one job waits for each (`JobQueue`); a batch
ends with its last task. A generation of a search is such a batch: the next one waits for all of it, and asking for and
telling its candidates is the driver's. Fits of a diagnosis are taken as one batch, which flatters them.

Printed: by how much n workers are faster than one, and where the gain of twice as many falls below 1.3.
"""

from __future__ import annotations

import heapq
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

from benchmarks.output import ROOT, make_parser, write
from benchmarks.soak import LONGER
from tests.cli.search_study import STUDY

from pliant import api
from pliant.diagnosis.fitting import Fitter
from pliant.execution.executors import executor_for
from pliant.execution.jobs import JobQueue
from pliant_search.evaluate.evaluator import Evaluator

MESSAGES = 400
WORTH = 1.3
HIDDEN = ROOT / "examples" / "hidden_effect" / "finger.yaml"
BENCH = HIDDEN.parent / "bench.csv"
FINGER = ROOT / "examples" / "first_finger" / "finger.yaml"


@dataclass(frozen=True)
class Load:
    """Work in batches.

    Attributes:
        name: in words.
        tasks: of a batch, seconds in a worker each.
        batches: one after another.
        driver_s: of the driver for each task.
        between_s: of the driver after each batch.
    """

    name: str
    tasks: tuple[float, ...]
    batches: int = 1
    driver_s: float = 0.0
    between_s: float = 0.0

    def takes(self, workers: int) -> float:
        """Return the seconds of all batches with a number of workers."""
        return self.batches * (makespan(self.tasks, workers, self.driver_s) + self.between_s)


def makespan(tasks: Sequence[float], workers: int, driver_s: float) -> float:
    """Return the time of the last task: each passes the driver once, in turn, then the first free worker."""
    free = [0.0] * min(workers, len(tasks))
    driver, last = 0.0, 0.0
    for task in tasks:
        worker = heapq.heappop(free)
        driver = (
            max(driver, worker - task) + driver_s
        )  # one job waits for each worker: it is handed out meanwhile
        end = max(driver, worker) + task
        heapq.heappush(free, end)
        last = max(last, end)
    return last


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--most", type=int, default=64)
    most = parser.parse_args().most
    with tempfile.TemporaryDirectory() as name:
        loads = measured(Path(name))
    counts = [2**k for k in range(most.bit_length()) if 2**k <= most]
    table = {}
    print(f"{'faster than one worker with':44}" + "".join(f"{n:>8}" for n in counts))
    for load in loads:
        alone = load.takes(1)
        gains = {n: alone / load.takes(n) for n in counts}
        table[load.name] = gains
        worth = [n for n in counts[1:] if gains[n] < WORTH * gains[n // 2]]
        stops = f"   twice as many gain less than {WORTH} × from {worth[0] // 2} on" if worth else ""
        print(f"{load.name:44}" + "".join(f"{gains[n]:8.1f}" for n in counts) + stops)
    write("scaling", {"gains": table, "loads": [vars(load) for load in loads]})


def measured(folder: Path) -> list[Load]:
    """Measure this machine's costs, print them and return loads with them."""
    message_s = message_seconds()
    fem_s = design_seconds(folder)
    fits = fit_seconds(folder)
    between_s, candidate_s = candidate_seconds(folder)
    print(f"a job through dask costs the driver {1e3 * message_s:.2f} ms")
    print(
        f"FEM of a design {fem_s:.1f} s; a candidate {1e3 * candidate_s:.1f} ms, its driver {1e3 * between_s:.2f} ms"
    )
    print(f"fits of a diagnosis {len(fits)}: {sum(fits):.1f} s, the longest {max(fits):.2f} s")

    def search(many: int, seconds: float, what: str) -> Load:
        tasks = (seconds,) * many
        return Load(
            f"search, {many} at a time, {what} each", tasks, 4860 // many, message_s, many * between_s
        )

    here = f"{1e3 * candidate_s:.0f} ms"
    return [
        Load("sweep of 200 designs", (fem_s,) * 200, 1, message_s),
        search(16, candidate_s, here),
        search(128, candidate_s, here),
        search(128, 0.1, "0.1 s"),
        Load("1 190 diagnoses, one in a worker each", (sum(fits),) * 1190, 1, message_s),
        Load("fits of one diagnosis", fits, 1, message_s),
    ]


def message_seconds() -> float:
    """Return the driver's CPU seconds for an empty job, through a dask cluster of one process."""
    import distributed

    settings = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(**settings) as cluster,
        executor_for(cluster.scheduler_address) as executor,
        JobQueue[int, int](executor, abs) as queue,
    ):
        list(queue.each([0] * 20))
        begun = time.process_time()
        list(queue.each([-1] * MESSAGES))
        return (time.process_time() - begun) / MESSAGES


def design_seconds(folder: Path) -> float:
    """Return CPU seconds of the FEM of the first finger's module, after compilation."""
    taken = []
    for name in ("first", "second"):
        begun = time.process_time()
        api.fem(api.open_study(FINGER, store=folder / name))
        taken.append(time.process_time() - begun)
    return min(taken)


def fit_seconds(folder: Path) -> tuple[float, ...]:
    """Return CPU seconds of each fit of a diagnosis of the example's recording, in their order."""
    opened = api.open_study(HIDDEN, store=folder / "hidden")
    measurement = api.read_measurement(opened, [BENCH])
    taken: list[float] = []
    plain = Fitter.fit_from

    def timed(self, asked):  # type: ignore[no-untyped-def]
        begun = time.thread_time()
        found = plain(self, asked)
        taken.append(time.thread_time() - begun)
        return found

    api.diagnose(opened, measurement)  # compiles
    with patch.object(Fitter, "fit_from", timed):
        api.diagnose(opened, measurement)
    return tuple(taken)


def candidate_seconds(folder: Path) -> tuple[float, float]:
    """Return CPU seconds of ask and tell for a candidate of the soaked search, and of its evaluation."""
    path, taken, plain = folder / "search.yaml", [], Evaluator.evaluate
    path.write_text(STUDY)

    def timed(self, values, context=-1):  # type: ignore[no-untyped-def]
        begun = time.thread_time()
        found = plain(self, values, context)
        taken.append(time.thread_time() - begun)
        return found

    api.optimize(api.open_study(path, [*LONGER, "search.budget=16"], store=folder / "warm"), workers=1)
    with patch.object(Evaluator, "evaluate", timed):
        begun = time.process_time()
        api.optimize(api.open_study(path, LONGER, store=folder / "search"), workers=1)
        whole = time.process_time() - begun
    return (whole - sum(taken)) / len(taken), sum(taken) / len(taken)


if __name__ == "__main__":
    main()
