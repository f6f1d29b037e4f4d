"""Reduction of the error on unseen runs by a learned term, for hidden forms that are no effect's.

    python -m benchmarks.evidence.learned [--seeds 2] [--kinds gain_bump …]

Sets of the calibration split of every unknown form are made as the bench makes them (one joint, rich protocol,
compiled truth). Each is evaluated twice, for the unchanged model:

- *unseen runs*: a quarter of the runs is held out as by `pliant improve`, the term is learned from the others, and the
  error on the held-out runs is taken over the noise floor of all runs, without and with it;
- *outside its data*: all readings above `REACH` of the largest pressure are hidden, the term is learned from the
  others, and the error on the hidden ones with the term is taken over that without.

If no term is offered both are those without. Printed: each set, then the medians; in benchmarks/out/learned.json.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from benchmarks.evidence.sets import SetSpec, make_set
from benchmarks.evidence.truths import UNKNOWN
from benchmarks.output import Bar, write

from pliant import api
from pliant.diagnosis.data_split import split_runs
from pliant.diagnosis.learned_term import LearnedTerm, learn
from pliant.diagnosis.left_out import condition_indices
from pliant.diagnosis.noise import noise_view
from pliant.diagnosis.readings import readings_over_floor, score
from pliant.evidence.error_bins import run_residuals
from pliant.evidence.prediction import Predictor
from pliant.measurements.repeats import repeat_groups
from pliant.records.measurement import Measurement

REACH = 0.7
MOST = 1.3
PUSHED = "pressure_pa"


@dataclass(frozen=True)
class Answer:
    """Result of a set: the learned term, RMS errors over the floor on held-out runs, the ratio outside its data."""

    kind: str
    seed: int
    learned: str
    without: float
    with_it: float
    outside: float
    wall_s: float


def main() -> None:
    """Make the sets, learn, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2, help="sets per unknown form")
    parser.add_argument("--kinds", nargs="*", default=list(UNKNOWN), help="unknown forms")
    asked = parser.parse_args()
    rows = []
    for kind in asked.kinds:
        for seed in range(asked.seeds):
            rows.append(answer(kind, seed))
            print(line(rows[-1]), flush=True)
    told = summary(rows)
    for name, value in told.items():
        print(f"{name}: {value:.2f}")
    bars = [
        Bar("error on unseen runs over the floor, median", told["with, median"], MOST, "times"),
        Bar("outside its data: with over without, median", told["outside, median"], 1.0, "times"),
    ]
    write("learned", {"sets": [asdict(row) for row in rows], "summary": told}, bars)


def answer(kind: str, seed: int) -> Answer:
    """Make one set and ask it both ways."""
    started = time.perf_counter()
    made = make_set(SetSpec(kind, seed, split="calibration"), "learned")
    with tempfile.TemporaryDirectory() as folder:
        study, csv = Path(folder) / "set.yaml", Path(folder) / "set.csv"
        study.write_text(made.study)
        csv.write_text(made.csv)
        opened = api.open_study(study, store=Path(folder))
        whole = api.read_measurement(opened, csv)
        locked = split_runs(whole)
        model = Predictor.from_study(opened.context, opened.study, locked.training)
        found = learned(model, locked.training)
        plain, better = (run_residuals(whole, model.predict(term_effects(one))) for one in (None, found))
        floors = noise_view(whole, better, dict.fromkeys(better[0], 1.0), repeat_groups(whole)).floors
        without, with_it = (score(one, floors, locked.runs).over_floor for one in (plain, better))
        outside = beyond(Predictor.from_study(opened.context, opened.study, whole), whole)
    words = "nothing" if found is None else describe_form(found)
    return Answer(kind, seed, words, without, with_it, outside, time.perf_counter() - started)


def learned(model: Predictor, measurement: Measurement) -> LearnedTerm | None:
    """Learn the term that these readings support, for the unchanged model."""
    plain, groups = run_residuals(measurement, model.predict()), repeat_groups(measurement)
    readings, _ = readings_over_floor(measurement, plain, groups)
    noise = noise_view(measurement, plain, readings.scales, groups)
    condition = condition_indices(readings.n_runs, [group.runs for group in groups])
    return learn(model, readings, noise, condition[readings.run])


def beyond(model: Predictor, whole: Measurement) -> float:
    """Return the error at pressures above the training range, with the term over without it."""
    most = max(float(run.history.actuation[PUSHED].max()) for run in whole.runs)
    low, high = [], []
    for run in whole.runs:
        above = run.history.actuation[PUSHED] > REACH * most
        low.append(run.with_outputs({n: np.where(above, np.nan, v) for n, v in run.outputs.items()}))
        high.append(run.with_outputs({n: np.where(above, v, np.nan) for n, v in run.outputs.items()}))
    inside = replace(whole, runs=tuple(low))
    found = learned(model.for_runs(inside), inside)
    if found is None:
        return 1.0
    unread = replace(whole, runs=tuple(high))
    squares = []
    for one in (found, None):
        left = run_residuals(unread, model.predict(term_effects(one)))
        squares.append(sum(float(np.nansum(values**2)) for run in left for values in run.values()))
    return float(np.sqrt(squares[0] / squares[1]))


def term_effects(found: LearnedTerm | None) -> tuple:
    """Return the term as effects of a model."""
    return () if found is None else (found.effect,)


def describe_form(found: LearnedTerm) -> str:
    """Return the place of action and the covariates of a term."""
    return f"{found.form.acts_on}({', '.join(axis.name for axis in found.form.axes)})"


def line(row: Answer) -> str:
    """Return one set in words."""
    fall = f"{row.without:5.2f} -> {row.with_it:5.2f} over the floor"
    return f"{row.kind:20s}{row.seed:3d}  {fall}   outside {row.outside:5.2f}   {row.learned}  ({row.wall_s:.0f} s)"


def summary(rows: Sequence[Answer]) -> dict[str, float]:
    """Return medians and the worst value."""
    without, with_it, outside = (
        np.array([getattr(row, name) for row in rows]) for name in ("without", "with_it", "outside")
    )
    return {
        "without, median": float(np.median(without)),
        "with, median": float(np.median(with_it)),
        "with, worst": float(with_it.max()),
        "share within the bar": float(np.mean(with_it <= MOST)),
        "outside, median": float(np.median(outside)),
        "outside, worst": float(outside.max()),
    }


if __name__ == "__main__":
    sys.exit(main())
