"""Where the error is: every bin of every covariate, with its share of the squared error and its significance.

Residuals are modelled as r_i = o_k + e_i with an offset o_k ~ N(0, σ_b²) per run k and first-order autoregressive
noise e of standard deviation σ_w and lag-one correlation φ. The mean over a set of samples with n_k in run k then has

    Var = Σ_k (n_k/n)² σ_b² + (σ_w/n)² Σ_k Σ_ij φ^|i−j|

(Bartlett 1946 for the second part). The effective sample size is that of as many independent samples:
σ_w² / Var of the second part.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from pliant.evidence.bins import PAIRS, Bins, Codes, binned, crossed
from pliant.evidence.covariates import Covariates
from pliant.evidence.noise import Noise
from pliant.formatting import NamedUnit, listed, unit_of
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


Residuals = Sequence[
    Mapping[str, Array]
]  # per run, measured − predicted by output, NaN where nothing was read
LEVEL = 0.05  # false discovery rate
MOST_PAIR_BINS = 40
LISTED = 8
NOTABLE = 0.02  # more of the error than of the readings, before a place is called bad


@dataclass(frozen=True)
class PlaceOutput:
    """One output in one place, SI: `mean` is measured − predicted, `interval` its 95 % interval under noise."""

    n: int
    n_effective: float
    mean: float
    interval: tuple[float, float]
    rms: float
    z: float
    p: float
    significant: bool


@dataclass(frozen=True)
class Place:
    """One bin of one covariate, over all outputs.

    Attributes:
        covariate, condition: its name, and the bin in words.
        centre: where it stands on the covariate's axis (SI); NaN for categories.
        share_of_error: of the squared error in units of the floor; those of one covariate sum to 1.
        share_of_samples: likewise of the readings.
        rms_over_floor: root mean square error in units of the floor.
        z: mean error over its standard error, for the output where it is largest.
        output: that output.
        significant: whether any output's mean error stands after correction for all places.
        outputs: see `PlaceOutput`.
    """

    covariate: str
    condition: str
    centre: float
    share_of_error: float
    share_of_samples: float
    rms_over_floor: float
    z: float
    output: str
    significant: bool
    outputs: Mapping[str, PlaceOutput]

    @property
    def excess(self) -> float:
        """How much more of the error than of the readings lies here."""
        return self.share_of_error - self.share_of_samples


@dataclass(frozen=True, eq=False)
class _Counted:
    """A covariate's bins with their sums, before the correction for many places."""

    bins: Bins
    means: Mapping[str, BinMeans]
    squares: Mapping[str, Array]


def find_places(
    residuals: Residuals, found: Covariates, noise: Mapping[str, Noise], steps_s: Sequence[float]
) -> tuple[Place, ...]:
    """Every bin of every covariate and of some pairs; significance controls the false discovery rate over all.

    Args:
        residuals: see `Residuals`.
        found: the covariates of the same runs.
        noise: per output; its `total` is the unit in which errors of different outputs are added.
        steps_s: per run the time between neighbouring readings.
    """
    counted = [_count(bins, residuals, noise, steps_s) for bins in all_bins(found)]
    counted += [
        _count(bins, residuals, part, steps_s) for bins, part in _along_chain(found, residuals, noise)
    ]
    p = [m.p[k] for c in counted for m in c.means.values() for k in range(len(c.bins)) if m.n[k]]
    accepted = iter(significant(np.array(p), LEVEL).tolist())
    total = sum(float(np.nansum((run[o] / noise[o].total) ** 2)) for run in residuals for o in noise)
    readings = sum(int(np.isfinite(run[o]).sum()) for run in residuals for o in noise)
    places: list[Place] = []
    for one in counted:
        flags = {
            o: [next(accepted) if m.n[k] else False for k in range(len(one.bins))]
            for o, m in one.means.items()
        }
        places += _places_of(one, flags, noise, (total, readings))
    return tuple(places)


def all_bins(found: Covariates) -> list[Bins]:
    """Bins of every covariate, then of the pairs in `PAIRS` that are not too many."""
    singles = [bins for bins in map(binned, found.items) if len(bins) > 1]
    pairs = [crossed(a, b) for a, b in _pairs(singles)]
    return singles + [pair for pair in pairs if 2 < len(pair) <= MOST_PAIR_BINS]


