"""Which hypotheses are fitted: nothing, every single effect, and larger sets as far as the data ask for them.

Forward steps add the effect that helps most, swaps exchange one of a set for another, and every subset of a set
that was reached is fitted too, so that an effect that has become idle drops out (backward elimination; Miller,
Subset Selection in Regression, 2002).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.candidates import Candidate
from pliant.diagnosis.fitting import MOST_LOST, Fit, Fitter
from pliant.diagnosis.heldout import condition_of_runs, heldout_residual
from pliant.diagnosis.noise import NoiseView, noise_view
from pliant.diagnosis.readings import ReadingVector
from pliant.diagnosis.table import (
    NOTHING,
    UNKNOWN,
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
# Singles that are within this of the best one in log-evidence are grown too.
NEAR = 15.0
MOST_GROWN = 2
# Of all sets with one effect more, those that promise most are fitted.
SCREENED = 5

Tick = Callable[[str], None]


@dataclass(eq=False)
class Search:
    """Fits hypotheses one after another and keeps them."""

    registry: Registry
    measurement: Measurement
    readings: ReadingVector
    fitter: Fitter
    prices: Prices
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
        for base in self._promising():
            self._grow(base, kinds)
        return self.table()

    def table(self) -> EvidenceTable:
        """The rows so far, against the noise that the best of them leaves."""
        best = min(self.rows.values(), key=lambda row: row.mean_square)
        return EvidenceTable(dict(self.rows), self.noise(self.fits[best.kinds]), len(self.readings))

    def noise(self, fit: Fit) -> NoiseView:
        """Noise as the residuals of a fit show it."""
        residuals = self.readings.unpack(fit.residual)
        return noise_view(self.measurement, residuals, self.readings.scales, self.groups)

    def _promising(self) -> list[Kinds]:
        """Singles from which larger sets are grown: the best and those near it."""
        table = self.table()
        evidence = self._ranked(table)
        first = evidence[0][1]
        near: list[Kinds] = [kinds for kinds, value in evidence if len(kinds) == 1 and first - value < NEAR]
        return near[:MOST_GROWN] if room_above_floor(table, evidence[0][0], self.prices) else []

    def _grow(self, base: Kinds, kinds: Sequence[str]) -> None:
        current = base
        while len(current) < MOST_EFFECTS and room_above_floor(self.table(), current, self.prices):
            larger = self._screened(current, kinds)
            if not larger:
                return
            for candidate in larger:
                self._fit(candidate, near=current)
            best = self._best(larger)
            if not self._pays(best, current):
                return
            best = self._swapped(best, kinds)
            for left in best:
                self._fit(tuple(kind for kind in best if kind != left), near=best)
            current = best

    def _swapped(self, best: Kinds, kinds: Sequence[str]) -> Kinds:
        """The set with each of its effects exchanged in turn while that helps."""
        for out in tuple(best):
            if out not in best:
                continue
            rest = tuple(kind for kind in best if kind != out)
            self._fit(rest, near=best)
            others = [larger for larger in self._screened(rest, kinds) if larger != best]
            for candidate in others:
                self._fit(candidate, near=rest)
            best = self._best([best, *others])
        return best

    def _screened(self, base: Kinds, kinds: Sequence[str]) -> list[Kinds]:
        """Sets with one effect more that promise most.

        Rao's score test (1948): the readings that the base leaves are regressed on what a small further effect
        would change, the base's own parameters free to follow.
        """
        promise: dict[Kinds, float] = {}
        for kind in kinds:
            if kind in base:
                continue
            larger = sorted_kinds((*base, kind))
            candidate = Candidate.of(self.registry, larger)
            starts = candidate.starts(self._known(base))
            promise[larger] = min(self._linear_rest(self.fitter.look(candidate, x), base) for x in starts)
        return sorted(promise, key=lambda larger: promise[larger])[:SCREENED]

    def _linear_rest(self, looked: Fit, base: Kinds) -> float:
        """Mean square that is left after the residual of the base is regressed on the slopes there."""
        residual = self.fits[base].residual
        change = residual - looked.residual
        basis = np.column_stack([looked.slopes, change])
        there = np.all(np.isfinite(basis), axis=1) & np.isfinite(residual)
        if there.mean() < 1.0 - MOST_LOST:
            return np.inf
        weights = np.linalg.lstsq(basis[there], residual[there], rcond=1e-8)[0]
        rest = residual[there] - basis[there] @ weights
        return float(rest @ rest)

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

    def _ranked(self, table: EvidenceTable) -> list[tuple[Kinds, float]]:
        evidence = log_evidence(table, self.prices)
        evidence.pop(UNKNOWN, None)
        return sorted(evidence.items(), key=lambda item: -item[1])

    def _fit(self, kinds: Kinds, near: Kinds | None = None) -> None:
        if kinds in self.fits:
            return
        candidate = Candidate.of(self.registry, kinds)
        known = {} if near is None else self._known(near)
        fit = self.fitter.fit(candidate, candidate.starts(known))
        self.fits[kinds] = fit
        self.rows[kinds] = _row(kinds, fit, self.fits[NOTHING].residual, self.readings, self.condition)
        self.tick(" + ".join(kinds) or "nothing")


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
