"""A study of a fast grasp, and the header of its counts."""

from __future__ import annotations

STUDY = """\
pliant: 1
name: counted
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
family: {kind: bellow_bending, inner_radius: 2 mm, average_radius: 6 mm, wall: 1.5 mm, module_length: 11 mm}
material: {kind: neo_hookean, shear_modulus: 249 kPa, density: 1150 kg/m^3}
chain:
  segments: [{rigid: {length: 6.5 mm}}, {modules: 6}, {rigid: {length: 14 mm, section: module}}]
physics: mujoco
task:
  kind: grasp
  object: cylinder
  pressure: 14 kPa
  lower_height: 5 mm
  lower_time: 0.2 s
  ramp_time: 0.3 s
  hold_time: 0.1 s
  lift_height: 20 mm
  lift_time: 0.5 s
  final_time: 0.2 s
  seed: 5
noise: {friction: 5 %, pressure: 0.5 kPa, placement: 5 %}
measurements: {file: counts.csv, trials: 2}
"""
HEADER = "run,object,pressure_kpa,extra_weights,successes,trials\n"
