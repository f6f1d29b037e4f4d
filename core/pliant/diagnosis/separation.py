"""How well a run would tell hypotheses apart: expected log Bayes factors and the probability of a right verdict.

Each hypothesis predicts the readings y of a run as m + G δ with its parameters' deviation δ ~ N(0, A⁻¹) from where
the measured runs put them, and noise of unit variance per independent reading:

    y | a ~ N(m_a, V_a),      V_a = 1 + f + G_a A_a⁻¹ G_aᵀ.

What b cannot reach by bending its parameters, at the price that the old data set on bending them, is what tells it from
a: the expected log Bayes factor is the Kullback–Leibler divergence

    E_a ln p(y | a) / p(y | b) = ½ [tr(V_b⁻¹ V_a) − r + ln det V_b / det V_a + (m_a − m_b)ᵀ V_b⁻¹ (m_a − m_b)]

(Hunter and Reiner, Technometrics 7, 1965; Box and Hill, Technometrics 9, 1967). f is what a model that is slightly
off may do to the readings by itself: its square sum, along three of the r directions in which the hypotheses differ,
whichever they are. Outside these r directions all hypotheses are the same, so that everything happens within. Draws of
y under each hypothesis give the probability that the verdict would be right and the expected information (Lindley,
Ann. Math. Statist. 27, 1956; Chaloner and Verdinelli, Statist. Sci. 10, 1995).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pliant.records.design import Array

# Directions whose size is below this share of the largest are rounding.
FLAT = 1e-9
DRAWS = 256
# Errors of a form are smooth: they lie along few directions.
FORM_DIRECTIONS = 3


@dataclass(frozen=True, eq=False)
class Contender:
    """A hypothesis about a run.

    Attributes:
        probability: so far; those of all contenders need not sum to one.
        mean: (M,) readings over their noise, each times the root of the independent readings that it is worth.
        slopes: (M, k) their slopes, likewise.
        information: (k, k) what is known of the parameters: the inverse of their covariance.
        form: sum of squares that this hypothesis' own inexactness may add to the readings.
    """

    probability: float
    mean: Array
    slopes: Array
    information: Array
    form: float = 0.0


@dataclass(frozen=True, eq=False)
class ExpectedOutcome:
    """What a run is expected to do to the contenders.

    Attributes:
        right: probability that the true one is then believed.
        wrong: probability that another is.
        information: expected fall of the entropy of the probabilities, in nats.
        factors: (K, K) expected log Bayes factor of row against column if the row is true.
    """

    right: float
    wrong: float
    information: float
    factors: Array


def expected(contenders: Sequence[Contender], temperature: float, believed: float) -> ExpectedOutcome:
    """What a run would tell, the draws always the same.

    Args:
        contenders: two or more.
        temperature: log Bayes factors are divided by this before they change a probability.
        believed: probability from which a hypothesis is the verdict.
    """
    share = np.array([one.probability for one in contenders])
    share = share / share.sum()
    means, spreads = _reduced(contenders)
    roots: list[Array] = [np.asarray(np.linalg.cholesky(v), float) for v in spreads]
    log_det = np.array([2.0 * np.log(np.diag(root)).sum() for root in roots])
    factors = np.array(
        [
            [
                _divergence(means[a] - means[b], spreads[a], roots[b], log_det[b] - log_det[a])
                for b in range(len(share))
            ]
            for a in range(len(share))
        ]
    )
    rng = np.random.default_rng(0)
    before = -float(share @ np.log(np.maximum(share, 1e-300)))
    right = wrong = after = 0.0
    for a, probability in enumerate(share):
        drawn = means[a] + rng.standard_normal((DRAWS, means.shape[1])) @ roots[a].T
        odds = np.log(np.maximum(share, 1e-300)) + _log_density(drawn, means, roots, log_det) / temperature
        odds -= odds.max(axis=1, keepdims=True)
        posterior = np.exp(odds)
        posterior /= posterior.sum(axis=1, keepdims=True)
        sure = posterior >= believed
        right += probability * float(sure[:, a].mean())
        wrong += probability * float(np.delete(sure, a, axis=1).any(axis=1).mean())
        after -= probability * float((posterior * np.log(np.maximum(posterior, 1e-300))).sum(axis=1).mean())
    return ExpectedOutcome(float(right), float(wrong), before - after, factors)


def _reduced(contenders: Sequence[Contender]) -> tuple[Array, list[Array]]:
    """Means (K, r) and covariances (r, r) in the directions in which the contenders differ."""
    middle = np.mean([one.mean for one in contenders], axis=0)
    columns = [np.column_stack([one.mean - middle, one.slopes]) for one in contenders]
    left, sizes, _ = np.linalg.svd(np.column_stack(columns), full_matrices=False)
    basis = left[:, sizes > FLAT * max(float(sizes[0]), 1e-12)]
    r = min(max(basis.shape[1], 1), FORM_DIRECTIONS)
    spreads = []
    for one in contenders:
        slopes = basis.T @ one.slopes
        bent = slopes @ np.linalg.solve(one.information, slopes.T) if slopes.shape[1] else 0.0
        spreads.append((1.0 + one.form / r) * np.eye(basis.shape[1]) + bent)
    return np.array([basis.T @ (one.mean - middle) for one in contenders]), spreads


def _divergence(apart: Array, mine: Array, root: Array, log_ratio: float) -> float:
    """Kullback–Leibler divergence to a normal distribution with this Cholesky root."""
    inverse = np.linalg.inv(root)
    scaled = inverse @ apart
    trace = float(np.sum((inverse @ mine) * inverse))
    return 0.5 * (trace - len(apart) + log_ratio + float(scaled @ scaled))


def _log_density(drawn: Array, means: Array, roots: Sequence[Array], log_det: Array) -> Array:
    """(draws, K) up to a constant."""
    found = np.empty((len(drawn), len(means)))
    for b, root in enumerate(roots):
        scaled = np.linalg.solve(root, (drawn - means[b]).T)
        found[:, b] = -0.5 * (log_det[b] + (scaled**2).sum(axis=0))
    return found
