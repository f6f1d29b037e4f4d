"""Stage 2b: solved designs become one model, and the law of any other design comes from it.

`designs` → fit and `cross_validation` on designs left out → `error_bars` of unseen designs → `stage` (artifacts,
laws of designs) → `next_design` (what to solve next).
"""
