"""Which hypotheses are fitted: nothing, every single effect, and larger sets as far as the data ask for them.

Near where it was fitted alone, and near its plausible end, an effect changes the readings along a few directions: its
change there and its slopes. What a set could explain of a residual is, to first order, the regression of the residual
on the directions of its effects (Rao's score test, 1948, for all subsets at once as in Furnival & Wilson,
Technometrics 16, 1974). Of all sets of two effects, then of three, those that promise most by this superposition are
fitted with the physics in the loop, and the best single with what helps it most. Directions may add up only beyond
first order: each leading single is also tried with every other effect beside it, by one bounded step from where both
act. The best set's effects are exchanged in turn, and its subsets are fitted too, so that an effect that has become
idle drops out (Miller, Subset Selection in Regression, 2002).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.directions import Directions
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.evidence_table import (
    NOTHING,
    EvidenceTable,
    EvidenceThresholds,
    Kinds,
    Row,
    at_limit,
    log_evidence,
    prior_price,
    room_above_floor,
    sorted_kinds,
)
from pliant.diagnosis.excitation import Excitation
from pliant.diagnosis.fitting import MOST_LOST, Fitter
from pliant.diagnosis.left_out import condition_of_runs, heldout_residual
from pliant.diagnosis.noise import LEAST_SQUARE, NoiseView, noise_view
from pliant.diagnosis.readings import ReadingVector
from pliant.execution.executors import Executor, InlineExecutor
from pliant.execution.jobs import JobQueue
from pliant.measurements.repeats import RepeatGroup, repeat_groups
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.registry.discovery import Registry

MOST_EFFECTS = 3
# Of all sets of one size, so many that promise most are fitted; of the neighbours of the best one, so many each.
SCREENED = 10
EXCHANGED = 3
# So many singles that lead are tried with every other effect beside them.
PAIRED = 10
# So many sets that lead their size are asked whether a relative of their equations fits better.
BENT, BENT_LARGER = 5, 2
# A hypothesis with so much less log-evidence than the best is not made more exact.
OUT_OF_REACH = 30.0
# Steps from sample to sample in which larger sets are screened.
SCREENING_STEPS = 2

Tick = Callable[[str], None]


@dataclass(eq=False)
class HypothesisSearch:
    """Fits hypotheses, as many at a time as the executor does, and keeps them."""

    registry: Registry
    measurement: Measurement
    readings: ReadingVector
    fitter: Fitter
    thresholds: EvidenceThresholds
    shown: Mapping[str, Excitation]
    tick: Tick = lambda _: None
    executor: Executor = field(default_factory=InlineExecutor)
    fits: dict[Kinds, EffectFit] = field(default_factory=dict)
    rows: dict[Kinds, Row] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.groups: tuple[RepeatGroup, ...] = repeat_groups(self.measurement)
        repeats = [group.runs for group in self.groups]
        self._noise: tuple[EffectFit, NoiseView] | None = None
        self.condition = condition_of_runs(len(self.measurement.runs), repeats)

    def run(self, kinds: Sequence[str]) -> EvidenceTable:
        """The table of everything that was worth fitting among these kinds."""
        self._fit([NOTHING])
        self._fit([(kind,) for kind in kinds])
        self._bend([(kind,) for kind in kinds])
        current = self._best([key for key in self.fits if len(key) <= 1])
        if room_above_floor(self.table(), current, self.thresholds):
            whitened = self.fitter.whitened
            self._grow(Directions.of(kinds, self.fits, self.shown, MOST_LOST, whitened), len(kinds))
        self._weigh_law_errors()
        return self.table()

    def _weigh_law_errors(self) -> None:
        """Estimate the law's error of every fit again, for the noise that is known now."""
        law = self.fitter.law
        if law is None:
            return
        n = self.table().noise.n_effective
        self._noise = None
        for kinds, fit in self.fits.items():
            self._keep(kinds, fit.with_law(law.prior, n), self.rows[kinds].form_price)

    def table(self) -> EvidenceTable:
        """The rows so far, against the noise that the best of them leaves."""
        best = min(self.rows.values(), key=lambda row: row.mean_square)
        count = np.bincount(self.condition[self.readings.run])
        shares = tuple((count[count > 0] / len(self.readings)).tolist())
        noise = self.noise(self.fits[best.kinds])
        return EvidenceTable(dict(self.rows), noise, len(self.readings), shares, self.fitter.law is not None)

    def noise(self, fit: EffectFit) -> NoiseView:
        """Noise as the residuals of a fit show it; that of the last one is kept, for the best fit is often the same."""
        if self._noise is None or self._noise[0] is not fit:
            residuals = self.readings.unpack(fit.residual)
            found = noise_view(self.measurement, residuals, self.readings.scales, self.groups)
            self._noise = fit, found
        return self._noise[1]

    def _grow(self, directions: Directions, n_kinds: int) -> None:
        """Sets of two and more effects, while the best of a size is better than what is smaller and may be bettered."""
        plain = self.fitter.whitened(self.fits[NOTHING].raw)
        for size in range(2, min(MOST_EFFECTS, n_kinds) + 1):
            before = self._best([key for key in self.fits if len(key) < size])
            sets = directions.promising(plain, size, SCREENED)
            if size == 2:
                sets += self._pairs(directions.kinds)
            beside = [key for key in self.fits if len(key) == size - 1]
            sets += self._larger(self._best(beside), directions)
            if not sets:
                return
            self._fit(sets)
            best = self._exchanged(self._best(sets), directions)
            self._fit([tuple(kind for kind in best if kind != left) for left in best], near=best)
            best = self._best([best, *self._bend(sets)])
            if not self._pays(best, before) or not room_above_floor(self.table(), best, self.thresholds):
                return

    def _bend(self, sets: Sequence[Kinds]) -> list[Kinds]:
        """Let the forms of the leading sets vary, and keep those that pay for it; returns the leading sets."""
        table, plain = self.table(), self.rows[NOTHING].mean_square
        evidence = log_evidence(table, self.thresholds)
        gaining = [kinds for kinds in dict.fromkeys(sets) if self.rows[kinds].mean_square < plain]
        most = BENT if all(len(kinds) == 1 for kinds in sets) else BENT_LARGER
        leading = sorted(gaining, key=lambda kinds: -evidence[kinds])[:most]
        tried = [
            kinds for kinds in leading if len(kinds) > 1 or EffectSet.of(self.registry, kinds, kinds).forms
        ]
        asked = [EffectSet.of(self.registry, kinds, kinds) for kinds in tried]
        starts = [one.starts(self.fits[kinds].named)[:1] for one, kinds in zip(asked, tried, strict=True)]
        jobs = zip(asked, starts, map(self._steps, tried), strict=True)
        found = dict(zip(tried, self._fitted([(*job, False) for job in jobs]), strict=True))
        n = table.noise.n_effective
        plain_ones = {kinds: (self.fits[kinds], self.rows[kinds]) for kinds in tried}
        kept = [kinds for kinds in tried if self._keep_if_it_pays(kinds, found[kinds], n)]
        evidence = log_evidence(self.table(), self.thresholds)
        least = max(evidence.values()) - OUT_OF_REACH
        # In finer steps those alone that may still lead: a rate may ask for many.
        near = [kinds for kinds in kept if evidence[kinds] > least]
        again = [(found[kinds].candidate, [found[kinds].x], found[kinds].parts, True) for kinds in near]
        for kinds, fit in zip(near, self._fitted(again), strict=True):
            self.fits[kinds], self.rows[kinds] = plain_ones[kinds]
            self._keep_if_it_pays(kinds, fit, n)
        for kinds in tried:
            self.tick(" + ".join(kinds) + ", relatives")
        return leading

    def _fitted(self, jobs: Sequence[tuple[EffectSet, list[Array], int, bool]]) -> list[EffectFit]:
        """Fits of these jobs, in their order."""
        with JobQueue(self.executor, self.fitter.fit_from) as queue:
            return [one.unwrap() for one in queue.each(jobs)]

    def _keep_if_it_pays(self, kinds: Kinds, fit: EffectFit, n_effective: float) -> bool:
        """Keep a fit with forms where it gains more over the set's row than they cost; whether it does."""
        price = form_price(fit, n_effective)
        squares = (self.rows[kinds].mean_square, fit.mean_square())
        before, after = (max(square, LEAST_SQUARE) for square in squares)
        gain = 0.5 * n_effective * np.log(before / after) + self.rows[kinds].law_price - fit.law_price
        if not gain + self.rows[kinds].form_price > price:
            return False
        self._keep(kinds, fit, price)
        return True

    def _pairs(self, kinds: Sequence[str]) -> list[Kinds]:
        """The pairs with a leading single that promise most by one step from where both effects act."""
        evidence = log_evidence(self.table(), self.thresholds)
        singles = [(kind,) for kind in kinds if np.isfinite(self.rows[(kind,)].mean_square)]
        leading = sorted(singles, key=lambda key: -evidence[key])[:PAIRED]
        pairs = list(
            dict.fromkeys(sorted_kinds((*one, kind)) for one in leading for kind in kinds if kind not in one)
        )
        jobs = []
        for pair in pairs:
            candidate = EffectSet.of(self.registry, pair)
            known = {k: v for one in leading if set(one) < set(pair) for k, v in self.fits[one].named.items()}
            jobs.append((candidate, candidate.starts(known)[0], 1))
        with JobQueue(self.executor, self.fitter.promise_from) as queue:
            costs = [one.unwrap() for one in queue.each(jobs)]
        ranked = sorted(range(len(pairs)), key=lambda k: costs[k])
        return [pairs[k] for k in ranked[:SCREENED] if np.isfinite(costs[k])]

    def _larger(self, base: Kinds, directions: Directions) -> list[Kinds]:
        """The base with each of the kinds that promise most beside it, its own parameters free to follow."""
        fit = self.fits[base]
        if not np.all(np.isfinite(fit.residual)):
            return []
        white = fit.whitened(np.column_stack([fit.raw, fit.slopes]))
        found = directions.next_to(white[:, 0], white[:, 1:], base, EXCHANGED)
        return [sorted_kinds((*base, kind)) for kind in found]

    def _exchanged(self, best: Kinds, directions: Directions) -> Kinds:
        """The set with each of its effects exchanged in turn while that helps."""
        for out in tuple(best):
            if out not in best:
                continue
            rest = tuple(kind for kind in best if kind != out)
            part = EffectSet.of(self.registry, rest, set(rest) & set(self.fits[best].candidate.forms))
            known = self.fits[best].named
            x = np.array([known[parameter.name] for parameter in part.parameters])
            looked = self.fitter.look(part, x, self.fits[best].parts)
            if not np.all(np.isfinite(looked.residual)):
                continue
            white = looked.whitened(np.column_stack([looked.raw, looked.slopes]))
            others = directions.next_to(white[:, 0], white[:, 1:], best, EXCHANGED)
            sets = [sorted_kinds((*rest, kind)) for kind in others]
            self._fit(sets, near=best)
            best = self._best([best, *sets])
        return best

    def _pays(self, larger: Kinds, smaller: Kinds) -> bool:
        evidence = log_evidence(self.table(), self.thresholds)
        return evidence[larger] > evidence[smaller]

    def _best(self, among: Sequence[Kinds]) -> Kinds:
        evidence = log_evidence(self.table(), self.thresholds)
        return max(among, key=lambda kinds: evidence[kinds])

    def _fit(self, sets: Sequence[Kinds], near: Kinds | None = None) -> None:
        """Fit those of the sets that are new; where each begins does not depend on the others."""
        new = [kinds for kinds in dict.fromkeys(sets) if kinds not in self.fits]
        asked = [EffectSet.of(self.registry, kinds, self._bent(kinds)) for kinds in new]
        starts = [self._starts(candidate, near) for candidate in asked]
        with JobQueue(self.executor, self.fitter.fit_from) as queue:
            done = queue.each([self._job(*one) for one in zip(asked, starts, strict=True)])
            for kinds, one in zip(new, done, strict=True):
                fit = one.unwrap()
                price = form_price(fit, self.table().noise.n_effective) if fit.candidate.forms else 0.0
                self._keep(kinds, fit, price)
                self.tick(" + ".join(kinds) or "nothing")

    def _job(self, candidate: EffectSet, starts: list[Array]) -> tuple[EffectSet, list[Array], int, bool]:
        """Larger sets in few steps from sample to sample at first; those that lead their size are refined after it."""
        steps, large = self._steps(candidate.kinds), len(candidate.kinds) > 1
        return candidate, starts, min(steps, SCREENING_STEPS) if large else steps, not large

    def _keep(self, kinds: Kinds, fit: EffectFit, price: float) -> None:
        self.fits[kinds] = fit
        plain = self.fits[NOTHING].residual
        self.rows[kinds] = _row(kinds, fit, plain, self.readings, self.condition, price)

    def _bent(self, kinds: Kinds) -> list[str]:
        """Those of these kinds that, each by itself, had not the plain form."""
        return [kind for kind in kinds if (kind,) in self.fits and self.fits[(kind,)].candidate.forms]

    def _steps(self, kinds: Kinds) -> int:
        """Steps from sample to sample that its effects, each by itself, were found to need."""
        return max(
            [1, *(self.fits[part].parts for part in (NOTHING, *((k,) for k in kinds)) if part in self.fits)]
        )

    def _starts(self, candidate: EffectSet, near: Kinds | None) -> list[Array]:
        """Near a fitted set, or near each effect as it was fitted alone and near all of them."""
        if near is not None:
            return candidate.starts(self.fits[near].named)
        alone = [self.fits[(kind,)].named for kind in candidate.kinds if (kind,) in self.fits]
        if len(alone) < len(candidate.kinds) or len(alone) < 2:
            return candidate.starts()
        together = {name: x for known in alone for name, x in known.items()}
        return [candidate.starts(known)[0] for known in alone] + candidate.starts(together)


