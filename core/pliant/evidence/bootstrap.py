"""Intervals of an error by resampling blocks: whole runs where there are enough, else stretches of runs.

Blocks keep the colour of the noise (Künsch 1989). Percentile intervals of few blocks are too narrow; the percentiles
are moved outwards to Φ(√(m/(m−1)) t_{α/2, m−1}) of m blocks (Hesterberg 2015, The American Statistician 69, 4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy

from pliant.records.design import Array

ENOUGH_RUNS = 8  # fewer are cut into stretches
REPLICATES = 1000
BLOCKS_WANTED = 24  # stretches in all when runs are cut
Interval = tuple[float, float]
NONE: Interval = (np.nan, np.nan)


def block_sums(columns: Sequence[Array], shortest: Sequence[float]) -> Array:
    """(m, c) sums over blocks: whole runs, or where they are few, stretches of at least `shortest` samples.

    Args:
        columns: per run (t, c) what is summed.
        shortest: per run the samples that its noise needs to forget itself.
    """
    filled = [(run, least) for run, least in zip(columns, shortest, strict=True) if len(run)]
    if len(filled) >= ENOUGH_RUNS:
        return np.array([run.sum(axis=0) for run, _ in filled])
    wanted = sum(len(run) for run, _ in filled) // BLOCKS_WANTED
    blocks: list[Array] = []
    for run, least in filled:
        length = max(int(np.ceil(least)), wanted, 1)
        blocks += [part.sum(axis=0) for part in np.array_split(run, max(len(run) // length, 1))]
    return np.array(blocks)


def interval(
    sums: Array, statistic: Callable[[Array], Array], seed: int = 0, confidence: float = 0.95
) -> Interval:
    """Interval of a statistic of summed columns.

    Args:
        sums: (m, c) from `block_sums`.
        statistic: (k, c) sums → (k,) values.
    """
    m = len(sums)
    if m < 3:
        return NONE
    weights = np.random.default_rng(seed).multinomial(m, np.full(m, 1 / m), size=REPLICATES)
    with np.errstate(invalid="ignore", divide="ignore"):  # a draw may leave out all that was read
        values = statistic(weights @ sums)
    values = values[np.isfinite(values)]
    if len(values) < REPLICATES // 2:
        return NONE
    tail = scipy.stats.norm.cdf(np.sqrt(m / (m - 1)) * scipy.stats.t.ppf((1 - confidence) / 2, m - 1))
    low, high = np.quantile(values, [tail, 1 - tail])
    return float(low), float(high)
