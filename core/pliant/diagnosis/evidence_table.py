"""Evidence table: the evidence of every fitted hypothesis, its complexity penalty, and its probability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.candidates import NINETY
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.noise import LEAST_SQUARE, NoiseView
from pliant.evidence.excess import Excess
from pliant.records.design import Array

Kinds = tuple[str, ...]
NOTHING: Kinds = ()
UNKNOWN: Kinds = ("unknown",)
# The law's own shape as a member of a class of indistinguishable effects.
LAW = "law"
# Rise of the error on held-out conditions that is still rounding and noise.
UNSEEN_RISE = 1.03


@dataclass(frozen=True)
class Row:
    """One hypothesis of the table.

    Attributes:
        kinds: its effects, sorted by name; empty for "nothing is missing".
        n_parameters: fitted strengths and shapes.
        mean_square: S, the mean squared residual in units of the floor's square.
        heldout_square: the same with each run held out of the fit.
        unseen_square: the same with each condition held out, all its repeats together.
        squares: contribution of each condition to S; empty if there is only one.
        unseen: sums of squares of each held-out condition; nan if a parameter is unknown without it.
        at_limit: names of parameters that ended on a bound.
        form_price: log-odds penalty of forms that vary; 0 for the plain ones.
        law_price: log-odds penalty of the law's own error with these effects.
        raw_square: S with the unchanged law.
        prior_price: log-odds penalty of values outside their plausible ranges.
        imitated_price: log-odds that an effect costs which the law's own error imitates.
    """

    kinds: Kinds
    n_parameters: int
    mean_square: float
    heldout_square: float
    unseen_square: float
    unseen: tuple[float, ...]
    at_limit: tuple[str, ...]
    form_price: float = 0.0
    squares: tuple[float, ...] = ()
    law_price: float = 0.0
    raw_square: float = np.nan
    prior_price: float = 0.0
    imitated_price: float = 0.0

    @property
    def before_law_error(self) -> float:
        """Return the mean square with the unchanged law."""
        return self.raw_square if np.isfinite(self.raw_square) else self.mean_square

    @property
    def explained_by_law(self) -> float:
        """Return the reduction of the mean square by the law's own error."""
        return max(self.raw_square - self.mean_square, 0.0) if np.isfinite(self.raw_square) else 0.0

    @property
    def as_it_is(self) -> float:
        """Return the mean square on held-out runs with the unchanged law, if the law's own error is part of the row."""
        return (
            max(self.raw_square, self.heldout_square) if np.isfinite(self.raw_square) else self.heldout_square
        )


@dataclass(frozen=True)
class EvidenceTable:
    """All rows, and the noise against which they are weighed.

    Attributes:
        shares: of each condition in all readings.
        has_law_error: the law's own error is part of every hypothesis.
        largest_law_price: expected log-odds penalty of the largest error of the law that its prior admits.
        number_error: largest share by which the numbers of a user's own model may be off, in every hypothesis.
    """

    rows: Mapping[Kinds, Row]
    noise: NoiseView
    n_readings: int
    shares: tuple[float, ...] = ()
    has_law_error: bool = False
    largest_law_price: float = 0.0
    number_error: float = 0.0

    @property
    def nothing(self) -> Row:
        """Return the row of the unchanged model."""
        return self.rows[NOTHING]

    @property
    def n_candidates(self) -> int:
        """Return the number of effects that were fitted alone."""
        return sum(len(kinds) == 1 for kinds in self.rows)

    def law_is_off(self, kinds: Kinds) -> bool:
        """Return whether the readings show an error of the law with these effects, beyond doubt."""
        return self.has_law_error and self._error_shows(kinds)

    def numbers_are_off(self, kinds: Kinds) -> bool:
        """Return whether the readings show errors of the model's own numbers with these effects, beyond doubt."""
        return self.number_error > 0.0 and self._error_shows(kinds)

    def _error_shows(self, kinds: Kinds) -> bool:
        row = self.rows[kinds]
        if not (np.isfinite(row.mean_square) and row.raw_square > row.mean_square):
            return False
        n = max(self.noise.n_effective, 2.0)
        squares = (max(square, LEAST_SQUARE) for square in (row.raw_square, row.mean_square))
        before, after = squares
        return bool(0.5 * n * np.log(before / after) - row.law_price > LAW_IS_OFF)

    def over_floor(self, square: float) -> float:
        """Return the root of a mean square over the noise floor; nan if the floor is unknown or the data noiseless."""
        floor = self.noise.floor_square
        return float(np.sqrt(square / floor)) if floor > LEAST_SQUARE else np.nan

    def excess(self, square: float) -> Excess:
        """Return the root of a mean square over the noise floor with its standard error."""
        return Excess.from_ratio(self.over_floor(square), self.noise.floors, self.noise.n_effective)


