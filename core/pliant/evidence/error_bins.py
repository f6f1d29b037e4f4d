"""Localization of the error: every bin of every covariate, its share of the squared error and its significance.

Residuals are modelled as r_i = o_k + e_i with an offset o_k ~ N(0, σ_b²) per run k and first-order autoregressive
noise e of standard deviation σ_w and lag-one correlation φ. The mean over a set of samples with n_k in run k then has

    Var = Σ_k (n_k/n)² σ_b² + (σ_w/n)² Σ_k Σ_ij φ^|i−j|

(Bartlett 1946 for the second part). The effective sample size is the number of independent samples with the same
variance of the mean: σ_w² / Var of the second part.

`Noise` describes how noise acts on a mean: offsets of runs, noise within them, its correlation time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from pliant.evidence.covariates import PAIRS, Bins, Codes, Covariates, binned, crossed
from pliant.formatting import NamedUnit, listed, output_unit
from pliant.measurements.effective import autocorrelation, run_clock
from pliant.measurements.floors import Floor
from pliant.measurements.repeats import Aligned, RepeatGroup, aligned
from pliant.records.design import Array
from pliant.records.measurement import Measurement

# Per run, measured − predicted by output, NaN where nothing was read.
Residuals = Sequence[Mapping[str, Array]]
SMALLEST_OFFSET = 0.5  # of the variance of a run's mean: repeats cannot rule out smaller offsets
LONGEST = 0.995  # largest lag-one correlation that a short record can determine
OUTLIER = 4.0  # differences beyond this number of robust sigmas are steps of the signal


def run_residuals(
    measurement: Measurement, predicted: Sequence[Mapping[str, Array]]
) -> list[dict[str, Array]]:
    """Return per run measured − predicted (t,) for the outputs that both have; NaN where nothing was read."""
    common = [name for name in measurement.outputs if all(name in run for run in predicted)]
    return [
        {name: np.asarray(run.outputs[name], float) - np.asarray(model[name], float) for name in common}
        for run, model in zip(measurement.runs, predicted, strict=True)
    ]


def padded(measurement: Measurement, residuals: Residuals) -> list[dict[str, Array]]:
    """Return residuals for every output of the measurement: NaN for those that a model does not have."""
    return [
        {name: run.get(name, np.full(len(m), np.nan)) for name in measurement.outputs}
        for m, run in zip(measurement.runs, residuals, strict=True)
    ]


@dataclass(frozen=True)
class Noise:
    """The noise of one output.

    Attributes:
        within: standard deviation inside a run, SI.
        between: standard deviation of the offsets between repeated runs, SI; 0 where it is not known.
        memory_s: correlation time, after which the noise inside a run has decayed by 63 % (in samples where runs have
            no clock); 0 for white noise.
        floor: the unit of errors; the two combined where it is not given.
        freedom_within, freedom_between: degrees of freedom of the two estimates.
    """

    within: float
    between: float = 0.0
    memory_s: float = 0.0
    floor: float | None = None
    freedom_within: float = np.inf
    freedom_between: float = np.inf

    @property
    def total(self) -> float:
        """Return the unit of errors: the floor, else the scatter of one reading about the truth."""
        return float(np.hypot(self.within, self.between)) if self.floor is None else self.floor

    def correlation(self, step_s: float) -> float:
        """Return the correlation of neighbouring readings `step_s` apart."""
        return float(np.exp(-step_s / self.memory_s)) if self.memory_s > 0 else 0.0


def output_noise(
    floor: Floor | None, measurement: Measurement, groups: Sequence[RepeatGroup], residuals: Sequence[Array]
) -> Noise:
    """Return the noise of one output.

    With repeats, offsets and memory are estimated from the repeats' deviations from their mean, without a model.
    With a stated sigma alone, the memory follows from neighbours: Var(r_i − r_{i−1}) = 2 σ² (1 − φ). With neither, the
    residual itself is taken as noise, model error included: only places that exceed it can then be significant.

    Args:
        residuals: for each run (t,) measured − predicted.
    """
    if floor is None or floor.source not in ("repeats", "stated sigma"):
        rms = float(np.sqrt(np.nanmean(np.concatenate(residuals) ** 2)))
        unit = floor.value if floor is not None and floor.value > 0 else rms
        found = autocorrelation([run_clock(run) for run in measurement.runs], list(residuals))
        memory = _memory(found.time_scale, found.slot_s)
        return Noise(rms if rms > 0 else 1.0, memory_s=memory, floor=unit if unit > 0 else 1.0)
    if floor.between is None:
        memory = _memory_beside(floor.value, measurement, residuals)
        return Noise(floor.value, memory_s=memory, floor=floor.value)
    within = min(floor.within, floor.value)
    scale, memory = _repeat_autocorrelation(floor.output, measurement, groups)
    longest = max(len(run) for run in measurement.runs)
    offsets = max(floor.between, floor.value) ** 2 - within**2
    unseen = SMALLEST_OFFSET * within**2 * scale / longest
    freedom = max(floor.n_runs - floor.n_groups, 1)
    known = floor.value**2 / (2 * floor.se**2) if floor.se > 0 else np.inf
    return Noise(
        within=within,
        between=float(np.sqrt(max(offsets, unseen))),
        memory_s=memory,
        floor=floor.value,
        freedom_within=max(known, freedom),
        freedom_between=freedom,
    )


def _memory(scale: float, step_s: float) -> float:
    """Return the time constant of first-order noise with the given n/n_eff = (1 + φ)/(1 − φ)."""
    phi = (scale - 1) / (scale + 1)
    return float(-step_s / np.log(min(phi, LONGEST))) if phi > 0 else 0.0


def _repeat_autocorrelation(
    output: str, measurement: Measurement, groups: Sequence[RepeatGroup]
) -> tuple[float, float]:
    """Return n / n_eff and memory of the deviations of repeats from their mean, each run's offset subtracted.

    Subtracting offsets of n readings removes a share (n/n_eff)/n of the noise's slow part, which is corrected.
    """
    clocks, series = [], []
    for group in groups:
        runs = [measurement.runs[k] for k in group.runs]
        table: Aligned = aligned(runs, [run.outputs[output] for run in runs])
        if table.values.shape[1] < 4:
            continue
        wander = table.values - table.values.mean(axis=0)
        wander = wander - wander.mean(axis=1, keepdims=True)
        step = float(np.median(np.diff(run_clock(runs[0]))))
        clocks += [step * np.arange(wander.shape[1])] * len(wander)
        series += list(wander)
    if not series:
        return 1.0, 0.0
    found = autocorrelation(clocks, series)
    length = float(np.mean([len(values) for values in series]))
    scale = max(found.time_scale / max(1 - found.time_scale / length, 0.5), 1.0)
    return scale, _memory(scale, found.slot_s)


def _memory_beside(sigma: float, measurement: Measurement, residuals: Sequence[Array]) -> float:
    """Return the memory of noise with known standard deviation, from differences of neighbours."""
    differences = np.concatenate([np.diff(values) for values in residuals])
    differences = differences[np.isfinite(differences)]
    steps = np.concatenate([np.diff(run_clock(run)) for run in measurement.runs])
    if len(differences) < 8 or sigma <= 0:
        return 0.0
    robust = float(np.median(np.abs(differences))) / 0.6745
    kept = differences[np.abs(differences) <= OUTLIER * robust] if robust > 0 else differences
    phi = 1 - float(np.mean(kept**2)) / (2 * sigma**2)
    return float(-np.median(steps) / np.log(min(phi, LONGEST))) if phi > 0 else 0.0


LARGEST_Z = 99.0


@dataclass(frozen=True, eq=False)
class BinMeans:
    """(b,) each: count, effective count, mean, its standard error, z and two-sided p, sum of squares and its p.

    The p of the sum of squares is sensitive to errors of either sign.
    """

    n: Array
    n_effective: Array
    mean: Array
    standard_error: Array
    freedom: Array
    z: Array
    p: Array
    squares: Array
    p_squares: Array


def bin_means(
    residuals: Sequence[Array], codes: Sequence[Codes], n_bins: int, noise: Noise, steps_s: Sequence[float]
) -> BinMeans:
    """Return the mean residual of every bin, and its probability under noise alone.

    Args:
        residuals: per run (t,), NaN where missing.
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
    flat, every = np.concatenate(residuals), np.concatenate(codes)
    there = np.isfinite(flat)
    squares = np.asarray(np.bincount(every[there], flat[there] ** 2, n_bins), float)
    with np.errstate(invalid="ignore", divide="ignore"):
        p_squares = _noise_probability(squares / n, effective, n**2 / square, noise)
    return BinMeans(n, effective, mean, error, freedom, z, p, squares, p_squares)


