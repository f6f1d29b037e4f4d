"""How long a diagnosis takes: of a usual recording, of a long one, and of many runs.

    python -m benchmarks.evidence.speed     prints, and writes benchmarks/out/diagnosis_speed.json

The usual one is also diagnosed with the sensitivities of the law's own error at every fit instead of at those that may
lead; the ratio is that of processor times.

All are read from the joint of examples/hidden_effect made stiffer, with noise; every shipped effect is a candidate. The
baseline is the usual recording, that of the example, in the same process, which has a thread for each of two cores. The
many runs have two worker processes.
"""

from __future__ import annotations

import math
import os
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from unittest.mock import patch

import numpy as np
from benchmarks.output import ROOT, Bar, ratio, time_calls, write

from pliant import api
from pliant.diagnosis import search
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement

STUDY = ROOT / "examples" / "hidden_effect" / "finger.yaml"
CSV = STUDY.parent / "bench.csv"
LONG = 100_000
MANY, EACH = 1190, 168
STEP_S = 0.1
SWING_S = 9.0  # of the pressure's cosine, over 2 π
PRESSURE_PA = 15e3
STIFFER = 1.15
NOISE_RAD = 2e-3
OUTPUT = "angle_rad"
ROUNDS = 2
MOST_S = {"usual": 5.0, "long": 15.0, "many": 45.0}


def main() -> None:
    with tempfile.TemporaryDirectory() as store:
        opened = api.open_study(STUDY, store=store)
        usual = api.read_measurement(opened, [CSV])
        sets = {"usual": usual, "long": recorded(opened, swings()), "many": recorded(opened, holds())}
        workers = {"usual": 1, "long": 1, "many": min(2, os.cpu_count() or 1)}
        api.diagnose(opened, usual)  # triggers compilation
        diagnosis = partial(api.diagnose, opened, usual)
        with patch.object(search, "OUT_OF_LAW_REACH", math.inf):
            everywhere = time_calls(diagnosis, ROUNDS)
        law_reach = ratio(time_calls(diagnosis, ROUNDS), everywhere)
        taken = {
            name: time_calls(
                partial(api.diagnose, opened, measurement, workers=workers[name]), clock=time.perf_counter
            )
            for name, measurement in sets.items()
        }
    counts = {name: measurement.n_samples for name, measurement in sets.items()}
    bars = [
        Bar(f"diagnosis of {counts[name]} readings in {len(sets[name].runs)} runs", taken[name][0], most, "s")
        for name, most in MOST_S.items()
    ]
    ratios = {name: ratio(taken[name], taken["usual"]) for name in ("long", "many")}
    bars += [
        Bar(f"{name} over usual", value, MOST_S[name] / MOST_S["usual"], "×")
        for name, value in ratios.items()
    ]
    bars.append(
        Bar("sensitivities of the law's error where a fit may lead, over at every fit", law_reach, 1.0, "×")
    )
    ratios["law_reach"] = law_reach
    write("diagnosis_speed", {"readings": counts, "seconds": taken, "ratios": ratios}, bars)


def swings() -> list[History]:
    """Return two long runs with slow swings of the pressure."""
    clock = STEP_S * np.arange(LONG // 2)
    pressure = {"pressure_pa": PRESSURE_PA * (0.5 - 0.5 * np.cos(clock / SWING_S))}
    return [History.from_arrays(pressure, clock, run=name, specimen="A") for name in ("one", "two")]


def holds() -> list[History]:
    """Return many short runs: up at one of five rates to one of forty levels, a hold, half down, a hold."""
    clock, runs = STEP_S * np.arange(EACH), []
    for k in range(MANY):
        top, rise = PRESSURE_PA * (0.2 + 0.02 * (k % 40)), 1.0 + 0.6 * (k // 40 % 5)
        turn = 0.6 * clock[-1]
        pressure = np.interp(clock, [0.0, rise, turn, turn + rise], [0.0, top, top, 0.5 * top])
        runs.append(History.from_arrays({"pressure_pa": pressure}, clock, run=f"r{k}", specimen="A"))
    return runs


def recorded(opened: api.OpenStudy, runs: Sequence[History]) -> Measurement:
    """Return the runs with the readings of a stiffer joint."""
    stiffness = opened.context.registry.get("effect", "stiffness").config_model()
    hidden = stiffness.model_validate({"kind": "stiffness", "factor": STIFFER})
    truth = api.predictor(opened, read(runs, [np.zeros(len(run)) for run in runs])).predict((hidden,))
    noise = np.random.default_rng(1)
    return read(runs, [run[OUTPUT] + noise.normal(0, NOISE_RAD, len(run[OUTPUT])) for run in truth])


def read(runs: Sequence[History], angles: Sequence[Array]) -> Measurement:
    """Return runs with their readings."""
    found = [
        MeasuredRun(run, {OUTPUT: angle}, {}, np.ones(len(run)), np.arange(len(run)) + 2)
        for run, angle in zip(runs, angles, strict=True)
    ]
    return Measurement(tuple(found), (OUTPUT,), source="made in memory")


if __name__ == "__main__":
    main()