def form_price(fit: EffectFit, n_effective: float) -> float:
    """Log-odds that free forms cost: their prior at the fit, and Occam's factor of what the readings know of them.

    With A = JᵀJ n_eff / (N s²) and D the prior's weights, ½ Σ D x² + ½ ln det (I + D⁻¹ A_ff·o), A_ff·o the information
    on the forms with all else refitted: the ratio of the evidence integral to the likelihood at its top (Laplace;
    MacKay, Neural Computation 4, 1992). A form that nobody feels costs nothing.
    """
    if not np.isfinite(fit.slopes).all():
        return np.inf
    parameters = fit.candidate.parameters
    form = np.array([parameter.is_form for parameter in parameters], bool)
    pull = np.array([parameter.pull for parameter in parameters])
    known = fit.information * n_effective / (len(fit.residual) * max(fit.mean_square(), LEAST_SQUARE))
    rest = known[~form][:, ~form] + np.diag(pull[~form])
    across = known[~form][:, form]
    alone = known[form][:, form] - across.T @ np.linalg.solve(rest, across)
    _, size = np.linalg.slogdet(np.eye(int(form.sum())) + alone / pull[form, None])
    return float(0.5 * (pull[form] @ fit.x[form] ** 2) + 0.5 * size)


def _row(
    kinds: Kinds,
    fit: EffectFit,
    plain: Array,
    readings: ReadingVector,
    condition: NDArray[np.intp],
    form_price: float,
) -> Row:
    of_reading = condition[readings.run]
    left = heldout_residual(fit, readings.fold, plain)
    unseen = heldout_residual(fit, of_reading, np.full_like(plain, np.nan))
    present = np.unique(of_reading)
    several = len(present) > 1
    by_condition = np.bincount(of_reading, weights=fit.residual**2)[present] / len(plain)
    known = np.where(np.isnan(unseen), plain, unseen) if several else left
    return Row(
        kinds=kinds,
        n_parameters=sum(not parameter.is_form for parameter in fit.candidate.parameters),
        form_price=form_price,
        mean_square=fit.mean_square() if np.isfinite(fit.mean_square()) else np.inf,
        heldout_square=float(np.mean(left**2)),
        unseen_square=float(np.mean(known**2)),
        unseen=tuple(np.bincount(of_reading, weights=unseen**2)) if several else (),
        at_limit=at_limit(fit),
        law_price=fit.law_price,
        prior_price=prior_price(fit),
        raw_square=float(np.mean(fit.raw**2)),
        squares=tuple(by_condition.tolist()) if several else (),
    )
