"""Coiled tubes that shorten under pressure with a dead weight: two specimens, five loads, a separate zero per run.

python -m benchmarks.real.coiled_muscle     prints, and writes benchmarks/out/coiled_muscle.json

One hanging prismatic joint. File names contain specimen and weight; the laser's zero differs between runs. Stated are
the lengths under load, which give the stiffness (specimen 1 and 3 have 148 and 105 N/m between 100 and 500 g; the law
has their mean); the force per pressure follows from the training runs, by a straight line of the displacement within
each run.
"""

from __future__ import annotations

import numpy as np
from benchmarks.real.five import run_bench_script
from benchmarks.real.measured_bench import MeasuredBench

from pliant.records.measurement import Measurement

# Stated lengths under 100, 200, 300, 400 and 500 g, mm.
LENGTHS_MM = {"1": (29, 35, 45, 49, 55), "2": (34, 41, 50, 63, 68), "3": (46, 50, 65, 71, 83)}
SPECIMENS = ("1", "3")  # those with recordings here
STEP_N = 0.1 * 9.81
CHAIN = """
pliant: 1
name: coiled-muscle
surrogate:
  kind: polynomial
  form: study
  odd: true
  joint: prismatic
  coefficients: {k_n: {gain}, m_a: 0, m_e: 0, b_e: {stiffness}}
chain:
  modules: 1
  module_length: 40 mm
  module_mass: 0 g
physics: quasistatic
"""
NOTES = {
    "rename": {"displacement_mm": "extension_mm"},
    "name_pattern": "specimen_{specimen}_{payload_g}g",
    "zero": {"extension_m": "per run"},
}


def stiffness_n_m() -> float:
    """Return the mean stiffness of the specimens by their stated lengths under load, N/m."""
    loads = STEP_N * np.arange(1, 6)
    slopes = [np.polyfit(1e-3 * np.array(LENGTHS_MM[one], float), loads, 1)[0] for one in SPECIMENS]
    return float(np.mean(slopes))


def fit(bench: MeasuredBench, measurement: Measurement) -> dict[str, float]:
    """Return the force per pressure that the slope of the training runs needs at the stated stiffness."""
    square = product = 0.0
    for run in measurement.runs:
        there = np.isfinite(run.outputs["extension_m"])
        p, x = run.input("pressure_pa")[there], run.outputs["extension_m"][there]
        square += float(((p - p.mean()) ** 2).sum())
        product += float(((p - p.mean()) * (x - x.mean())).sum())
    stiffness = stiffness_n_m()
    return {"gain": product / square * stiffness, "stiffness": stiffness}


BENCH = MeasuredBench("coiled_muscle", CHAIN, NOTES, fit, inputs=("pressure_pa",))

if __name__ == "__main__":
    run_bench_script(BENCH, __doc__)