def _noise_probability(mean_square: Array, effective: Array, runs: Array, noise: Noise) -> Array:
    """Return (b,) the probability that noise alone gives so large a mean square; NaN in an empty bin.

    Divided by its expectation σ_w² + σ_b² it is approximated by an F with degrees of freedom that match its variance
    (Satterthwaite 1946): σ_w² from the effective readings, σ_b² from the runs.
    """
    within, between = noise.within**2, noise.between**2
    expected = within + between
    if expected <= 0:
        return np.where(mean_square > 0, 0.0, 1.0)
    freedom = expected**2 / (within**2 / effective + between**2 / runs)
    known = expected**2 / max(
        within**2 / noise.freedom_within + between**2 / noise.freedom_between, 1e-9 * expected**2
    )
    return np.asarray(scipy.stats.f.sf(mean_square / expected, freedom, known), float)


def coloured_count(code: Codes, there: Array, n_bins: int, correlation: float) -> Array:
    """Return (b,) Σ_ij φ^|i−j| over the samples of each bin in one run, by the recursion s_i = φ s_{i−1} + w_i."""
    if not len(code):
        return np.zeros(n_bins)
    member = (code[:, None] == np.arange(n_bins)) & there[:, None]
    if correlation <= 0:
        return np.asarray(member.sum(axis=0), float)
    weight = member.astype(float)
    reach = scipy.signal.lfilter([1.0], [1.0, -correlation], weight, axis=0)
    return np.asarray((weight * (2 * reach - weight)).sum(axis=0))


