"""Diagnose many hidden effects and count how often the answer is right.

    python benchmarks/evidence/run_bench.py                    the whole bench, resumed where it stopped
    python benchmarks/evidence/run_bench.py --small            a handful, for CI
    python benchmarks/evidence/run_bench.py --seeds 3 --kinds mullins none
    python benchmarks/evidence/run_bench.py --summarise        the tables of what is there

Results are in benchmarks/out/evidence/NAME.jsonl, one line per set, and the tables in benchmarks/out/evidence.json.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

# Before numpy; child processes inherit it. Two diagnosers on two cores must not fight for them.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"
os.environ["NUMBA_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.evidence import diagnosers
from benchmarks.evidence.bench import Bench, judged, run, write
from benchmarks.evidence.judge import ERROR, summary
from benchmarks.evidence.protocols import NAMES
from benchmarks.evidence.tables import tables
from benchmarks.evidence.tasks import Plan, small_plan
from benchmarks.evidence.truths import CLEAN, KINDS, UNKNOWN

OUT = Path(__file__).resolve().parents[1] / "out"


def _plan(given: argparse.Namespace) -> Plan:
    plan = small_plan() if given.small else Plan()
    names = (
        "seeds",
        "clean",
        "unknown",
        "weak",
        "beside",
        "improve",
        "pairs",
        "chain_every",
        "protocol",
        "split",
    )
    changes = {name: getattr(given, name) for name in names if getattr(given, name) is not None}
    if given.kinds:
        changes["kinds"] = tuple(given.kinds)
    return replace(plan, **changes)


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--name", help="of the results file; full or small by default")
    parser.add_argument("--small", action="store_true", help="a handful of sets")
    parser.add_argument("--summarise", action="store_true", help="only the tables of what is there")
    parser.add_argument("--kinds", nargs="+", choices=(*KINDS, CLEAN, *UNKNOWN), metavar="KIND")
    parser.add_argument("--seeds", type=int, help="sets per effect")
    parser.add_argument("--clean", type=int, help="clean sets")
    parser.add_argument("--unknown", type=int, help="sets per unknown form")
    parser.add_argument("--weak", type=int, help="sets per effect at 0.5 and at 1 σ")
    parser.add_argument("--beside", type=int, help="sets per effect under the other protocols")
    parser.add_argument("--improve", type=int, help="sets per effect that are improved")
    parser.add_argument("--pairs", type=int, help="sets with two effects")
    parser.add_argument("--chain-every", type=int, help="every this many-th set is a chain; 0: none")
    parser.add_argument("--protocol", choices=NAMES)
    parser.add_argument("--split", choices=("judged", "calibration"))
    parser.add_argument("--workers", type=int, default=2, help="diagnosers at a time")
    parser.add_argument("--diagnoser", default=diagnosers.DEFAULT, help="module with diagnose and improve")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of evidence.json and evidence/")
    parser.add_argument("--fresh", action="store_true", help="forget the results that are there")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what is left, judge, print the tables, write evidence.json."""
    given = _arguments(arguments)
    plan = _plan(given)
    name = given.name or ("small" if given.small else "full")
    bench = Bench(given.out / "evidence", name, given.diagnoser, given.workers)
    if given.fresh:
        bench.results.unlink(missing_ok=True)
    if not given.summarise:
        run(bench, plan)
    items = judged(bench, plan)
    data = summary(items)
    print(tables(data))
    target = given.out / ("evidence.json" if name == "full" else f"evidence_{name}.json")
    write(target, json.dumps(data, indent=1))
    if any(item.outcome == ERROR for item in items):
        sys.exit(1)  # errors are no answers


if __name__ == "__main__":
    main()
