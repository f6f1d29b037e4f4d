"""Classes of effects that given runs cannot distinguish, and the run of a menu that would best split each.

Two effects belong together if neither can be distinguished from the other: each imitates the other's change with
adjusted parameters. Only the inputs and the model decide this, not the readings, so that a class can be stated before
anything is measured or unsealed. Classes are the connected components of these pairs.

Without a measurement no effect is more probable than another: every effect is placed at the far end of its plausible
range, and a run distinguishes two of them if neither can imitate the other. Runs are chosen one by one, each for the
additional splits beyond those of the runs chosen before.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.catalogue_view import CataloguePrediction, CatalogueView
from pliant.diagnosis.evidence_table import LAW, THRESHOLDS, Kinds
from pliant.diagnosis.excitation import (
    SEPARABLE,
    TYPICAL_SNR,
    ConfoundedPair,
    Excitation,
    applicable,
    confounded_with,
    excitations,
)
from pliant.diagnosis.fitting import Fitter
from pliant.diagnosis.law_discrepancy import LawReference
from pliant.diagnosis.readings import SHARE_OF_RANGE
from pliant.evidence.measured_model import MeasuredModel
from pliant.experiments.planned_run import PlannedRun, unread_run
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.registry.discovery import Registry

# Eigenvalues below this share of the largest are numerically zero.
FLAT = 1e-10


@dataclass(frozen=True)
class EffectClass:
    """Effects that these runs cannot distinguish.

    Attributes:
        kinds: sorted by name, two or more.
        run, words, minutes: the run that splits it best, by name and as an order; empty if none does or none was
            requested.
        parts: the classes after the split; the class itself without such a run.
    """

    kinds: Kinds
    run: str = ""
    words: str = ""
    minutes: float = 0.0
    parts: tuple[Kinds, ...] = ()


def confounded_classes(
    excitations: Mapping[str, Excitation], n_effective: float, law: LawReference | None = None
) -> tuple[Kinds, ...]:
    """Return classes of two or more effects, the largest first; with `law`, its shape may be a member (`LAW`).

    Args:
        excitations: every excited effect at the far end of its plausible range under these runs.
        n_effective: independent readings of these runs.
        law: the law's own error, if it is part of every hypothesis.
    """
    kinds = [*excitations, *([] if law is None else [LAW])]
    return connected(kinds, confounded_with(excitations, {}, n_effective, law))


def connected(kinds: Iterable[str], pairs: Sequence[ConfoundedPair]) -> tuple[Kinds, ...]:
    """Return connected components of two or more kinds, from pairs that imitate each other both ways."""
    alike = {(pair.a, pair.b) for pair in pairs}
    left, classes = sorted(kinds), []
    while left:
        part, waiting = [], [left[0]]
        while waiting:
            kind = waiting.pop()
            if kind in part:
                continue
            part.append(kind)
            waiting += [other for other in left if (kind, other) in alike and (other, kind) in alike]
        left = [kind for kind in left if kind not in part]
        if len(part) > 1:
            classes.append(tuple(sorted(part)))
    return tuple(sorted(classes, key=lambda kinds: (-len(kinds), kinds)))


@dataclass(frozen=True, eq=False)
class Overlaps:
    """Sums of products of the effects' changes and of their slopes, over independent readings.

    Attributes:
        columns: for each kind the indices of its change and of its slopes in the matrices; those of the law's own
            error as `LAW`, if there is one.
        measured: (c, c) of the runs that were measured, and of the prior of the law's error; zeros without any.
        of_run: (c, c) of each run of the menu.
        readings: number of independent readings that were measured, and of each run of the menu.
    """

    columns: Mapping[str, tuple[int, ...]]
    measured: Array
    of_run: tuple[Array, ...]
    readings: tuple[float, tuple[float, ...]]

    @staticmethod
    def from_changes(
        view: CatalogueView,
        changes: Mapping[str, CataloguePrediction],
        excitations: Mapping[str, Excitation] | None = None,
        n_effective: float = 0.0,
        law: LawReference | None = None,
    ) -> Overlaps:
        """Return the sums of these changes in the menu, and of the excitations under the measured runs if given."""
        columns, at = {}, 0
        for kind, look in changes.items():
            columns[kind] = tuple(range(at, at + 1 + look.slopes.shape[1]))
            at += 1 + look.slopes.shape[1]
        pieces = [np.column_stack([look.values, look.slopes]) for look in changes.values()]
        if law is not None:
            columns[LAW] = tuple(range(at, at + view.law_columns.shape[1]))
            at += view.law_columns.shape[1]
            pieces.append(view.law_columns)
        table = np.column_stack(pieces)
        rows = [view.rows([k]) for k in range(len(view.runs))]
        of_run = tuple((table[r] * view.worth[r, None]).T @ table[r] for r in rows)
        measured = np.zeros((at, at))
        if excitations is not None:
            before = [np.column_stack([excitations[k].change, excitations[k].slopes]) for k in changes]
            old = np.column_stack([*before, *([] if law is None else [law.columns])])
            measured = n_effective / len(old) * old.T @ old
        if law is not None:
            prior = list(columns[LAW])
            measured[prior, prior] += 1.0 / law.prior.large**2
        worth = tuple(float(view.worth[r].sum()) for r in rows)
        return Overlaps(columns, measured, of_run, (n_effective, worth))

    def parts(self, kinds: Sequence[str], chosen: Sequence[int]) -> tuple[Kinds, ...]:
        """Return the classes of these kinds with the chosen runs added to the measured ones, the largest first.

        Kinds that change nothing in any of these runs stay together.
        """
        whole = self.measured + sum((self.of_run[k] for k in chosen), np.zeros_like(self.measured))
        n = self.readings[0] + sum(self.readings[1][k] for k in chosen)
        real = [kind for kind in kinds if kind != LAW]
        apart = self._apart(whole, n, real)
        alike = [
            ConfoundedPair(a, b, 0.0)
            for i, a in enumerate(real)
            for j, b in enumerate([*real, *([LAW] if LAW in kinds else [])])
            if i != j and apart[i, j] < SEPARABLE
        ]
        alike += [ConfoundedPair(LAW, pair.a, 0.0) for pair in alike if pair.b == LAW]
        joined = connected(kinds, alike)
        alone = [(kind,) for kind in sorted(kinds) if not any(kind in part for part in joined)]
        return (*joined, *alone)

    def snr(self, kind: str, run: int) -> float:
        """Return the RMS change of a run's readings over their noise."""
        change = self.columns[kind][0]
        return float(np.sqrt(self.of_run[run][change, change] / max(self.readings[1][run], 1e-12)))

    def _apart(self, whole: Array, n: float, kinds: Sequence[str]) -> Array:
        """Return (k, k) n · SNR² · unexplained share: squares of a's typical change that b cannot imitate.

        (k, k + 1) if the law has an error: it may accompany either effect, and the last column is the part that it
        cannot imitate alone.
        """
        changes = [self.columns[kind][0] for kind in kinds]
        squares = np.diag(whole)[changes]
        nuisance = self.columns.get(LAW, ())
        imitators = [(*self.columns[kind], *nuisance) for kind in kinds]
        imitators += [nuisance] if nuisance else []
        left = np.repeat(squares[:, None], len(imitators), axis=1)
        for j, places in enumerate(imitators):
            basis = [k for k in places if whole[k, k] > 0.0]
            if not basis:
                continue
            size = np.sqrt(np.diag(whole)[basis])
            values, vectors = np.linalg.eigh(whole[np.ix_(basis, basis)] / np.outer(size, size))
            along = vectors.T @ (whole[np.ix_(basis, changes)] / size[:, None])
            felt = values > FLAT * values.max()
            left[:, j] -= np.sum(along[felt] ** 2 / values[felt, None], axis=0)
        snr = np.sqrt(squares / max(n, 1e-12))
        typical = np.minimum(snr, TYPICAL_SNR) / np.where(snr > 0.0, snr, 1.0)
        apart: Array = np.maximum(left, 0.0) * typical[:, None] ** 2
        return apart