@dataclass(frozen=True)
class EvidenceThresholds:
    """Complexity penalties and thresholds of hypotheses; calibrated on simulated nulls with model error.

    Attributes:
        effect: log-odds penalty of each further effect, times ln(1 + candidates), in addition to the ½ ln n_eff of each
            parameter (Schwarz 1978): the longer the list, the likelier one of it fits by chance (Scott & Berger, Ann.
            Statist. 38, 2010).
        third_effect: additional log-odds penalty of a third effect: three of a long list imitate almost anything
            outside it.
        unknown: log-odds penalty of "an effect outside the list", which may reach the noise floor with any form.
        model_form_tolerance: share of what a hypothesis explains that may remain because its equation is an
            idealisation: a further effect must explain more than that.
        unknown_form_tolerance: that share with an effect outside the list, which could have any form.
        temperature: log-evidence is divided by this, because forms and noise models are inexact.
        accepted: probability above which the first hypothesis is the verdict.
        between_run_scatter: between / within scatter from which runs do not repeat.
        drift: change of scale between repeats, in floors (which it increases), from which they do not.
        fewest: n_eff below which no verdict is given.
        rival_form: maximum log-odds that a hypothesis loses against a rival of the same size, for each share of what
            the exchanged effect explains that it leaves: more data do not decide whether a small share is another
            effect or an inexact form.
        excited: change in σ below which an effect cannot be judged: the model's own law may have an error of this size,
            so that only what an effect explains beyond it counts.
        reversed_gain: maximum log-odds that a further effect loses because it explains only what smaller sets may leave
            anyway.
        law_form_tolerance: share of what the law's own error explains that may remain because it is taken to first
            order.
    """

    effect: float = 2.1
    third_effect: float = 20.0
    unknown: float = 30.0
    model_form_tolerance: float = 0.03
    unknown_form_tolerance: float = 0.05
    rival_form: float = 220.0
    temperature: float = 2.0
    accepted: float = 0.9
    between_run_scatter: float = 1.5
    drift: float = 0.3
    fewest: float = 12.0
    excited: float = 0.3
    law_form_tolerance: float = 0.0025
    reversed_gain: float = 6.0

    def price(self, effects: int, n_candidates: int) -> float:
        """Return the penalty of a number of effects together, given the number of candidates."""
        return self.effect * float(np.log1p(n_candidates)) * effects + self.third_effect * max(effects - 2, 0)


THRESHOLDS = EvidenceThresholds()
# Excess over the noise's square at which an effect outside the list is as likely as the hypothesis that leaves it.
OUTSIDE = 5.0
# Log-odds of an error of the law from which it is reported.
LAW_IS_OFF = 6.0
# Share of that tolerance if forms vary, because they account for the rest.
VARIED_SHARE = 0.2
# Half the number of independent ways in which a form may be wrong.
COINCIDENCE = 2.0


