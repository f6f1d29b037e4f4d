"""What any model of a bench has to beat: four baselines, each chosen on blocks of the training runs.

`python -m benchmarks.real.five` prints their errors on the runs that judge, by bench and output.

1. the stated law: the study's chain with its plain law, its frame and zeros as the training runs have them;
2. a polynomial of the inputs of the moment (total degree 1 to 3);
3. a first-order lag of the inputs, then a polynomial of them and of what lags (the time constant chosen too);
4. an ARX model (linear in the last n readings and inputs, ridge), run freely: it sees its own predictions, never a
   reading after its first n.

A polynomial is fitted by ridge regression of standardised columns. "Chosen on
training blocks" means: a block is a run where the training has three or more, else one of `FOLDS` × `ROUNDS` stretches
that are dealt out in turn; each is predicted by a model that was fitted without its rows, and the order with the
smallest error is fitted again to all. Where the notes leave the zero of each run open, a run's mean error is taken off,
for every model alike; nothing else of a judged run is seen. Positions in turned cameras are turned back first.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pliant.config.measurements import PER_RUN
from pliant.records.design import Array
from pliant.records.measurement import Measurement

FOLDS, ROUNDS, ENOUGH_RUNS = 5, 3, 3
DEGREES = (1, 2, 3)
LAGS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.5)  # time constants, as a share of the longest run over 10
ORDERS = (1, 2, 3, 5, 8)
RIDGES = (1e-6, 1e-4, 1e-2, 1.0)
PLAIN_RIDGE = 1e-8  # of a row, of polynomials
FAR = 20.0  # standard deviations from which on a free run has left the bench


@dataclass(frozen=True, eq=False)
class Series:
    """A run as the baselines see it: the clock, inputs (t, m) and readings (t, k), standardised over training."""

    name: str
    time: Array
    inputs: Array
    outputs: Array
    fold: Array


@dataclass(frozen=True, eq=False)
class Scales:
    """Scales of inputs and readings: the training runs' mean and standard deviation."""

    input_mean: Array
    input_sd: Array
    output_mean: Array
    output_sd: Array
    names: tuple[str, ...]
    per_run: tuple[bool, ...]
    clocked: bool


Predictor = Callable[[Series], Array]
Fit = Callable[[Sequence[Series], int | None], Predictor]


def driving_columns(run: Any) -> Array:
    """Return (t, m) all that drives a run: its inputs, the payload, whether it is still held."""
    history = run.history
    signals = [*history.actuation.values()]
    payload = np.zeros(len(history)) if history.payload_kg is None else history.payload_kg
    free = np.ones(len(history))
    if history.let_go is not None:
        until = -np.inf if history.let_go.until_s is None else history.let_go.until_s
        free = np.array(history.time_s > until, float)
    return np.stack([*signals, payload * free, free], axis=1)


def training_scales(measurement: Measurement, outputs: Sequence[str]) -> Scales:
    """Return the scales of the training runs; a column that never changes is left at zero."""
    inputs = np.concatenate([driving_columns(run) for run in measurement.runs])
    read = np.concatenate([_readings(run, outputs, measurement) for run in measurement.runs])
    return Scales(
        inputs.mean(axis=0),
        np.where(np.ptp(inputs, axis=0) > 0, inputs.std(axis=0), np.inf),
        np.nanmean(read, axis=0),
        np.nanstd(read, axis=0),
        tuple(outputs),
        tuple(measurement.free_zeros.get(name) == PER_RUN for name in outputs),
        all(run.history.time_s is not None for run in measurement.runs),
    )


def _readings(run: Any, outputs: Sequence[str], measurement: Measurement) -> Array:
    """Return readings (t, k), those with a free zero per run relative to the run's first one."""
    read = np.stack([run.outputs[name] for name in outputs], axis=1)
    for k, name in enumerate(outputs):
        there = np.flatnonzero(np.isfinite(read[:, k]))
        if measurement.free_zeros.get(name) == PER_RUN and len(there):
            read[:, k] -= read[there[0], k]
    return read