def significant(p: Array, level: float) -> Array:
    """Return (m,) which tests are significant under a controlled false discovery rate (Benjamini and Hochberg 1995)."""
    adjusted = scipy.stats.false_discovery_control(np.where(np.isfinite(p), p, 1.0)) if len(p) else p
    return np.asarray(adjusted <= level)


LEVEL = 0.05  # false discovery rate
MOST_PAIR_BINS = 40
LISTED = 8
NOTABLE = 0.02  # more of the error than of the readings, for a place to be listed


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
class ErrorBin:
    """One bin of one covariate, over all outputs.

    Attributes:
        covariate, condition: its name, and the bin in words.
        centre: its position on the covariate's axis (SI); NaN for categories.
        share_of_error: of the squared error in units of the floor; the shares of one covariate sum to 1.
        share_of_samples: likewise of the readings.
        rms_over_floor: root mean square error in units of the floor.
        z: mean error over its standard error, for the output where it is largest.
        output: that output.
        significant: whether any output's mean error is significant after correction for all places.
        outputs: see `PlaceOutput`.
        loud: whether any output's mean square is, for errors of either sign.
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
    loud: bool = False

    @property
    def more_than_noise(self) -> bool:
        """Return whether the error here, of either sign, exceeds the noise."""
        return self.significant or self.loud

    @property
    def excess(self) -> float:
        """Return the share of the error minus the share of the readings."""
        return self.share_of_error - self.share_of_samples


def bin_errors(
    residuals: Residuals, covariates: Covariates, noise: Mapping[str, Noise], steps_s: Sequence[float]
) -> tuple[ErrorBin, ...]:
    """Return every bin of every covariate and of some pairs; significance controls the false discovery rate over all.

    Args:
        residuals: see `Residuals`.
        covariates: the covariates of the same runs.
        noise: per output; its `total` is the unit in which errors of different outputs are added.
        steps_s: per run the time between neighbouring readings.
    """
    parts = [(bins, noise) for bins in all_bins(covariates)] + list(
        _along_chain(covariates, residuals, noise)
    )
    tested = [
        {
            o: bin_means([run[o] for run in residuals], bins.codes, len(bins), one, steps_s)
            for o, one in part.items()
        }
        for bins, part in parts
    ]
    filled = [(m, k) for means in tested for m in means.values() for k in np.flatnonzero(m.n)]
    accepted = iter(significant(np.array([m.p[k] for m, k in filled]), LEVEL).tolist())
    heard = iter(significant(np.array([m.p_squares[k] for m, k in filled]), LEVEL).tolist())
    total = sum(float(np.nansum((run[o] / noise[o].total) ** 2)) for run in residuals for o in noise)
    readings = sum(int(np.isfinite(run[o]).sum()) for run in residuals for o in noise)
    places = []
    for (bins, _), means in zip(parts, tested, strict=True):
        flags = {o: [bool(n and next(accepted)) for n in m.n] for o, m in means.items()}
        loud = {o: [bool(n and next(heard)) for n in m.n] for o, m in means.items()}
        for k, words in enumerate(bins.words):
            outputs = {o: _place_output(m, k, flags[o][k]) for o, m in means.items() if m.n[k]}
            n = sum(entry.n for entry in outputs.values())
            if not n:
                continue
            error = sum(float(means[o].squares[k]) / noise[o].total ** 2 for o in outputs)
            loudest = max(outputs, key=lambda o: abs(outputs[o].z) if np.isfinite(outputs[o].z) else -1.0)
            places.append(
                ErrorBin(
                    covariate=bins.name,
                    condition=words,
                    centre=bins.centres[k],
                    share_of_error=error / total if total > 0 else n / readings,
                    share_of_samples=n / readings,
                    rms_over_floor=float(np.sqrt(error / n)),
                    z=outputs[loudest].z,
                    output=loudest,
                    significant=any(entry.significant for entry in outputs.values()),
                    outputs=outputs,
                    loud=any(loud[o][k] for o in outputs),
                )
            )
    return tuple(places)


def all_bins(covariates: Covariates) -> list[Bins]:
    """Return the bins of every covariate, then of the pairs in `PAIRS` that have few enough."""
    singles = [bins for bins in map(binned, covariates.items) if len(bins) > 1]
    pairs = []
    for names in PAIRS:
        first, second = (next((b for b in singles if b.name.startswith(name)), None) for name in names)
        if first is not None and second is not None:
            pairs.append(crossed(first, second))
    return singles + [pair for pair in pairs if 2 < len(pair) <= MOST_PAIR_BINS]


def _along_chain(
    covariates: Covariates, residuals: Residuals, noise: Mapping[str, Noise]
) -> Iterator[tuple[Bins, Mapping[str, Noise]]]:
    """Yield one bin for the outputs of each joint or marker, and one for all others, where outputs have numbers."""
    numbers = {output: covariates.position.get(output) for output in noise}
    if len({k for k in numbers.values() if k is not None}) < 2:
        return
    for k in sorted(set(numbers.values()), key=lambda k: (k is None, k)):
        part = {output: one for output, one in noise.items() if numbers[output] == k}
        first = next(iter(part))
        if k is not None:
            words = f"{first.split('_')[0]} {k}"
        elif all(output.startswith("tip_") for output in part):
            words = "the tip"
        else:
            words = listed([output_unit(output).label for output in part])
        codes = tuple(np.zeros(len(run[first]), np.int64) for run in residuals)
        centre = np.nan if k is None else float(k)
        yield Bins("position", NamedUnit("position along the chain"), (words,), codes, (centre,)), part


def worst_places(places: Sequence[ErrorBin], count: int = LISTED) -> tuple[ErrorBin, ...]:
    """Return places with more of the error than of the readings: those above the noise first, then by that excess.

    Among places with the same readings only the first is listed.
    """
    seen: set[tuple[float, ...]] = set()
    different = []
    for place in places:
        print_ = (round(place.share_of_error, 12), round(place.share_of_samples, 12), round(place.z, 9))
        if print_ not in seen and place.excess > NOTABLE:
            seen.add(print_)
            different.append(place)
    return tuple(sorted(different, key=lambda place: (not place.more_than_noise, -place.excess))[:count])


def _place_output(means: BinMeans, k: int, flag: bool) -> PlaceOutput:
    n, mean, z = int(means.n[k]), float(means.mean[k]), float(means.z[k])
    reach = float(scipy.stats.t.ppf(0.975, means.freedom[k])) * float(means.standard_error[k])
    if not np.isfinite(z):
        z = 0.0 if mean == 0 else float(np.sign(mean)) * LARGEST_Z
    span, rms = (mean - reach, mean + reach), float(np.sqrt(means.squares[k] / n))
    return PlaceOutput(n, float(means.n_effective[k]), mean, span, rms, z, float(means.p[k]), flag)
