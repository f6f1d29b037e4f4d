"""Model against measurement: how large the error is, against which noise, and where.

Residuals are measured − predicted throughout.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pliant.errors import UserError
from pliant.evidence.bins import binned
from pliant.evidence.bootstrap import NONE, Interval, block_sums, interval
from pliant.evidence.covariates import Covariates, covariates
from pliant.evidence.effective import clock_of
from pliant.evidence.floors import Floor, floor_remarks, noise_floors
from pliant.evidence.importance import importance
from pliant.evidence.noise import Noise, noise_of
from pliant.evidence.places import Place, Residuals, find_places, worst_places
from pliant.evidence.repeats import RepeatGroup, repeat_groups
from pliant.evidence.significance import coloured_count
from pliant.evidence.words import si_unit
from pliant.records.design import Array
from pliant.records.measurement import MeasuredRun, Measurement

NO_NOISE = "no noise"
ROUNDING = 1e-7  # of the readings: smaller floors come from computed data
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
JUDGED_BY = ("repeats", "stated sigma")  # floors that hold the bench's own scatter


@dataclass(frozen=True)
class OutputError:
    """One output, SI: intervals are 95 % (see `bootstrap`); `source` is that of `noise_floor`."""

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
        depends_on: covariate → share of the error's variance that it tells (see `importance`), largest first.
        labels: covariate → words.
        n_places: (bin, output) pairs that were tested; significance is corrected for so many.
        n_samples, n_effective: readings, and how many independent ones they are worth.
        judged: every floor comes from repeats or a stated sigma, so that "right" and "wrong" have a meaning.
        remarks: what limits the comparison, in sentences.
    """

    outputs: Mapping[str, OutputError]
    rmse_over_floor: float
    rmse_over_floor_interval: Interval
    runs: tuple[GroupError, ...]
    conditions: tuple[GroupError, ...]
    places: tuple[Place, ...]
    worst: tuple[Place, ...]
    depends_on: Mapping[str, float]
    labels: Mapping[str, str]
    n_places: int
    n_samples: int
    n_effective: float
    judged: bool
    remarks: tuple[str, ...]

    @property
    def has_floor(self) -> bool:
        """Whether every output has a floor of some source."""
        return bool(np.isfinite(self.rmse_over_floor))

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


def compare(
    measurement: Measurement,
    predicted: Sequence[Mapping[str, Array]],
    floors: Mapping[str, Floor] | None = None,
    *,
    seed: int = 0,
) -> Comparison:
    """Errors per output, run and condition against the noise floor, and where they are.

    Args:
        measurement: what the bench recorded.
        predicted: for each run the model's outputs by name, (t,) each.
        floors: from `noise_floors`; made here by default.
        seed: of the bootstrap.

    Raises:
        UserError: no output in common, or no reading that can be compared.
    """
    residuals = residuals_of(measurement, predicted)
    names = [n for n in residuals[0] if any(np.isfinite(run[n]).any() for run in residuals)]
    if not names:
        raise UserError("no reading can be compared: every reading or prediction is missing.")
    residuals = [{name: run[name] for name in names} for run in residuals]
    floors = noise_floors(measurement, predicted_aside(measurement, residuals)) if floors is None else floors
    floors = {name: floors[name] for name in names if name in floors}
    noiseless = _without_noise(floors, measurement)
    floors = {name: floor for name, floor in floors.items() if name not in noiseless}
    groups = repeat_groups(measurement)
    noise = {n: noise_of(floors.get(n), measurement, groups, [run[n] for run in residuals]) for n in names}
    steps_s = [_step_s(run) for run in measurement.runs]
    found = covariates(measurement, predicted)
    places = find_places(residuals, found, noise, steps_s)
    outputs = {n: _output(n, residuals, floors.get(n), noise[n], steps_s, seed) for n in names}
    outputs |= {name: replace(outputs[name], source=NO_NOISE) for name in noiseless}
    known = all(np.isfinite(error.noise_floor) for error in outputs.values())
    ratio, ratio_interval = _overall(residuals, noise, steps_s, seed) if known else (np.nan, NONE)
    runs = [(k,) for k in range(len(measurement.runs))]
    score = partial(_group, measurement, _run_words(found, len(runs)), residuals, noise, known)
    return Comparison(
        outputs=outputs,
        rmse_over_floor=ratio,
        rmse_over_floor_interval=ratio_interval,
        runs=tuple(score(run) for run in runs),
        conditions=tuple(score(condition) for condition in _conditions(runs, groups)),
        places=places,
        worst=worst_places(places),
        depends_on=importance(residuals, found, {name: one.total for name, one in noise.items()}),
        labels={
            "position": "position along the chain",
            **{item.name: item.shown.label for item in found.items},
        },
        n_places=sum(len(place.outputs) for place in places),
        n_samples=sum(error.n for error in outputs.values()),
        n_effective=sum(error.n_effective for error in outputs.values()),
        judged=all(error.source in JUDGED_BY for error in outputs.values()),
        remarks=(
            *measurement.remarks,
            *floor_remarks(floors),
            *_remarks(measurement, names, residuals, noiseless),
        ),
    )


def _without_noise(floors: Mapping[str, Floor], measurement: Measurement) -> list[str]:
    """Outputs whose floor is only rounding: computed data."""
    found = []
    for name, floor in floors.items():
        readings = np.concatenate([run.outputs[name] for run in measurement.runs])
        if floor.value <= ROUNDING * float(np.sqrt(np.nanmean(readings**2))):
            found.append(name)
    return found


