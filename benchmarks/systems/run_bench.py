"""Diagnose hidden effects in systems that others wrote, and count how often the answer is right.

    python -m benchmarks.systems.run_bench --sealed               judged sets that are drawn for this code; resumable
    python -m benchmarks.systems.run_bench                        calibration sets, on which thresholds may be tuned
    python -m benchmarks.systems.run_bench --small            a handful of them of the smallest system
    python -m benchmarks.systems.run_bench --systems reacher --kinds viscous_damping none
    python -m benchmarks.systems.run_bench --summarise        the tables of the existing results

The rules are those of `benchmarks.evidence.run_bench`: sets are made and judged by this process, which has the key;
diagnosers get a study, an MJCF and a CSV. A sealed run is in `benchmarks/systems/ledger.jsonl` when it begins and when
it ends, and stores its answers for the page (`python -m benchmarks.systems.publish`).
"""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.evidence import ledger
from benchmarks.evidence.run_bench import Bench, answers, in_the_ledger, run
from benchmarks.evidence.truths import CLEAN
from benchmarks.output import OUT, make_parser
from benchmarks.systems.form_table import EVERY
from benchmarks.systems.judging import headline, judged_twice, summary
from benchmarks.systems.publish import ANSWERS, LEDGER, as_text
from benchmarks.systems.robots import ROBOTS, present
from benchmarks.systems.tasks import CODE, SystemPlan, make, small_plan

from pliant.store.store import write_atomically

COUNTS = ("kinds", "seeds", "unknown", "clean")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the bench."""
    parser = make_parser(__doc__)
    parser.add_argument("--small", action="store_true", help="a few sets of the smallest system")
    parser.add_argument(
        "--sealed", action="store_true", help="judge this code, on sets drawn for it; in the ledger"
    )
    parser.add_argument("--digest", action="store_true", help="only which code of the diagnosis this is")
    parser.add_argument("--summarise", action="store_true", help="only the tables of what is there")
    parser.add_argument("--plan-only", action="store_true", help="only how many sets of what")
    parser.add_argument("--systems", nargs="+", choices=tuple(ROBOTS), default=(), metavar="SYSTEM")
    parser.add_argument("--kinds", nargs="+", choices=(CLEAN, *EVERY), metavar="KIND")
    parser.add_argument("--seeds", type=int, help="sets per effect")
    parser.add_argument("--unknown", type=int, help="sets per unknown form")
    parser.add_argument("--clean", type=int, help="clean sets")
    parser.add_argument("--share", type=float, default=1.0, help="this part of the sets, 0 to 1")
    parser.add_argument("--workers", type=int, default=2, help="diagnosers at a time")
    parser.add_argument("--name", help="of the results file")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of systems.json and systems/")
    given = parser.parse_args(arguments)
    code = ledger.code_digest(parts=CODE)
    if given.digest:
        print(code)
        return
    changes = {name: getattr(given, name) for name in COUNTS if getattr(given, name)}
    if given.sealed and (
        changes or given.small or given.name or given.systems or not 0.0 < given.share <= 1.0
    ):
        raise SystemExit("a sealed run is the whole plan or a --share of it: leave the other options out")
    plan = small_plan() if given.small else SystemPlan(tuple(r.name for r in present(tuple(given.systems))))
    plan = replace(plan, share=given.share, **changes)
    name = given.name or ("small" if given.small else "full")
    if given.sealed:
        plan, name = replace(plan, split="judged", draw=code), f"sealed-{code}"
    if given.plan_only:
        print(f"{len(plan.tasks())} sets of {', '.join(plan.robots)}")
        return
    stored = ledger.stored_answers(code, ANSWERS) if given.sealed else {}
    folder = (given.out / "systems").resolve()
    bench = Bench(folder, name, workers=given.workers, stored=stored, maker=make, parts=CODE)
    if not given.summarise:
        noted = (
            in_the_ledger(bench, plan, LEDGER, ANSWERS, headline)
            if given.sealed
            else contextlib.nullcontext()
        )
        with noted:
            run(bench, plan)
    data = summary(judged_twice(answers(bench, plan)))
    print(as_text(data))
    write_atomically(
        given.out / f"systems{'' if name == 'full' else f'_{name}'}.json", json.dumps(data, indent=1)
    )
    if data["errors"]:
        sys.exit(1)  # errors are no answers


if __name__ == "__main__":
    main()
