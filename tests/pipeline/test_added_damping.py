"""Damping added by an engine is named with the metrics of motion that include it (Euler–Bernoulli: none)."""

import pytest

from pliant import api

# A massive cantilever without damping, released: EI 0.01 N·m², 0.1 kg/m, 0.4 m.
STUDY = """pliant: 1
name: swing
surrogate: {kind: polynomial, form: study, coefficients: {k_n: 1e-6, m_a: 0, m_e: 0, b_e: 1}}
chain: {modules: 40, module_length: 10 mm, module_mass: 1 g, module_radius: 5 mm, gravity: [0, 0, 0]}
physics: PHYSICS
task: {kind: follow_pressure, pressure: 1 kPa, waveform: release, duration: 3 s, record: 5 ms}
"""
FIRST_HZ = 1.8751**2 / (2 * 3.141592653589793) * (0.01 / (0.1 * 0.4**4)) ** 0.5


def simulated(folder, physics):
    path = folder / "swing.yaml"
    path.write_text(STUDY.replace("PHYSICS", physics), encoding="utf-8")
    return api.simulate(api.open_study(path, store=folder / "store"))


def test_the_engine_s_default_damping_is_named(tmp_path):
    done = simulated(tmp_path, "mujoco")
    (said,) = done.remarks
    assert "drag_1 7 1/s" in said and "joint_damping" in said and "mode_1_damping_ratio" in said


def test_without_it_the_beam_swings_as_euler_bernoulli_says(tmp_path):
    done = simulated(tmp_path, "{kind: mujoco, drag_1: 0, joint_damping: 0, timestep: 1 ms}")
    metrics = done.engines[0].result.metrics
    assert done.remarks == ()
    assert metrics["mode_1_frequency_hz"] == pytest.approx(FIRST_HZ, rel=5e-3)
    assert metrics["mode_1_damping_ratio"] == pytest.approx(0.0, abs=0.01)
