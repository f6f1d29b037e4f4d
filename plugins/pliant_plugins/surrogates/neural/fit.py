"""Early stop by states left out: how supple the network may become, and what it misses there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.law import Domain
from pliant_plugins.surrogates.neural.doubt import error_bar
from pliant_plugins.surrogates.neural.law import NeuralLaw
from pliant_plugins.surrogates.neural.system import Scales, States
from pliant_plugins.surrogates.neural.training import Stop, train
from pliant_plugins.surrogates.stability import stable_choice

# Parts of the states that are left out in turn.
FOLDS = 4


@dataclass(frozen=True, eq=False)
class Trained:
    """The law and how it was stopped.

    Attributes:
        law: of the network that was chosen, trained on all states; its error bar is from networks that saw less.
        history: of each decay, the steps so far, the residual and the error on states left out, as shares of the
            range, and whether the law is stable.
        chosen: the place in `history`.
        largest_slope: largest eigenvalue of ∂τ/∂u on a grid of the box.
    """

    law: NeuralLaw
    history: tuple[Mapping[str, Any], ...]
    chosen: int
    largest_slope: float


def fit_network(
    states: States, domain: Domain, ranges: Array, units: int, seed: int, **named: Any
) -> Trained:
    """Train on all states, and without each of `FOLDS` seeded parts; stop where those parts are met best.

    A law that is not stable in its whole box gives way to a stable one that is about as good. `named` are the law's
    axes, joint and actuation_name.
    """
    scales = Scales.of(domain, ranges)
    n = len(states.tau)
    part = np.random.default_rng(seed).permutation(n) % min(FOLDS, n)
    # the first network sees all states, each other one does without a part
    seen = np.concatenate([np.ones((1, n), bool), part != np.arange(part.max() + 1)[:, None]])
    stops = list(train(states, scales, units, seed, seen))
    misses = np.stack([_left_out(states, stop, part) for stop in stops])
    errors = np.sqrt(np.mean((misses / ranges) ** 2, axis=(1, 2)))
    laws = [NeuralLaw(stop.networks[0], domain, **named) for stop in stops]
    slopes = [law.outside.largest_slope for law in laws]
    chosen = stable_choice(errors.tolist(), slopes)
    history = tuple(
        _step(stop, float(error), slope < 0) for stop, error, slope in zip(stops, errors, slopes, strict=True)
    )
    error = error_bar(states, scales, units, stops[chosen], misses[chosen], part)
    return Trained(replace(laws[chosen], error=error), history, chosen, slopes[chosen])


def _left_out(states: States, stop: Stop, part: NDArray[np.int64]) -> Array:
    """(n, k) predicted minus true effort of each state by the network that did not see its part (n,)."""
    misses = np.empty_like(states.tau)
    for fold, network in enumerate(stop.networks[1:]):
        out = part == fold
        misses[out] = network.efforts(states.points[out])[0] - states.tau[out]
    return misses


def _step(stop: Stop, error: float, stable: bool) -> dict[str, Any]:
    return {
        "decay": stop.decay,
        "steps": int(stop.steps[0]),
        "residual_of_range": float(stop.residuals[0]),
        "left_out_rmse_of_range": error,
        "stable": stable,
    }
