"""The judged bench and the co-design study on a dask cluster of two: python -m benchmarks.through_dask

The same judged sets, of a draw that no sealed run has, are diagnosed by two processes and by the cluster; the
gripper of examples/gripper_codesign is searched at a small budget for all six tasks, its winners tried again under
noise, by two processes and by the cluster, each with a separate store. Prints whether the answers and the searches are
the same, and the time of each; writes benchmarks/out/through_dask.json.
"""

from __future__ import annotations

import os

# Before numpy; workers inherit it.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"
os.environ["NUMBA_NUM_THREADS"] = "1"

import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.evidence.run_bench import Bench, answers, run
from benchmarks.evidence.tasks import Plan
from benchmarks.output import make_parser, write
from benchmarks.studies.command import Asked, searched
from benchmarks.studies.gripper_codesign import EXAMPLES, SEED_CONFIRM

DRAW = "through dask"
KEY = "0d" * 32  # one key for both ways: runs that are drawn at random are drawn by it
TIMES = ("wall_s", "cpu_s", "fem_wall_s", "reference_kernel_s", "wall_in_kernels", "whole_wall_s")
APART = {*TIMES, "workers", "machine", "from_store", "cached"}


def diagnosed(folder: Path, share: float, scheduler: str | None) -> list[dict[str, Any]]:
    """Return the answers of a share of the judged plan, by two processes or by a cluster, without their times."""
    plan = replace(Plan(), split="judged", draw=DRAW, share=share)
    bench = Bench(folder, "through_dask")
    folder.mkdir(parents=True)
    (folder / "judge.key").write_text(KEY)
    run(bench, plan, scheduler)
    return without_times(answers(bench, plan))


def designed(store: Path, budget: int, scheduler: str | None) -> dict[str, Any]:
    """Return the search of CMA-ES, by two processes or by a cluster, without its times.

    Raises:
        NotReachedError: nothing feasible was found.
    """
    changes = (f"search.budget={budget}", "search.verify=null", "search.sensitivity=false", SEED_CONFIRM)
    asked = Asked("cmaes", "one gripper for all tasks, by CMA-ES", EXAMPLES / "cmaes.yaml", changes)
    where = (f"workers={{kind: dask, address: {scheduler}}}",) if scheduler else ()
    opened = asked.opened(store, where, quiet=True)
    found, _ = searched(asked, opened, None if scheduler else 2)
    return without_times(found)


def without_times(value: Any) -> Any:
    """Return JSON values without times, hosts and durations."""
    if isinstance(value, dict):
        return {key: without_times(one) for key, one in value.items() if key not in APART}
    return [without_times(one) for one in value] if isinstance(value, list | tuple) else value


def main(arguments: Sequence[str] | None = None) -> int:
    import distributed

    parser = make_parser(__doc__)
    parser.add_argument("--share", type=float, default=0.02, help="of the judged plan")
    parser.add_argument("--budget", type=int, default=48, help="candidates of six grasps each")
    given = parser.parse_args(arguments)
    found: dict[str, dict[str, Any]] = {"answers": {}, "search": {}}
    wall_s: dict[str, dict[str, float]] = {"answers": {}, "search": {}}
    settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with (
        tempfile.TemporaryDirectory(prefix="pliant-dask-") as made,
        distributed.LocalCluster(**settings) as cluster,
    ):
        for name, scheduler in (("two processes", None), ("dask", cluster.scheduler_address)):
            folder = Path(made) / name.replace(" ", "_")
            for what, work in (
                ("answers", partial(diagnosed, folder / "evidence", given.share)),
                ("search", partial(designed, folder / "store", given.budget)),
            ):
                begun = time.perf_counter()
                found[what][name] = work(scheduler)
                wall_s[what][name] = time.perf_counter() - begun
                print(f"{what}, {name}: {wall_s[what][name]:.0f} s", flush=True)
    sets, grasps = len(found["answers"]["dask"]), found["search"]["dask"]["simulations"]
    same = {what: by["two processes"] == by["dask"] for what, by in found.items()}
    print(f"judged bench, {sets} sets: {'the same answers' if same['answers'] else 'OTHER ANSWERS'}")
    print(f"co-design study, {grasps} grasps: {'the same search' if same['search'] else 'ANOTHER SEARCH'}")
    write("through_dask", {"sets": sets, "grasps": grasps, "same": same, "wall_s": wall_s})
    return 0 if all(same.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
