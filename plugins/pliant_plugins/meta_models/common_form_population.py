"""Coefficients of many designs at once: what a design's states leave open follows the other designs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant_plugins.meta_models.common_form_terms import Equations

ROUNDS = 12
# Relative accuracy below which no data are believed.
NOISE_FLOOR = 1e-5
# Share of the mean variance that every direction keeps.
SPREAD_FLOOR = 1e-8
# How many designs' worth of belief there is in coefficients that fall with the degree.
BELIEF = 1.0
# How many equations of typical noise stand behind each design's own.
TYPICAL = 10.0


@dataclass(frozen=True, eq=False)
class Population:
    """Coefficients c_i ~ N(B h(s_i), Σ) of designs with states rows_i · c_i = right_i ± σ_i.

    Empirical Bayes by expectation and maximisation (Laird and Ware, Biometrics 38, 1982): B, Σ and σ_i come from all
    designs together; a design's coefficients are the posterior mean. A direction that its states do not determine
    keeps what its parameters suggest.

    Attributes:
        coefficients: (n, m) posterior means.
        mean: (t, m) B.
        spread: (m, m) Σ.
        noise: (n,) σ of each design.
    """

    coefficients: Array
    mean: Array
    spread: Array
    noise: Array


def fit_population(
    designs: Sequence[Equations], h: Array, rounds: int = ROUNDS, held: Array | None = None
) -> Population:
    """The population of designs with equations in well-scaled terms; h (n, t) are regressors of their mean.

    `held` (m, m) is a precision about zero that every design has beside its equations.
    """
    n, m = len(designs), designs[0].rows.shape[1]
    grams = [one.rows.T @ one.rows for one in designs]
    moments = [one.rows.T @ one.right for one in designs]
    squares = np.array([float(one.right @ one.right) for one in designs])
    counts = np.array([len(one.right) for one in designs])
    scale = float(squares.sum() / max(counts.sum(), 1))
    held = np.zeros((m, m)) if held is None else held
    first = np.linalg.solve(sum(grams) + 1e-6 * counts.sum() / m * np.eye(m), sum(moments))
    mean = np.zeros((h.shape[1], m))
    mean[0] = first
    noise = np.full(n, 0.01 * np.sqrt(scale))
    prior = scale * np.diag((1.0 + np.arange(m)) ** -2.0)
    now = Population(np.tile(first, (n, 1)), mean, prior, noise)
    for _ in range(rounds):
        found = [
            _posterior(g, b, row @ now.mean, now.spread, s, held)
            for g, b, row, s in zip(grams, moments, h, now.noise, strict=True)
        ]
        c = np.array([mean_of for mean_of, _ in found])
        mean = np.linalg.solve(h.T @ h + 1e-6 * n * np.eye(h.shape[1]), h.T @ c)
        apart = c - h @ mean
        spread = (apart.T @ apart + sum(cov for _, cov in found) + BELIEF * prior) / (n + BELIEF)
        spread += SPREAD_FLOOR * np.trace(spread) / m * np.eye(m)
        missed = np.array(
            [
                float(np.sum((one.right - one.rows @ ci) ** 2)) + float(np.sum(g * cov))
                for one, ci, g, (_, cov) in zip(designs, c, grams, found, strict=True)
            ]
        )
        now = Population(c, mean, spread, _noise(missed, counts, NOISE_FLOOR**2 * scale))
    return now


def _noise(missed: Array, counts: NDArray[np.int64], floor: float) -> Array:
    """(n,) of each design, held to what is typical as if that had been seen in `TYPICAL` equations."""
    typical = float(np.median(missed / np.maximum(counts, 1)))
    found: Array = np.sqrt(np.maximum((missed + TYPICAL * typical) / (counts + TYPICAL), floor))
    return found


def _posterior(
    gram: Array, moment: Array, prior: Array, spread: Array, noise: float, held: Array
) -> tuple[Array, Array]:
    """Mean and covariance of one design's coefficients."""
    precision = gram / noise**2 + np.linalg.inv(spread) + held
    covariance = np.asarray(np.linalg.inv((precision + precision.T) / 2), float)
    return prior + covariance @ ((moment - gram @ prior) / noise**2 - held @ prior), covariance
