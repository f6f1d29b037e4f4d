"""Error bars for laws of unsolved designs, from left-out designs.

The errors of one design's states are correlated, so designs, not states, are the independent samples. A state's
residual e (as a share of the law's range of effort) is scaled by a size for its design and one for x = (p, u),

    σ_i² = d_i^2γ ( Σ_j k(v_i − v_j) M_j² / d_j^2γ / Σ_j k(v_i − v_j) + floor ),    s(x)² as in `ErrorBar`, of e / σ,

with M_j the RMS residual of design j at parameters v_j, d_j the model's doubt, γ the closest of `POWERS`, and each
design excluded from the estimate of its sizes. A level's quantile of the scores |e| / (σ s) weights all designs equally
and adds one design of infinite score: the band covers a state of a new design with at least that probability, if new
and left-out designs are exchangeable (Dunn, Wasserman, Ramdas, J. Am. Stat. Assoc. 118, 2023; Lee, Barber, Willett,
arXiv:2306.06342).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from pliant.records.design import Array
from pliant.records.error_bar import FLOOR, GROWTH, ErrorBar
from pliant.records.law import JointLaw
from pliant_designs.cross_validation import LeftOutResiduals, effort_size
from pliant_designs.records import SolvedDesigns

LEVELS = (0.5, 0.9, 0.99)
# Exponents of the model's doubt; 0 ignores it.
POWERS = (0.0, 0.5, 1.0)
# Number of levels that a bar resolves, evenly from 0 to 1.
RESOLVED = 999
# Limits for sweeps of thousands: states in the kernel, and designs on which the bars are checked.
MOST_STATES = 3000
MOST_CHECKED = 200
TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Bars:
    """Residuals of n left-out designs with m states on a axes, from which the bar of any design's law is made.

    Attributes:
        low, width: (d,) of the range of designs.
        values: (n, d) designs, scaled to [0, 1].
        doubt: (n,) of each design by the model fitted without it.
        design: (m,) of each state.
        place: (m, 1 + a) p (all of several actuations) and u, scaled to [−1, 1] on the law's box.
        share: (m, a) |residual| as a share of the law's range of effort; NaN where an axis is not scored.
    """

    low: Array
    width: Array
    values: Array
    doubt: Array
    design: NDArray[np.int64]
    place: Array
    share: Array

    @staticmethod
    def from_residuals(designs: SolvedDesigns, misses: LeftOutResiduals) -> Bars:
        """Return the bars of a meta-model's residuals."""
        low, width = designs.box[:, 0], designs.scale
        keep = _chosen(misses.design, len(designs))
        share = np.abs(misses.miss) / misses.size[misses.design]
        share = np.where(misses.counts, share, np.nan)
        doubt = np.maximum(misses.doubt, TINY)
        return Bars(
            low,
            width,
            (designs.values - low) / width,
            doubt,
            misses.design[keep],
            misses.place[keep],
            share[keep],
        )

    def bar(self, law: JointLaw, values: Array, doubt: float) -> ErrorBar:
        """Return the error bar of one design's law: values (d,) and the model's doubt of them."""
        size, at = effort_size(law), ((np.asarray(values, float) - self.low) / self.width)[None]
        everyone = np.ones(len(self.values), bool)
        misses = np.empty_like(self.share)
        for a, (one, learnt) in enumerate(zip(self._axes, self._learnt, strict=True)):
            new = float(one.sizes_at(learnt.power, everyone, at, np.array([doubt]))[0])
            misses[:, a] = learnt.misses * new * size[a]
        scores = np.stack([learnt.scores for learnt in self._learnt], axis=1)
        return ErrorBar(law.domain.box, self.place, misses, self.weights, scores, _reach(self.place))

    @cached_property
    def _axes(self) -> tuple[_Axis, ...]:
        return tuple(_Axis.from_bars(self, a) for a in range(self.share.shape[1]))

    @cached_property
    def _learnt(self) -> tuple[_Learnt, ...]:
        """Quantities of each axis for the bar of any design."""
        everyone = np.ones(len(self.values), bool)
        levels = np.arange(1, RESOLVED + 1) / (RESOLVED + 1)
        found = []
        for one in self._axes:
            power = one.power(everyone)
            own = one.sizes(power, everyone)
            squares = np.where(one.scored, one.share, 0.0) ** 2 / own[self.design] ** 2
            misses = np.sqrt(np.where(one.scored, squares, one._mean(own, everyone)))
            found.append(_Learnt(power, misses, one.quantiles(own, everyone, levels)))
        return tuple(found)

    @property
    def weights(self) -> Array:
        """(m,) weights of states such that all designs have equal weight."""
        counts = np.bincount(self.design, minlength=len(self.values))
        found: Array = 1.0 / counts[self.design]
        return found

    def coverage(self, border: NDArray[np.bool_]) -> dict[str, dict[str, float]]:
        """Return the share of the left-out designs' states inside bars made only from the other designs.

        Args:
            border: (n,) designs on the border of the range.

        Returns:
            place (all, interior, border) → level → share, with equal weight for each design and axis.
        """
        n = len(self.values)
        checked = np.sort(np.random.default_rng(0).permutation(n)[:MOST_CHECKED])
        inside = np.full((len(checked), self.share.shape[1], len(LEVELS)), np.nan)
        for a, one in enumerate(self._axes):
            for row, design in enumerate(checked):
                inside[row, a] = one.covered(int(design), LEVELS)
        found: dict[str, dict[str, float]] = {}
        for place, group in {"all": np.ones(n, bool), "interior": ~border, "border": border}.items():
            chosen = inside[group[checked]]
            if chosen.size and not np.all(np.isnan(chosen)):
                shares = np.nanmean(chosen, axis=(0, 1))
                found[place] = {f"{level:g}": float(s) for level, s in zip(LEVELS, shares, strict=True)}
        return found


