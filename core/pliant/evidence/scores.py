"""Errors of outputs, runs and conditions against the noise.

Intervals of an error are found by resampling blocks: whole runs if there are enough, else stretches of runs.

Blocks preserve the autocorrelation of the noise (Künsch 1989). Percentile intervals of few blocks are too narrow; the
percentiles are moved outwards to Φ(√(m/(m−1)) t_{α/2, m−1}) of m blocks (Hesterberg 2015, The American Statistician 69,
4).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from pliant.evidence.covariates import Covariates, binned
from pliant.evidence.error_bins import Noise, Residuals
from pliant.measurements.floors import Floor
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.units import si_unit

ENOUGH_RUNS = 8  # fewer are divided into stretches
REPLICATES = 1000
BLOCKS_WANTED = 24  # stretches in all when runs are cut
Interval = tuple[float, float]
NONE: Interval = (np.nan, np.nan)


def block_sums(columns: Sequence[Array], shortest: Sequence[float]) -> Array:
    """Return (m, c) sums over blocks: whole runs, or if they are few, stretches of at least `shortest` samples.

    Args:
        columns: per run (t, c) the summands.
        shortest: per run the number of samples over which its noise decorrelates.
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
    """Return the interval of a statistic of summed columns.

    Args:
        sums: (m, c) from `block_sums`.
        statistic: (k, c) sums → (k,) values.
    """
    m = len(sums)
    if m < 3:
        return NONE
    weights = np.random.default_rng(seed).multinomial(m, np.full(m, 1 / m), size=REPLICATES)
    with np.errstate(invalid="ignore", divide="ignore"):  # a resample may have no reading
        values = statistic(weights @ sums)
    values = values[np.isfinite(values)]
    if len(values) < REPLICATES // 2:
        return NONE
    tail = scipy.stats.norm.cdf(np.sqrt(m / (m - 1)) * scipy.stats.t.ppf((1 - confidence) / 2, m - 1))
    low, high = np.quantile(values, [tail, 1 - tail])
    return float(low), float(high)


FORGETTING = 6.0  # memory times in a bootstrap block
SET_BY_THE_BENCH = (
    "pressure",
    "tendon",
    "moment_n_m",
    "tip_force",
    "payload",
    "temperature",
    "base_",
    "specimen",
)


@dataclass(frozen=True)
class OutputError:
    """One output, SI: intervals are 95 % (see `interval`); `source` is that of `noise_floor`."""

    rmse: float
    unit: str
    noise_floor: float
    source: str
    ratio_to_floor: float
    bias: float
    rmse_interval: Interval
    bias_interval: Interval
    noise: Noise
    n: int
    n_effective: float


@dataclass(frozen=True)
class GroupError:
    """The error over one run, or over the repeats of one condition.

    Attributes:
        name: the run's, or the runs' names.
        words: what distinguishes it, e.g. "payload 20 g, 40 °C"; may be empty.
        runs: names of its runs.
        outputs: rmse and bias by output, SI.
        rmse_over_floor: over all outputs.
        share_of_error: of the squared error in units of the floor.
        n: readings.
    """

    name: str
    words: str
    runs: tuple[str, ...]
    outputs: Mapping[str, Mapping[str, float]]
    rmse_over_floor: float
    share_of_error: float
    n: int


def output_error(
    name: str,
    residuals: Residuals,
    floor: Floor | None,
    noise: Noise,
    steps_s: Sequence[float],
    worth: float,
    seed: int,
) -> OutputError:
    """Return the error of one output.

    `steps_s` is the time between neighbouring readings of each run, `worth` the number of independent readings.
    """
    series = [run[name] for run in residuals]
    columns = [np.stack([np.isfinite(s), np.nan_to_num(s), np.nan_to_num(s) ** 2], axis=1) for s in series]
    n, total, square = np.sum([c.sum(axis=0) for c in columns], axis=0)
    sums = block_sums(columns, _blocks(noise, steps_s))
    rmse, value = float(np.sqrt(square / n)), np.nan if floor is None else floor.value
    return OutputError(
        rmse=rmse,
        unit=si_unit(name),
        noise_floor=value,
        source="unknown" if floor is None else floor.source,
        ratio_to_floor=rmse / value if value > 0 else np.nan,
        bias=float(total / n),
        rmse_interval=interval(sums, lambda s: np.sqrt(s[:, 2] / s[:, 0]), seed),
        bias_interval=interval(sums, lambda s: s[:, 1] / s[:, 0], seed),
        noise=noise,
        n=int(n),
        n_effective=worth,
    )


