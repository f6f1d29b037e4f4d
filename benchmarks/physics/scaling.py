"""How the engines scale: modules in a chain, and designs in a batch.

    python -m benchmarks.physics.scaling      prints, and writes benchmarks/out/physics_scaling.json

Helices of 8 to 256 modules of the study's sizes under their own weight. Times are CPU seconds of
`apply` and `settle`; designs, rollouts and laws per second are by the clock, on one core and on all.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from benchmarks.output import Bar, engine, settle, write
from benchmarks.physics.helix import PRESSURE_PA, helix, helix_law, inputs, random_cases, sized_segments

from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend, Run
from pliant.records.chain import ChainModel
from pliant.records.history import History

MODULES = (8, 16, 32, 64, 128, 256)
BATCHES = (1, 2, 8, 32, 128, 512)
HISTORIES, LAWS, STATES = (4, 32), (4, 32), 20_000
# An engine that took longer than this on a chain is not run on the next, longer one.
PATIENCE_S = 2.0


def modules() -> list[dict[str, Any]]:
    """Return the time to the settled state per engine and size with the residual, or the reason of a failure."""
    engines = {kind: engine(kind) for kind in ("quasistatic", "mujoco", "pybullet")}
    law, rows, given_up = helix_law(), list[dict[str, Any]](), set[str]()
    print(f"{'modules':>7}  " + "".join(f"{kind:>34}" for kind in engines))
    for count in MODULES:
        chain, cells = helix(law, sized_segments(count)), []
        for kind, backend in engines.items():
            found = {"skipped": "not asked, slow before"} if kind in given_up else _settled(backend, chain)
            rows.append({"modules": count, "engine": kind, **found})
            if found.get("cpu_s", 0.0) > PATIENCE_S:
                given_up.add(kind)
            if "cpu_s" in found:
                verdict = "" if found["converged"] else "NOT CONVERGED "
                cells.append(f"{verdict}{found['cpu_s'] * 1e3:.2f} ms, {found['residual_n_m']:.0e} N·m")
            else:
                cells.append("refused" if "refused" in found else found["skipped"])
        print(f"{count:7d}  " + "".join(f"{cell:>34}" for cell in cells), flush=True)
    for row in rows:
        if "refused" in row:
            print(f"  {row['engine']}, {row['modules']} modules: {row['refused']}")
    return rows


def _settled(backend: PhysicsBackend, chain: ChainModel) -> dict[str, Any]:
    times: list[float] = []
    try:
        while len(times) < 5 and sum(times) < PATIENCE_S:
            final, cpu_s = settle(backend, chain, inputs(0.0))
            times.append(cpu_s)
    except UserError as error:
        return {"refused": str(error)}
    found = {"residual_n_m": final.residual, "converged": final.converged, "iterations": final.iterations}
    return {"cpu_s": statistics.median(times), **found}


def designs() -> list[dict[str, Any]]:
    """Return designs per second of `settle_batch`, models built included."""
    backend = engine("quasistatic")
    cases = random_cases(max(BATCHES), seed=1, modules=(18, 26))
    backend.settle_batch(cases[:2])
    print("designs of 18 to 26 modules, settled, per second")
    return [_on_cores("designs", n, partial(backend.settle_batch, cases[:n])) for n in BATCHES]


def rollouts() -> list[dict[str, Any]]:
    """Return the number of 1 s histories per second of MuJoCo's `rollout_batch`, a helix with varied pressures."""
    backend, chain = engine("mujoco"), helix(helix_law(), sized_segments(8))
    time_s = np.linspace(0.0, 1.0, 21)
    tops = PRESSURE_PA * np.linspace(0.2, 1.0, max(HISTORIES))
    runs = [Run(chain, History.from_arrays({"pressure_pa": top * time_s}, time_s)) for top in tops]
    backend.rollout_batch(runs[:2])
    print("histories of 1 s of a helix of 8 modules, rolled out, per second")
    return [_on_cores("rollouts", n, partial(backend.rollout_batch, runs[:n])) for n in HISTORIES]


def laws() -> list[dict[str, Any]]:
    """Return laws per second, each evaluated at `STATES` states, in a thread per core."""
    random = np.random.default_rng(0)
    actuation, turns = PRESSURE_PA * random.random(STATES), random.uniform(-0.3, 0.3, (STATES, 3))
    each = [case.chain.laws[0] for case in random_cases(max(LAWS), seed=2, modules=(6, 6))]
    each[0].evaluate(actuation, turns)

    def work(count: int) -> None:
        with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
            list(pool.map(lambda law: law.evaluate(actuation, turns), each[:count]))

    print(f"laws of three axes, evaluated at {STATES} states, per second")
    return [_on_cores("laws", n, partial(work, n)) for n in LAWS]


def _on_cores(what: str, count: int, work: Callable[[], Any]) -> dict[str, Any]:
    """Return rates on one core and on all, the best of five each, and the cores used besides other programs."""
    cores, before = os.cpu_count() or 1, os.sched_getaffinity(0)
    rates, got = {}, {}
    for threads in (1, cores):
        # Threads made meanwhile stay on these cores.
        os.sched_setaffinity(0, set(sorted(before)[:threads]))
        runs = []
        for _ in range(5):
            start, busy = time.perf_counter(), time.process_time()
            work()
            wall = time.perf_counter() - start
            runs.append((count / wall, (time.process_time() - busy) / wall))
        rates[str(threads)], got[str(threads)] = max(runs)
        os.sched_setaffinity(0, before)
    gain = rates[str(cores)] / rates["1"]
    cells = "".join(f"{rates[k]:10.0f} on {k} (cores that it got: {got[k]:.2f})" for k in rates)
    print(f"{count:7d}  {cells}   gain {gain:.2f}", flush=True)
    return {what: count, "per_s": rates, "cores_got": got, "gain": gain}


if __name__ == "__main__":
    batches = {"designs": designs(), "rollouts": rollouts(), "laws": laws()}
    last = [
        Bar(f"{name} on all cores, gain", rows[-1]["gain"], 1.85, "times", at_most=False)
        for name, rows in batches.items()
    ]
    print(*last, sep="\n")
    write("physics_scaling", {"modules": modules(), **batches, "bars": [bar.json() for bar in last]})
