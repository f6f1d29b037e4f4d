"""Effects at single places: whether one joint is meant or all alike is a question to the readings.

The effects of a user's own model act at all places of their kind alike. Those that could explain most are tried at each
place alone, too, as hypotheses of their own: first to first order (Rao's score test, 1948), and the best are fitted. An
effect at one place changes some outputs only, so that an effect at all places alike may fit badly although it is the
right one: what a kind could explain is counted with a strength of its own for each output.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.candidates import START_SHARE, EffectSet
from pliant.diagnosis.evidence_table import NOTHING, log_evidence
from pliant.diagnosis.excitation import (
    Excitation,
    applicable,
    excitations,
    explained_by,
    explained_by_columns,
)
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.readings import ReadingVector
from pliant.diagnosis.search import HypothesisSearch
from pliant.evidence.measured_model import MeasuredModel
from pliant.execution.executors import Executor
from pliant.execution.jobs import JobQueue
from pliant.interfaces.effect import AT
from pliant.records.design import Array

# Kinds whose places are tried: the first ones by the evidence of all places alike, and those that could explain this
# share of what the best could, with a strength of its own for each output.
LEADING, LEAST_BY_OUTPUT = 2, 0.25
# How many kinds at single places are fitted. Of the first kinds by what they could explain, every place is looked at
# more closely, and the likeliest is fitted.
MOST_FITTED, FIRST_KINDS = 10, 6
# The same share where the change at one strength alone is looked at.
LEAST_ALONE = 0.05
# Runs in which that is looked at: those with this share of the squared error, and at least so many.
MOST_LEFT, FEWEST_RUNS = 0.3, 3


def kinds_at_places(
    search: HypothesisSearch, model: MeasuredModel, executor: Executor
) -> tuple[list[str], dict[str, Excitation]]:
    """Return kinds at single places that may explain more than all places alike, and their excitations.

    Args:
        search: with the fits of all single effects.
        model: names the places of a kind.
        executor: does the simulations.
    """
    evidence = log_evidence(search.table(), search.thresholds)
    spread = {
        key: places for key in search.fits if len(key) == 1 and (places := model.places_of_kind(key[0]))
    }
    by_evidence = sorted(spread, key=lambda key: -evidence[key])[:LEADING]
    explained = {key: _explained_by_output(search, key[0]) for key in spread}
    enough = LEAST_BY_OUTPUT * max(explained.values(), default=0.0)
    by_output = [key for key in sorted(spread, key=lambda key: -explained[key]) if explained[key] >= enough]
    asked = [kind for key in dict.fromkeys((*by_output, *by_evidence)) for kind in spread[key]]
    if not asked:
        return [], {}
    nothing = search.fits[NOTHING]
    kinds, _ = applicable(search.registry, search.fitter, asked, executor)
    likely = _most_explaining(search, kinds, executor)
    shown = excitations(search.registry, search.fitter, nothing, likely, executor)
    return sorted(shown, key=lambda kind: -explained_by(nothing.raw, shown[kind])), shown


def _most_explaining(search: HypothesisSearch, kinds: Sequence[str], executor: Executor) -> list[str]:
    """Return the kinds at single places whose change at a usual strength is most like the residual.

    `kinds` are in the order of what each could explain at all its places. They are tried in the runs that hold most of
    the error; all places of the first kinds, and the likeliest of each other one, also with the strength that the
    residual would need, since a large effect may change the readings in another way than a small one.
    """
    fitter, there = _where_most_is_left(search)
    residual, parts = search.fits[NOTHING].raw[there], search.fits[NOTHING].parts

    def changes(points: Sequence[_Point]) -> list[Array]:
        asked = [(one.candidate, one.x, parts) for one in points]
        with JobQueue(executor, fitter.residual_from) as queue:
            return [residual - one.unwrap() for one in queue.each(asked)]

    usual = {kind: _usual(search, kind) for kind in kinds}
    alone = dict(zip(kinds, changes(list(usual.values())), strict=True))
    gains = {kind: explained_by_columns(residual, change[:, None]) for kind, change in alone.items()}
    everywhere = list(dict.fromkeys(kind.partition(AT)[0] for kind in kinds))[:FIRST_KINDS]
    likeliest = _best_places(sorted(gains, key=lambda kind: -gains[kind]))
    again = [kind for kind in kinds if kind.partition(AT)[0] in everywhere or kind in likeliest.values()]
    stronger = changes([usual[kind].scaled(alone[kind], residual) for kind in again])
    for kind, change in zip(again, stronger, strict=True):
        gains[kind] = explained_by_columns(residual, np.column_stack([alone[kind], change]))
    least = LEAST_ALONE * max(gains.values(), default=0.0)
    likely = sorted((kind for kind in gains if gains[kind] >= least), key=lambda kind: -gains[kind])
    best = _best_places(likely)
    first = [best[kind] for kind in everywhere if kind in best]
    return list(dict.fromkeys((*first, *likely)))[:MOST_FITTED]


def _best_places(ranked: Sequence[str]) -> dict[str, str]:
    """Return by kind the first of its places in a ranking."""
    return {kind.partition(AT)[0]: kind for kind in reversed(ranked)}


@dataclass(frozen=True, eq=False)
class _Point:
    """An effect at a single place with a strength; `place` is that of the strength in x."""

    kind: str
    candidate: EffectSet
    x: Array
    place: int

    def scaled(self, change: Array, residual: Array) -> _Point:
        """Return the strength that the residual would need, by the change of this one."""
        there = np.isfinite(change) & np.isfinite(residual)
        square = float(change[there] @ change[there])
        share = float(change[there] @ residual[there]) / square if square > 0.0 else 0.0
        low, high = self.candidate.parameters[self.place].limits
        x = self.x.copy()
        x[self.place] = min(max(share * x[self.place], low), high)
        return replace(self, x=x)


def _usual(search: HypothesisSearch, kind: str) -> _Point:
    """Return the effect at a usual strength, by that of all places alike."""
    alike, candidate = search.shown[kind.partition(AT)[0]], EffectSet.from_kinds(search.registry, (kind,))
    x = alike.x.copy()
    x[alike.place] *= START_SHARE
    return _Point(kind, candidate, x, alike.place)


def _where_most_is_left(search: HypothesisSearch) -> tuple[Fitter, NDArray[np.bool_]]:
    """Return a fitter of the runs that hold most of the unchanged model's error, and (N,) which readings are theirs."""
    readings, measurement = search.readings, search.measurement
    raw = search.fits[NOTHING].raw
    squares = np.bincount(
        readings.run, weights=np.where(np.isfinite(raw), raw, 0.0) ** 2, minlength=readings.n_runs
    )
    order = np.argsort(-squares)
    enough = int(np.searchsorted(np.cumsum(squares[order]), MOST_LEFT * squares.sum())) + 1
    chosen = np.sort(order[: max(enough, FEWEST_RUNS)])
    part = replace(measurement, runs=tuple(measurement.runs[k] for k in chosen.tolist()))
    own = ReadingVector.from_measurement(part, readings.outputs, readings.scales)
    return Fitter(search.fitter.predictor.for_runs(part), own), np.isin(readings.run, chosen)


def _explained_by_output(search: HypothesisSearch, kind: str) -> float:
    """Return the sum of squares that a kind explains to first order, with other strengths for each output."""
    shown, fit, nothing = search.shown[kind], search.fits[(kind,)], search.fits[NOTHING]
    columns = np.column_stack([shown.change, shown.slopes, nothing.raw - fit.raw, fit.slopes])
    output = search.readings.output
    return sum(
        explained_by_columns(nothing.raw[output == k], columns[output == k]) for k in np.unique(output)
    )
