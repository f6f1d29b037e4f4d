"""The five benches together: their names, and the printed figures of each.

python -m benchmarks.real.five [BENCH …] [--improve] [--page]     prints, and writes benchmarks/out/<bench>.json

`--improve` looks at the runs that judge once: it belongs to the end of a piece of work, not into it.
"""

from __future__ import annotations

import importlib
import re
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.output import make_parser, write
from benchmarks.real import baselines
from benchmarks.real.measured_bench import MeasuredBench, in_the_world, study_predictor
from benchmarks.real.recordings import publish, table
from benchmarks.real.splits import Part

from pliant.config.measurements import PER_RUN
from pliant.evidence.alignment import Alignment, components
from pliant.records.measurement import Measurement

BENCHES = ("soft_arm", "three_bellow_link", "coiled_muscle", "cable_arm", "silicone_beam")
# Units of printed values: factor and unit by the ending of an output's name.
SHOWN = {"_1_per_m": (1.0, "1/m"), "_m": (1e3, "mm"), "_rad": (180.0 / np.pi, "°")}


def bench_named(name: str) -> MeasuredBench:
    """Return one of the benches by its name."""
    found: MeasuredBench = importlib.import_module(f"benchmarks.real.{name}").BENCH
    return found


def missing(bench: MeasuredBench) -> bool:
    """Return whether a file of the bench is missing, and print it."""
    absent = [path for part in ("train", "judge") for path in bench.files(part) if not path.is_file()]
    if absent:
        print(f"skipped: {absent[0]} is not here")
    return bool(absent)


def run_bench_script(bench: MeasuredBench, doc: str | None) -> None:
    """Run a bench's script."""
    options = make_parser(doc)
    options.add_argument(
        "--improve", action="store_true", help="improve on the training runs, and judge that too"
    )
    report(bench, options.parse_args().improve)


def report(bench: MeasuredBench, improve: bool = False, part: Part = "judge") -> dict[str, Any]:
    """Print `compare` of the training runs and what all models miss on the runs that judge; return the figures.

    Args:
        bench: which.
        improve: also improve on the training runs, and score the resulting study.
        part: "train" tries the script out without a look at the runs that judge.
    """
    if missing(bench):
        return {}
    with tempfile.TemporaryDirectory() as name:
        folder, started = Path(name), time.perf_counter()
        training, judged = bench.read("train"), bench.read(part)
        numbers = bench.fit(bench, training)
        study = bench.study(folder, numbers)
        found = study.compare()
        print(f"== {bench.name}: {numbers}, {time.perf_counter() - started:.0f} s to the comparison\n{found}")
        turns = study_predictor(study).turns
        rows = {"stated law": model_errors(bench, folder, study, numbers, part)}
        orders = {"stated law": "fitted to the training runs"}
        sessions = Alignment.from_measurement(training)
        training, judged = (in_the_world(one, sessions, turns) for one in (training, judged))
        spread: dict[str, float] = {}
        for outputs in groups(training):
            scales = baselines.training_scales(training, outputs)
            spread |= dict(zip(outputs, scales.output_sd.tolist(), strict=True))
            seen, unseen = (
                baselines.standardised_series(training, scales),
                baselines.standardised_series(judged, scales),
            )
            for chosen in baselines.baselines(seen, scales):
                rows.setdefault(chosen.name, {}).update(baselines.errors(chosen, unseen, scales))
                orders[chosen.name] = "; ".join(filter(None, (orders.get(chosen.name, ""), chosen.order)))
        figures: dict[str, Any] = {"numbers": numbers, "orders": orders}
        if improve:
            errors, said = improved_errors(bench, folder, study, numbers, part)
            rows["improve"], orders["improve"] = errors, said["added"]
            figures["improve"] = said
    sizes = by_vector(spread)
    figures["errors"] = {model: by_vector(of) for model, of in rows.items()}
    figures["overall"] = {model: overall(of, sizes) for model, of in figures["errors"].items()}
    for model, of in figures["errors"].items():
        cells = ", ".join(f"{output} {shown(output, of[output])}" for output in sizes if output in of)
        print(f"{model:18s} {figures['overall'][model]:.3f}  {cells}  ({orders[model]})")
    if improve:
        best = min(value for model, value in figures["overall"].items() if model != "improve")
        figures["ratio"] = figures["overall"]["improve"] / best
        print(f"improve / best of the four: {figures['ratio']:.2f}")
    if part == "judge":
        write(bench.name, figures)
    return figures


