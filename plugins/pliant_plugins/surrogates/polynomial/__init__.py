"""Polynomial joint laws: fitted with the degree that the data support, or stated by coefficients.

To read, from `surrogate`, which calls the rest; `states` (fitted or scored) and `scoring` serve all:
one axis: `system` (rows of least squares, folds) → `fit` (choice of terms, by `posterior` and its prior) → `law`
(compiled: `kernel`);
several coupled axes: `energy` (terms) → `energy_system` → `energy_fit` (or three laws apart) → `energy_law` (inside and
outside its box; compiled: `energy_kernel`);
three independent axes: `axes`; the published form: `study`.

The law of one axis is not the energy with one axis: u|u| of the published form has no polynomial energy, its terms are
chosen by leaving out whole levels and under a prior, and its continuation reads its reach off the border alone. Fits
and poses outside the box would move, and the energy's kernel costs several times as much for one axis.
"""