def standardised_series(measurement: Measurement, scales: Scales) -> list[Series]:
    """Return the runs, standardised; runs without a reading of these outputs are left out."""
    found = []
    for run in measurement.runs:
        read = (_readings(run, scales.names, measurement) - scales.output_mean) / scales.output_sd
        if not np.isfinite(read).any():
            continue
        n = len(run)
        time = np.arange(n, dtype=float) if run.history.time_s is None else run.history.time_s
        there = np.flatnonzero(np.isfinite(read).all(axis=1))
        place = np.clip((np.arange(n) - there[0]) / max(there[-1] - there[0] + 1, 1), 0.0, 1.0 - 1e-9)
        fold = (place * FOLDS * ROUNDS).astype(int) % FOLDS
        found.append(
            Series(run.name, time, (driving_columns(run) - scales.input_mean) / scales.input_sd, read, fold)
        )
    if len(found) < ENOUGH_RUNS:
        return found
    return [replace(one, fold=np.full(len(one.time), number)) for number, one in enumerate(found)]


def ridge(columns: Array, targets: Array, strength: float) -> Array:
    """Return the weights of a ridge regression, the last column of ones free; (c, k)."""
    penalty = strength * len(columns) * np.eye(columns.shape[1])
    penalty[-1, -1] = 0.0
    return np.asarray(np.linalg.lstsq(columns.T @ columns + penalty, columns.T @ targets, rcond=None)[0])


def powers(inputs: Array, degree: int) -> Array:
    """Return all products of the columns up to a total degree, and ones at the end."""
    n = inputs.shape[1]
    products = [
        np.prod(inputs[:, list(chosen)], axis=1)
        for d in range(1, degree + 1)
        for chosen in itertools.combinations_with_replacement(range(n), d)
    ]
    return np.stack([*products, np.ones(len(inputs))], axis=1)


def lagged(series: Series, time_s: float) -> Array:
    """Return (t, m) inputs behind a first-order lag, at rest at the begin."""
    if time_s <= 0.0:
        return series.inputs
    state, found = series.inputs[0], np.empty_like(series.inputs)
    for k, (values, step) in enumerate(
        zip(series.inputs, np.diff(series.time, prepend=series.time[0]), strict=True)
    ):
        state = state + (1.0 - np.exp(-step / time_s)) * (values - state)
        found[k] = state
    return found


def _kept(series: Series, left_out: int | None) -> NDArray[np.bool_]:
    good = np.isfinite(series.outputs).all(axis=1)
    return np.asarray(good if left_out is None else good & (series.fold != left_out), bool)


def _static(columns: Callable[[Series], Array]) -> Fit:
    def fit(training: Sequence[Series], left_out: int | None) -> Predictor:
        kept = [_kept(one, left_out) for one in training]
        tables = [columns(one)[keep] for one, keep in zip(training, kept, strict=True)]
        targets = [one.outputs[keep] for one, keep in zip(training, kept, strict=True)]
        weights = ridge(np.concatenate(tables), np.concatenate(targets), PLAIN_RIDGE)
        return lambda series: np.asarray(columns(series) @ weights)

    return fit


def polynomial(degree: int) -> Fit:
    """Return the fit of a polynomial of the inputs of the moment."""
    return _static(lambda series: powers(series.inputs, degree))


def lag(time_s: float, degree: int) -> Fit:
    """Return the fit of a polynomial of the lagged inputs and of the instantaneous inputs."""
    return _static(lambda series: np.hstack([series.inputs, powers(lagged(series, time_s), degree)]))