def overall(errors: Mapping[str, float], sizes: Mapping[str, float]) -> float:
    """Return the root mean square over outputs (a point or a pair is one) of errors over the training runs' spread."""
    return float(np.sqrt(np.mean([(errors[name] / size) ** 2 for name, size in sizes.items()])))


def improved_errors(
    bench: MeasuredBench, folder: Path, study: Any, numbers: Mapping[str, float], part: Part
) -> tuple[dict[str, float], dict[str, Any]]:
    """Return the errors of the study that `improve` writes from the training runs, its additions and their reasons."""
    started = time.perf_counter()
    found = study.improve().record
    effects = [effect.canonical() for effect in found.steps[-1].effects]
    better = study.with_({"effects": effects}) if effects else study
    said = {
        "added": " + ".join(f"{step.named} ({step.cause})" for step in found.steps[1:]) or "nothing",
        "values": {} if found.final is None else dict(found.final.values),
        "stop": found.stop,
        "reason": found.reason,
        "wall_s": time.perf_counter() - started,
    }
    print(f"improve, {said['wall_s']:.0f} s: {said['added']}; {said['values']}; {found.reason}")
    return model_errors(bench, folder, better, numbers, part, effects), said


def groups(measurement: Measurement) -> list[tuple[str, ...]]:
    """Return the outputs that are read together, run by run: each group is predicted by separate models."""
    found = {
        tuple(name for name in measurement.outputs if np.isfinite(run.outputs[name]).any())
        for run in measurement.runs
    }
    return sorted(found)


def model_errors(
    bench: MeasuredBench,
    folder: Path,
    study: Any,
    numbers: Mapping[str, float],
    part: Part,
    effects: Sequence[Any] = (),
) -> dict[str, float]:
    """Return the root mean square errors of a study of the training runs on the runs that judge, SI."""
    there = bench.judged(folder, study, numbers, part)
    predictor = study_predictor(there.with_({"effects": list(effects)}) if effects else there)
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


def page_lines(figures: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the section of the page: a row for each bench."""
    models = ["stated law", "polynomial", "lag + polynomial", "ARX, free run", "improve"]
    models = [model for model in models if any(model in of["overall"] for of in figures.values())]
    rows = []
    for name, of in figures.items():
        known = of["overall"]
        best = min(value for model, value in known.items() if model != "improve")
        cells = [
            "–"
            if model not in known
            else f"**{known[model]:.2f}**"
            if known[model] == best
            else f"{known[model]:.2f}"
            for model in models
        ]
        law = ", ".join(
            f"{output.rpartition('_')[0]} {shown(output, value)}"
            for output, value in of["errors"]["stated law"].items()
        )
        rows.append([f"`{name}`", *cells, law])
    return table(["bench", *models, "stated law, by output"], rows)


def main() -> None:
    """Report the benches that are named, or all; publish them."""
    options = make_parser(__doc__)
    options.add_argument("benches", nargs="*", metavar="BENCH", help=", ".join(BENCHES))
    options.add_argument(
        "--improve", action="store_true", help="improve on the training runs, and judge that too"
    )
    options.add_argument("--page", action="store_true", help="write the page's section too")
    asked = options.parse_args()
    found = {name: report(bench_named(name), asked.improve) for name in asked.benches or BENCHES}
    if asked.page and all(found.values()):
        publish("five", page_lines(found))


if __name__ == "__main__":
    main()
