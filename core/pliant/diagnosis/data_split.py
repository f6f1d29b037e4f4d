"""Test set held out before any inspection: whole runs, whose inputs are kept and whose readings are hidden.

Two questions are separated. A held-out repeat tests the model for the same inputs on another day; a condition that is
held out with all its repeats tests it for inputs that it never saw.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pliant.diagnosis.left_out import condition_indices
from pliant.formatting import plural
from pliant.measurements.repeats import repeat_groups
from pliant.records.design import Array
from pliant.records.history import History
from pliant.records.measurement import MeasuredRun, Measurement

SHARE = 0.25
# Conditions that training must keep, and the number from which one may be held out as a whole.
KEPT, ENOUGH = 3, 5
# A circumstance is unique to a condition if no other comes as near as this share of the range.
ALONE = 0.2
GRID = 60


@dataclass(frozen=True, eq=False)
class TrainTestSplit:
    """A measurement in two parts.

    Attributes:
        runs: indices of the runs whose readings are hidden, increasing.
        unseen: those of them whose condition no training run has.
        training: the measurement with NaN for hidden readings; specimens still go through these runs.
        why: how it was divided, in a sentence.
    """

    runs: tuple[int, ...]
    unseen: tuple[int, ...]
    training: Measurement
    why: str

    def restricted_to(self, measurement: Measurement) -> TrainTestSplit:
        """Return the same split after readings were removed: runs without any are in no part."""
        there = [k for k, run in enumerate(measurement.runs) if _is_read(run)]
        return replace(
            self,
            runs=tuple(k for k in self.runs if k in there),
            unseen=tuple(k for k in self.unseen if k in there),
            training=_hidden(measurement, self.runs),
        )


def split_runs(measurement: Measurement, share: float = SHARE) -> TrainTestSplit:
    """Hold out about `share` of the runs; only inputs decide, never readings; the same runs give the same parts.

    1. From `ENOUGH` conditions on, one condition with all its runs: the one most similar to another one and not unique
    in what it shows, so that training still spans all that was done. The only repeated condition stays: it shows the
    noise.
    2. The last repeat of further conditions, evenly over the list, one each; of conditions done twice at most half, so
    that training keeps repeats to estimate its noise.
    3. If that is too little, further conditions chosen like the first, as long as `KEPT` remain.

    Fewer than 4 runs with readings cannot be divided: then nothing is held out.
    """
    read = [k for k, run in enumerate(measurement.runs) if _is_read(run)]
    if len(read) < 4:
        return TrainTestSplit(
            (), (), measurement, "There are too few runs to put any aside: all were fitted."
        )
    wanted = max(round(share * len(read)), 1)
    conditions = _conditions(measurement, read)
    several = [c for c in range(len(conditions)) if len(conditions[c]) > 1]
    alike = [c for c in _most_alike(measurement, conditions) if several != [c]]
    locked: list[int] = []
    gone: list[int] = []
    if alike and len(conditions) >= ENOUGH and len(conditions[alike[0]]) <= wanted:
        gone.append(alike[0])
        locked += conditions[alike[0]]
    repeated = [c for c in range(len(conditions)) if len(conditions[c]) > 1 and c not in gone]
    locked += _last_repeats([conditions[c] for c in repeated], wanted - len(locked))
    for c in alike:
        left = len(conditions) - len(gone)
        single = c not in gone and len(conditions[c]) == 1
        if single and left > KEPT and len(locked) < wanted:
            gone.append(c)
            locked += conditions[c]
    hidden = tuple(sorted(locked))
    unseen = tuple(sorted(k for c in gone for k in conditions[c]))
    return TrainTestSplit(
        hidden, unseen, _hidden(measurement, hidden), _why(measurement, hidden, unseen, len(read))
    )


def extend_split(measurement: Measurement, earlier: TrainTestSplit) -> TrainTestSplit:
    """Return an earlier split extended to new runs: old runs keep their part, new ones are split by `split_runs`."""
    number = {run.name: k for k, run in enumerate(measurement.runs)}
    before = [run.name for run in earlier.training.runs]
    since = split_runs(_hidden(measurement, [number[name] for name in before if name in number]))

    def both(old: Sequence[int], new: Sequence[int]) -> tuple[int, ...]:
        return tuple(sorted({number[before[k]] for k in old if before[k] in number} | set(new)))

    hidden, unseen = both(earlier.runs, since.runs), both(earlier.unseen, since.unseen)
    count = sum(map(_is_read, measurement.runs))
    return TrainTestSplit(
        hidden, unseen, _hidden(measurement, hidden), _why(measurement, hidden, unseen, count)
    )


def _is_read(run: MeasuredRun) -> bool:
    return any(np.isfinite(values).any() for values in run.outputs.values())


def _conditions(measurement: Measurement, read: Sequence[int]) -> list[list[int]]:
    """Return the runs with readings, repeats grouped, in the order of the measurement."""
    number = condition_indices(len(measurement.runs), [group.runs for group in repeat_groups(measurement)])
    found: dict[int, list[int]] = {}
    for k in read:
        found.setdefault(int(number[k]), []).append(k)
    return list(found.values())


def _last_repeats(conditions: Sequence[Sequence[int]], count: int) -> list[int]:
    """Return the last run of `count` of these conditions, evenly spread; at most half of the pairs are used."""
    if count <= 0 or not conditions:
        return []
    pairs = [runs for runs in conditions if len(runs) == 2]
    order = sorted(range(len(conditions)), key=lambda c: (len(conditions[c]) == 2, c))
    rich = [c for c in order if len(conditions[c]) > 2]
    paired = [c for c in order if len(conditions[c]) == 2]
    from_pairs = min(len(pairs) // 2, max(count - len(rich), 0))
    even = np.linspace(0, len(paired) - 1, from_pairs).round().astype(int) if from_pairs else np.zeros(0, int)
    chosen = [*rich[:count], *(paired[k] for k in np.unique(even))]
    return [conditions[c][-1] for c in chosen]


def _most_alike(measurement: Measurement, conditions: Sequence[Sequence[int]]) -> list[int]:
    """Return conditions that may be held out as a whole, the one nearest to another one first.

    A condition stays if it is unique: alone in a load, an orientation or a temperature, or done with a specimen that
    was new.
    """
    first = {run.history.specimen: k for k, run in reversed(list(enumerate(measurement.runs)))}
    prints = np.array([_fingerprint(measurement.runs[runs[0]].history) for runs in conditions])
    means = np.array([_circumstances(measurement.runs[runs[0]].history) for runs in conditions])
    needed = [_alone(means, c) or bool(set(runs) & set(first.values())) for c, runs in enumerate(conditions)]
    span = np.ptp(prints, axis=0)
    scaled = prints / np.where(span > 0, span, 1.0)
    distance = np.linalg.norm(scaled[:, None] - scaled[None], axis=2) + np.diag(np.full(len(prints), np.inf))
    return [int(c) for c in np.argsort(distance.min(axis=1), kind="stable") if not needed[c]]


def _alone(means: Array, which: int) -> bool:
    """Return whether a condition has a unique circumstance."""
    others = np.delete(means, which, axis=0)
    span = np.ptp(means, axis=0)
    nearest = np.abs(others - means[which]).min(axis=0) if len(others) else span
    return bool(np.any(nearest > ALONE * span))


def _circumstances(history: History) -> Array:
    """Return mean and spread of all signals other than actuation."""
    signals = [history.moment_n_m, history.temperature_c, *history.tip_force_n.T, *history.base_angles_rad.T]
    if history.payload_kg is not None:
        signals.append(history.payload_kg)
    signals.append(np.ones(len(history)) if history.valve_open is None else history.valve_open)
    return np.array([f(signal) for signal in signals for f in (np.mean, np.std)])


def _fingerprint(history: History) -> Array:
    """Return every input at even instants as mean, spread and rate, and the duration of the run."""
    signals = [*history.actuation.values(), history.moment_n_m, history.temperature_c]
    signals += [*history.tip_force_n.T, *history.base_angles_rad.T]
    signals.append(np.zeros(len(history)) if history.payload_kg is None else history.payload_kg)
    signals.append(np.ones(len(history)) if history.valve_open is None else history.valve_open)
    n = len(history)
    clock = np.arange(n, dtype=float) if history.time_s is None else history.time_s - history.time_s[0]
    duration = float(clock[-1]) if n > 1 else 0.0
    grid = np.linspace(0.0, duration, GRID)
    numbers = [np.log1p(duration)]
    for signal in signals:
        even = np.interp(grid, clock, signal)
        rate = np.abs(np.diff(even)).sum() / duration if duration > 0 else 0.0
        numbers += [float(even.mean()), float(even.std()), float(rate)]
    return np.array(numbers)


def _hidden(measurement: Measurement, locked: Sequence[int]) -> Measurement:
    """Return the measurement without the readings of these runs."""
    runs = tuple(
        run.with_outputs({name: np.full(len(run), np.nan) for name in run.outputs}) if k in locked else run
        for k, run in enumerate(measurement.runs)
    )
    return replace(measurement, runs=runs)


def _why(measurement: Measurement, locked: Sequence[int], unseen: Sequence[int], n_read: int) -> str:
    if not locked:
        return (
            f"None of the {n_read} runs could be held out: each is needed to span what was done, and none is a repeat "
            "to spare. All were fitted."
        )
    names = ", ".join(measurement.runs[k].name for k in locked)
    kinds = []
    if unseen:
        kinds.append(f"{len(unseen)} of conditions that are in no other run")
    if len(locked) > len(unseen):
        kinds.append(f"{plural(len(locked) - len(unseen), 'repeat')} of conditions that others fit")
    return f"Held out at the start: {len(locked)} of {n_read} runs ({names}), {' and '.join(kinds)}."
