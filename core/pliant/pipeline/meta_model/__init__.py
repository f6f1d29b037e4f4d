"""Stage 2b: a meta-model is fitted to solved designs and predicts the law of any other design.

`designs` → fit and `cross_validation` on designs left out → `error_bars` of unseen designs → `stage` (artifacts,
laws of designs) → `next_design` (designs to solve next).
"""
