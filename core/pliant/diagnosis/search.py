"""Search over hypotheses: none, every single effect, and larger sets as far as the data require them.

Near its single fit, and near its plausible end, an effect changes the readings along a few directions: its change there
and its slopes. The part of a residual that a set could explain is, to first order, the regression of the residual on
the directions of its effects (Rao's score test, 1948, for all subsets at once as in Furnival & Wilson, Technometrics
16, 1974). Of all sets of two effects, then of three, those with the largest expected gain by this superposition are
fitted with the physics in the loop, and the best single with its best partners. Directions may add up only beyond first
order: each leading single is also tried with every other effect, by one bounded step from where both act. An effect
that the law's own error imitates has no expected gain in addition to it, but may still be present: the leading singles
are also fitted with each such effect. The best set's effects are exchanged in turn, and its subsets are fitted too, so
that an effect that has become idle is dropped (Miller, Subset Selection in Regression, 2002).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

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
from pliant.diagnosis.excitation import Excitation, explained_by
from pliant.diagnosis.fitting import MOST_LOST, Fitter
from pliant.diagnosis.left_out import condition_indices, heldout_residual
from pliant.diagnosis.noise import LEAST_SQUARE, NoiseView, noise_view
from pliant.diagnosis.readings import ReadingVector
from pliant.execution.executors import Executor, InlineExecutor
from pliant.execution.jobs import JobQueue
from pliant.measurements.repeats import RepeatGroup, repeat_groups
from pliant.records.design import Array
from pliant.records.measurement import Measurement
from pliant.registry.discovery import Registry

MOST_EFFECTS = 3
# Number of highest-ranked sets of one size that are fitted; and of each kind of neighbours of the best one.
SCREENED = 10
EXCHANGED = 3
# The same without derivatives, where fits cost more; singles that are fitted to their end, and steps of the others.
SCREENED_BY_DIFFERENCES, LIKELY, UNLIKELY_ITERATIONS = 4, 12, 2
# The same where slopes cost as much as predictions.
LIKELY_BY_COSTLY_SLOPES, UNLIKELY_ITERATIONS_BY_COSTLY_SLOPES = 6, 1
# Number of leading singles that are tried with every other effect.
PAIRED = 10
# Number of leading sets of their size whose forms are varied.
VARIED_FORMS, VARIED_FORMS_LARGER = 5, 2
# Number of leading singles, within this log-evidence of the best, that are fitted with each effect imitated by the
# law's own error, which leaves at most this share of its squares.
BESIDE_LAW, NEAR_BEST, LEFT_BY_LAW = 3, 14.0, 0.2
# Log-odds that such an effect costs: the law's own error says the same without it.
IMITATED_PRICE = 8.0
# A hypothesis with this much less log-evidence than the best is not refined.
OUT_OF_REACH = 30.0
# With this much less, the law's sensitivities stay those of the unchanged model; a fit's own change it by up to 3.
OUT_OF_LAW_REACH = 15.0
# Steps from sample to sample for screening larger sets.
SCREENING_STEPS = 2

Tick = Callable[[str], None]
# A candidate, its starts, steps from sample to sample, whether to refine them, and iterations at most.
Job = tuple[EffectSet, list[Array], int, bool, int | None]


@dataclass(eq=False)
class HypothesisSearch:
    """A search that fits hypotheses, as many at a time as the executor does, and caches them."""

    registry: Registry
    measurement: Measurement
    readings: ReadingVector
    fitter: Fitter
    thresholds: EvidenceThresholds
    shown: dict[str, Excitation]
    tick: Tick = lambda _: None
    executor: Executor = field(default_factory=InlineExecutor)
    fits: dict[Kinds, EffectFit] = field(default_factory=dict)
    rows: dict[Kinds, Row] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.groups: tuple[RepeatGroup, ...] = repeat_groups(self.measurement)
        repeats = [group.runs for group in self.groups]
        self._noise: tuple[EffectFit, NoiseView] | None = None
        self._imitated: set[Kinds] = set()  # sets with an effect that the law's own error imitates
        self._unlikely: set[Kinds] = set()  # singles that explain little to first order
        self._own: set[Kinds] = set()  # fits with the law's error at their own point
        self.condition = condition_indices(len(self.measurement.runs), repeats)

    def fit_singles(self, kinds: Sequence[str]) -> None:
        """Fit the unchanged model, and each of these kinds alone.

        Without derivatives every step costs many simulations: kinds that explain little of the error to first order
        (Rao's score test, 1948) are given a few steps only.
        """
        self._fit([NOTHING])
        if not self.fitter.predictor.has_derivatives:
            residual = self.fits[NOTHING].raw
            gains = {kind: explained_by(residual, self.shown[kind]) for kind in kinds}
            ranked = sorted(gains, key=lambda kind: -gains[kind])
            likely = LIKELY_BY_COSTLY_SLOPES if self.fitter.predictor.costly_slopes else LIKELY
            self._unlikely = {(kind,) for kind in ranked[likely:]}
        self._fit([(kind,) for kind in kinds])

    def run(self, kinds: Sequence[str]) -> EvidenceTable:
        """Return the table of all hypotheses fitted among these kinds."""
        self.fit_singles(kinds)
        self._fit_shape_variants([(kind,) for kind in kinds])
        current = self._best([key for key in self.fits if len(key) <= 1])
        if room_above_floor(self.table(), current, self.thresholds):
            whitened = self.fitter.whitened
            directions = Directions.from_fits(self._felt(kinds), self.fits, self.shown, MOST_LOST, whitened)
            self._forward_step(directions, len(kinds))
        self._fit_beside_law(self._felt(kinds))
        self._take_own_law_errors(list(self.fits))
        self._weigh_law_errors()
        return self.table()

    def _felt(self, kinds: Sequence[str]) -> list[str]:
        """Return the kinds that change some reading: a set with another one says the same without it."""
        return [kind for kind in kinds if self.shown[kind].change.any() or self.fits[(kind,)].slopes.any()]

    def _fit_beside_law(self, kinds: Sequence[str]) -> None:
        """Fit each leading single effect with each effect that the law's own error imitates."""
        imitated = [kind for kind in kinds if self._is_imitated(self.shown[kind].change)]
        evidence = log_evidence(self.table(), self.thresholds)
        least = max(evidence.values()) - NEAR_BEST
        near = [key for key in self.fits if len(key) == 1 and evidence[key] > least]
        for best in sorted(near, key=lambda key: -evidence[key])[:BESIDE_LAW]:
            sets = [sorted_kinds((*best, kind)) for kind in imitated if kind not in best]
            self._imitated |= {kinds for kinds in sets if kinds not in self.fits}
            self._fit(sets, near=best)

    def _is_imitated(self, change: Array) -> bool:
        """Return whether the law's own error explains most of a change (N,) of the readings."""
        if self.fitter.joint_law is None or not np.isfinite(change).all():
            return False
        left = self.fitter.whitened(change)
        return float(left @ left) < LEFT_BY_LAW * float(change @ change)

    def _weigh_law_errors(self) -> None:
        """Estimate the law's error of every fit again, for the present noise."""
        law = self.fitter.law
        if law is None:
            return
        n = self.table().noise.n_effective
        self._noise = None
        for kinds, fit in self.fits.items():
            self._keep(kinds, fit.with_law(law.prior, n), self.rows[kinds].form_price)

    def table(self) -> EvidenceTable:
        """Return the rows so far, against the noise estimated from the best of them."""
        best = min(self.rows.values(), key=lambda row: row.mean_square)
        count = np.bincount(self.condition[self.readings.run])
        shares = tuple((count[count > 0] / len(self.readings)).tolist())
        noise = self.noise(self.fits[best.kinds])
        law = self.fitter.law
        largest = 0.0 if law is None else law.largest_price(noise.n_effective)
        has_law = self.fitter.joint_law is not None
        off = 0.0 if law is None or has_law else law.prior.most
        return EvidenceTable(dict(self.rows), noise, len(self.readings), shares, has_law, largest, off)

    def noise(self, fit: EffectFit) -> NoiseView:
        """Return noise from the residuals of a fit; the last one is cached, because the best fit is often the same."""
        if self._noise is None or self._noise[0] is not fit:
            residuals = self.readings.unpack(fit.residual)
            found = noise_view(self.measurement, residuals, self.readings.scales, self.groups)
            self._noise = fit, found
        return self._noise[1]

    def _forward_step(self, directions: Directions, n_kinds: int) -> None:
        """Fit sets of two and more effects, while the best of a size improves on smaller ones and may be improved."""
        plain = self.fitter.whitened(self.fits[NOTHING].raw)
        screened = SCREENED if self.fitter.predictor.has_derivatives else SCREENED_BY_DIFFERENCES
        for size in range(2, min(MOST_EFFECTS, n_kinds) + 1):
            sets = directions.highest_ranked(plain, size, screened)
            if size == 2 and self.fitter.predictor.has_derivatives:
                sets += self._pairs(directions.kinds)
            beside = [key for key in self.fits if len(key) == size - 1]
            sets += self._larger(self._best(beside), directions)
            if not sets:
                return
            self._fit(sets)
            best = self._swap_terms(self._best(sets), directions)
            subsets = [tuple(kind for kind in best if kind != left) for left in best]
            self._fit(subsets, near=best)
            best = self._best([best, *self._fit_shape_variants(sets)])
            self._refit_near(best, subsets)
            before = self._best([key for key in self.fits if len(key) < size])
            if not self._pays(best, before) or not room_above_floor(self.table(), best, self.thresholds):
                return

    def _fit_shape_variants(self, sets: Sequence[Kinds]) -> list[Kinds]:
        """Let the forms of the leading sets vary, and keep those that pay for it; return the leading sets."""
        table, plain = self.table(), self.rows[NOTHING].mean_square
        evidence = log_evidence(table, self.thresholds)
        gaining = [kinds for kinds in dict.fromkeys(sets) if self.rows[kinds].mean_square < plain]
        most = VARIED_FORMS if all(len(kinds) == 1 for kinds in sets) else VARIED_FORMS_LARGER
        leading = sorted(gaining, key=lambda kinds: -evidence[kinds])[:most]
        tried = [
            kinds
            for kinds in leading
            if len(kinds) > 1 or EffectSet.from_kinds(self.registry, kinds, kinds).forms
        ]
        asked = [EffectSet.from_kinds(self.registry, kinds, kinds) for kinds in tried]
        starts = [one.starts(self.fits[kinds].named)[:1] for one, kinds in zip(asked, tried, strict=True)]
        jobs = zip(asked, starts, map(self._steps, tried), strict=True)
        found = dict(zip(tried, self._fitted([(*job, False, None) for job in jobs]), strict=True))
        n = table.noise.n_effective
        plain_ones = {kinds: (self.fits[kinds], self.rows[kinds]) for kinds in tried}
        kept = [kinds for kinds in tried if self._keep_if_it_pays(kinds, found[kinds], n)]
        evidence = log_evidence(self.table(), self.thresholds)
        least = max(evidence.values()) - OUT_OF_REACH
        # Only those that may still lead are refined: a rate may need many steps.
        near = [kinds for kinds in kept if evidence[kinds] > least]
        with JobQueue(self.executor, self.fitter.refined_from) as queue:
            again = [one.unwrap() for one in queue.each([found[kinds] for kinds in near])]
        self._own -= set(kept)
        for kinds, fit in zip(near, again, strict=True):
            self.fits[kinds], self.rows[kinds] = plain_ones[kinds]
            self._keep_if_it_pays(kinds, fit, n)
            self._own.add(kinds)
        for kinds in tried:
            self.tick(" + ".join(kinds) + ", relatives")
        return leading

    def _fitted(self, jobs: Sequence[Job]) -> list[EffectFit]:
        """Return the fits of these jobs, in their order."""
        with JobQueue(self.executor, self.fitter.fit_from) as queue:
            return [one.unwrap() for one in queue.each(jobs)]

    def _keep_if_it_pays(self, kinds: Kinds, fit: EffectFit, n_effective: float) -> bool:
        """Keep a fit with forms if it gains more over the set's row than its penalty; return whether it does."""
        price = form_price(fit, n_effective)
        squares = (self.rows[kinds].mean_square, fit.mean_square())
        before, after = (max(square, LEAST_SQUARE) for square in squares)
        gain = 0.5 * n_effective * np.log(before / after) + self.rows[kinds].law_price - fit.law_price
        if not gain + self.rows[kinds].form_price > price:
            return False
        self._keep(kinds, fit, price)
        return True

    def _pairs(self, kinds: Sequence[str]) -> list[Kinds]:
        """Return the highest-ranked pairs with a leading single, by one step from where both effects act."""
        evidence = log_evidence(self.table(), self.thresholds)
        singles = [(kind,) for kind in kinds if np.isfinite(self.rows[(kind,)].mean_square)]
        leading = sorted(singles, key=lambda key: -evidence[key])[:PAIRED]
        pairs = list(
            dict.fromkeys(sorted_kinds((*one, kind)) for one in leading for kind in kinds if kind not in one)
        )
        jobs = []
        for pair in pairs:
            candidate = EffectSet.from_kinds(self.registry, pair)
            known = {k: v for one in leading if set(one) < set(pair) for k, v in self.fits[one].named.items()}
            jobs.append((candidate, candidate.starts(known)[0], 1))
        with JobQueue(self.executor, self.fitter.promise_from) as queue:
            costs = [one.unwrap() for one in queue.each(jobs)]
        ranked = sorted(range(len(pairs)), key=lambda k: costs[k])
        return [pairs[k] for k in ranked[:SCREENED] if np.isfinite(costs[k])]

    def _larger(self, base: Kinds, directions: Directions) -> list[Kinds]:
        """Return the base with each of the highest-ranked further kinds, its own parameters being refitted."""
        fit = self.fits[base]
        if not np.all(np.isfinite(fit.residual)):
            return []
        white = fit.whitened(np.column_stack([fit.raw, fit.slopes]))
        found = directions.next_to(white[:, 0], white[:, 1:], base, EXCHANGED)
        return [sorted_kinds((*base, kind)) for kind in found]

    def _swap_terms(self, best: Kinds, directions: Directions) -> Kinds:
        """Return the set with each of its effects exchanged in turn while that helps."""
        for out in tuple(best):
            if out not in best:
                continue
            rest = tuple(kind for kind in best if kind != out)
            part = EffectSet.from_kinds(self.registry, rest, set(rest) & set(self.fits[best].candidate.forms))
            known = self.fits[best].named
            x = np.array([known[parameter.name] for parameter in part.parameters])
            looked = self.fitter.evaluate(part, x, self.fits[best].parts)
            if not np.all(np.isfinite(looked.residual)):
                continue
            white = looked.whitened(np.column_stack([looked.raw, looked.slopes]))
            others = directions.next_to(white[:, 0], white[:, 1:], best, EXCHANGED)
            sets = [sorted_kinds((*rest, kind)) for kind in others]
            self._fit(sets, near=best)
            best = self._best([best, *sets])
        return best

    def _refit_near(self, best: Kinds, sets: Sequence[Kinds]) -> None:
        """Fit sets again from the values of the best one, where their cost is lower there than at their own fits.

        A smaller set can end in a minimum that a larger one avoids; the larger one would then lead for no reason.
        """
        known = self.fits[best].named
        for kinds in sets:
            fit = self.fitter.refit_from(self.fits[kinds], [known])
            if fit is not self.fits[kinds]:
                price = form_price(fit, self.table().noise.n_effective) if fit.candidate.forms else 0.0
                self._keep(kinds, fit, price)
                self._own.add(kinds)

    def _pays(self, larger: Kinds, smaller: Kinds) -> bool:
        evidence = log_evidence(self.table(), self.thresholds)
        return evidence[larger] > evidence[smaller]

    def _best(self, among: Sequence[Kinds]) -> Kinds:
        evidence = log_evidence(self.table(), self.thresholds)
        return max(among, key=lambda kinds: evidence[kinds])

    def _fit(self, sets: Sequence[Kinds], near: Kinds | None = None) -> None:
        """Fit those of the sets that are new; the start of each does not depend on the others."""
        new = [kinds for kinds in dict.fromkeys(sets) if kinds not in self.fits]
        asked = [EffectSet.from_kinds(self.registry, kinds, self._varied_forms(kinds)) for kinds in new]
        starts = [self._starts(candidate, near) for candidate in asked]
        with JobQueue(self.executor, self.fitter.fit_from) as queue:
            done = queue.each([self._job(*one) for one in zip(asked, starts, strict=True)])
            for kinds, one in zip(new, done, strict=True):
                fit = one.unwrap()
                price = form_price(fit, self.table().noise.n_effective) if fit.candidate.forms else 0.0
                self._keep(kinds, fit, price)
                self.tick(" + ".join(kinds) or "nothing")
        self._take_own_law_errors(new)

    def _take_own_law_errors(self, sets: Sequence[Kinds]) -> None:
        """Give fits that may still lead the sensitivities of the law's error at their own point."""
        if self.fitter.law is None:
            return
        evidence = log_evidence(self.table(), self.thresholds)
        least = max(evidence.values()) - OUT_OF_LAW_REACH
        near = [kinds for kinds in sets if kinds not in self._own and evidence[kinds] > least]
        with JobQueue(self.executor, self.fitter.with_own_law_error_from) as queue:
            done = [one.unwrap() for one in queue.each([self.fits[kinds] for kinds in near])]
        for kinds, fit in zip(near, done, strict=True):
            self._keep(kinds, fit, self.rows[kinds].form_price)
            self._own.add(kinds)

    def _job(self, candidate: EffectSet, starts: list[Array]) -> Job:
        """Return the job of a candidate: larger sets start with few steps, and are refined later if they lead."""
        steps, large = self._steps(candidate.kinds), len(candidate.kinds) > 1
        few = UNLIKELY_ITERATIONS
        if self.fitter.predictor.costly_slopes:
            few = UNLIKELY_ITERATIONS_BY_COSTLY_SLOPES
        iterations = few if candidate.kinds in self._unlikely else None
        return candidate, starts, min(steps, SCREENING_STEPS) if large else steps, not large, iterations

    def _keep(self, kinds: Kinds, fit: EffectFit, price: float) -> None:
        self.fits[kinds] = fit
        plain = self.fits[NOTHING].residual
        row = _row(kinds, fit, plain, self.readings, self.condition, price)
        self.rows[kinds] = replace(row, imitated_price=IMITATED_PRICE) if kinds in self._imitated else row

    def _varied_forms(self, kinds: Kinds) -> list[str]:
        """Return the kinds whose single fits do not have the plain form."""
        return [kind for kind in kinds if (kind,) in self.fits and self.fits[(kind,)].candidate.forms]

    def _steps(self, kinds: Kinds) -> int:
        """Return the steps from sample to sample that the single fits of its effects needed."""
        return max(
            [1, *(self.fits[part].parts for part in (NOTHING, *((k,) for k in kinds)) if part in self.fits)]
        )

    def _starts(self, candidate: EffectSet, near: Kinds | None) -> list[Array]:
        """Return starts near a fitted set, or near each effect's single fit and near all of them."""
        if near is not None:
            return candidate.starts(self.fits[near].named)
        alone = [self.fits[(kind,)].named for kind in candidate.kinds if (kind,) in self.fits]
        if len(alone) < len(candidate.kinds) or len(alone) < 2:
            return candidate.starts()
        together = {name: x for known in alone for name, x in known.items()}
        return [candidate.starts(known)[0] for known in alone] + candidate.starts(together)


def form_price(fit: EffectFit, n_effective: float) -> float:
    """Return the log-odds penalty of free forms: their prior at the fit, and Occam's factor of their information.

    With A = JᵀJ n_eff / (N s²) and D the prior's weights, ½ Σ D x² + ½ ln det (I + D⁻¹ A_ff·o), A_ff·o the information
    on the forms with all else refitted: the ratio of the evidence integral to the likelihood at its top (Laplace;
    MacKay, Neural Computation 4, 1992). A form without influence costs nothing.
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
