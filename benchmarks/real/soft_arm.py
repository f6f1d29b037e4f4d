"""An arm of three pneumatic chambers under motion capture: residuals of a simple law and of four baselines.

python -m benchmarks.real.soft_arm     prints, and writes benchmarks/out/soft_arm.json

Stated: a length of 185 mm, three chambers at 120°, gauge pressures in psi. Not stated: weight, stiffness, the order of
the chambers about the axis, and the camera's pose: the arm rests along its z in the runs with steps and along its y in
those of tracking, so that each of the two sessions has a separate rotation, fitted to the training runs. The law is
simple: each of four ball joints bends by the sum of the pressures, g Σ pₖ eₖ, with g from the training runs. Without a
run under load in training the stiffness behind g is assumed (0.6 N·m/rad for the whole arm); the payload of
`tracking_4` tests it.
"""

from __future__ import annotations

from benchmarks.real.five import run_bench_script
from benchmarks.real.measured_bench import MeasuredBench, bend_gain

from pliant.records.measurement import Measurement

STIFFNESS_N_M = 0.6  # of the whole arm: a guess
JOINTS = 4
CHAIN = """
pliant: 1
name: soft-arm
surrogate:
  kind: polynomial
  axes:
    x: {form: study, odd: true, coefficients: {k_n: 0, m_a: 0, m_e: 0, b_e: 50}}
    y: {form: study, odd: true, coefficients: {k_n: {gain}, m_a: 0, m_e: 0, b_e: 2.4}}
    z: {form: study, odd: true, coefficients: {k_n: 0, m_a: 0, m_e: 0, b_e: 2.4}}
chain:
  modules: 4
  module_length: 46.25 mm
  module_mass: 0 g
  actuators:
    - {input: pressure_1_pa}
    - {input: pressure_2_pa, rotation: {second} deg}
    - {input: pressure_3_pa, rotation: {third} deg}
physics: quasistatic
"""
NOTES = {
    "frame": {"turn": {"steps_*": "unknown", "tracking_*": "unknown"}},
    "runs": {"tracking_4": {"payload": "200 g"}},
    "outputs": ["tip_x_m", "tip_y_m", "tip_z_m"],
}


def fit(bench: MeasuredBench, measurement: Measurement) -> dict[str, float]:
    """Return the gain, and the order of the chambers about the axis, that fit the training runs best."""
    joint = STIFFNESS_N_M * JOINTS
    tries = []
    for second in (120.0, 240.0):
        turned = MeasuredBench(
            bench.name,
            bench.chain,
            bench.notes,
            fit,
            start={"gain": 1e-6, "second": second, "third": 360.0 - second},
        )
        gain, error = bend_gain(turned, measurement, most=1e-5)
        tries.append((error, {"gain": gain * joint, "second": second, "third": 360.0 - second}))
    return min(tries, key=lambda one: one[0])[1]


BENCH = MeasuredBench(
    "soft_arm", CHAIN, NOTES, fit, inputs=("pressure_1_pa", "pressure_2_pa", "pressure_3_pa")
)

if __name__ == "__main__":
    run_bench_script(BENCH, __doc__)
