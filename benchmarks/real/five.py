"""The five benches together: their names, and what is printed of each.

python -m benchmarks.real.five [BENCH …]
"""

from __future__ import annotations

import importlib
import re
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import parser_of, write
from benchmarks.real import baselines
from benchmarks.real.measured_bench import MeasuredBench, in_the_world, predictor_of

from pliant.config.measurements import PER_RUN
from pliant.evidence.alignment import Alignment, components
from pliant.records.measurement import Measurement

BENCHES = ("soft_arm", "three_bellow_link", "coiled_muscle", "cable_arm", "silicone_beam")
# What is printed in another unit: factor and unit by the ending of an output's name.
SHOWN = {"_1_per_m": (1.0, "1/m"), "_m": (1e3, "mm"), "_rad": (180.0 / np.pi, "°")}


def bench_named(name: str) -> MeasuredBench:
    """Return one of the benches by its name."""
    found: MeasuredBench = importlib.import_module(f"benchmarks.real.{name}").BENCH
    return found


def missing(bench: MeasuredBench) -> bool:
    """Return whether a file of the bench is not here, which is said."""
    absent = [path for part in ("train", "judge") for path in bench.files(part) if not path.is_file()]  # type: ignore[arg-type]
    if absent:
        print(f"skipped: {absent[0]} is not here")
    return bool(absent)


def main_of_bench(bench: MeasuredBench, doc: str | None) -> None:
    """Run what a bench's script does."""
    parser_of(doc).parse_args()
    report(bench)


def report(bench: MeasuredBench) -> None:
    """Print `compare` of the training runs and the errors of the four baselines on the runs that judge."""
    if missing(bench):
        return
    with tempfile.TemporaryDirectory() as name:
        folder, started = Path(name), time.perf_counter()
        training, judged = bench.read("train"), bench.read("judge")
        numbers = bench.fit(bench, training)
        study = bench.study(folder, numbers)
        found = study.compare()
        print(f"== {bench.name}: {numbers}, {time.perf_counter() - started:.0f} s to the comparison")
        print(found)
        predictor = predictor_of(study)
        alignment, turns = Alignment.of(training), predictor.turns
        rows = {"stated law": law_errors(bench, folder, study, numbers)}
        training, judged = (in_the_world(one, alignment, turns) for one in (training, judged))
        orders = {"stated law": "fitted to the training runs"}
        for outputs in groups(training):
            scales = baselines.scales_of(training, outputs)
            seen, unseen = baselines.series_of(training, scales), baselines.series_of(judged, scales)
            for chosen in baselines.baselines(seen, scales):
                rows.setdefault(chosen.name, {}).update(baselines.errors(chosen, unseen, scales))
                orders[chosen.name] = "; ".join(filter(None, (orders.get(chosen.name, ""), chosen.order)))
    rows = {model: by_vector(of) for model, of in rows.items()}
    names = list(rows["stated law"])
    for model, of in rows.items():
        cells = ", ".join(f"{output} {shown(output, of[output])}" for output in names if output in of)
        print(f"{model:18s} {cells}  ({orders[model]})")
    write(bench.name, {"numbers": numbers, "errors": rows, "orders": orders})


def groups(measurement: Measurement) -> list[tuple[str, ...]]:
    """Return the outputs that are read together, run by run: each group is predicted by models of its own."""
    found = {
        tuple(name for name in measurement.outputs if np.isfinite(run.outputs[name]).any())
        for run in measurement.runs
    }
    return sorted(found)


def law_errors(bench: MeasuredBench, folder: Path, study: Any, numbers: Any) -> dict[str, float]:
    """Return the root mean square errors of the stated law on the runs that judge, SI."""
    predictor = predictor_of(bench.judged(folder, study, numbers))
    runs, measured = predictor.predict(), predictor.measurement
    return {
        name: rms(
            [m.outputs[name] - run[name] for m, run in zip(measured.runs, runs, strict=True)],
            measured.free_zeros.get(name) == PER_RUN,
        )
        for name in predictor.outputs
    }


def by_vector(errors: Mapping[str, float]) -> dict[str, float]:
    """Return the errors with those of a point's x, y and z, or of a pair's y and z, as one length."""
    found: dict[str, float] = {}
    for name, value in errors.items():
        parts = components(name)
        if parts and all(part in errors for part in parts):
            length = float(np.sqrt(sum(errors[part] ** 2 for part in parts)))
            found.setdefault(re.sub(r"_[xyz]_", "_", name), length)
        else:
            found[name] = value
    return found


def rms(misses: Sequence[Any], per_run: bool) -> float:
    """Return the root mean square of all runs, each run's mean taken off where its zero is its own."""
    there = [miss[np.isfinite(miss)] for miss in misses]
    kept = [miss - miss.mean() if per_run and len(miss) else miss for miss in there]
    return float(np.sqrt(np.mean(np.concatenate(kept) ** 2)))


def shown(output: str, value: float) -> str:
    """Return an error in the unit in which people read it."""
    factor, unit = next(pair for ending, pair in SHOWN.items() if output.endswith(ending))
    return f"{factor * value:.3g} {unit}"


if __name__ == "__main__":
    for wanted in sys.argv[1:] or BENCHES:
        report(bench_named(wanted))