def overall(
    residuals: Residuals, noise: Mapping[str, Noise], steps_s: Sequence[float], seed: int
) -> tuple[float, Interval]:
    columns = []
    for run in residuals:
        scaled = np.stack([run[name] / one.total for name, one in noise.items()], axis=1)
        columns.append(np.stack([np.isfinite(scaled).sum(axis=1), np.nansum(scaled**2, axis=1)], axis=1))
    n, square = np.sum([c.sum(axis=0) for c in columns], axis=0)
    longest = max(noise.values(), key=lambda one: one.memory_s)
    sums = block_sums(columns, _blocks(longest, steps_s))
    return float(np.sqrt(square / n)), interval(sums, lambda s: np.sqrt(s[:, 1] / s[:, 0]), seed)


def _blocks(noise: Noise, steps_s: Sequence[float]) -> list[float]:
    """Return per run the number of samples over which the noise decorrelates."""
    return [FORGETTING * noise.memory_s / step_s if step_s > 0 else 1.0 for step_s in steps_s]


def group_error(
    measurement: Measurement,
    words: Sequence[tuple[str, ...]],
    residuals: Residuals,
    noise: Mapping[str, Noise],
    known: bool,
    numbers: tuple[int, ...],
) -> GroupError:
    """Return the error over these runs; `words` are those of every run, `known` whether every output has a floor."""
    total = sum(float(np.nansum((run[o] / noise[o].total) ** 2)) for run in residuals for o in noise)
    series = {o: np.concatenate([residuals[k][o] for k in numbers]) for o in noise}
    there = {o: s[np.isfinite(s)] for o, s in series.items()}
    error = sum(float(np.sum((s / noise[o].total) ** 2)) for o, s in there.items())
    n = sum(len(s) for s in there.values())
    names = tuple(measurement.runs[k].name for k in numbers)
    shared = [text for text in words[numbers[0]] if all(text in words[k] for k in numbers)]
    read = {o: s for o, s in there.items() if len(s)}
    outputs = {o: {"rmse": float(np.sqrt(np.mean(s**2))), "bias": float(s.mean())} for o, s in read.items()}
    ratio = float(np.sqrt(error / n)) if n and known else np.nan
    share = error / total if total > 0 else np.nan
    return GroupError(", ".join(names), ", ".join(shared), names, outputs, ratio, share, n)


def run_words(covariates: Covariates, n_runs: int) -> list[tuple[str, ...]]:
    """Return what distinguishes each run: its rate, its specimen, and unusual loads and conditions."""
    parts: list[list[str]] = [[] for _ in range(n_runs)]
    for item in covariates.items:
        if item.name.startswith("rate_"):
            for part, rate in zip(parts, item.values, strict=True):
                if np.isfinite(rate).any():
                    part.append(item.shown.text(float(np.nanmedian(rate)), 2))
        elif item.name.startswith(SET_BY_THE_BENCH):
            bins = binned(item)
            own = [codes[0] if len(codes) and np.ptp(codes) == 0 else -1 for codes in bins.codes]
            most = max(set(own), key=own.count)
            usual = most if own.count(most) > n_runs / 2 else None
            for part, code in zip(parts, own, strict=True):
                if code >= 0 and code != usual:
                    part.append(bins.words[code])
    return [tuple(part) for part in parts]
