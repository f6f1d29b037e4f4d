"""A link of three bellows read as two curvatures, and let go once: one ball joint under three pressures.

python -m benchmarks.real.three_bellow_link     prints, and writes benchmarks/out/three_bellow_link.json

Stated: three bellows at 120°, 17 g, radius 13 mm. Not stated: the length (65 mm is taken: it scales curvatures and
gains alike), the sensor's axes about the link (their turn and zeros are fitted). The law is plain: the ball joint
bends by g Σ pₖ eₖ. Its stiffness follows from the first half of the swing: k = I (2π f)², I of a rod that turns about
its middle.
"""

from __future__ import annotations

import numpy as np
from benchmarks.real.five import run_bench_script
from benchmarks.real.measured_bench import MeasuredBench, bend_gain

from pliant.records.measurement import Measurement

LENGTH_M, MASS_KG = 65e-3, 17e-3
CHAIN = """
pliant: 1
name: three-bellow-link
surrogate:
  kind: polynomial
  axes:
    x: {form: study, odd: true, coefficients: {k_n: 0, m_a: 0, m_e: 0, b_e: 10}}
    y: {form: study, odd: true, coefficients: {k_n: {gain}, m_a: 0, m_e: 0, b_e: {stiffness}}}
    z: {form: study, odd: true, coefficients: {k_n: 0, m_a: 0, m_e: 0, b_e: {stiffness}}}
chain:
  modules: 1
  module_length: 65 mm
  module_mass: 17 g
  module_radius: 13 mm
  actuators:
    - {input: pressure_1_pa}
    - {input: pressure_2_pa, rotation: {second} deg}
    - {input: pressure_3_pa, rotation: {third} deg}
physics: quasistatic
"""
REST = {f"pressure_{k}_pa": 0 for k in (1, 2, 3)}
NOTES = {
    "rename": {
        "curvature_x_1_per_m": "curvature_y_1_per_m",
        "curvature_y_1_per_m": "curvature_z_1_per_m",
        "bend_deg": "angle_deg",
    },
    "frame": {"turn": "unknown"},
    "zero": {"curvature_y_1_per_m": "unknown", "curvature_z_1_per_m": "unknown"},
    "runs": {"swing_17": REST},
    "let_go": {"swing_17": {}},
}


def fit(bench: MeasuredBench, measurement: Measurement) -> dict[str, float]:
    """Return the gain and order of the bellows from the drive, and the stiffness from the swing."""
    stiffness = swing_stiffness(measurement)
    tries = []
    for second in (120.0, 240.0):
        start = {"gain": 1e-6, "stiffness": 0.1, "second": second, "third": 360.0 - second}
        gain, error = bend_gain(
            MeasuredBench(bench.name, bench.chain, bench.notes, fit, start=start), measurement, most=1e-4
        )
        tries.append((error, {**start, "gain": gain * stiffness, "stiffness": stiffness}))
    return min(tries, key=lambda one: one[0])[1]


def swing_stiffness(measurement: Measurement) -> float:
    """Return I (2π f)² from the crossings of zero of the swing, N·m/rad."""
    swing = next(run for run in measurement.runs if run.history.let_go is not None)
    assert swing.history.time_s is not None
    bend = swing.outputs["angle_rad"]
    there = np.isfinite(bend)
    time, bend = swing.history.time_s[there], bend[there]
    crossings = time[1:][bend[1:] * bend[:-1] < 0]
    half_period = float(np.median(np.diff(crossings)))
    inertia = MASS_KG * LENGTH_M**2 * (1 / 12 + 1 / 16) / 2  # the outer half about the joint in the middle
    return inertia * (np.pi / half_period) ** 2


BENCH = MeasuredBench(
    "three_bellow_link", CHAIN, NOTES, fit, inputs=("pressure_1_pa", "pressure_2_pa", "pressure_3_pa")
)

if __name__ == "__main__":
    run_bench_script(BENCH, __doc__)
