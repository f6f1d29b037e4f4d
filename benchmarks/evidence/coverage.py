"""Coverage of readings of unseen runs by their 90 % band, and the normal approximation compared with a sampler.

    OMP_NUM_THREADS=1 python -m benchmarks.evidence.coverage [--count 50] [--sampled 2] [--bed law_off]

Sets of the calibration split, each with one hidden effect whose form is not the fitted one: runs are held out as by
`pliant improve`, the right effect is fitted to the others, and the band is evaluated on the held-out runs. Prints, and
writes benchmarks/out/band_coverage.json, of laws that are off band_coverage_law_off.json.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.evidence.sets import SetSpec, make_set
from benchmarks.evidence.tasks import BEDS, group_tasks
from benchmarks.output import Bar, make_parser, write

from pliant import api
from pliant.diagnosis.bands import bands
from pliant.diagnosis.data_split import split_runs
from pliant.diagnosis.extension import Extension, Ground, extend
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.sampler import sample_posterior
from pliant.records.measurement import Measurement
from pliant.store.store import write_atomically

LEAST, MOST = 0.85, 0.95
STEPS = 300  # of the sampler's walkers
MOST_PARAMETERS = 3  # of a sampled fit


def main(arguments: Sequence[str] | None = None) -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--count", type=int, default=50, help="sets, kinds in turn")
    parser.add_argument("--sampled", type=int, default=2, help="sets that are sampled, too")
    parser.add_argument("--bed", choices=BEDS, default="exact", help="laws that are exact, or off in shape")
    given = parser.parse_args(arguments)
    rows: list[dict[str, Any]] = []
    for task in group_tasks("effect", given.count, "calibration", given.bed):
        rows.append(covered(task.spec, sampled=len([r for r in rows if "sampled" in r]) < given.sampled))
        print(" ".join(f"{key} {_text(value)}" for key, value in rows[-1].items()), flush=True)
    aside = np.array([row["aside"] for row in rows])
    unseen = np.array([row["unseen"] for row in rows if row["unseen"] is not None])
    what = f"readings of runs held out within their 90 % band, {len(rows)} calibration sets"
    bars = [
        Bar(what, float(aside.mean()), LEAST, "%", at_most=False, scale=100.0),
        Bar(what, float(aside.mean()), MOST, "%", scale=100.0),
        Bar(
            "the same, of conditions in no other run",
            float(unseen.mean()),
            LEAST,
            "%",
            at_most=False,
            scale=100.0,
        ),
        Bar("the same, of conditions in no other run", float(unseen.mean()), MOST, "%", scale=100.0),
        Bar(
            "the same, the worst tenth of the sets",
            float(np.quantile(aside, 0.1)),
            0.8,
            "%",
            at_most=False,
            scale=100.0,
        ),
    ]
    write("band_coverage" + ("" if given.bed == "exact" else f"_{given.bed}"), {"sets": rows}, bars)


def covered(spec: SetSpec, sampled: bool = False) -> dict[str, Any]:
    """Return the coverage of one set: of held-out runs, of conditions in no other run, and of fitted runs."""
    with tempfile.TemporaryDirectory() as folder:
        made = make_set(spec)
        write_atomically(Path(folder) / "study.yaml", made.study)
        write_atomically(Path(folder) / "bench.csv", made.csv)
        opened = api.open_study(Path(folder) / "study.yaml", store=Path(folder) / "store")
        measurement = api.read_measurement(opened, [Path(folder) / "bench.csv"])
        split = split_runs(measurement)
        ground = Ground.from_study(opened.context, opened.study, split.training)
        found = extend(ground, opened.study.effects, made.label["kinds"], profiles=sampled)
    band = bands(ground.predictor, found.posterior, found.scatter)

    def held(runs: Sequence[int]) -> float | None:
        chosen = Measurement(tuple(measurement.runs[k] for k in runs), measurement.outputs)
        shares = band.select_runs(runs).held(replace(chosen, marker_arms_m=measurement.marker_arms_m))
        return float(np.mean(list(shares.values()))) if shares else None

    fitted = [k for k in range(len(measurement.runs)) if k not in split.runs]
    row = {
        "kind": spec.kind,
        "seed": spec.seed,
        "aside": held(split.runs),
        "unseen": held(split.unseen),
        "fitted": held(fitted),
        "normal": found.normal,
    }
    if sampled and found.normal and len(found.fit.x) <= MOST_PARAMETERS:
        row["sampled"] = _sampled(ground, opened.study.effects, found)
    return row


def _sampled(ground: Ground, effects: Any, found: Extension) -> dict[str, Any]:
    """Compare the sampler's mean and spread with the approximation's, in its standard deviations."""
    fitter = Fitter(ground.predictor, ground.readings(effects))
    walk = sample_posterior(fitter, found.fit, found.noise.n_effective, STEPS)
    sd = np.sqrt(np.diag(found.posterior.covariance))
    return {
        "mean_off": ((walk.x.mean(axis=0) - found.posterior.x) / sd).tolist(),
        "sd_factor": (walk.x.std(axis=0) / sd).tolist(),
        "worth": walk.worth,
    }


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return " ".join(f"{key} {_text(one)}" for key, one in value.items())
    if isinstance(value, list):
        return "[" + ", ".join(map(_text, value)) + "]"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    main()