def split_classes(
    registry: Registry,
    view: CatalogueView,
    excitations: Mapping[str, Excitation],
    n_effective: float,
    left: Sequence[Kinds] | None = None,
    law: LawReference | None = None,
) -> tuple[EffectClass, ...]:
    """Return each class with the run of the menu that splits it into the most parts; the shortest of equals.

    Args:
        registry: the installed effects.
        view: the model in the menu.
        found, n_effective: as for `confounded_classes`.
        left: remaining explanations; a class without an effect of them is returned without a run, to save time.
            By default every class gets a run.
        law: the law's own error, if it is part of every hypothesis.
    """
    classes = confounded_classes(excitations, n_effective, law)
    open_kinds = (
        {kind for explanation in left for kind in explanation} if left is not None else set(excitations)
    )
    asked = [one for one in classes if open_kinds & set(one)]
    kinds = sorted({kind for one in asked for kind in one} - {LAW})
    if not kinds:
        return tuple(EffectClass(one, parts=(one,)) for one in classes)
    changes = catalogue_changes(registry, view, {kind: excitations[kind] for kind in kinds})
    overlaps = Overlaps.from_changes(view, changes, excitations, n_effective, law)
    return tuple(
        _split(one, view, overlaps) if one in asked else EffectClass(one, parts=(one,)) for one in classes
    )


