"""Polynomial joint laws: fitted with the degree that the data support, or stated by coefficients.

To read, from `surrogate`, which calls the rest:
one axis: `states` (fitted or scored) → `system` (rows of least squares, folds) → `fit` (choice of terms, by
`posterior` and the prior of `shrinkage`) → `law` (compiled: `batch`, `scalar`; `drawn`) → `scoring`;
several coupled axes: `energy_states` → `energy_terms` → `energy_system` → `energy_fit` (or three laws: `energy_apart`)
→ `energy_law` (outside its box `energy_continuation`; compiled `energy_kernel`, `_batch`, `_scalar`) → `energy_report`;
three independent axes: `axes`, `axes_law`; the published form: `study_form`, `study_differences`.
"""
