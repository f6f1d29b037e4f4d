"""Meta-models: laws of designs that were never solved, from those that were.

To read: `common_form` (laws of all designs in one form, a short vector of numbers a design) and its fit,
`common_form_fit`: `_scales` → `_terms` (how many: `chosen_terms`) → `_population` (all designs at once) → `_stable`.
Each kind then goes `config` → `model` (fits; any design's law as `FormLaws`): `regression` takes a design's parameters
to its numbers by Gaussian processes, `coefficients` by a network (`networks`, `network_training`); `neural` is one
network of design, actuation and deformation, which takes the scales alone from the form.
"""