def log_evidence(table: EvidenceTable, thresholds: EvidenceThresholds) -> dict[Kinds, float]:
    """Return ln P(data | hypothesis) + ln prior of each row, up to a constant, and of `UNKNOWN` if it can be judged.

    −½ n_eff ln S* − ½ k ln n_eff − effect · ln(1 + candidates) · effects, S* the mean squared residual plus, for every
    hypothesis but "nothing", the part that a slightly wrong law may explain alone, and the part that the slightly wrong
    equations of simpler hypotheses may have left.
    """
    n = max(table.noise.n_effective, 2.0)
    found = {}
    paid_square = paid_squares(table, thresholds)
    for kinds, row in table.rows.items():
        price = thresholds.price(len(kinds), table.n_candidates)
        paid = 0.5 * row.n_parameters * np.log(n) + price + row.form_price + row.law_price + row.prior_price
        paid += row.imitated_price
        found[kinds] = -0.5 * n * np.log(paid_square[kinds]) - paid
    _limit_rival_advantage(table, found, paid_square, n, thresholds)
    if table.noise.judged:
        best = max(found, key=lambda kinds: found[kinds])
        left = _left_over(table, best, thresholds, thresholds.unknown_form_tolerance)
        square = table.noise.floor_square + left
        square += _floor_too_low(table.noise, table.rows[best].mean_square - square)
        by_size = -0.5 * n * np.log(square) - thresholds.unknown - table.rows[best].law_price
        found[UNKNOWN] = max(by_size, found[best] + thresholds.temperature * _outside_odds(table, best))
    return found


def _floor_too_low(noise: NoiseView, excess: float) -> float:
    """Return by how much the floor's square may be too low: a standard error, times exp(−½ z²).

    z is the excess that the floor's error would have to explain, in standard errors.
    """
    se = noise.floor_square_se
    return se * float(np.exp(-0.5 * (max(excess, 0.0) / se) ** 2)) if se > 0.0 else 0.0


def paid_squares(table: EvidenceTable, thresholds: EvidenceThresholds) -> dict[Kinds, float]:
    """Return S* of each row: S with its allowance.

    With a law error the allowance makes no set worse than the best smaller one by more than `reversed_gain` in
    log-evidence: an effect's merit may be that no error of the law is needed.
    """
    n = max(table.noise.n_effective, 2.0)
    paid: dict[Kinds, float] = {}
    for kinds in sorted(table.rows, key=len):
        mine = max(table.rows[kinds].mean_square, LEAST_SQUARE)
        square = mine + _allowance(table, kinds, thresholds)
        smaller = [value for key, value in paid.items() if len(key) < len(kinds)]
        if table.has_law_error and smaller and np.isfinite(mine):
            most = max(min(smaller), mine) * float(np.exp(min(2.0 * thresholds.reversed_gain / n, 50.0)))
            square = min(square, most)
        paid[kinds] = square
    return paid


def _outside_odds(table: EvidenceTable, kinds: Kinds) -> float:
    """Return the log-odds of an effect outside the list against a hypothesis, by its error above the noise.

    With e the excess over the floor, in units of it and beyond two standard errors of both, the odds are
    (e / `OUTSIDE`)²: zero for a hypothesis that reaches the floor, 1 : 3 for one that leaves twice the noise.
    """
    floor, n = table.noise.floor_square, max(table.noise.n_effective, 2.0)
    square = table.rows[kinds].mean_square
    if not (floor > LEAST_SQUARE and np.isfinite(square)):
        return -np.inf
    se = float(np.hypot(np.sqrt(2.0 / n), table.noise.floor_square_se / floor))
    excess = square / floor - 1.0 - 2.0 * se
    return 2.0 * float(np.log(excess / OUTSIDE)) if excess > 0.0 else -np.inf


