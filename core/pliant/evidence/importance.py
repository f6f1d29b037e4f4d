"""Share of an unexplained residual that each covariate explains: cross-validated, without physics.

A model of one covariate is a mean per category or a broken line over its quantiles, fitted with a small ridge toward
the mean. Its importance is 1 − SSE/SST on runs that it was not fitted to, SST being about the mean of the fitted runs
(the cross-validated R², clipped at 0). Normal equations are sums over runs, so that leaving one out is a subtraction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pliant.evidence.covariates import Covariate, Covariates
from pliant.records.design import Array

KNOTS = 9
PAIR_KNOTS = 5
RIDGE = 1e-3  # of the samples
ENOUGH_RUNS = 4  # fewer are divided into stretches for cross-validation
STRETCHES = 8
MOST_SAMPLES = 12_000  # neighbouring samples are redundant: longer data are downsampled
PAIRED = 4  # the best covariates are tried in pairs
PAIR_GAIN = 0.05  # a pair is named if it explains this much more than either alone


@dataclass(frozen=True, eq=False)
class _Folds:
    """Downsampled residuals: `values` (s, o) scaled, 0 where missing, `there` (s, o), `fold` (s,), `keep` per run."""

    values: Array
    there: Array
    fold: NDArray[np.int64]
    keep: tuple[slice, ...]

    def basis(self, item: Covariate, knots: int) -> Array:
        """Return (s, m) hat functions at quantiles, or indicators; rows sum to 1; missing values share a column."""
        values = np.concatenate([v[k] for v, k in zip(item.values, self.keep, strict=True)])
        there = np.isfinite(values)
        if not there.any():
            return np.ones((len(values), 1))
        places = np.unique(values[there])
        if item.numeric and len(places) > knots:
            places = np.unique(np.quantile(values[there], np.linspace(0, 1, knots)))
        basis = np.zeros((len(values), len(places) + 1))
        x = np.interp(values[there], places, np.arange(len(places)))
        low = np.minimum(x.astype(int), max(len(places) - 2, 0))
        rows = np.flatnonzero(there)
        basis[rows, low] = 1 - (x - low)
        if len(places) > 1:
            basis[rows, low + 1] = x - low
        basis[~there, -1] = 1.0
        return basis[:, basis.any(axis=0)]


def importance(
    residuals: Sequence[Mapping[str, Array]],
    covariates: Covariates,
    scales: Mapping[str, float] | None = None,
) -> dict[str, float]:
    """Return the covariates on which the residual depends: covariate → importance from 0 to 1, the largest first.

    Args:
        residuals: per run the residuals by output (t,), NaN where missing.
        covariates: covariates of the same runs.
        scales: unit in which outputs are added, their noise floors for example; their RMS by default.

    Returns:
        one entry per covariate, and for pairs ("a × b") that explain at least `PAIR_GAIN` more than either.
    """
    names = list(residuals[0]) if residuals else []
    if not names:
        return dict.fromkeys(covariates.names, 0.0)
    folds = _folds(residuals, names, scales or {})
    if len(np.unique(folds.fold)) < 2 or not folds.there.any():
        return dict.fromkeys(covariates.names, 0.0)
    told = {item.name: _explained(folds.basis(item, KNOTS), folds) for item in covariates.items}
    if covariates.position:
        told["position"] = _position(folds, [covariates.position.get(name) for name in names], names)
    best = sorted(covariates.items, key=lambda item: -told[item.name])[:PAIRED]
    pairs = {}
    for a, b in combinations(best, 2):
        both = folds.basis(a, PAIR_KNOTS)[:, :, None] * folds.basis(b, PAIR_KNOTS)[:, None, :]
        product = both.reshape(len(both), -1)
        share = _explained(product[:, product.any(axis=0)], folds)
        if share >= max(told[a.name], told[b.name]) + PAIR_GAIN:
            pairs[f"{a.name} × {b.name}"] = share
    return dict(sorted({**told, **pairs}.items(), key=lambda entry: -entry[1]))


def _folds(
    residuals: Sequence[Mapping[str, Array]], names: Sequence[str], scales: Mapping[str, float]
) -> _Folds:
    lengths = [len(run[names[0]]) for run in residuals]
    step = max(sum(lengths) // MOST_SAMPLES, 1)
    keep = tuple(slice(None, None, step if n > 4 * step else 1) for n in lengths)
    stacked = [np.stack([run[n][k] for n in names], axis=1) for run, k in zip(residuals, keep, strict=True)]
    values = np.concatenate(stacked)
    there = np.isfinite(values)
    values = np.where(there, values, 0.0)
    rms = np.sqrt((values**2).sum(axis=0) / np.maximum(there.sum(axis=0), 1))
    unit = np.array([scales.get(n, 0.0) or r for n, r in zip(names, rms, strict=True)])
    values = values / np.where(unit > 0, unit, 1.0)
    each = 1 if len(stacked) >= ENOUGH_RUNS else -(-STRETCHES // len(stacked))
    parts = [k * each + (np.arange(len(run)) * each) // max(len(run), 1) for k, run in enumerate(stacked)]
    return _Folds(values, there, np.concatenate(parts), keep)


def _explained(basis: Array, folds: _Folds) -> float:
    """Return the cross-validated share of the squares about the mean, all outputs together."""
    rest = total = 0.0
    starts = [np.flatnonzero(folds.fold == k) for k in range(int(folds.fold.max()) + 1)]
    for values, there in zip(folds.values.T, folds.there.T, strict=True):
        blocks = [rows[there[rows]] for rows in starts]
        gram = np.array([basis[rows].T @ basis[rows] for rows in blocks])
        right = np.array([basis[rows].T @ values[rows] for rows in blocks])
        square = np.array([values[rows] @ values[rows] for rows in blocks])
        count = np.array([len(rows) for rows in blocks])
        add = np.array([values[rows].sum() for rows in blocks])
        for k in np.flatnonzero(count):
            n = count.sum() - count[k]
            if n == 0:
                continue
            mean = (add.sum() - add[k]) / n
            ridge = RIDGE * n * np.eye(basis.shape[1])
            normal, aim = gram.sum(axis=0) - gram[k], right.sum(axis=0) - right[k]
            weight = np.linalg.solve(normal + ridge, aim + RIDGE * n * mean)
            rest += square[k] - 2 * weight @ right[k] + weight @ gram[k] @ weight
            total += square[k] - 2 * mean * add[k] + mean**2 * count[k]
    return float(np.clip(1 - rest / total, 0.0, 1.0)) if total > 0 else 0.0


def _position(folds: _Folds, numbers: Sequence[int | None], names: Sequence[str]) -> float:
    """Return the share explained by the number along the chain, pooled over a family (joint angles, marker x…)."""
    family = [
        "" if k is None else name.replace(str(k), "", 1) for name, k in zip(names, numbers, strict=True)
    ]
    rest = total = 0.0
    for one in sorted(set(family) - {""}):
        columns = [c for c, f in enumerate(family) if f == one]
        if len(columns) < 2:
            continue
        values, there = folds.values[:, columns], folds.there[:, columns]
        for k in np.unique(folds.fold):
            test = folds.fold == k
            if not there[test].any() or not there[~test].any():
                continue
            n = there[~test].sum(axis=0)
            mean = values[~test].sum() / max(int(n.sum()), 1)
            own = np.where(n > 0, values[~test].sum(axis=0) / np.maximum(n, 1), mean)
            rest += float((there[test] * (values[test] - own) ** 2).sum())
            total += float((there[test] * (values[test] - mean) ** 2).sum())
    return float(np.clip(1 - rest / total, 0.0, 1.0)) if total > 0 else 0.0