def _along_chain(
    found: Covariates, residuals: Residuals, noise: Mapping[str, Noise]
) -> Iterator[tuple[Bins, Mapping[str, Noise]]]:
    """One bin for the outputs of each joint or marker, and one for all others, where outputs have numbers."""
    numbers = {output: found.position.get(output) for output in noise}
    if len({k for k in numbers.values() if k is not None}) < 2:
        return
    for k in sorted(set(numbers.values()), key=lambda k: (k is None, k)):
        part = {output: one for output, one in noise.items() if numbers[output] == k}
        first = next(iter(part))
        words = f"{first.split('_')[0]} {k}" if k is not None else _beyond_joints(list(part))
        codes = tuple(np.zeros(len(run[first]), np.int64) for run in residuals)
        centre = np.nan if k is None else float(k)
        yield Bins("position", NamedUnit("position along the chain"), (words,), codes, (centre,)), part


def _beyond_joints(outputs: list[str]) -> str:
    """Outputs that belong to no joint or marker: the tip, mostly."""
    return (
        "the tip"
        if all(name.startswith("tip_") for name in outputs)
        else listed([unit_of(o).label for o in outputs])
    )


def worst_places(places: Sequence[Place], count: int = LISTED) -> tuple[Place, ...]:
    """Places that hold more of the error than of the readings: significant ones first, then by that excess.

    Of places that hold the same readings only the first is listed.
    """
    seen: set[tuple[float, ...]] = set()
    different = []
    for place in places:
        print_ = (round(place.share_of_error, 12), round(place.share_of_samples, 12), round(place.z, 9))
        if print_ not in seen and place.excess > NOTABLE:
            seen.add(print_)
            different.append(place)
    return tuple(sorted(different, key=lambda place: (not place.significant, -place.excess))[:count])


def _pairs(singles: Sequence[Bins]) -> Iterator[tuple[Bins, Bins]]:
    for first, second in PAIRS:
        a = [bins for bins in singles if bins.name.startswith(first)]
        b = [bins for bins in singles if bins.name.startswith(second)]
        if a and b:
            yield a[0], b[0]


def _count(
    bins: Bins, residuals: Residuals, noise: Mapping[str, Noise], steps_s: Sequence[float]
) -> _Counted:
    means: dict[str, BinMeans] = {}
    squares: dict[str, Array] = {}
    for output, of_output in noise.items():
        r = [run[output] for run in residuals]
        means[output] = bin_means(r, bins.codes, len(bins), of_output, steps_s)
        flat, codes = np.concatenate(r), np.concatenate(bins.codes)
        there = np.isfinite(flat)
        squares[output] = np.asarray(np.bincount(codes[there], flat[there] ** 2, len(bins)), float)
    return _Counted(bins, means, squares)


def _places_of(
    one: _Counted,
    flags: Mapping[str, Sequence[bool]],
    noise: Mapping[str, Noise],
    of: tuple[float, int],
) -> Iterator[Place]:
    """Places of one covariate, as shares of the squared error and of the readings, `of`."""
    total, readings = of
    for k, words in enumerate(one.bins.words):
        outputs = {
            o: _place_output(m, one.squares[o], k, flags[o][k]) for o, m in one.means.items() if m.n[k]
        }
        n = sum(entry.n for entry in outputs.values())
        if not n:
            continue
        error = sum(float(one.squares[o][k]) / noise[o].total ** 2 for o in outputs)
        loudest = max(outputs, key=lambda o: abs(outputs[o].z) if np.isfinite(outputs[o].z) else -1.0)
        yield Place(
            covariate=one.bins.name,
            condition=words,
            centre=one.bins.centres[k],
            share_of_error=error / total if total > 0 else n / readings,
            share_of_samples=n / readings,
            rms_over_floor=float(np.sqrt(error / n)),
            z=outputs[loudest].z,
            output=loudest,
            significant=any(entry.significant for entry in outputs.values()),
            outputs=outputs,
        )


def _place_output(means: BinMeans, squares: Array, k: int, flag: bool) -> PlaceOutput:
    n, mean, error = int(means.n[k]), float(means.mean[k]), float(means.standard_error[k])
    reach = float(scipy.stats.t.ppf(0.975, means.freedom[k])) * error
    z = (
        float(means.z[k])
        if np.isfinite(means.z[k])
        else (0.0 if mean == 0 else float(np.sign(mean)) * LARGEST_Z)
    )
    return PlaceOutput(
        n, float(means.n_effective[k]), mean, (mean - reach, mean + reach),
        float(np.sqrt(squares[k] / n)), z, float(means.p[k]), bool(flag),
    )  # fmt: skip