@dataclass(frozen=True, eq=False)
class _Learnt:
    """Fit of one axis: exponent of the doubt, the states' residuals over σ (m,), quantiles of the scores."""

    power: float
    misses: Array
    scores: Array


@dataclass(frozen=True, eq=False)
class _Axis:
    """Kernel sums of one axis by design, so that any design can be left out of them.

    Attributes:
        square: (n,) mean square share of each design; NaN where the axis is not scored.
        near: (n, n) kernel between designs.
        scored: (m,) states of this axis.
        share: (m,) of all states; NaN where not scored.
        part, mass: (m, n) kernel sums at each state over the states of each design: of squared shares, of weights.
        blank: (m, n) the part of `mass` of states that are not scored.
        grown: (m,) factor by which a bar is wider because the state is outside the box.
    """

    bars: Bars
    square: Array
    near: Array
    scored: NDArray[np.bool_]
    share: Array
    part: Array
    mass: Array
    blank: Array
    grown: Array

    @staticmethod
    def from_bars(bars: Bars, a: int) -> _Axis:
        share = bars.share[:, a]
        scored = np.isfinite(share)
        n = len(bars.values)
        filled = np.where(scored, share, 0.0)
        counts = np.bincount(bars.design, scored.astype(float), n)
        with np.errstate(invalid="ignore", divide="ignore"):
            square = np.bincount(bars.design, filled**2, n) / counts
        inside = np.clip(bars.place, -1.0, 1.0)
        kernel = bars.weights * _kernel(inside, bars.place)
        member = (bars.design[:, None] == np.arange(n)).astype(float)
        return _Axis(
            bars,
            square,
            _kernel(bars.values, bars.values),
            scored,
            share,
            kernel @ (member * (filled**2)[:, None]),
            kernel @ member,
            kernel @ (member * (~scored)[:, None]),
            1 + np.abs(bars.place - inside).max(axis=1) / GROWTH,
        )

    def power(self, among: NDArray[np.bool_]) -> float:
        """Return the exponent of the doubt that minimises the variation of residuals over sizes between designs."""
        known = among & (self.square > 0)
        if known.sum() < 4 or np.ptp(self.bars.doubt[known]) <= 1e-9 * self.bars.doubt[known].max():
            return 0.0
        spreads = [
            float(np.std(np.log(self.square[known]) - 2 * np.log(self.sizes(power, among)[known])))
            for power in POWERS
        ]
        return POWERS[int(np.argmin(spreads))]

    def sizes(self, power: float, among: NDArray[np.bool_]) -> Array:
        """Return (n,) σ of every design from the designs `among`, with the design itself left out."""
        near = self.near.copy()
        np.fill_diagonal(near, 0.0)
        return self._sizes(near, power, among, self.bars.doubt)

    def sizes_at(self, power: float, among: NDArray[np.bool_], values: Array, doubt: Array) -> Array:
        """Return (k,) σ of further designs, scaled values (k, d)."""
        near = _kernel(values, self.bars.values)
        return self._sizes(near, power, among, doubt)

    def _sizes(self, near: Array, power: float, among: NDArray[np.bool_], doubt: Array) -> Array:
        known = among & np.isfinite(self.square)
        relative = np.where(known, self.square, 0.0) / self.bars.doubt ** (2 * power)
        near = near * known
        local = near @ relative / np.maximum(near.sum(axis=1), TINY)
        floor = FLOOR**2 * relative[known].mean()
        sizes: Array = np.sqrt(np.maximum(local + floor, TINY)) * np.maximum(doubt, TINY) ** power
        return sizes

    def _mean(self, sizes: Array, among: NDArray[np.bool_]) -> float:
        """Return the mean of squared share / σ², with equal weight for each design."""
        known = among & np.isfinite(self.square)
        return float(np.mean(self.square[known] / sizes[known] ** 2))

    def places(self, sizes: Array, among: NDArray[np.bool_], own: bool) -> Array:
        """Return (m,) s at each state from the states of designs `among`; `own` excludes the state's design."""
        mean = self._mean(sizes, among)
        part = (self.part / sizes**2 + mean * self.blank) * among
        mass = self.mass * among
        if own:
            rows = np.arange(len(self.bars.design))
            part[rows, self.bars.design] = 0.0
            mass[rows, self.bars.design] = 0.0
        # A place covered only by its own design gets the mean.
        total = mass.sum(axis=1)
        local = np.where(total > TINY, part.sum(axis=1) / np.maximum(total, TINY), mean)
        found: Array = np.sqrt(local + FLOOR**2 * mean) * self.grown
        return found

    def quantiles(self, sizes: Array, among: NDArray[np.bool_], levels: Array) -> Array:
        """Return (levels,) quantiles of the scores of designs `among`, equally weighted, and one infinite score.

        Above n / (n + 1), which n designs do not resolve, the quantile grows from the largest score as that of a normal
        error.
        """
        scale = np.maximum(self.places(sizes, among, own=True) * sizes[self.bars.design], TINY)
        keep = self.scored & among[self.bars.design]
        score = self.share[keep] / scale[keep]
        of = self.bars.design[keep]
        counts = np.bincount(of, minlength=len(among))
        n = int(np.sum(counts > 0))
        weight = 1.0 / (counts[of] * (n + 1))
        order = np.argsort(score, kind="stable")
        reached = np.cumsum(weight[order])
        levels = np.asarray(levels, float)
        place = np.searchsorted(reached, levels - 1e-12)
        growth = scipy.special.ndtri((1 + np.maximum(levels, n / (n + 1))) / 2) / scipy.special.ndtri(
            (1 + n / (n + 1)) / 2
        )
        found: Array = score[order][np.minimum(place, len(order) - 1)] * growth
        return found

    def covered(self, design: int, levels: tuple[float, ...]) -> Array:
        """Return (levels,) share of one design's states in the bands from the other designs; NaN without states."""
        rows = self.scored & (self.bars.design == design)
        if not rows.any():
            return np.full(len(levels), np.nan)
        others = np.ones(len(self.bars.values), bool)
        others[design] = False
        power = self.power(others)
        sizes = self.sizes(power, others)
        limit = self.quantiles(sizes, others, np.array(levels))
        width = self.places(sizes, others, own=False)[rows] * sizes[design]
        return np.array([np.mean(self.share[rows] <= q * width) for q in limit])


def _kernel(points: Array, places: Array) -> Array:
    """Return (n, m) Gaussian kernel of width `_reach`, scaled to 1 at each row's nearest place (no underflow)."""
    squares = np.sum(points**2, axis=1)[:, None] + np.sum(places**2, axis=1) - 2 * points @ places.T
    distance = np.maximum(squares, 0.0) / _reach(places) ** 2
    found: Array = np.exp(-(distance - distance.min(axis=1, keepdims=True)) / 2)
    return found


def _reach(places: Array) -> float:
    m, d = places.shape
    return float(m ** (-1.0 / (d + 4)))


def _chosen(design: NDArray[np.int64], n: int) -> NDArray[np.bool_]:
    """Return (m,) the states that are kept: all, or as many of each design as `MOST_STATES` allows."""
    most = max(3, MOST_STATES // n)
    random = np.random.default_rng(0)
    keep = np.ones(len(design), bool)
    for number in range(n):
        rows = np.flatnonzero(design == number)
        if len(rows) > most:
            keep[random.permutation(rows)[most:]] = False
    return keep
