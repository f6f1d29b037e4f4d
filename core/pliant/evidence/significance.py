"""When a mean error is more than noise: coloured noise, offsets between runs, many places looked at.

Residuals are modelled as r_i = o_k + e_i with an offset o_k ~ N(0, σ_b²) per run k and first-order autoregressive
noise e of standard deviation σ_w and lag-one correlation φ. The mean over a set of samples with n_k in run k then has

    Var = Σ_k (n_k/n)² σ_b² + (σ_w/n)² Σ_k Σ_ij φ^|i−j|

(Bartlett 1946 for the second part). The effective sample size is that of as many independent samples:
σ_w² / Var of the second part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from pliant.evidence.bins import Codes
from pliant.evidence.noise import Noise
from pliant.records.design import Array

LARGEST_Z = 99.0


@dataclass(frozen=True, eq=False)
class BinMeans:
    """(b,) each: count, effective count, mean, its standard error, z and two-sided p."""

    n: Array
    n_effective: Array
    mean: Array
    standard_error: Array
    freedom: Array
    z: Array
    p: Array


def bin_means(
    residuals: Sequence[Array], codes: Sequence[Codes], n_bins: int, noise: Noise, steps_s: Sequence[float]
) -> BinMeans:
    """Mean residual of every bin, and whether noise alone would do that.

    Args:
        residuals: per run (t,), NaN where there is none.
        codes: per run (t,) bin numbers below `n_bins`.
        steps_s: per run the time between neighbouring readings.
    """
    n, total, square, coloured = (np.zeros(n_bins) for _ in range(4))
    for residual, code, step_s in zip(residuals, codes, steps_s, strict=True):
        there = np.isfinite(residual)
        count = np.bincount(code[there], minlength=n_bins)
        n += count
        total += np.bincount(code[there], residual[there], minlength=n_bins)
        square += count.astype(float) ** 2
        coloured += coloured_count(code, there, n_bins, noise.correlation(step_s))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / n
        within = noise.within**2 * coloured / n**2
        between = noise.between**2 * square / n**2
        error = np.sqrt(within + between)
        freedom = (within + between) ** 2 / (
            within**2 / noise.freedom_within + between**2 / noise.freedom_between
        )
        z = np.clip(mean / error, -LARGEST_Z, LARGEST_Z)
        effective = n**2 / coloured
    freedom = np.where(np.isfinite(freedom), np.maximum(freedom, 1.0), 1e9)
    p = 2 * scipy.stats.t.sf(np.abs(z), freedom)
    return BinMeans(n, effective, mean, error, freedom, z, p)


def coloured_count(code: Codes, there: Array, n_bins: int, correlation: float) -> Array:
    """(b,) Σ_ij φ^|i−j| over the samples of each bin in one run, by the recursion s_i = φ s_{i−1} + w_i."""
    if not len(code):
        return np.zeros(n_bins)
    member = (code[:, None] == np.arange(n_bins)) & there[:, None]
    if correlation <= 0:
        return np.asarray(member.sum(axis=0), float)
    weight = member.astype(float)
    reach = scipy.signal.lfilter([1.0], [1.0, -correlation], weight, axis=0)
    return np.asarray((weight * (2 * reach - weight)).sum(axis=0))


def significant(p: Array, level: float) -> Array:
    """(m,) bool: which of m tests stand after controlling the false discovery rate (Benjamini and Hochberg 1995)."""
    p = np.where(np.isfinite(p), p, 1.0)
    order = np.argsort(p)
    below = p[order] <= level * np.arange(1, len(p) + 1) / len(p)
    accepted = np.zeros(len(p), bool)
    if below.any():
        accepted[order[: np.flatnonzero(below)[-1] + 1]] = True
    return accepted
