"""Time of a design's FEM against an older checkout: python -m benchmarks.families.fem_speed --baseline DIR

Each design is solved alternately by the checkout at DIR and by this one, each in a separate process with one thread,
`--pairs` times. Printed are processor seconds and their ratio pair by pair (wall times of a shared machine vary too
much), states and corrections, the distribution of the time, and the difference of the two data sets: every column, as a
share of its largest value.

    git worktree add DIR 2087817

(a) the reference bending bellow, adaptive states
(b) the reference helical bellow on three axes; 24 designs of a grid take 24 times as long

Prints the figures and writes them to benchmarks/out/fem_speed.json.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import ROOT, make_parser, write

DESIGNS = ("bending", "helical")
COLUMNS = ("actuation", "deformation", "tau", "dtau_dp", "dtau_du", "energy_j", "travel")
# Timed methods: class, method, name; those that a checkout lacks are left out.
PHASES = (
    ("pliant_plugins.fem.skfem.assembly", "Assembler", "__init__", "setting up"),
    ("pliant_plugins.fem.skfem.assembly", "Assembler", "elastic_energy", "assembly"),
    ("pliant_plugins.fem.skfem.assembly", "Assembler", "travels", "cavities"),
    ("pliant_plugins.fem.skfem.linear", "Pardiso", "__init__", "opening MKL"),
    ("pliant_plugins.fem.skfem.linear", "Pardiso", "solve", "factorising"),
    ("pliant_plugins.fem.skfem.linear", "Pardiso", "again", "chord steps"),
    ("pliant_plugins.fem.rod_solver", "RodSolver", "_expected", "foretelling"),
    ("pliant.pipeline.sampling.gaussian", "", "fit", "choosing states"),
)


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--baseline", type=Path, help="an older checkout; without it this one alone is timed")
    parser.add_argument("--pairs", type=int, default=2, help="how often each design is solved by both")
    parser.add_argument("--designs", nargs="*", choices=DESIGNS, default=DESIGNS)
    parser.add_argument("--child", choices=DESIGNS, help="used by the benchmark itself")
    options = parser.parse_args()
    if options.child:
        print(json.dumps(timed(options.child)))
        return
    results = {}
    for design in options.designs:
        trees = {"now": ROOT, **({"before": options.baseline.resolve()} if options.baseline else {})}
        runs: dict[str, list[dict[str, Any]]] = {name: [] for name in trees}
        for _ in range(options.pairs):
            for name, tree in trees.items():
                runs[name].append(solved_by(tree, design))
        results[design] = told(design, runs)
    write("fem_speed", results)


def solved_by(tree: Path, design: str) -> dict[str, Any]:
    """Solve one design in a process over the checkout `tree`."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    path = os.pathsep.join(str(tree / part) for part in ("core", "plugins", ""))
    command = [sys.executable, str(Path(__file__).resolve()), "--child", design]
    done = subprocess.run(
        command, cwd=tree, env=os.environ | threads | {"PYTHONPATH": path}, capture_output=True, text=True
    )
    if done.returncode:
        sys.exit(f"fem_speed: {design} failed in {tree}: {done.stderr.strip()[-500:]}")
    return dict(json.loads(done.stdout.splitlines()[-1]))


def timed(design: str) -> dict[str, Any]:
    """Return a design's data with its processor time, in this process."""
    from benchmarks.families import sampling

    family = {"bending": sampling.BENDING, "helical": sampling.HELICAL}[design]
    registry = sampling.discover()
    # compiled code is loaded and MKL opened before the clock starts on what is solved
    sampling.solved(registry, sampling.BENDING, max_states=8, check_states=0)
    spent: Counter[str] = Counter()
    for phase in PHASES:
        _watched(*phase, spent)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        begun = time.process_time()
        data, _ = sampling.solved(registry, family)
        used = time.process_time() - begun
        os.chdir("/")
    columns = {name: np.asarray(getattr(data, name)).tolist() for name in COLUMNS}
    corrections, count = int(data.iterations.sum()), int((data.iterations > 0).sum())
    phases = {**spent, "all else": used - sum(spent.values())}
    return {
        "processor_s": used,
        "states": count,
        "corrections": corrections,
        "phases": phases,
        "columns": columns,
    }


def _watched(module: str, owner: str, name: str, label: str, spent: Counter[str]) -> None:
    """Count the processor time of calls of a function, those within others of the list not twice."""
    from importlib import import_module

    place: Any = import_module(module)
    place = getattr(place, owner) if owner else place
    plain: Callable[..., Any] | None = getattr(place, name, None)
    if plain is None:
        return
    function = plain

    def watched(*values: Any, **options: Any) -> Any:
        begun, others = time.process_time(), sum(spent.values())
        try:
            return function(*values, **options)
        finally:
            spent[label] += time.process_time() - begun - (sum(spent.values()) - others)

    setattr(place, name, watched)


def told(design: str, runs: dict[str, list[dict[str, Any]]]) -> dict[str, Any]:
    """Print one design; its figures."""
    row: dict[str, Any] = {}
    for name, found in runs.items():
        seconds = [run["processor_s"] for run in found]
        phases = {label: round(value, 2) for label, value in found[-1]["phases"].items()}
        row[name] = {
            "processor_s": seconds,
            "states": found[-1]["states"],
            "corrections": found[-1]["corrections"],
            "phases": phases,
        }
        print(
            f"{design}, {name}: {', '.join(f'{s:.1f}' for s in seconds)} s of processor time, "
            f"{found[-1]['states']} states solved, {found[-1]['corrections']} corrections"
        )
        print("    " + ", ".join(f"{label} {value:.1f}" for label, value in phases.items()))
    if "before" in runs:
        ratios = [
            old["processor_s"] / new["processor_s"]
            for old, new in zip(runs["before"], runs["now"], strict=True)
        ]
        apart = differences(runs["before"][-1]["columns"], runs["now"][-1]["columns"])
        row |= {"ratios": ratios, "differences": apart}
        print(
            f"    before / now: {', '.join(f'{r:.2f}' for r in ratios)}, median {statistics.median(ratios):.2f}"
        )
        print(f"    largest difference {max(apart.values()):.1e} of a column's largest value")
    return row


def differences(before: dict[str, Any], now: dict[str, Any]) -> dict[str, float]:
    """Return the largest difference of each column as a share of its largest value; infinite for other states."""
    found = {}
    for name in COLUMNS:
        a, b = (np.array(columns[name], float) for columns in (before, now))
        same = a.shape == b.shape
        found[name] = float(np.nanmax(np.abs(a - b)) / np.nanmax(np.abs(a))) if same else float("inf")
    return found


if __name__ == "__main__":
    main()
