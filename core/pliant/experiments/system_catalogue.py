"""Menu of runs for a user's own model: the motions that tell most effects apart, within the recorded ranges."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pliant.evidence.measured_model import MeasuredModel
from pliant.experiments.planned_run import PlannedRun
from pliant.records.design import Array
from pliant.records.history import History

# Samples of a run of the menu, at most.
MOST_SAMPLES = 1_000
# Minutes of setting up.
SET_UP = 0.5
FEWEST_PER_CYCLE = 20


def system_catalogue(model: MeasuredModel) -> tuple[PlannedRun, ...]:
    """Return slow and fast cycles, steps, small loops, a hold, and each input alone.

    Levels are within the ranges of the recorded inputs, durations and the sampling step are those of the recorded runs.
    """
    names = [channel.name for channel in model.inputs]
    histories = [run.history for run in model.measurement.runs if run.history.time_s is not None]
    clocks = [h.time_s for h in histories if h.time_s is not None]
    seconds = float(np.median([clock[-1] - clock[0] for clock in clocks]))
    step = max(float(np.median(np.concatenate([np.diff(c) for c in clocks]))), seconds / MOST_SAMPLES)
    clock: Array = step * np.arange(round(seconds / step) + 1, dtype=float)
    low = {name: min(float(h.actuation[name].min()) for h in histories) for name in names}
    high = {name: max(float(h.actuation[name].max()) for h in histories) for name in names}
    start = {name: float(np.median([h.actuation[name][0] for h in histories])) for name in names}

    def run(name: str, words: str, shapes: Mapping[str, Array]) -> PlannedRun:
        """Return a run of shares in [-1, 1] by input: from the usual start to either end of the range."""
        inputs = {}
        for one in names:
            share = shapes.get(one, np.zeros(len(clock)))
            up, down = high[one] - start[one], start[one] - low[one]
            inputs[one] = start[one] + np.where(share > 0.0, up * share, down * share)
        minutes = SET_UP + float(clock[-1]) / 60.0
        return PlannedRun(name, words, History.from_arrays(inputs, clock, run=name), round(minutes, 2))

    def everywhere(share: Array) -> dict[str, Array]:
        """Return the shape for every input, each with its own delay so that they are not proportional."""
        n = max(len(clock) // (4 * len(names)), 1)
        return {
            name: np.concatenate([np.zeros(k * n), share[: len(share) - k * n]])
            for k, name in enumerate(names)
        }

    fast = max(FEWEST_PER_CYCLE * step, seconds / 12.0)
    levels = np.array([0.5, 1.0, -0.5, -1.0, 0.0])
    place = np.minimum((clock / (seconds / len(levels))).astype(int), len(levels) - 1)
    loops = np.where(clock < 0.5 * seconds, 1.0, 0.4) * _wave(clock, seconds / 6.0)
    found = [
        run("slow_cycles", "two slow cycles of every input", everywhere(_wave(clock, seconds / 2.0))),
        run("fast_cycles", f"fast cycles of every input, {fast:.3g} s each", everywhere(_wave(clock, fast))),
        run("step_response", "steps of every input to five levels", everywhere(levels[place])),
        run("small_loops", "large cycles, then small ones", everywhere(loops)),
        run(
            "holds",
            "a step of every input that is held",
            everywhere(np.where(clock > 0.1 * seconds, 0.7, 0.0)),
        ),
        run("vented_zero", "no motion of any input", {}),
    ]
    if len(names) > 1:
        for name in names:
            words = f"cycles of {name} alone, the other inputs at rest"
            found.append(run(f"only_{name}", words, {name: _wave(clock, seconds / 3.0)}))
    return tuple(found)


def _wave(clock: Array, period: float) -> Array:
    """Return triangles between -1 and 1 from 0."""
    phase = clock / period
    return np.asarray(2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * phase)), float)
