"""How long a diagnosis takes, and how that grows with the number of samples.

    OMP_NUM_THREADS=1 python -m benchmarks.evidence.speed     prints, and writes benchmarks/out/diagnosis_speed.json

Two runs in which the pressure swings slowly, read from the joint of examples/hidden_effect made stiffer, with noise;
every shipped effect is a candidate. The baseline is a tenth of the samples at the same rate, in the same process.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from functools import partial

import numpy as np
from benchmarks.output import ROOT, Bar, ratio, seconds_of, write

from pliant import api
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement

STUDY = ROOT / "examples" / "hidden_effect" / "finger.yaml"
FEW, MANY = 10_000, 100_000
STEP_S = 0.1
SWING_S = 9.0  # of the pressure's cosine, over 2 π
PRESSURE_PA = 15e3
STIFFER = 1.15
NOISE_RAD = 2e-3
OUTPUT = "angle_rad"
LONGEST_S = 60.0
# Linear in the samples, and half as much again.
STEEPEST = 1.5 * MANY / FEW


def main() -> None:
    with tempfile.TemporaryDirectory() as store:
        opened = api.open_study(STUDY, store=store)
        asked = {n: partial(api.diagnose, opened, measured(opened, n)) for n in (FEW, MANY)}
        asked[FEW]()  # compiles what is not compiled yet
        few, many = (seconds_of(asked[n], clock=time.perf_counter) for n in (FEW, MANY))
    grown = ratio(many, few)
    bars = [
        Bar(f"diagnosis of {MANY} samples among all effects", many[0], LONGEST_S, "s"),
        Bar(f"its time as a multiple of that of {FEW} samples", grown, STEEPEST, "×"),
    ]
    write("diagnosis_speed", {"samples": [FEW, MANY], "seconds": [few[0], many[0]], "ratio": grown}, bars)


def measured(opened: api.OpenStudy, samples: int) -> Measurement:
    """Two runs of half the samples each, as a stiffer joint reads them."""
    clock = STEP_S * np.arange(samples // 2)
    pressure = {"pressure_pa": PRESSURE_PA * (0.5 - 0.5 * np.cos(clock / SWING_S))}
    runs = [History.of(pressure, clock, run=name, specimen="A") for name in ("one", "two")]
    stiffness = opened.bench.registry.get("effect", "stiffness").config_model()
    hidden = stiffness.model_validate({"kind": "stiffness", "factor": STIFFER})
    truth = api.predictor(opened, read(runs, [np.zeros(len(clock)) for _ in runs])).predict((hidden,))
    noise = np.random.default_rng(1)
    return read(runs, [run[OUTPUT] + noise.normal(0, NOISE_RAD, len(clock)) for run in truth])


def read(runs: Sequence[History], angles: Sequence[Array]) -> Measurement:
    """Runs with their readings."""
    found = [
        MeasuredRun(run, {OUTPUT: angle}, {}, np.ones(len(run)), np.arange(len(run)) + 2)
        for run, angle in zip(runs, angles, strict=True)
    ]
    return Measurement(tuple(found), (OUTPUT,), source="made in memory")


if __name__ == "__main__":
    main()
