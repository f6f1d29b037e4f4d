"""Polynomial joint laws: fitted with the degree that the data support, or stated by coefficients.

To read, from `surrogate`, which calls the rest; `states` (fitted or scored) and `scoring` serve all:
one axis: `system` (rows of least squares, folds) → `fit` (choice of terms, by `posterior` and its prior) → `law`
(compiled: `batch`, `scalar`);
several coupled axes: `energy` (terms) → `energy_system` → `energy_fit` (or three laws: `energy_apart`) → `energy_law`
(outside its box `energy_continuation`; compiled `energy_kernel`, `_batch`, `_scalar`);
three independent axes: `axes`; the published form: `study`.

The law of one axis is not the energy with one axis: u|u| of the study's form has no polynomial energy, its terms are
chosen by leaving out whole levels and under a prior, and its continuation reads its reach off the border alone. Fits
and poses outside the box would move.
"""
