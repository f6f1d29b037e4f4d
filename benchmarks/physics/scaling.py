"""How the engines scale: modules in a chain, and designs in a batch.

    python -m benchmarks.physics.scaling      prints, and writes benchmarks/out/physics_scaling.json

Helices of 8 to 256 modules of the study's sizes under their own weight. Times are CPU seconds of
`apply` and `settle`; designs per second are by the clock.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import statistics
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from benchmarks.output import write
from benchmarks.physics.helix import helix, helix_law, inputs, of_size
from benchmarks.physics.random_designs import random_cases

from pliant.errors import UserError
from pliant.interfaces.physics import Case, PhysicsBackend
from pliant.records.chain import ChainModel
from pliant_plugins.physics.mujoco.backend import Mujoco
from pliant_plugins.physics.mujoco.config import MujocoConfig
from pliant_plugins.physics.pybullet.backend import Pybullet
from pliant_plugins.physics.pybullet.config import PybulletConfig
from pliant_plugins.physics.quasistatic.backend import Quasistatic
from pliant_plugins.physics.quasistatic.config import QuasistaticConfig

MODULES = (8, 16, 32, 64, 128, 256)
BATCHES = (1, 2, 8, 32, 128, 512)
# An engine that took longer than this on a chain is not asked for the next, longer one.
PATIENCE_S = 2.0


def main() -> None:
    """Both tables."""
    chains = modules()
    batches = designs()
    write("physics_scaling", {"modules": chains, "designs": batches})


def modules() -> list[dict[str, Any]]:
    """Time to the settled state per engine and size, with the residual reached, or why there is none."""
    engines: list[PhysicsBackend] = [
        Quasistatic(QuasistaticConfig()),
        Mujoco(MujocoConfig()),
        Pybullet(PybulletConfig()),
    ]
    law = helix_law()
    rows = []
    print(f"{'modules':>7}  " + "".join(f"{engine.config.kind:>34}" for engine in engines))
    given_up: set[str] = set()
    for count in MODULES:
        chain = helix(law, of_size(count))
        cells = []
        for engine in engines:
            kind = engine.config.kind
            row: dict[str, Any] = {"modules": count, "engine": kind}
            row |= {"skipped": "not asked, slow before"} if kind in given_up else _settle(engine, chain)
            rows.append(row)
            if row.get("cpu_s", 0.0) > PATIENCE_S:
                given_up.add(kind)
            cells.append(_cell(row))
        print(f"{count:7d}  " + "".join(f"{cell:>34}" for cell in cells), flush=True)
    for row in rows:
        if "refused" in row:
            print(f"  {row['engine']}, {row['modules']} modules: {row['refused']}")
    return rows


def designs() -> list[dict[str, Any]]:
    """Designs per second of `settle_batch`, the machine's cores against one."""
    backend = Quasistatic(QuasistaticConfig())
    cases = random_cases(max(BATCHES), seed=1, modules=(18, 26))
    backend.settle_batch(cases[:2])
    cores = os.cpu_count() or 1
    rows = []
    print(f"designs of 18 to 26 modules; designs/s on 1 thread, on {cores} (in brackets: cores that it got)")
    for count in BATCHES:
        rates, got = {}, {}
        for threads in (1, cores):
            with _cores(threads):
                rates[str(threads)], got[str(threads)] = _rate(backend, cases[:count])
        rows.append({"designs": count, "per_s": rates, "cores_got": got})
        print(f"{count:7d}  " + "".join(f"{rates[k]:10.0f} ({got[k]:.2f})" for k in rates), flush=True)
    return rows


def _rate(backend: PhysicsBackend, cases: Sequence[Case]) -> tuple[float, float]:
    """Designs per second, building their models included, and CPU seconds per second: the best of five.

    Where other programs use the cores, the second figure says how much of them was left.
    """
    runs = []
    for _ in range(5):
        start, busy = time.perf_counter(), time.process_time()
        backend.settle_batch(cases)
        wall = time.perf_counter() - start
        runs.append((len(cases) / wall, (time.process_time() - busy) / wall))
    return max(runs)


def _settle(engine: PhysicsBackend, chain: ChainModel) -> dict[str, Any]:
    times: list[float] = []
    try:
        while len(times) < 5 and sum(times) < PATIENCE_S:
            with engine.build(chain) as simulation:
                start = time.process_time()
                simulation.apply(inputs(0.0))
                final = simulation.settle()
                times.append(time.process_time() - start)
    except UserError as error:
        return {"refused": str(error)}
    return {
        "cpu_s": statistics.median(times),
        "residual_n_m": final.residual,
        "converged": final.converged,
        "iterations": final.iterations,
    }


def _cell(row: dict[str, Any]) -> str:
    if "cpu_s" not in row:
        return "refused" if "refused" in row else row["skipped"]
    verdict = "" if row["converged"] else "NOT CONVERGED "
    return f"{verdict}{row['cpu_s'] * 1e3:.2f} ms, {row['residual_n_m']:.0e} N·m"


@contextmanager
def _cores(count: int) -> Iterator[None]:
    """Keep this process on so many cores; threads made meanwhile stay there."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, set(sorted(before)[:count]))
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


if __name__ == "__main__":
    main()
