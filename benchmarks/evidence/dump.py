"""Write sets with open labels for tuning the diagnosis: of the calibration split, never of judged sets.

    python -m benchmarks.evidence.dump --split calibration --group pair --count 40 --out FOLDER
    python -m benchmarks.evidence.dump --bed law_off --group clean --count 4 --out FOLDER

writes NNN_study.yaml, NNN.csv and NNN_label.json for each set of the group, with the kinds mixed.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.evidence.sets import make_set
from benchmarks.evidence.tasks import BEDS, GROUPS, Task, group_tasks
from benchmarks.output import make_parser

from pliant.store.store import write_atomically


def dump(tasks: Sequence[Task], folder: Path) -> Iterator[str]:
    """Write the sets; what each hides, as they come."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, task in enumerate(tasks):
        label = folder / f"{number:03d}_label.json"
        if label.exists():
            continue
        try:
            made = make_set(task.spec, name=f"set-{number:03d}")
        except RuntimeError as error:
            yield f"{number:03d} {task.spec.kind}: no set, {error}"
            continue
        write_atomically(folder / f"{number:03d}_study.yaml", made.study)
        write_atomically(folder / f"{number:03d}.csv", made.csv)
        write_atomically(label, json.dumps({"group": task.group, **made.label}, indent=1))
        what, spec = " + ".join(made.label["forms"]), task.spec
        law = f", law off by {spec.law_error:.2%} ({made.label['law_snr']:.2f} σ)" if spec.law_error else ""
        said = f"{made.label['snr_reached']:.2f} σ{law}"
        yield f"{number:03d} {spec.kind} ({what}) {spec.engine} {spec.robot} {said}"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--group", choices=GROUPS, required=True)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--split", choices=("calibration", "judged"), default="calibration")
    parser.add_argument("--bed", choices=BEDS, default="exact", help="laws that are exact, or off in shape")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args(arguments)
    for line in dump(group_tasks(given.group, given.count, given.split, given.bed), given.out):
        print(line, flush=True)


if __name__ == "__main__":
    main()
