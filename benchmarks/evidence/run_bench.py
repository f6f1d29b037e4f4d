"""Diagnose many hidden effects and count how often the answer is right.

    python benchmarks/evidence/run_bench.py                    the whole bench, resumed where it stopped
    python benchmarks/evidence/run_bench.py --small            a handful, for CI
    python benchmarks/evidence/run_bench.py --seeds 3 --kinds mullins none
    python benchmarks/evidence/run_bench.py --share 0.5        half of every group; without it later, the other half
    python benchmarks/evidence/run_bench.py --summarise        the tables of what is there
    python benchmarks/evidence/run_bench.py --summarise --publish   and docs/how_often_it_is_right.md with its pictures
    python benchmarks/evidence/run_bench.py --shard 2/4        every fourth set from the second on, beside other shards
    python benchmarks/evidence/run_bench.py --scheduler tcp://host:8786   diagnosers on a dask cluster

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
from benchmarks.evidence.bench import Bench, judged, run
from benchmarks.evidence.judge import ERROR, summary
from benchmarks.evidence.protocols import NAMES
from benchmarks.evidence.publish import as_text, expected_time, publish
from benchmarks.evidence.tasks import Plan, planned, small_plan
from benchmarks.evidence.truths import CLEAN, KINDS, UNKNOWN
from benchmarks.output import parser_of

from pliant.store.store import write_atomically

OUT = Path(__file__).resolve().parents[1] / "out"


COUNTS = {
    "seeds": "sets per effect",
    "clean": "clean sets",
    "unknown": "sets per unknown form",
    "pairs": "sets with two effects",
    "weak": "sets per effect at 0.5 and at 1 σ",
    "poor": "sets per effect under the poor protocol",
    "noload": "sets per effect without load steps",
    "plan": "poor sets that get two more runs, proposed and random",
    "improve": "sets per effect that are improved",
    "other_every": "every this many-th set is made of the kind's other robot; 0: none",
}


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument("--name", help="of the results file; full or small by default")
    parser.add_argument("--small", action="store_true", help="a few of every group, for CI")
    parser.add_argument("--summarise", action="store_true", help="only the tables of what is there")
    parser.add_argument("--publish", action="store_true", help="and write them into docs, with pictures")
    parser.add_argument(
        "--plan-only", action="store_true", help="how many sets of what, and the expected time"
    )
    parser.add_argument("--kinds", nargs="+", choices=(*KINDS, CLEAN, *UNKNOWN), metavar="KIND")
    for name, words in COUNTS.items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=int, help=words)
    parser.add_argument(
        "--share",
        type=_share,
        metavar="0..1",
        help="this part of every group, the first seeds; all by default",
    )
    parser.add_argument("--protocol", choices=NAMES)
    parser.add_argument("--split", choices=("judged", "calibration"))
    parser.add_argument("--workers", type=int, default=2, help="diagnosers at a time")
    parser.add_argument("--scheduler", help="ask on a dask cluster instead: its address or its file")
    parser.add_argument("--shard", type=_shard, default=(1, 1), metavar="I/N", help="only every N-th set")
    parser.add_argument("--diagnoser", default=diagnosers.DEFAULT, help="module with diagnose and improve")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of evidence.json and evidence/")
    parser.add_argument("--fresh", action="store_true", help="forget the results that are there")
    return parser.parse_args(arguments)


def _share(text: str) -> float:
    share = float(text)
    if not 0.0 < share <= 1.0:
        raise ValueError(text)
    return share


def _shard(text: str) -> tuple[int, int]:
    part, count = (int(word) for word in text.split("/"))
    if not 1 <= part <= count:
        raise ValueError(text)
    return part, count


def main(arguments: Sequence[str] | None = None) -> None:
    given = _arguments(arguments)
    chosen = {name: getattr(given, name) for name in (*COUNTS, "protocol", "split", "share")}
    chosen["kinds"] = tuple(given.kinds) if given.kinds else None
    changes = {name: value for name, value in chosen.items() if value is not None}
    plan = replace(small_plan() if given.small else Plan(), **changes)
    name = given.name or ("small" if given.small else "full")
    bench = Bench((given.out / "evidence").resolve(), name, given.diagnoser, given.workers, given.shard)
    if given.plan_only:
        print(expected_time(plan))
        return
    if given.fresh:
        bench.results.unlink(missing_ok=True)
    if not given.summarise:
        run(bench, plan, given.scheduler)
    items = judged(bench, plan)
    data = {**summary(items), "planned": planned(plan)}
    print(as_text(data))
    target = given.out / ("evidence.json" if name == "full" else f"evidence_{name}.json")
    write_atomically(target, json.dumps(data, indent=1))
    if given.publish:
        publish(data)
    if any(item.outcome == ERROR for item in items):
        sys.exit(1)  # errors are no answers


if __name__ == "__main__":
    main()
