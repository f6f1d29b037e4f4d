"""Model against measurement: how large the error is, against which noise, and where.

    compare(measurement, predicted, floors)  →  Comparison

Residuals are measured − predicted throughout.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.errors import UserError
from pliant.evidence.bins import binned
from pliant.evidence.bootstrap import NONE, Interval, interval, run_sums
from pliant.evidence.covariates import Covariates, covariates
from pliant.evidence.places import Place, Residuals, find_places, worst_places
from pliant.evidence.significance import Noise, coloured_count
from pliant.evidence.words import si_unit
from pliant.records.design import Array
from pliant.records.measurement import Measurement

FORGETTING = 6.0  # correlation times in a bootstrap block


@dataclass(frozen=True)
class OutputError:
    """One output, SI. `interval`s are 95 % (see `bootstrap`); `noise_floor` is NaN where none is known."""

    rmse: float
    unit: str
    noise_floor: float
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


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model against a measurement.

    Attributes:
        outputs: by name, see `OutputError`.
        rmse_over_floor: root mean square error in units of the floor, all readings; NaN without a floor.
        rmse_over_floor_interval: its 95 % interval.
        runs, conditions: errors run by run, and with repeats taken together.
        places: every bin of every covariate; shares of one covariate sum to 1.
        worst: places that hold more than their part of the error, the worst first.
        n_places: (bin, output) pairs that were tested; significance is corrected for so many.
        n_samples, n_effective: readings, and how many independent ones they are worth.
        judged: a noise floor is known, so that "right" and "wrong" have a meaning.
        remarks: what limits the comparison, in sentences.
    """

    outputs: Mapping[str, OutputError]
    rmse_over_floor: float
    rmse_over_floor_interval: Interval
    runs: tuple[GroupError, ...]
    conditions: tuple[GroupError, ...]
    places: tuple[Place, ...]
    worst: tuple[Place, ...]
    n_places: int
    n_samples: int
    n_effective: float
    judged: bool
    remarks: tuple[str, ...]

    @property
    def significant(self) -> tuple[Place, ...]:
        """Places where the mean error is more than noise, after correction for all that were looked at."""
        return tuple(place for place in self.places if place.significant)


def residuals_of(measurement: Measurement, predicted: Sequence[Mapping[str, Array]]) -> Residuals:
    """Per run, measured − predicted for the outputs that both have; NaN where nothing was read.

    Raises:
        UserError: no output in common.
    """
    common = [name for name in measurement.outputs if all(name in run for run in predicted)]
    if not common:
        has = ", ".join(sorted({name for run in predicted for name in run})) or "none"
        raise UserError(
            f"{measurement.source or 'the measurement'} has the outputs {', '.join(measurement.outputs) or 'none'}, "
            f"the model has {has}: nothing to compare."
        )
    return [
        {name: np.asarray(run.outputs[name], float) - np.asarray(model[name], float) for name in common}
        for run, model in zip(measurement.runs, predicted, strict=True)
    ]


def compare_noise(
    measurement: Measurement,
    predicted: Sequence[Mapping[str, Array]],
    noise: Mapping[str, Noise | None],
    groups: Sequence[Sequence[str]] = (),
    *,
    seed: int = 0,
) -> Comparison:
    """`compare` with the noise of each output stated; None where it is not known.

    Args:
        groups: names of runs that repeat each other; runs in no group stand alone.
    """
    residuals = residuals_of(measurement, predicted)
    names = [n for n in residuals[0] if any(np.isfinite(run[n]).any() for run in residuals)]
    if not names:
        raise UserError("no reading can be compared: every reading or prediction is missing.")
    residuals = [{name: run[name] for name in names} for run in residuals]
    known = {name: noise.get(name) for name in names}
    unit = {name: _scale(known[name], [run[name] for run in residuals]) for name in names}
    found = covariates(measurement, predicted)
    places = find_places(residuals, found, unit)
    outputs = {name: _output(name, residuals, known[name], unit[name], seed) for name in names}
    judged = all(value is not None for value in known.values())
    ratio, ratio_interval = _overall(residuals, unit, seed) if judged else (np.nan, NONE)
    by_name = {run.name: k for k, run in enumerate(measurement.runs)}
    alone = [(run.name,) for run in measurement.runs]
    together = _conditions(measurement, groups)
    words = _run_words(found, len(alone))
    return Comparison(
        outputs=outputs,
        rmse_over_floor=ratio,
        rmse_over_floor_interval=ratio_interval,
        runs=_groups(alone, by_name, words, residuals, unit, judged),
        conditions=_groups(together, by_name, words, residuals, unit, judged),
        places=places,
        worst=worst_places(places),
        n_places=sum(len(place.outputs) for place in places),
        n_samples=sum(error.n for error in outputs.values()),
        n_effective=sum(error.n_effective for error in outputs.values()),
        judged=judged,
        remarks=(*measurement.remarks, *_remarks(measurement, names)),
    )


def _scale(noise: Noise | None, residuals: Sequence[Array]) -> Noise:
    """The noise, or, where none is known, the residual's own scatter and colour, so that shares can be told."""
    if noise is not None and noise.total > 0:
        return noise
    there = np.concatenate(residuals)
    rms = float(np.sqrt(np.nanmean(there**2)))
    return Noise(rms if rms > 0 else 1.0, correlation=lag_one(residuals))