def predicted_aside(measurement: Measurement, residuals: Residuals) -> Residuals:
    """Residuals for every output of the measurement: NaN for those that the model does not have."""
    return [
        {name: run.get(name, np.full(len(m), np.nan)) for name in measurement.outputs}
        for m, run in zip(measurement.runs, residuals, strict=True)
    ]


def _step_s(run: MeasuredRun) -> float:
    return float(np.median(np.diff(clock_of(run)))) if len(run) > 1 else 1.0


def _output(
    name: str, residuals: Residuals, floor: Floor | None, noise: Noise, steps_s: Sequence[float], seed: int
) -> OutputError:
    series = [run[name] for run in residuals]
    columns = [np.stack([np.isfinite(s), np.nan_to_num(s), np.nan_to_num(s) ** 2], axis=1) for s in series]
    n, total, square = np.sum([c.sum(axis=0) for c in columns], axis=0)
    sums = block_sums(columns, _blocks(noise, steps_s))
    coloured = sum(
        float(coloured_count(np.zeros(len(s), np.int64), np.isfinite(s), 1, noise.correlation(step_s))[0])
        for s, step_s in zip(series, steps_s, strict=True)
    )
    rmse, value = float(np.sqrt(square / n)), floor.value if floor is not None else np.nan
    return OutputError(
        rmse=rmse,
        unit=si_unit(name),
        noise_floor=value,
        source=floor.source if floor is not None else "unknown",
        ratio_to_floor=rmse / value if value > 0 else np.nan,
        bias=float(total / n),
        rmse_interval=interval(sums, lambda s: np.sqrt(s[:, 2] / s[:, 0]), seed),
        bias_interval=interval(sums, lambda s: s[:, 1] / s[:, 0], seed),
        noise=noise,
        n=int(n),
        n_effective=float(n**2 / coloured),
    )


def _overall(
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
    """Per run the samples after which the noise has forgotten itself."""
    return [FORGETTING * noise.memory_s / step_s if step_s > 0 else 1.0 for step_s in steps_s]


def _conditions(runs: Sequence[tuple[int, ...]], groups: Sequence[RepeatGroup]) -> list[tuple[int, ...]]:
    """Runs that repeat each other together, the others alone, in the order of the measurement."""
    group_of = {k: tuple(group.runs) for group in groups for k in group.runs}
    return list(dict.fromkeys(group_of.get(run[0], run) for run in runs))


def _group(
    measurement: Measurement,
    words: Sequence[tuple[str, ...]],
    residuals: Residuals,
    noise: Mapping[str, Noise],
    known: bool,
    numbers: tuple[int, ...],
) -> GroupError:
    total = sum(float(np.nansum((run[o] / noise[o].total) ** 2)) for run in residuals for o in noise)
    series = {o: np.concatenate([residuals[k][o] for k in numbers]) for o in noise}
    there = {o: s[np.isfinite(s)] for o, s in series.items()}
    error = sum(float(np.sum((s / noise[o].total) ** 2)) for o, s in there.items())
    n = sum(len(s) for s in there.values())
    names = tuple(measurement.runs[k].name for k in numbers)
    return GroupError(
        name=", ".join(names),
        words=", ".join(text for text in words[numbers[0]] if all(text in words[k] for k in numbers)),
        runs=names,
        outputs={
            o: {"rmse": float(np.sqrt(np.mean(s**2))), "bias": float(s.mean())}
            for o, s in there.items()
            if len(s)
        },
        rmse_over_floor=float(np.sqrt(error / n)) if n and known else np.nan,
        share_of_error=error / total if total > 0 else np.nan,
        n=n,
    )


def _run_words(found: Covariates, n_runs: int) -> list[tuple[str, ...]]:
    """What sets each run apart: its rate, its specimen, and loads and conditions that are not the usual ones."""
    parts: list[list[str]] = [[] for _ in range(n_runs)]
    for item in found.items:
        if item.name.startswith("rate_"):
            for part, rate in zip(parts, item.values, strict=True):
                if np.isfinite(rate).any():
                    part.append(item.shown.text(float(np.nanmedian(rate)), 2))
        elif item.name.startswith(SET_BY_THE_BENCH):
            bins = binned(item)
            own = [codes[0] if len(codes) and np.ptp(codes) == 0 else -1 for codes in bins.codes]
            usual = (
                max(set(own), key=own.count) if own.count(max(set(own), key=own.count)) > n_runs / 2 else None
            )
            for part, code in zip(parts, own, strict=True):
                if code >= 0 and code != usual:
                    part.append(bins.words[code])
    return [tuple(part) for part in parts]


def _remarks(
    measurement: Measurement, names: Sequence[str], residuals: Residuals, noiseless: Sequence[str]
) -> list[str]:
    remarks = []
    if noiseless:
        remarks.append(
            f"{', '.join(noiseless)}: readings without any noise; there is no floor to compare with."
        )
    left = [name for name in measurement.outputs if name not in names]
    lost = sum(
        int((np.isfinite(run.outputs[name]) & ~np.isfinite(error[name])).sum())
        for run, error in zip(measurement.runs, residuals, strict=True)
        for name in names
    )
    if lost:
        remarks.append(f"{lost} readings are left out, because the model found no equilibrium there.")
    if left:
        remarks.append(f"Not compared, because the model or the file has no values of it: {', '.join(left)}.")
    if len(measurement.runs) == 1:
        remarks.append("There is one run only: offsets between runs cannot be told from errors of the model.")
    return remarks
