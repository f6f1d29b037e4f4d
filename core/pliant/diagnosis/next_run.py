"""Which run to do next: the one in which the explanations that are left disagree most per minute.

After Hunter & Reiner (Technometrics 7, 1965): of the runs that a bench can do, take the one with the largest
expected squared difference between the predictions of the contenders, weighted by their probabilities.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.fitting import Fit
from pliant.diagnosis.table import UNKNOWN, Kinds
from pliant.evidence.prediction import Predictor
from pliant.interfaces.effect import EffectConfig
from pliant.records.design import Array
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from pliant.records.measurement import Measurement

# Contenders below this probability are not asked.
SMALL = 0.01
MOST_CONTENDERS = 6
SAMPLE_S = 0.5
SEPARATED = 4.0
# The specimen that was measured, in the runs of the menu.
USED = "used"


@dataclass(frozen=True, eq=False)
class MenuRun:
    """A run that the bench can do: `words` are an order to the bench."""

    words: str
    history: History

    @property
    def minutes(self) -> float:
        assert self.history.time_s is not None
        return float(self.history.time_s[-1]) / 60.0


@dataclass(frozen=True)
class NextRun:
    """The run to do next, why, which hypotheses it separates, and what it costs."""

    run: str
    why: str
    separates: tuple[tuple[Kinds, Kinds], ...]
    minutes: float


def menu(measurement: Measurement) -> tuple[MenuRun, ...]:
    """Runs that most benches can do, scaled to the largest actuation and load of the measurement."""
    names = sorted(measurement.runs[0].history.actuation, key=lambda name: -_largest(measurement, name))
    top = _largest(measurement, names[0]) or 1.0
    moment = max(float(np.abs(run.history.moment_n_m).max()) for run in measurement.runs)
    rest = dict.fromkeys(names[1:], 0.0)

    def run(words: str, drive: Array, specimen: str = USED, **conditions: object) -> MenuRun:
        time_s = SAMPLE_S * np.arange(len(drive))
        inputs = {names[0]: top * drive, **rest}
        return MenuRun(words, History.of(inputs, time_s, run=words, specimen=specimen, **conditions))  # type: ignore[arg-type]

    found = [
        run("cycle slowly, 80 s per cycle, twice", _triangles(80.0, [1.0, 1.0])),
        run("cycle quickly, 4 s per cycle, fifteen times", _triangles(4.0, [1.0] * 15)),
        run("small loops inside a large one at a medium rate", _triangles(20.0, [1.0, 0.4, 0.7, 1.0])),
        run(
            "raise the pressure in steps, hold each for a minute, vent and keep recording",
            _steps((0.4, 0.8, 1.0, 0.0)),
        ),
        run(
            "a new specimen, amplitude rising from cycle to cycle, each amplitude twice",
            _triangles(20.0, [0.3, 0.3, 0.6, 0.6, 1.0, 1.0]),
            specimen="new",
        ),
        run(
            "the base horizontal, two medium cycles",
            _triangles(20.0, [1.0, 1.0]),
            base_angles_rad=[0.0, np.pi / 2, 0.0],
        ),
        run(
            "upside down, two medium cycles", _triangles(20.0, [1.0, 1.0]), base_angles_rad=[0.0, np.pi, 0.0]
        ),
        run(
            "15 K warmer, two medium cycles",
            _triangles(20.0, [1.0, 1.0]),
            temperature_c=REFERENCE_TEMPERATURE_C + 15.0,
        ),
    ]
    if moment > 0.0:
        pushes = moment * np.repeat([0.0, 1.0, 0.0, -1.0, 0.5, 0.0], int(20.0 / SAMPLE_S))
        found += [
            run("no pressure, load steps of both signs", np.zeros(len(pushes)), moment_n_m=pushes),
            run("constant pressure, load steps of both signs", np.full(len(pushes), 0.6), moment_n_m=pushes),
        ]
    return tuple(found)


def next_run(
    predictor: Predictor,
    scales: Mapping[str, float],
    fits: Mapping[Kinds, Fit],
    probability: Mapping[Kinds, float],
) -> NextRun | None:
    """The run of the menu that separates the contenders best; None with fewer than two of them."""
    contenders = [k for k, p in probability.items() if k != UNKNOWN and p >= SMALL][:MOST_CONTENDERS]
    if len(contenders) < 2:
        return None
    runs = menu(predictor.measurement)
    answers = {k: _answers(predictor, fits[k].candidate.configs(fits[k].x), runs, scales) for k in contenders}
    best: tuple[float, int] = (-1.0, 0)
    for index, run in enumerate(runs):
        gain = sum(
            probability[a] * probability[b] * _distance(answers[a][index], answers[b][index])
            for i, a in enumerate(contenders)
            for b in contenders[:i]
        )
        best = max(best, (gain / max(run.minutes, 0.5), -index))
    chosen = -best[1]
    separates = tuple(
        (a, b)
        for i, b in enumerate(contenders)
        for a in contenders[:i]
        if _distance(answers[a][chosen], answers[b][chosen]) > SEPARATED
    )
    why = f"the explanations that are left predict different readings there: {_worded(contenders)}"
    return NextRun(runs[chosen].words, why, separates, round(runs[chosen].minutes, 1))


def run_that_excites(
    predictor: Predictor, scales: Mapping[str, float], configs: Mapping[str, Sequence[EffectConfig]]
) -> dict[str, str]:
    """For each effect the run of the menu in which it changes the readings most, in words; where any does."""
    runs = menu(predictor.measurement)
    plain = _answers(predictor, (), runs, scales)
    found = {}
    for kind, effects in configs.items():
        there = _answers(predictor, effects, runs, scales)
        changes = [_distance(a, b) / len(a) for a, b in zip(plain, there, strict=True)]
        best = int(np.argmax(changes))
        if changes[best] > 0.0:
            found[kind] = runs[best].words
    return found


def _answers(
    predictor: Predictor,
    effects: Sequence[EffectConfig],
    runs: Sequence[MenuRun],
    scales: Mapping[str, float],
) -> list[Array]:
    """Predicted readings of each run over the noise, all outputs one after another.

    The first run is done before as well, unread: a specimen that was measured is no longer virgin.
    """
    histories = [run.history for run in runs]
    prediction = predictor.evaluate(effects, [histories[0], *histories])
    return [
        np.concatenate([readings[name] / scale for name, scale in scales.items()])
        for readings in prediction.runs[1:]
    ]


def _largest(measurement: Measurement, name: str) -> float:
    return max(float(np.abs(run.history.actuation[name]).max()) for run in measurement.runs)


def _distance(a: Array, b: Array) -> float:
    return float(np.nansum((a - b) ** 2))


def _worded(contenders: Sequence[Kinds]) -> str:
    return " or ".join(" + ".join(kinds) or "nothing missing" for kinds in contenders[:3])


def _triangles(period_s: float, amplitudes: Sequence[float]) -> Array:
    n = round(period_s / SAMPLE_S)
    shape = 1.0 - np.abs(2.0 * np.arange(n) / n - 1.0)
    return np.concatenate([*(a * shape for a in amplitudes), [0.0]])


def _steps(levels: Sequence[float]) -> Array:
    n, rise = round(60.0 / SAMPLE_S), round(1.0 / SAMPLE_S)
    ramp = np.minimum(1.0, np.arange(1, n + 1) / rise)
    before = (0.0, *levels[:-1])
    return np.concatenate([a + (b - a) * ramp for a, b in zip(before, levels, strict=True)])