def _limit_rival_advantage(
    table: EvidenceTable,
    probabilities: dict[Kinds, float],
    paid: Mapping[Kinds, float],
    n: float,
    thresholds: EvidenceThresholds,
) -> None:
    """Limit the advantage over a rival of the same size to the admissible one, in place.

    With x the share of what the exchanged effects explain that the rival leaves, and e the error of either above the
    noise and the law's own error, it is at most `rival_form` · x + `COINCIDENCE` · ln (e / e of the best): if the rival
    were right with another form, the best one would match it that closely only by chance. The evidence of one condition
    counts regardless of the others (`_due_to_one`): runs in which both act alike make x small.
    """
    for size in {len(kinds) for kinds in probabilities} - {0}:
        rivals = [
            kinds
            for kinds in probabilities
            if len(kinds) == size and np.isfinite(table.rows[kinds].mean_square)
        ]
        if len(rivals) < 2:
            continue
        best = max(rivals, key=lambda kinds: probabilities[kinds])
        top = max(table.rows[best].mean_square, LEAST_SQUARE)
        for kinds in rivals:
            shared = tuple(kind for kind in best if kind in kinds)
            mine = max(table.rows[kinds].mean_square, LEAST_SQUARE)
            if mine <= top or shared not in table.rows:
                continue
            explained = table.rows[shared].mean_square - top
            allowed = _allowance(table, kinds, thresholds)
            lost = max(0.5 * n * float(np.log(paid[kinds] / paid[best])), 0.0)
            if explained > 0.0:
                rows = [table.rows[key] for key in (kinds, best, shared)]
                due = max(
                    thresholds.rival_form * (mine - top) / explained,
                    _due_to_one(table.shares, rows, n, allowed, thresholds),
                )
                chance = COINCIDENCE * np.log(
                    _above(table, mine, n, thresholds) / _above(table, top, n, thresholds)
                )
                probabilities[kinds] += max(lost - due - chance, 0.0)


def _due_to_one(
    shares: Sequence[float], rows: Sequence[Row], n: float, allowed: float, thresholds: EvidenceThresholds
) -> float:
    """Return the maximum loss of a rival if only the most informative condition had been measured.

    Args:
        shares: of each condition in all readings.
        rows: the rival, the best one, and the effects common to both.
        n, allowed, thresholds: as for all readings.
    """
    if not shares or not all(row.squares for row in rows):
        return 0.0
    part = np.array(shares)
    mine, top, without = (np.array(row.squares) / part for row in rows)
    more = mine - top
    # where the best one does nothing, the rival's own change is what it could have left
    changed = np.maximum(without - top, more) + thresholds.excited**2
    lost = (
        0.5
        * n
        * part
        * np.log((np.maximum(mine, LEAST_SQUARE) + allowed) / (np.maximum(top, LEAST_SQUARE) + allowed))
    )
    due = np.minimum(lost, thresholds.rival_form * more / changed)
    return float(np.max(due, initial=0.0, where=np.isfinite(due)))


def _above(table: EvidenceTable, square: float, n: float, thresholds: EvidenceThresholds) -> float:
    """Return a mean square above the noise, plus the uncertainty from n readings and a slightly wrong law."""
    floor = table.noise.floor_square if np.isfinite(table.noise.floor_square) else 0.0
    return max(square - floor, 0.0) + floor * float(np.sqrt(2.0 / n)) + thresholds.excited**2


def probabilities(evidence: Mapping[Kinds, float], temperature: float) -> dict[Kinds, float]:
    """Return normalised exp(evidence / temperature), the largest first."""
    top = max(evidence.values())
    weights = {kinds: float(np.exp((value - top) / temperature)) for kinds, value in evidence.items()}
    total = sum(weights.values())
    ordered = sorted(weights.items(), key=lambda item: (-item[1], len(item[0]), item[0]))
    return {kinds: weight / total for kinds, weight in ordered}


def credible_set(probabilities: Mapping[Kinds, float], share: float = 0.9) -> tuple[Kinds, ...]:
    """Return the most probable hypotheses with a total probability of `share`."""
    chosen: list[Kinds] = []
    total = 0.0
    for kinds, probability in probabilities.items():
        chosen.append(kinds)
        total += probability
        if total >= share:
            break
    return tuple(chosen)


def predicts_unseen(table: EvidenceTable, kinds: Kinds) -> bool:
    """Return whether every effect of a set lowers the error on held-out runs without raising it on held-out conditions.

    An effect that only one condition shows cannot be tested on that condition.
    """
    row = table.rows[kinds]
    simpler = [tuple(kind for kind in kinds if kind != left) for left in kinds]
    others = [table.rows[part] for part in simpler if part in table.rows]
    return all(
        row.heldout_square < other.heldout_square
        and _no_worse_unseen(np.array(row.unseen), np.array(other.unseen))
        for other in others
    )


