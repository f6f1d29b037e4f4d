"""Bins: a covariate cut into a handful of places that have a name."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pliant.evidence.covariates import Covariate
from pliant.formatting import NamedUnit, named_unit, number
from pliant.records.design import Array

Codes = NDArray[np.int64]
MOST_LEVELS = 8  # a covariate with so many values or fewer has a bin for each
N_BINS = 5
ATOM = 0.1  # of the samples at one value: it has a bin of its own
LEVEL_WIDTH = 0.02  # of the range: values closer than this are one level…
LEVEL_RATIO = 1.3  # …unless one is so many times the other
PAIRS = (
    ("direction", "pressure"),
    ("direction", "rate"),
    ("direction", "moment_direction"),
    ("moment_direction", "pressure"),
)


@dataclass(frozen=True, eq=False)
class Bins:
    """A covariate cut into bins; every sample is in exactly one.

    Attributes:
        name: the covariate's, or two joined by " × ".
        shown: the covariate in words.
        words: each bin in words.
        codes: per run (t,) the bin of each sample.
        centres: where each bin stands on the covariate's axis (SI); NaN for categories and the rest.
    """

    name: str
    shown: NamedUnit
    words: tuple[str, ...]
    codes: tuple[Codes, ...]
    centres: tuple[float, ...]

    def __len__(self) -> int:
        return len(self.words)


def binned(covariate: Covariate) -> Bins:
    """The covariate in bins: one per category or level; else about as many samples in each of `N_BINS`."""
    values = np.concatenate(covariate.values)
    if not np.isfinite(values).any():
        found, words, centres = values, [], []
    elif not covariate.numeric:
        found, words, centres = values, list(covariate.categories), [np.nan] * len(covariate.categories)
    else:
        found, words, centres = _numeric(covariate, values)
    codes = np.where(np.isfinite(found), found, len(words)).astype(np.int64)
    words.append(covariate.rest)
    centres.append(np.nan)
    return _without_empty(covariate, codes, words, centres)


def crossed(first: Bins, second: Bins) -> Bins:
    """Every combination that occurs of a bin of `first` and one of `second`."""
    size = len(second)
    codes = np.concatenate([a * size + b for a, b in zip(first.codes, second.codes, strict=True)])
    label = second.shown.label + " "  # "rising pressure, pressure 5 kPa" says it twice
    words = [
        f"{a}, {b.removeprefix(label) if a.endswith(label.strip()) else b}"
        for a in first.words
        for b in second.words
    ]
    used, codes = np.unique(codes, return_inverse=True)
    return Bins(
        f"{first.name} × {second.name}",
        named_unit(f"{first.shown.label} × {second.shown.label}"),
        tuple(words[k] for k in used),
        _by_run(codes, first.codes),
        (np.nan,) * len(used),
    )


def _numeric(covariate: Covariate, values: Array) -> tuple[Array, list[str], list[float]]:
    there = values[np.isfinite(values)]
    levels = _levels(there)
    if levels is not None:
        edges, centres = (levels[1:] + levels[:-1]) / 2, levels.tolist()
        words = [_level_words(covariate.shown, value) for value in centres]
    else:
        edges, marks = _edges(there, covariate.shown.factor)
        place = np.searchsorted(edges, there, side="right")
        inside = [there[place == k] for k in range(len(edges) + 1)]
        centres = [float(np.median(v)) if len(v) else np.nan for v in inside]
        narrow = [len(v) > 0 and np.ptp(v) <= LEVEL_WIDTH * np.ptp(there) / 4 for v in inside]
        words = [
            _level_words(covariate.shown, centre) if level else text
            for text, centre, level in zip(_range_words(covariate.shown, marks), centres, narrow, strict=True)
        ]
    found = np.where(np.isfinite(values), np.searchsorted(edges, values, side="right"), np.nan)
    return found, words, centres


def _levels(there: Array) -> Array | None:
    """The levels that the values stand at; None where they are spread or more than `MOST_LEVELS`.

    A level ends where the next value is farther than `LEVEL_WIDTH` of the range, or by `LEVEL_RATIO`.
    """
    unique = np.unique(there)
    width = LEVEL_WIDTH * np.ptp(unique)
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = (np.diff(unique) > width) | ((unique[:-1] > 0) & (unique[1:] / unique[:-1] > LEVEL_RATIO))
    groups = np.split(unique, np.flatnonzero(apart) + 1)
    if len(groups) > MOST_LEVELS or any(np.ptp(group) > 2 * width for group in groups):
        return None
    return np.array([np.median(there[(there >= g[0]) & (there <= g[-1])]) for g in groups])


def _edges(there: Array, factor: float) -> tuple[Array, Array]:
    """Inner edges, and the values that they are called by.

    A value that many samples share (a rest, a plateau) gets a bin of its own; the others are cut near their
    quantiles, at numbers that people would choose.
    """
    unique, counts = np.unique(there, return_counts=True)
    atoms = np.flatnonzero(counts > ATOM * len(there))
    rest = there[~np.isin(there, unique[atoms])]
    edges, marks = [], []
    for k in atoms:
        for before, after in ((k - 1, k), (k, k + 1)):
            if before >= 0 and after < len(unique):
                edges.append((unique[before] + unique[after]) / 2)
                marks.append(unique[k])
    for edge in _rounded(rest, max(N_BINS - len(atoms), 2), factor):
        if all(abs(edge - other) > LEVEL_WIDTH * np.ptp(there) for other in marks):
            edges.append(edge)
            marks.append(edge)
    order = np.argsort(edges)
    return np.array(edges)[order], np.array(marks)[order]


def _rounded(there: Array, parts: int, factor: float) -> Array:
    """Edges of so many parts near the quantiles, inside the range."""
    if not len(there):
        return np.zeros(0)
    edges = np.quantile(there, np.arange(1, parts) / parts)
    shown = edges * factor
    step = 10.0 ** np.floor(np.log10(max(np.ptp(there) * factor, 1e-300))) / 10
    fine = np.maximum(10.0 ** np.floor(np.log10(np.maximum(np.abs(shown), 1e-300))) / 2, 1e-12)
    step = np.minimum(step, fine)
    rounded = np.unique(np.round(shown / step) * step) / factor
    inside = rounded[(rounded > there.min()) & (rounded <= there.max())]
    return inside if len(inside) else np.array([np.median(there)])


def _level_words(shown: NamedUnit, value: float) -> str:
    return f"{shown.label} {shown.text(value, 3)}"


def _range_words(shown: NamedUnit, edges: Array) -> list[str]:
    at = [number(edge * shown.factor, 3) for edge in edges]
    first, last = (
        shown.attached(f"{shown.label} below {at[0]}"),
        shown.attached(f"{shown.label} above {at[-1]}"),
    )
    return [first, *(shown.attached(f"{shown.label} {a} to {b}") for a, b in pairwise(at)), last]


def _without_empty(covariate: Covariate, codes: Codes, words: list[str], centres: list[float]) -> Bins:
    used, codes = np.unique(codes, return_inverse=True)
    return Bins(
        covariate.name,
        covariate.shown,
        tuple(words[k] for k in used),
        _by_run(codes, covariate.values),
        tuple(float(centres[k]) for k in used),
    )


def _by_run(codes: Codes, like: tuple[Array, ...] | tuple[Codes, ...]) -> tuple[Codes, ...]:
    return tuple(np.split(codes, np.cumsum([len(v) for v in like])[:-1]))