def arx(order: int, strength: float) -> Fit:
    """Return the fit of an ARX model with `order` past readings and inputs."""

    def rows(series: Series, outputs: Array) -> Array:
        n = len(outputs)
        past = [outputs[order - i : n - i] for i in range(1, order + 1)]
        driven = [series.inputs[order - i : n - i] for i in range(order + 1)]
        return np.hstack([*past, *driven, np.ones((n - order, 1))])

    def fit(training: Sequence[Series], left_out: int | None) -> Predictor:
        tables, targets = [], []
        for series in training:
            table = rows(series, series.outputs)
            keep = _kept(series, left_out)[order:] & np.isfinite(table).all(axis=1)
            tables.append(table[keep])
            targets.append(series.outputs[order:][keep])
        weights = ridge(np.concatenate(tables), np.concatenate(targets), strength)

        def predict(series: Series) -> Array:
            found = np.full_like(series.outputs, np.nan)
            first = int(np.flatnonzero(np.isfinite(series.outputs).all(axis=1))[0])
            start = series.outputs[first : first + order]
            found[first : first + order] = np.where(np.isfinite(start), start, series.outputs[first])
            for k in range(first + order, len(found)):
                past = [found[k - i] for i in range(1, order + 1)]
                driven = [series.inputs[k - i] for i in range(order + 1)]
                row = np.concatenate([*past, *driven, [1.0]])
                found[k] = np.clip(row @ weights, -FAR, FAR)
            return found

        return predict

    return fit


def miss(
    series: Sequence[Series], predictions: Sequence[Array], per_run: Sequence[bool], fold: int | None
) -> Array:
    """Return (k,) mean squares of standardised errors, a run's own zero taken off where it has one."""
    squares, counts = np.zeros(len(per_run)), np.zeros(len(per_run))
    for one, predicted in zip(series, predictions, strict=True):
        error = one.outputs - predicted
        if fold is not None:
            error = np.where((one.fold == fold)[:, None], error, np.nan)
        there = np.isfinite(error)
        means = np.where(there, error, 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
        error = error - np.where(per_run, means, 0.0)
        squares += np.where(there, error, 0.0).__pow__(2).sum(axis=0)
        counts += there.sum(axis=0)
    return squares / np.maximum(counts, 1)


@dataclass(frozen=True)
class Chosen:
    """A baseline with the order that blocks left out chose."""

    name: str
    order: str
    blocked: float
    predict: Predictor


def choose(name: str, tries: Sequence[tuple[str, Fit]], training: Sequence[Series], scales: Scales) -> Chosen:
    """Return the try that predicts blocks of the training runs best, fitted to all of them."""
    scored = []
    for order, fit in tries:
        total = 0.0
        folds = sorted({int(number) for one in training for number in one.fold})
        for fold in folds:
            predict = fit(training, fold)
            total += float(miss(training, [predict(one) for one in training], scales.per_run, fold).sum())
        scored.append((total / len(folds), order, fit))
    best = min(scored, key=lambda one: one[0])
    return Chosen(name, best[1], float(np.sqrt(best[0] / len(scales.names))), best[2](training, None))


def baselines(training: Sequence[Series], scales: Scales) -> list[Chosen]:
    """Return the three baselines without a law, each with its best order."""
    longest = max(float(np.ptp(one.time)) for one in training)
    found = [choose("polynomial", [(f"degree {d}", polynomial(d)) for d in DEGREES], training, scales)]
    if scales.clocked:
        tries = [
            (f"{share * longest / 10:.3g} s, degree {d}", lag(share * longest / 10, d))
            for share in LAGS[1:]
            for d in DEGREES
        ]
        found.append(choose("lag + polynomial", tries, training, scales))
    tries = [(f"order {n}, ridge {r:g}", arx(n, r)) for n in ORDERS for r in RIDGES]
    found.append(choose("ARX, free run", tries, training, scales))
    return found


def errors(chosen: Chosen, judged: Sequence[Series], scales: Scales) -> dict[str, float]:
    """Return the root mean square error of each output on the runs that judge, SI."""
    square = miss(judged, [chosen.predict(one) for one in judged], scales.per_run, None)
    sizes = np.sqrt(square) * scales.output_sd
    return dict(zip(scales.names, sizes.tolist(), strict=True))
