"""One search by one process, by two, and by a dask cluster of two: python -m benchmarks.search_workers [--budget 4860]

The search is that of examples/shape_matching/integers.yaml, whose budget is 4 860 candidates, without its check by FEM.
Each variant has a separate store, which a search of a few candidates has filled with the FEM and the laws of its
designs before. Timed is the stage `search`, as recorded in the store: starting the workers, every candidate,
evaluations of the best one; the time of the whole command, with its report, is also printed. Compared are the history
of all candidates and the best design. Hosts without a common file system: `tests/endtoend/test_two_hosts.py`. Prints
ratios to one process and writes benchmarks/out/search_workers.json.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.output import ROOT, Bar, make_parser, write

STUDY = ROOT / "examples" / "shape_matching" / "integers.yaml"
FEW = 8


def searched(folder: Path, budget: int, *workers: str) -> tuple[float, float, dict[str, Any]]:
    """Return wall time of the stage and of the command, and the result.

    Raises:
        RuntimeError: the command did not end well.
    """
    store, out, found = folder / "store", folder / "out", folder / "found.json"
    before = set(store.glob("search/*/manifest.json"))
    asked = [str(STUDY), f"search.budget={budget}", "search.verify=null", *workers]
    place = ["--store", str(store), "--out", str(out), "--json", str(found), "--quiet"]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    begun = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "pliant", "optimize", *asked, *place],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, **threads},
        check=False,
    )
    command_s = time.perf_counter() - begun
    if done.returncode != 0:
        raise RuntimeError(f"the search ended with {done.returncode}: {done.stderr[-2000:]}")
    (manifest,) = set(store.glob("search/*/manifest.json")) - before
    rows = [line.split(",") for line in (out / "history.csv").read_text(encoding="utf-8").splitlines()]
    timed = {k for k, name in enumerate(rows[0]) if name.endswith("wall_s")}
    history = [[cell for k, cell in enumerate(row) if k not in timed] for row in rows]
    best = json.loads(found.read_text(encoding="utf-8"))["best"]
    stage_s = float(json.loads(manifest.read_text(encoding="utf-8"))["wall_s"])
    return stage_s, command_s, {"history": history, "best": best}


def main(arguments: Sequence[str] | None = None) -> int:
    import distributed

    parser = make_parser(__doc__)
    parser.add_argument("--budget", type=int, default=4860, help="candidates")
    given = parser.parse_args(arguments)
    folder = Path(tempfile.mkdtemp(prefix="pliant-search-"))
    found, stage_s, command_s = {}, {}, {}
    try:
        (folder / "first").mkdir()
        searched(folder / "first", FEW, "--workers", "2")
        settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
        with distributed.LocalCluster(**settings) as cluster:
            ways = {
                "one process": ("--workers", "1"),
                "two processes": ("--workers", "2"),
                "dask, two workers": ("--scheduler", cluster.scheduler_address),
            }
            for name, workers in ways.items():
                here = folder / name.replace(" ", "_").replace(",", "")
                here.mkdir()
                shutil.copytree(folder / "first" / "store", here / "store")
                stage_s[name], command_s[name], found[name] = searched(here, given.budget, *workers)
                gain = stage_s["one process"] / stage_s[name]
                print(
                    f"{name}: {stage_s[name]:.1f} s, {gain:.2f} times one process; "
                    f"the whole command {command_s[name]:.1f} s",
                    flush=True,
                )
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    same = all(one == found["one process"] for one in found.values())
    print("the same candidates and the same best design" if same else "NOT the same candidates")
    gains = {name: stage_s["one process"] / wall for name, wall in stage_s.items()}
    bars = [
        Bar("two processes", gains["two processes"], 1.8, "times", at_most=False),
        Bar("dask, two workers", gains["dask, two workers"], 1.6, "times", at_most=False),
    ]
    print(*bars, sep="\n")
    times = {"stage_s": stage_s, "command_s": command_s}
    write("search_workers", {"budget": given.budget, **times, "same": same, "bars": [b.json() for b in bars]})
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
