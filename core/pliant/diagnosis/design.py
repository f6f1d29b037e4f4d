"""What runs could tell before anything is measured: effects × runs, and the fewest runs that tell the effects apart.

Nothing is read, so that nothing is probable: every effect stands at the far end of its plausible range, and a run tells
two of them apart where neither can imitate the other (`classes.py`). Runs are chosen one by one, each for what it
splits more beside those before it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.catalogue_view import CatalogueView
from pliant.diagnosis.classes import Overlaps, catalogue_changes
from pliant.diagnosis.cross_validation import SHARE_OF_RANGE
from pliant.diagnosis.diagnosis import applicable
from pliant.diagnosis.excitation import excitations
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.verdict import THRESHOLDS, Kinds
from pliant.evidence.prediction import Predictor
from pliant.experiments.planned_run import PlannedRun
from pliant.records.measurement import MeasuredRun, Measurement

# Without a measurement nobody knows how slowly the noise changes: one independent reading in so many seconds.
READING_S = 5.0


@dataclass(frozen=True, eq=False)
class RunDesign:
    """What a menu could tell.

    Attributes:
        runs: the menu.
        snr: by effect (runs,) RMS change of each run's readings over the noise.
        chosen: places of the runs that tell most effects apart, in the order in which they were chosen.
        parts: number of groups that the effects shown fall into after each of them, the first entry before any.
        together: classes of effects that the chosen runs leave together.
        silent: effects that none of the chosen runs shows.
        not_tried: effects that make no sense for this chain, with the reason.
    """

    runs: tuple[PlannedRun, ...]
    snr: Mapping[str, tuple[float, ...]]
    chosen: tuple[int, ...]
    parts: tuple[int, ...]
    together: tuple[Kinds, ...]
    silent: tuple[str, ...]
    not_tried: Mapping[str, str]

    @property
    def minutes(self) -> float:
        return sum(self.runs[k].minutes for k in self.chosen)


def unread(runs: Sequence[PlannedRun], outputs: Sequence[str]) -> Measurement:
    """A measurement of these runs without a reading: what a predictor needs to begin with."""
    measured = [
        MeasuredRun(
            run.history,
            {name: np.full(len(run.history), np.nan) for name in outputs},
            {},
            np.ones(len(run.history)),
            np.zeros(0),
        )
        for run in runs
    ]
    return Measurement(tuple(measured), tuple(outputs), source="the menu")


def design_runs(
    predictor: Predictor,
    runs: Sequence[PlannedRun],
    kinds: Sequence[str],
    *,
    most_runs: int | None = None,
    minutes: float = np.inf,
) -> RunDesign:
    """Which effects the runs could tell apart, and the fewest of them that do.

    Args:
        predictor: the study's model, with what the bench will read as its outputs; its runs do not count.
        runs: the menu.
        kinds: effects.
        most_runs, minutes: how many runs, and how long they may take in all.
    """
    registry = predictor.bench.registry
    view = CatalogueView.of(predictor, runs, _scales(predictor, runs), READING_S)
    fitter = Fitter(view.predictor, view.readings)
    chosen_kinds, left_out = applicable(registry, fitter, kinds)
    nothing = fitter.fit(EffectSet.of(registry, ()))
    found = excitations(registry, fitter, nothing, chosen_kinds)
    changes = catalogue_changes(registry, view, found)
    overlaps = Overlaps.of(view, changes)
    snr = {kind: tuple(overlaps.snr(kind, k) for k in range(len(runs))) for kind in found}
    chosen, parts = _fewest(view, overlaps, snr, most_runs, minutes)
    shown = shown_by(snr, chosen)
    together = tuple(part for part in overlaps.parts(shown, chosen) if len(part) > 1) if chosen else ()
    silent = tuple(kind for kind in found if kind not in shown)
    return RunDesign(tuple(runs), snr, chosen, parts, together, silent, left_out)


def shown_by(snr: Mapping[str, Sequence[float]], chosen: Sequence[int]) -> list[str]:
    """Effects that change the readings of at least one of these runs by more than the law's own error may."""
    return [kind for kind, values in snr.items() if any(values[k] >= THRESHOLDS.excited for k in chosen)]


def _scales(predictor: Predictor, runs: Sequence[PlannedRun]) -> dict[str, float]:
    """2 % of the range that the model predicts over the menu."""
    predicted = predictor.evaluate((), [run.history for run in runs]).runs
    scales = {}
    for name in predictor.outputs:
        series = np.concatenate([readings[name] for readings in predicted])
        span = float(np.ptp(series[np.isfinite(series)])) if np.isfinite(series).any() else 0.0
        scales[name] = SHARE_OF_RANGE * span or 1.0
    return scales


def _fewest(
    view: CatalogueView,
    overlaps: Overlaps,
    snr: Mapping[str, Sequence[float]],
    most_runs: int | None,
    minutes: float,
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Runs until no further one splits anything; of those that split most, the shortest first."""
    chosen: list[int] = []
    parts = [0]
    while most_runs is None or len(chosen) < most_runs:
        left = minutes - sum(view.runs[k].minutes for k in chosen)
        options = [
            (len(overlaps.parts(shown_by(snr, [*chosen, k]), [*chosen, k])), -run.minutes, -k)
            for k, run in enumerate(view.runs)
            if k not in chosen and run.minutes <= left
        ]
        best = max(options, default=(0, 0.0, 0))
        if best[0] <= parts[-1]:
            break
        chosen.append(-best[2])
        parts.append(best[0])
    return tuple(chosen), tuple(parts)
