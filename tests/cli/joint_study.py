"""One joint with a payload and a stated law, used by the tests of the evidence verbs."""

from __future__ import annotations

JOINT = """\
pliant: 1
name: joint
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 1, module_length: 11 mm, module_mass: 1.6 g, payload: 30 g}
physics: quasistatic
"""
