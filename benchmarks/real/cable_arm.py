"""An arm pulled by three cables, recorded without a clock; the same inputs on two days.

python -m benchmarks.real.cable_arm     prints, and writes benchmarks/out/cable_arm.json

Stated: a rest length of 90 mm (the tip's first reading), motor commands in steps. Neither the cable travel per step
(0.1 mm is assumed; it scales only the gain) nor the camera's rotation about the arm is stated. Each row is a separate
state. The law is simple: four ball joints bend by g Σ dₖ eₖ of the travels. On the second day the tip differs by 5 mm
(root mean square) for the same inputs, a lower bound of the error of any model of the inputs.
"""

from __future__ import annotations

from benchmarks.real.five import run_bench_script
from benchmarks.real.measured_bench import MeasuredBench, bend_gain

from pliant.records.measurement import Measurement

STIFFNESS_N_M = 0.4  # of a joint: without loads it has no influence
CHAIN = """
pliant: 1
name: cable-arm
surrogate:
  kind: polynomial
  axes:
    x: {form: study, odd: true, actuation_name: tendon_travel_m, coefficients: {k_n: 0, m_a: 0, m_e: 0, b_e: 10}}
    y: {form: study, odd: true, actuation_name: tendon_travel_m, coefficients: {k_n: {gain}, m_a: 0, m_e: 0, b_e: 0.4}}
    z: {form: study, odd: true, actuation_name: tendon_travel_m, coefficients: {k_n: 0, m_a: 0, m_e: 0, b_e: 0.4}}
chain:
  modules: 4
  module_length: 22.5 mm
  module_mass: 0 g
  gravity: [0, 0, 0]
  actuators:
    - {input: tendon_travel_1_m}
    - {input: tendon_travel_2_m, rotation: {second} deg}
    - {input: tendon_travel_3_m, rotation: {third} deg}
physics: quasistatic
"""
NOTES = {
    "rename": {f"motor_{k}_steps": f"tendon_travel_{k}_m" for k in (1, 2, 3)},
    "units": {f"motor_{k}_steps": "0.1 mm" for k in (1, 2, 3)},
    "frame": {"turn": "unknown"},
}


def fit(bench: MeasuredBench, measurement: Measurement) -> dict[str, float]:
    """Return the gain, and the order of the cables about the axis, that fit the training rows best."""
    tries = []
    for second in (120.0, 240.0):
        start = {"gain": 1.0, "second": second, "third": 360.0 - second}
        gain, error = bend_gain(
            MeasuredBench(bench.name, bench.chain, bench.notes, fit, start=start), measurement, most=1e3
        )
        tries.append((error, {**start, "gain": gain * STIFFNESS_N_M}))
    return min(tries, key=lambda one: one[0])[1]


BENCH = MeasuredBench(
    "cable_arm", CHAIN, NOTES, fit, inputs=("tendon_travel_1_m", "tendon_travel_2_m", "tendon_travel_3_m")
)

if __name__ == "__main__":
    run_bench_script(BENCH, __doc__)
