"""A search whose optimum is known: a pressure and a length that bring the tip to x = 10 mm."""

STUDY = """\
pliant: 1
name: toy
# a comment that stays
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 3, module_length: 11 mm, gravity: [0, 0, 0]}
physics: quasistatic
task: {kind: free_bending, pressure: 15 kPa, steps: 1}   # pressure is searched
search:
  variables:
    task.pressure: {low: 2 kPa, high: 14 kPa}
    chain.module_length: {low: 8 mm, high: 12 mm}
  objective: abs(tip_x - 10 mm)
  budget: 24
optimizer: {kind: cmaes}
"""
BUDGET = 24
