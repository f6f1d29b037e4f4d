"""How the engines scale: modules in a chain, and designs in a batch.

    python -m benchmarks.physics.scaling      prints, and writes benchmarks/out/physics_scaling.json

Helices of 8 to 256 modules of the study's sizes under their own weight. Times are CPU seconds of
`apply` and `settle`; designs per second are by the clock.
"""

from __future__ import annotations

import os
import statistics
import time
from typing import Any

from benchmarks.output import engine, settle, write
from benchmarks.physics.helix import helix, helix_law, inputs, of_size, random_cases

from pliant.errors import UserError
from pliant.interfaces.physics import PhysicsBackend
from pliant.records.chain import ChainModel

MODULES = (8, 16, 32, 64, 128, 256)
BATCHES = (1, 2, 8, 32, 128, 512)
# An engine that took longer than this on a chain is not asked for the next, longer one.
PATIENCE_S = 2.0


def modules() -> list[dict[str, Any]]:
    """Time to the settled state per engine and size, with the residual reached, or why there is none."""
    engines = {kind: engine(kind) for kind in ("quasistatic", "mujoco", "pybullet")}
    law, rows, given_up = helix_law(), list[dict[str, Any]](), set[str]()
    print(f"{'modules':>7}  " + "".join(f"{kind:>34}" for kind in engines))
    for count in MODULES:
        chain, cells = helix(law, of_size(count)), []
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
    """Designs per second of `settle_batch`, models built included, the machine's cores against one: best of five.

    Where other programs use the cores, CPU seconds per second say how much of them was left.
    """
    backend = engine("quasistatic")
    cases = random_cases(max(BATCHES), seed=1, modules=(18, 26))
    backend.settle_batch(cases[:2])
    cores, before = os.cpu_count() or 1, os.sched_getaffinity(0)
    rows = []
    print(f"designs of 18 to 26 modules; designs/s on 1 thread, on {cores} (in brackets: cores that it got)")
    for count in BATCHES:
        rates, got = {}, {}
        for threads in (1, cores):
            # Threads made meanwhile stay on these cores.
            os.sched_setaffinity(0, set(sorted(before)[:threads]))
            runs = []
            for _ in range(5):
                start, busy = time.perf_counter(), time.process_time()
                backend.settle_batch(cases[:count])
                wall = time.perf_counter() - start
                runs.append((count / wall, (time.process_time() - busy) / wall))
            rates[str(threads)], got[str(threads)] = max(runs)
            os.sched_setaffinity(0, before)
        rows.append({"designs": count, "per_s": rates, "cores_got": got})
        print(f"{count:7d}  " + "".join(f"{rates[k]:10.0f} ({got[k]:.2f})" for k in rates), flush=True)
    return rows


if __name__ == "__main__":
    write("physics_scaling", {"modules": modules(), "designs": designs()})
