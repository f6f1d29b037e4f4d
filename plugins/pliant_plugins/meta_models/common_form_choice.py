"""How many terms a family's designs get: the smallest set that predicts states left out nearly as well as the best."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pliant.records.design import Array
from pliant_plugins.meta_models.common_form_population import fit_population
from pliant_plugins.meta_models.common_form_terms import Equations, orthonormal
from pliant_plugins.surrogates.polynomial.energy import Exponents

LEFT_OUT = 0.25
SEED = 0
ROUNDS = 6
# Of several axes smaller sets win within this factor of the best error; of one axis, where all are small, none does.
WITHIN = 1.15
# Sets after two that are worse than the best by this factor are not tried.
HOPELESS = 3.0
# The share of the effort's size that suffices.
ENOUGH = 2e-4


def chosen_terms(
    sets: Sequence[Exponents],
    of_terms: Callable[[Exponents], list[Equations]],
    h: Array,
    held: Callable[[Exponents], Array],
) -> tuple[Exponents, list[float]]:
    """The chosen exponents, and the error of each set that was tried.

    Of every design a seeded quarter of the states is left out; the error is the root mean square of what the fit of
    all designs to the other states misses of their efforts, as a share of the effort's mean size.
    """
    errors: list[float] = []
    for exponents in sets:
        errors.append(_error(of_terms(exponents), h, held(exponents)))
        if errors[-1] < ENOUGH:
            break
        if len(errors) > 2 and min(errors[-2:]) > HOPELESS * min(errors):
            break
    within = WITHIN if sets[0].shape[1] > 2 else 1.0
    first = next(i for i, error in enumerate(errors) if error <= max(within * min(errors), ENOUGH))
    return sets[first], errors


def _error(blocks: list[Equations], h: Array, held: Array) -> float:
    random = np.random.default_rng(SEED)
    kept, left = [], []
    for one in blocks:
        n = int(one.state.max()) + 1
        out = np.zeros(n, bool)
        out[random.permutation(n)[: int(LEFT_OUT * n)]] = True
        kept.append(one.of_states(~out))
        left.append(one.of_states(out))
    lift = orthonormal(kept)
    population = fit_population([one.lifted(lift) for one in kept], h, ROUNDS, lift.T @ held @ lift)
    missed = [
        (one.right - one.rows @ (lift @ own))[one.value]
        for one, own in zip(left, population.coefficients, strict=True)
    ]
    together = np.concatenate(missed)
    return float(np.sqrt(np.mean(together**2))) if together.size else 0.0
