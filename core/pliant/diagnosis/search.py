"""Which hypotheses are fitted: nothing, every single effect, and larger sets as far as the data ask for them.

Of all sets of two effects, then of three, those that promise most by superposition (`screening`) are fitted, and the
best single with what helps it most. The best set's effects are exchanged in turn, and its subsets are fitted too, so
that an effect that has become idle drops out (Miller, Subset Selection in Regression, 2002).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.candidates import Candidate
from pliant.diagnosis.excitation import Excitation
from pliant.diagnosis.fitting import MOST_LOST, Fit, Fitter
from pliant.diagnosis.heldout import condition_of_runs, heldout_residual
from pliant.diagnosis.noise import NoiseView, noise_view
from pliant.diagnosis.readings import ReadingVector
from pliant.diagnosis.screening import Directions
from pliant.diagnosis.table import (
    NOTHING,
    EvidenceTable,
    Kinds,
    Prices,
    Row,
    at_limit,
    log_evidence,
    room_above_floor,
    sorted_kinds,
)
from pliant.measurements.repeats import RepeatGroup, repeat_groups
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.registry.discovery import Registry

MOST_EFFECTS = 3
# Of all sets of one size, so many that promise most are fitted; of the neighbours of the best one, so many each.
SCREENED = 8
EXCHANGED = 3

Tick = Callable[[str], None]


@dataclass(eq=False)
class Search:
    """Fits hypotheses one after another and keeps them."""

    registry: Registry
    measurement: Measurement
    readings: ReadingVector
    fitter: Fitter
    prices: Prices
    shown: Mapping[str, Excitation]
    tick: Tick = lambda _: None
    fits: dict[Kinds, Fit] = field(default_factory=dict)
    rows: dict[Kinds, Row] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.groups: tuple[RepeatGroup, ...] = repeat_groups(self.measurement)
        repeats = [group.runs for group in self.groups]
        self.condition = condition_of_runs(len(self.measurement.runs), repeats)

    def run(self, kinds: Sequence[str]) -> EvidenceTable:
        """The table of everything that was worth fitting among these kinds."""
        self._fit(NOTHING)
        for kind in kinds:
            self._fit((kind,))
        current = self._best([key for key in self.fits if len(key) <= 1])
        if room_above_floor(self.table(), current, self.prices):
            self._grow(Directions.of(kinds, self.fits, self.shown, MOST_LOST), len(kinds))
        return self.table()

    def table(self) -> EvidenceTable:
        """The rows so far, against the noise that the best of them leaves."""
        best = min(self.rows.values(), key=lambda row: row.mean_square)
        return EvidenceTable(dict(self.rows), self.noise(self.fits[best.kinds]), len(self.readings))

    def noise(self, fit: Fit) -> NoiseView:
        """Noise as the residuals of a fit show it."""
        residuals = self.readings.unpack(fit.residual)
        return noise_view(self.measurement, residuals, self.readings.scales, self.groups)

    def _grow(self, directions: Directions, n_kinds: int) -> None:
        """Sets of two and more effects, while the best of a size is better than what is smaller and may be bettered."""
        plain = self.fits[NOTHING].residual
        for size in range(2, min(MOST_EFFECTS, n_kinds) + 1):
            before = self._best([key for key in self.fits if len(key) < size])
            sets = directions.promising(plain, size, SCREENED)
            beside = [key for key in self.fits if len(key) == size - 1]
            sets += self._larger(self._best(beside), directions)
            if not sets:
                return
            for larger in dict.fromkeys(sets):
                self._fit(larger)
            best = self._exchanged(self._best(sets), directions)
            for left in best:
                self._fit(tuple(kind for kind in best if kind != left), near=best)
            if not self._pays(best, before) or not room_above_floor(self.table(), best, self.prices):
                return

    def _larger(self, base: Kinds, directions: Directions) -> list[Kinds]:
        """The base with each of the kinds that promise most beside it, its own parameters free to follow."""
        fit = self.fits[base]
        if not np.all(np.isfinite(fit.residual)):
            return []
        found = directions.next_to(fit.residual, fit.slopes, base, EXCHANGED)
        return [sorted_kinds((*base, kind)) for kind in found]

    def _exchanged(self, best: Kinds, directions: Directions) -> Kinds:
        """The set with each of its effects exchanged in turn while that helps."""
        for out in tuple(best):
            if out not in best:
                continue
            rest = tuple(kind for kind in best if kind != out)
            looked = self.fitter.look(Candidate.of(self.registry, rest), self._part(best, rest))
            if not np.all(np.isfinite(looked.residual)):
                continue
            others = directions.next_to(looked.residual, looked.slopes, best, EXCHANGED)
            sets = [sorted_kinds((*rest, kind)) for kind in others]
            for candidate in sets:
                self._fit(candidate, near=best)
            best = self._best([best, *sets])
        return best

    def _part(self, whole: Kinds, part: Kinds) -> Array:
        """The knobs of a part of a fitted set, as they are in the set."""
        known = self._known(whole)
        return np.array([known[knob.name] for knob in Candidate.of(self.registry, part).knobs])

    def _known(self, kinds: Kinds) -> dict[str, float]:
        """Knobs of a fitted set by name."""
        fit = self.fits[kinds]
        return {knob.name: float(x) for knob, x in zip(fit.candidate.knobs, fit.x, strict=True)}

    def _pays(self, larger: Kinds, smaller: Kinds) -> bool:
        evidence = log_evidence(self.table(), self.prices)
        return evidence[larger] > evidence[smaller]

    def _best(self, among: Sequence[Kinds]) -> Kinds:
        evidence = log_evidence(self.table(), self.prices)
        return max(among, key=lambda kinds: evidence[kinds])

    def _fit(self, kinds: Kinds, near: Kinds | None = None) -> None:
        if kinds in self.fits:
            return
        candidate = Candidate.of(self.registry, kinds)
        fit = self.fitter.fit(candidate, self._starts(candidate, near))
        self.fits[kinds] = fit
        self.rows[kinds] = _row(kinds, fit, self.fits[NOTHING].residual, self.readings, self.condition)
        self.tick(" + ".join(kinds) or "nothing")

    def _starts(self, candidate: Candidate, near: Kinds | None) -> list[Array]:
        """Near a fitted set, or near each effect as it was fitted alone and near all of them."""
        if near is not None:
            return candidate.starts(self._known(near))
        alone = [self._known((kind,)) for kind in candidate.kinds if (kind,) in self.fits]
        if len(alone) < len(candidate.kinds) or len(alone) < 2:
            return candidate.starts()
        together = {name: x for known in alone for name, x in known.items()}
        return [candidate.starts(known)[0] for known in alone] + candidate.starts(together)


def _row(kinds: Kinds, fit: Fit, plain: Array, readings: ReadingVector, condition: NDArray[np.intp]) -> Row:
    of_reading = condition[readings.run]
    left = heldout_residual(fit, readings.fold, plain)
    unseen = heldout_residual(fit, of_reading, np.full_like(plain, np.nan))
    several = len(np.unique(of_reading)) > 1
    known = np.where(np.isnan(unseen), plain, unseen) if several else left
    return Row(
        kinds=kinds,
        n_parameters=len(fit.x),
        mean_square=fit.mean_square() if np.isfinite(fit.mean_square()) else np.inf,
        heldout_square=float(np.mean(left**2)),
        unseen_square=float(np.mean(known**2)),
        unseen=tuple(np.bincount(of_reading, weights=unseen**2)) if several else (),
        at_limit=at_limit(fit),
    )