def catalogue_changes(
    registry: Registry, view: CatalogueView, excitations: Mapping[str, Excitation]
) -> dict[str, CataloguePrediction]:
    """Return each effect's changes in the menu at the strength of its excitation, and its slopes; 0 for NaN."""
    nothing = view.evaluate(EffectSet.from_kinds(registry, ()), np.zeros(0)).values
    changes = {}
    for kind, one in excitations.items():
        look = view.evaluate(EffectSet.from_kinds(registry, (kind,)), one.x)
        lost = ~(np.isfinite(look.values - nothing) & np.isfinite(look.slopes).all(axis=1))
        changes[kind] = CataloguePrediction(
            np.where(lost, 0.0, look.values - nothing), np.where(lost[:, None], 0.0, look.slopes)
        )
    return changes


def _split(kinds: Kinds, view: CatalogueView, overlaps: Overlaps) -> EffectClass:
    best = EffectClass(kinds, parts=(kinds,))
    rank: tuple[float, float] = (1.0, 0.0)
    for index, run in enumerate(view.runs):
        parts = overlaps.parts(kinds, [index])
        here = (float(len(parts)), -run.minutes)
        if len(parts) > 1 and here > rank:
            best, rank = EffectClass(kinds, run.name, run.words, run.minutes, parts), here
    return best


# Without a measurement the correlation time of the noise is unknown: one independent reading per this time.
READING_S = 5.0


@dataclass(frozen=True, eq=False)
class RunDesign:
    """The effects that runs of a menu could distinguish.

    Attributes:
        runs: the menu.
        snr: by effect (runs,) RMS change of each run's readings over the noise.
        chosen: indices of the runs that distinguish most effects, in the order in which they were chosen.
        parts: number of groups of the shown effects after each of them, the first entry before any.
        together: classes of effects that the chosen runs do not distinguish.
        not_excited: effects that none of the chosen runs shows.
        not_tried: effects that are not applicable to this chain, with the reason.
    """

    runs: tuple[PlannedRun, ...]
    snr: Mapping[str, tuple[float, ...]]
    chosen: tuple[int, ...]
    parts: tuple[int, ...]
    together: tuple[Kinds, ...]
    not_excited: tuple[str, ...]
    not_tried: Mapping[str, str]

    @property
    def minutes(self) -> float:
        return sum(self.runs[k].minutes for k in self.chosen)


def unread(runs: Sequence[PlannedRun], outputs: Sequence[str]) -> Measurement:
    """Return a measurement of these runs without readings, with which a predictor can be created."""
    return Measurement(
        tuple(unread_run(run.history, outputs) for run in runs), tuple(outputs), source="the menu"
    )


def design_runs(
    predictor: MeasuredModel,
    runs: Sequence[PlannedRun],
    kinds: Sequence[str],
    *,
    most_runs: int | None = None,
    minutes: float = np.inf,
) -> RunDesign:
    """Return which effects the runs could distinguish, and the fewest runs that do.

    Args:
        predictor: the study's model, with the planned readings as its outputs; its runs do not count.
        runs: the menu.
        kinds: effects.
        most_runs, minutes: maximum number of runs, and their maximum total duration.
    """
    registry = predictor.context.registry
    view = CatalogueView.from_predictor(predictor, runs, _scales(predictor, runs), READING_S)
    fitter = Fitter(view.predictor, view.readings)
    chosen_kinds, left_out = applicable(registry, fitter, kinds)
    nothing = fitter.fit(EffectSet.from_kinds(registry, ()))
    found = excitations(registry, fitter, nothing, chosen_kinds)
    changes = catalogue_changes(registry, view, found)
    overlaps = Overlaps.from_changes(view, changes)
    snr = {kind: tuple(overlaps.snr(kind, k) for k in range(len(runs))) for kind in found}
    chosen, parts = _fewest(view, overlaps, snr, most_runs, minutes)
    shown = shown_by(snr, chosen)
    together = tuple(part for part in overlaps.parts(shown, chosen) if len(part) > 1) if chosen else ()
    not_excited = tuple(kind for kind in found if kind not in shown)
    return RunDesign(tuple(runs), snr, chosen, parts, together, not_excited, left_out)


def shown_by(snr: Mapping[str, Sequence[float]], chosen: Sequence[int]) -> list[str]:
    """Return effects that change the readings of at least one of these runs by more than the law's own error may."""
    return [kind for kind, values in snr.items() if any(values[k] >= THRESHOLDS.excited for k in chosen)]


def _scales(predictor: MeasuredModel, runs: Sequence[PlannedRun]) -> dict[str, float]:
    """Return 2 % of the range that the model predicts over the menu."""
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
    """Return runs until no further one splits anything; the best split first, then the shortest."""
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
