"""Comparison of two finite counts: exact tests, the beta-binomial, intervals.

A count is s successes of n trials with one probability. All tests are exact, except `repeats_agree` for many sets.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import scipy

from pliant.records.design import Array

Count = tuple[int, int]  # successes, trials
TIES = 1e-7  # relative: probabilities closer than this are equal except for rounding
MOST_TABLES = 20_000  # of an exact test of repeats


def log_choose(n: Any, k: Any) -> Array:
    """Return the log of the binomial coefficient n over k, for numbers or arrays."""
    n, k = np.asarray(n, float), np.asarray(k, float)
    log_factorial = scipy.special.gammaln
    return np.asarray(log_factorial(n + 1) - log_factorial(k + 1) - log_factorial(n - k + 1))


def log_predictive(measured: Count, simulated: Count) -> float:
    """Return the log probability of the measured count given the simulated one, for one unknown success probability.

    The probability is uniform before the simulation, Beta(s' + 1, m − s' + 1) after s' of m simulated trials; the
    measured count is then beta-binomial (Gelman et al., *Bayesian Data Analysis*, 3rd ed., section 2.4). With few
    simulated trials no measured count is impossible, and none is certain.
    """
    (s, n), (t, m) = measured, simulated
    return float(
        log_choose(n, s)
        + scipy.special.betaln(s + t + 1, n - s + m - t + 1)
        - scipy.special.betaln(t + 1, m - t + 1)
    )


def log_own(measured: Count) -> float:
    """Return the log probability of a count with its own uniform success probability: 0…n are equally likely."""
    return -float(np.log(measured[1] + 1))


def deviance(measured: Count, simulated: Count) -> float:
    """Return twice the log-likelihood lost against the best possible simulated count of as many trials; ≥ 0."""
    best = max(log_predictive(measured, (k, simulated[1])) for k in range(simulated[1] + 1))
    return 2.0 * (best - log_predictive(measured, simulated))


def log_bayes_factor(a: Count, b: Count) -> float:
    """Return the log Bayes factor of one probability for both over one each, with uniform priors.

    Positive values favour one probability (Kass and Raftery 1995).
    """
    return log_predictive(a, b) - log_own(a)


def fisher_p(a: Count, b: Count) -> float:
    """Return the two-sided exact p of equal probabilities (Fisher 1935): Σ over tables that are no more likely."""
    total = a[0] + b[0]
    low, high = max(0, total - b[1]), min(a[1], total)
    k = np.arange(low, high + 1)
    weights = np.exp(log_choose(a[1], k) + log_choose(b[1], total - k) - log_choose(a[1] + b[1], total))
    seen = weights[a[0] - low]
    return min(1.0, float(weights[weights <= seen * (1 + TIES)].sum()))


def repeats_agree(sets: Sequence[Count]) -> float:
    """Return the p of all sets sharing one probability, exact by Pearson's χ² over all tables with these sums.

    With more than `MOST_TABLES` tables the χ² distribution is used. 1 for a single set, or if all trials ended alike.
    """
    s, n = np.array(sets, float).T
    share = s.sum() / n.sum()
    if len(sets) < 2 or share in (0.0, 1.0):
        return 1.0
    statistic = chi_square(sets)
    if np.prod(np.minimum(n[:-1], s.sum()) + 1) > MOST_TABLES:
        return float(scipy.special.chdtrc(len(sets) - 1, statistic))
    trials = [one[1] for one in sets]
    tables = np.array(list(_tables(trials, int(s.sum()))), float)
    log_p = log_choose(n, tables).sum(axis=1) - log_choose(n.sum(), s.sum())
    scatter = ((tables - n * share) ** 2 / (n * share * (1 - share))).sum(axis=1)
    return min(1.0, float(np.exp(log_p[scatter >= statistic * (1 - TIES)]).sum()))


def chi_square(sets: Sequence[Count]) -> float:
    """Return Pearson's χ² of sets against their pooled share; 0 where all trials ended alike."""
    s, n = np.array(sets, float).T
    share = s.sum() / n.sum()
    if share in (0.0, 1.0):
        return 0.0
    return float(((s - n * share) ** 2 / (n * share * (1 - share))).sum())


def holm(p: Sequence[float]) -> list[float]:
    """Return p-values adjusted family-wise for their number (Holm 1979), in the order given."""
    adjusted, worst = [0.0] * len(p), 0.0
    for rank, index in enumerate(sorted(range(len(p)), key=lambda i: p[i])):
        worst = max(worst, min(1.0, (len(p) - rank) * p[index]))
        adjusted[index] = worst
    return adjusted


def wilson(count: Count, level: float = 0.95) -> tuple[float, float]:
    """Return the interval of the probability of success (Wilson 1927)."""
    s, n = count
    z = float(scipy.special.ndtri(0.5 + level / 2))
    centre = (s + z * z / 2) / (n + z * z)
    half = z / (n + z * z) * float(np.sqrt(s * (n - s) / n + z * z / 4))
    return 0.0 if s == 0 else centre - half, 1.0 if s == n else centre + half


def signed_z(a: Count, b: Count) -> float:
    """Return the normal score of the exact test, positive where the first share is larger."""
    p = max(fisher_p(a, b), 1e-300)
    sign = np.sign(a[0] / a[1] - b[0] / b[1])
    return float(sign * -scipy.special.ndtri(p / 2)) if p < 1.0 else 0.0


def _tables(trials: Sequence[int], total: int) -> Iterator[tuple[int, ...]]:
    """Yield every distribution of `total` successes over sets of these sizes."""
    if len(trials) == 1:
        yield (total,)
        return
    rest = sum(trials[1:])
    for k in range(max(0, total - rest), min(trials[0], total) + 1):
        for others in _tables(trials[1:], total - k):
            yield (k, *others)
