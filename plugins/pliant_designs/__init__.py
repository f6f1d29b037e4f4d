"""Many designs: FEM of a sweep, and a meta-model that gives the law of any other design.

`sweep_designs` (designs of a study) → `sweep` (their FEM) → `solved_designs` → `stage`: fit, `cross_validation` on
designs left out, `error_bars` of unseen designs, their laws → `next_design` (designs to solve next).
"""