def _no_worse_unseen(mine: Array, theirs: Array) -> bool:
    both = np.isfinite(mine) & np.isfinite(theirs)
    return bool(mine[both].sum() <= UNSEEN_RISE * theirs[both].sum())


def room_above_floor(table: EvidenceTable, kinds: Kinds, thresholds: EvidenceThresholds) -> bool:
    """Return whether a further effect could pay its penalty if it reached the noise floor.

    It may also lower a penalty of the law's error beyond that of the largest admissible one.
    """
    n = max(table.noise.n_effective, 2.0)
    now = table.rows[kinds].mean_square + _allowance(table, kinds, thresholds)
    floor = table.noise.floor_square if np.isfinite(table.noise.floor_square) else 0.0
    reach = max(min(floor + _left_over(table, kinds, thresholds), now), 1e-12)
    gain = 0.5 * n * np.log(max(now, 1e-12) / reach)
    gain += max(table.rows[kinds].law_price - table.largest_law_price, 0.0)
    size = len(kinds)
    price = thresholds.price(size + 1, table.n_candidates) - thresholds.price(size, table.n_candidates)
    return bool(gain > price + 0.5 * np.log(n))


# Maximum penalty of an implausible value.
MOST_PRIOR_PRICE = 15.0


def prior_price(fit: EffectFit) -> float:
    """Return the log-odds penalty of values outside their plausible ranges.

    The plausible range is 90 % of a normal prior in x: the penalty is ½ (z² − 1.645²) where |z| > 1.645.
    """
    price = 0.0
    for parameter, x in zip(fit.candidate.parameters, fit.x, strict=True):
        if parameter.is_form:
            continue  # `form_price` includes its prior
        low, high = parameter.plausible
        if parameter.is_strength:
            low, high = min(low, 0.0), max(high, 0.0)
        z = 2.0 * NINETY * (float(x) - 0.5 * (low + high)) / max(high - low, 1e-300)
        price += min(0.5 * max(z * z - NINETY * NINETY, 0.0), MOST_PRIOR_PRICE)
    return price


def sorted_kinds(kinds: Sequence[str]) -> Kinds:
    """Return kinds in a fixed order, so that a pair has one name."""
    return tuple(sorted(kinds))


def at_limit(fit: EffectFit) -> tuple[str, ...]:
    """Return the parameters of a fit that ended on a bound."""
    ends = zip(fit.candidate.parameters, fit.at_limit, strict=True)
    return tuple(parameter.name for parameter, there in ends if there)


def _left_over(
    table: EvidenceTable, kinds: Kinds, thresholds: EvidenceThresholds, form: float | None = None
) -> float:
    """Return the error above the noise that slight errors of the law and of a hypothesis' equations may leave."""
    explained = table.nothing.before_law_error - table.rows[kinds].before_law_error
    varies = VARIED_SHARE if table.rows[kinds].form_price > 0.0 else 1.0
    tolerance = varies * thresholds.model_form_tolerance if form is None else form
    by_law = table.rows[kinds].explained_by_law
    off = thresholds.law_form_tolerance * (by_law if np.isfinite(by_law) else 0.0)
    return thresholds.excited**2 + off + tolerance * max(explained, 0.0)


def _allowance(table: EvidenceTable, kinds: Kinds, thresholds: EvidenceThresholds) -> float:
    """Return the largest error that hypotheses with fewer effects may leave, which is no merit of a further effect."""
    left = [thresholds.excited**2] if kinds else [0.0]
    for size in range(len(kinds)):
        smaller = [key for key in table.rows if len(key) == size]
        if smaller:
            best = min(smaller, key=lambda key: table.rows[key].mean_square)
            left.append(_left_over(table, best, thresholds))
    return max(left)