def lag_one(series: Sequence[Array]) -> float:
    """Lag-one correlation within runs about the mean of all, 0 to 0.999; missing neighbours are skipped."""
    mean = np.nanmean(np.concatenate(series))
    product = np.concatenate([(s[1:] - mean) * (s[:-1] - mean) for s in series])
    square = np.nanmean((np.concatenate(series) - mean) ** 2)
    if not np.isfinite(product).any() or square == 0:
        return 0.0
    return float(np.clip(np.nanmean(product) / square, 0.0, 0.999))


def _output(name: str, residuals: Residuals, noise: Noise | None, unit: Noise, seed: int) -> OutputError:
    series = [run[name] for run in residuals]
    columns = [np.stack([np.isfinite(s), np.nan_to_num(s), np.nan_to_num(s) ** 2], axis=1) for s in series]
    n, total, square = np.sum([c.sum(axis=0) for c in columns], axis=0)
    sums = run_sums(columns, _block(unit))
    zeros = [np.zeros(len(s), np.int64) for s in series]
    coloured = sum(
        coloured_count(z, np.isfinite(s), 1, unit.correlation)[0] for z, s in zip(zeros, series, strict=True)
    )
    rmse, floor = float(np.sqrt(square / n)), noise.total if noise else np.nan
    return OutputError(
        rmse=rmse,
        unit=si_unit(name),
        noise_floor=floor,
        ratio_to_floor=rmse / floor if floor > 0 else np.nan,
        bias=float(total / n),
        rmse_interval=interval(sums, lambda s: np.sqrt(s[:, 2] / s[:, 0]), seed),
        bias_interval=interval(sums, lambda s: s[:, 1] / s[:, 0], seed),
        noise=unit,
        n=int(n),
        n_effective=float(n**2 / coloured),
    )


def _overall(residuals: Residuals, unit: Mapping[str, Noise], seed: int) -> tuple[float, Interval]:
    columns = []
    for run in residuals:
        scaled = np.stack([run[name] / unit[name].total for name in unit], axis=1)
        columns.append(np.stack([np.isfinite(scaled).sum(axis=1), np.nansum(scaled**2, axis=1)], axis=1))
    n, square = np.sum([c.sum(axis=0) for c in columns], axis=0)
    sums = run_sums(columns, max(_block(noise) for noise in unit.values()))
    return float(np.sqrt(square / n)), interval(sums, lambda s: np.sqrt(s[:, 1] / s[:, 0]), seed)


def _block(noise: Noise) -> float:
    """Samples after which the noise has forgotten itself."""
    return FORGETTING / -np.log(noise.correlation) if noise.correlation > 0 else 1.0


def _conditions(measurement: Measurement, groups: Sequence[Sequence[str]]) -> list[tuple[str, ...]]:
    group_of = {name: tuple(group) for group in groups for name in group}
    return list(dict.fromkeys(group_of.get(run.name, (run.name,)) for run in measurement.runs))


def _groups(
    groups: Sequence[tuple[str, ...]],
    by_name: Mapping[str, int],
    words: Sequence[str],
    residuals: Residuals,
    unit: Mapping[str, Noise],
    judged: bool,
) -> tuple[GroupError, ...]:
    total = sum(float(np.nansum((run[o] / unit[o].total) ** 2)) for run in residuals for o in unit)
    made = []
    for group in groups:
        numbers = [by_name[name] for name in group]
        series = {o: np.concatenate([residuals[k][o] for k in numbers]) for o in unit}
        there = {o: s[np.isfinite(s)] for o, s in series.items()}
        error = sum(float(np.sum((s / unit[o].total) ** 2)) for o, s in there.items())
        n = sum(len(s) for s in there.values())
        made.append(
            GroupError(
                name=", ".join(group),
                words=words[numbers[0]],
                runs=group,
                outputs={
                    o: {"rmse": float(np.sqrt(np.mean(s**2))), "bias": float(s.mean())}
                    for o, s in there.items()
                    if len(s)
                },
                rmse_over_floor=float(np.sqrt(error / n)) if n and judged else np.nan,
                share_of_error=error / total if total > 0 else np.nan,
                n=n,
            )
        )
    return tuple(made)


def _run_words(found: Covariates, n_runs: int) -> list[str]:
    """What each run is like, where runs differ."""
    parts: list[list[str]] = [[] for _ in range(n_runs)]
    for item in found.items:
        if item.name in ("run_number", "moment_direction") or not item.constant_in_runs:
            continue
        bins = binned(item)
        for k, codes in enumerate(bins.codes):
            if len(codes):
                parts[k].append(bins.words[codes[0]])
    return [", ".join(dict.fromkeys(part)) for part in parts]


def _remarks(measurement: Measurement, names: Sequence[str]) -> list[str]:
    remarks = []
    left = [name for name in measurement.outputs if name not in names]
    if left:
        remarks.append(f"Not compared, because the model or the file has no values of it: {', '.join(left)}.")
    if len(measurement.runs) == 1:
        remarks.append("There is one run only: offsets between runs cannot be told from errors of the model.")
    return remarks
