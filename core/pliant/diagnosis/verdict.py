"""The evidence of every hypothesis that was fitted, its probability, and the verdict that this allows.

What the credible explanations have in common when no single one is credible enough.

Effects are exchanged for each other where two credible hypotheses are alike but for them and the runs can hardly tell
them apart. If nearly all probability lies on hypotheses with some member of such a group, an effect of that kind is
missing although nobody knows which: one member may stand for the group in a model that is needed today.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pliant.diagnosis.fitting import EffectFit
from pliant.diagnosis.noise import NoiseView
from pliant.evidence.excess import Excess
from pliant.records.design import Array

Kinds = tuple[str, ...]
NOTHING: Kinds = ()
UNKNOWN: Kinds = ("unknown",)
# Rise of the error on conditions left out that is still rounding and noise.
UNSEEN_RISE = 1.03


@dataclass(frozen=True)
class Row:
    """One hypothesis.

    Attributes:
        kinds: its effects, sorted by name; empty for "nothing is missing".
        n_parameters: fitted strengths and shapes.
        mean_square: S, the mean squared residual in units of the floor's square.
        heldout_square: the same with each run left out of its own fit.
        unseen_square: the same with each condition left out, all its repeats together.
        unseen: sums of squares of each condition left out; nan where a parameter is not known without it.
        at_limit: names of parameters that ended on a bound.
        form_price: log-odds that forms cost which vary; 0 for the plain ones.
    """

    kinds: Kinds
    n_parameters: int
    mean_square: float
    heldout_square: float
    unseen_square: float
    unseen: tuple[float, ...]
    at_limit: tuple[str, ...]
    form_price: float = 0.0


@dataclass(frozen=True)
class EvidenceTable:
    """All rows, and the noise that they are weighed against."""

    rows: Mapping[Kinds, Row]
    noise: NoiseView
    n_readings: int

    @property
    def nothing(self) -> Row:
        """The row of the model as it is."""
        return self.rows[NOTHING]

    @property
    def n_candidates(self) -> int:
        """Effects that were fitted by themselves."""
        return sum(len(kinds) == 1 for kinds in self.rows)

    def over_floor(self, square: float) -> float:
        """Root of a mean square over the noise floor; nan where the floor is not known or the data have no noise."""
        floor = self.noise.floor_square
        return float(np.sqrt(square / floor)) if floor > LEAST_SQUARE else np.nan

    def excess(self, square: float) -> Excess:
        """The same with its standard error."""
        return Excess.of(self.over_floor(square), self.noise.floors, self.noise.n_effective)


@dataclass(frozen=True)
class EvidenceThresholds:
    """What a hypothesis must pay before it is believed; calibrated on simulated nulls with model error.

    Attributes:
        effect: log-odds that each further effect costs, times ln(1 + candidates), beside the ½ ln n_eff of each
            parameter (Schwarz 1978): the longer the list, the likelier one of it fits by chance (Scott & Berger, Ann.
            Statist. 38, 2010).
        unknown: log-odds of "an effect outside the list", which may reach the noise floor with any form.
        model_form_tolerance: share of what a hypothesis explains that may be left over because its equation is an
            idealisation: a further effect must explain more than that.
        unknown_form_tolerance: that share beside an effect outside the list, which could have any form.
        temperature: log-evidence is divided by this: forms and noise models are never quite right.
        believed: probability above which the first hypothesis is the verdict.
        between_run_scatter: between / within scatter from which runs do not repeat.
        drift: change of scale between repeats, in floors (which it swells), from which they do not.
        fewest: n_eff below which no verdict is given.
        rival_form: log-odds that a hypothesis loses at most against a rival of the same size for each share of what the
            exchanged effect explains that it leaves over: more data do not tell whether a small share is another effect
            or a form that is not quite ours.
        excited: change in σ below which an effect cannot be judged: the model's own law may be off by as much, so
            that an effect is paid only for what it explains beyond that.
    """

    effect: float = 2.1
    unknown: float = 30.0
    model_form_tolerance: float = 0.03
    unknown_form_tolerance: float = 0.08
    rival_form: float = 220.0
    temperature: float = 2.0
    believed: float = 0.9
    between_run_scatter: float = 1.5
    drift: float = 0.3
    fewest: float = 12.0
    excited: float = 0.3

    def per_effect(self, n_candidates: int) -> float:
        """What one further effect costs when so many are tried."""
        return self.effect * float(np.log1p(n_candidates))


THRESHOLDS = EvidenceThresholds()
# Mean squares below this, a thousandth of the scales, are those of data without noise.
LEAST_SQUARE = 1e-6
# Share of that tolerance where forms vary: they have taken up the rest.
BENT_SHARE = 0.5
# Half the number of independent ways in which a form may be wrong.
COINCIDENCE = 2.0


def log_evidence(table: EvidenceTable, thresholds: EvidenceThresholds) -> dict[Kinds, float]:
    """ln P(data | hypothesis) + ln prior of each row, up to a constant, and of `UNKNOWN` where it can be judged.

    −½ n_eff ln S* − ½ k ln n_eff − effect · ln(1 + candidates) · effects, S* the mean squared residual plus, for every
    hypothesis but "nothing", what a law that is slightly off may explain by itself, and what the slightly wrong
    equations of the best simpler hypothesis may have left over.
    """
    n, price = max(table.noise.n_effective, 2.0), thresholds.per_effect(table.n_candidates)
    found = {}
    for kinds, row in table.rows.items():
        square = max(row.mean_square, LEAST_SQUARE) + _allowance(table, kinds, thresholds)
        paid = 0.5 * row.n_parameters * np.log(n) + price * len(kinds) + row.form_price
        found[kinds] = -0.5 * n * np.log(square) - paid
    _pay_rivals(table, found, n, thresholds)
    if table.noise.judged:
        best = max(found, key=lambda kinds: found[kinds])
        left = _left_over(table, best, thresholds, thresholds.unknown_form_tolerance)
        square = table.noise.floor_square + left
        found[UNKNOWN] = -0.5 * n * np.log(square) - thresholds.unknown
    return found


def _pay_rivals(
    table: EvidenceTable, found: dict[Kinds, float], n: float, thresholds: EvidenceThresholds
) -> None:
    """No hypothesis gets more against a rival of its size than is due to it, in place.

    With x the share of what the exchanged effects explain that the rival leaves over, and e what either leaves above
    the noise and the law's own error, at most `rival_form` · x + `COINCIDENCE` · ln (e / e of the best): were the rival
    right with a form of its own, the best one would have to meet it by chance as closely as it does.
    """
    for size in {len(kinds) for kinds in found} - {0}:
        rivals = [
            kinds for kinds in found if len(kinds) == size and np.isfinite(table.rows[kinds].mean_square)
        ]
        if len(rivals) < 2:
            continue
        best = max(rivals, key=lambda kinds: found[kinds])
        top = max(table.rows[best].mean_square, LEAST_SQUARE)
        for kinds in rivals:
            shared = tuple(kind for kind in best if kind in kinds)
            mine = max(table.rows[kinds].mean_square, LEAST_SQUARE)
            if mine <= top or shared not in table.rows:
                continue
            explained = table.rows[shared].mean_square - top
            allowed = _allowance(table, kinds, thresholds)
            lost = 0.5 * n * np.log((mine + allowed) / (top + allowed))
            if explained > 0.0:
                chance = COINCIDENCE * np.log(
                    _above(table, mine, n, thresholds) / _above(table, top, n, thresholds)
                )
                found[kinds] += max(lost - thresholds.rival_form * (mine - top) / explained - chance, 0.0)


def _above(table: EvidenceTable, square: float, n: float, thresholds: EvidenceThresholds) -> float:
    """What a mean square is above the noise, with what n readings and a law that is slightly off leave open."""
    floor = table.noise.floor_square if np.isfinite(table.noise.floor_square) else 0.0
    return max(square - floor, 0.0) + floor * float(np.sqrt(2.0 / n)) + thresholds.excited**2


def probabilities(evidence: Mapping[Kinds, float], temperature: float) -> dict[Kinds, float]:
    """Normalised exp(evidence / temperature), the largest first."""
    top = max(evidence.values())
    weights = {kinds: float(np.exp((value - top) / temperature)) for kinds, value in evidence.items()}
    total = sum(weights.values())
    ordered = sorted(weights.items(), key=lambda item: (-item[1], len(item[0]), item[0]))
    return {kinds: weight / total for kinds, weight in ordered}


def credible_set(found: Mapping[Kinds, float], share: float = 0.9) -> tuple[Kinds, ...]:
    """The most probable hypotheses that hold `share` together."""
    chosen: list[Kinds] = []
    total = 0.0
    for kinds, probability in found.items():
        chosen.append(kinds)
        total += probability
        if total >= share:
            break
    return tuple(chosen)


def predicts_unseen(table: EvidenceTable, kinds: Kinds) -> bool:
    """Whether every effect of a set lowers the error on runs that its fit has not seen, and raises it on no
    conditions left out. An effect that one condition alone shows says nothing about that condition.
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
    """Whether a further effect could pay its price if it reached the noise floor."""
    n = max(table.noise.n_effective, 2.0)
    now = table.rows[kinds].mean_square + _allowance(table, kinds, thresholds)
    floor = table.noise.floor_square if np.isfinite(table.noise.floor_square) else 0.0
    reach = max(floor + _left_over(table, kinds, thresholds), 1e-12)
    gain = 0.5 * n * np.log(max(now, 1e-12) / reach)
    return bool(gain > thresholds.per_effect(table.n_candidates) + 0.5 * np.log(n))


def sorted_kinds(kinds: Sequence[str]) -> Kinds:
    """Kinds in one order, so that a pair has one name."""
    return tuple(sorted(kinds))


def at_limit(fit: EffectFit) -> tuple[str, ...]:
    """Parameters of a fit that ended on a bound."""
    ends = zip(fit.candidate.parameters, fit.at_limit, strict=True)
    return tuple(parameter.name for parameter, there in ends if there)


def _left_over(
    table: EvidenceTable, kinds: Kinds, thresholds: EvidenceThresholds, form: float | None = None
) -> float:
    """What a slightly wrong law and the slightly wrong equations of a hypothesis may leave above the noise."""
    explained = table.nothing.mean_square - table.rows[kinds].mean_square
    varies = BENT_SHARE if table.rows[kinds].form_price > 0.0 else 1.0
    tolerance = varies * thresholds.model_form_tolerance if form is None else form
    return thresholds.excited**2 + tolerance * max(explained, 0.0)


def _allowance(table: EvidenceTable, kinds: Kinds, thresholds: EvidenceThresholds) -> float:
    """What the best of all hypotheses with one effect less may leave: no merit of any further effect."""
    if not kinds:
        return 0.0
    smaller = [key for key in table.rows if len(key) == len(kinds) - 1]
    if not smaller:
        return thresholds.excited**2
    return _left_over(table, min(smaller, key=lambda key: table.rows[key].mean_square), thresholds)


# The one sentence of each verdict, on measurements and on counts: where the error of the model as it is is small, and
# where it is clearly above the noise (`Judgement.small`). `reasons` beside it say more where there is more.
HEADLINES = {
    "missing_effect": ("Missing: {kinds}. The error without it is {left}.", "Missing: {kinds}."),
    "ambiguous": (
        "These data do not decide: {contenders}. The error is {left}.",
        "These data do not decide: {contenders}.",
    ),
    "class": (
        "Missing: {kinds}; these data cannot tell which. The error without it is {left}.",
        "Missing: {kinds}; these data cannot tell which.",
    ),
    "nothing_missing": (
        "Nothing is missing that these data could show.",
        "No listed effect helps, and the error is {ratio} times the noise: these data are too few to say more.",
    ),
    "unknown_effect": (
        "What is left is {left}; no listed effect explains it.",
        "Something is missing, and it is not in the list.",
    ),
    "not_repeatable": ("The bench does not repeat well enough to say.",) * 2,
    "insufficient_data": ("These data cannot tell.",) * 2,
}
NOT_PREDICTIVE = (
    "{kinds} fits best, but does not predict {what} left out of the fit better than a simpler model does."
)
MOST_NAMED = 4
# More effects than these are no class that a user can act upon.
MOST_IN_CLASS = 4

Verdict = Literal[
    "missing_effect", "ambiguous", "nothing_missing", "unknown_effect", "not_repeatable", "insufficient_data"
]


@dataclass(frozen=True)
class Judgement:
    """A verdict with what it rests on.

    Attributes:
        verdict: see docs/which_effect.md.
        probability: of every hypothesis, the largest first.
        selected: effects of the verdict; empty unless it is `missing_effect`.
        credible: hypotheses that hold 90 %.
        reasons: sentences.
        selected_class: effects one of which is missing, the most probable first, where the verdict is `ambiguous` only
            about which of them; else empty.
        beside: effects that are missing beside one of `selected_class`, whichever it is.
        as_it_is: error of the model as it is on runs left out, over the floor.
        best: that of the most probable listed explanation; of the model as it is where none was tried.
    """

    verdict: Verdict
    probability: Mapping[Kinds, float]
    selected: Kinds
    credible: tuple[Kinds, ...]
    reasons: tuple[str, ...]
    as_it_is: Excess
    best: Excess
    selected_class: Kinds = field(default=(), kw_only=True)
    beside: Kinds = field(default=(), kw_only=True)

    @property
    def contenders(self) -> str:
        """The explanations that are left, in words."""
        names = [named(kinds) for kinds in self.credible[:MOST_NAMED]]
        if more := len(self.credible) - len(names):
            names.append(f"{more} more")
        return " or ".join(names)

    @property
    def sentence(self) -> str:
        """The verdict in one sentence, with the explanations that are left."""
        known = "class" if self.selected_class else self.verdict
        group = " or ".join(self.selected_class)
        return HEADLINES[known][0 if self.small else 1].format(
            kinds=" and ".join(
                [*self.beside, f"({group})" if self.beside else group] if group else self.selected
            ),
            contenders=self.contenders,
            left=self.as_it_is.words,
            ratio=self.as_it_is,
        )

    @property
    def small(self) -> bool:
        """Little is left to gain; the standard error counts while "nothing is missing" is credible."""
        if not math.isfinite(self.as_it_is.ratio):  # readings without noise: there is no ratio to judge by
            return self.verdict == "nothing_missing"
        return self.as_it_is.small if NOTHING in self.credible else self.as_it_is.slight


def named(kinds: Kinds) -> str:
    """A hypothesis in words."""
    if kinds == NOTHING:
        return "nothing missing"
    return "an effect outside the list" if kinds == UNKNOWN else " + ".join(kinds)


def judge(table: EvidenceTable, thresholds: EvidenceThresholds, n_excited: int) -> Judgement:
    """Weigh the table.

    Args:
        table: all hypotheses.
        thresholds: thresholds.
        n_excited: effects that these runs could show.
    """
    evidence = log_evidence(table, thresholds)
    probability = probabilities(evidence, thresholds.temperature)
    first = next(iter(probability))
    verdict, reasons = _verdict(table, thresholds, n_excited, probability, first)
    selected = first if verdict == "missing_effect" else NOTHING
    best = next((kinds for kinds in probability if kinds not in (NOTHING, UNKNOWN)), NOTHING)
    left_out = [table.excess(table.rows[kinds].heldout_square) for kinds in (NOTHING, best)]
    credible = credible_set(probability)
    group, beside = _class_of(credible) if verdict == "ambiguous" and not reasons else ((), ())
    return Judgement(
        verdict, probability, selected, credible, reasons, *left_out, selected_class=group, beside=beside
    )


def _class_of(credible: Sequence[Kinds]) -> tuple[Kinds, Kinds]:
    """Effects one of which each credible hypothesis has, and what all of them have beside it; empty where they part."""
    if len(credible) < 2 or {NOTHING, UNKNOWN} & set(credible) or len({len(kinds) for kinds in credible}) > 1:
        return (), ()
    shared = tuple(kind for kind in credible[0] if all(kind in kinds for kinds in credible))
    exchanged = [tuple(kind for kind in kinds if kind not in shared) for kinds in credible]
    if any(len(kinds) != 1 for kinds in exchanged) or len(exchanged) > MOST_IN_CLASS:
        return (), ()
    return tuple(kinds[0] for kinds in exchanged), shared


def _verdict(
    table: EvidenceTable,
    thresholds: EvidenceThresholds,
    n_excited: int,
    probability: dict[Kinds, float],
    first: Kinds,
) -> tuple[Verdict, tuple[str, ...]]:
    noise = table.noise
    if table.n_readings < thresholds.fewest:
        return "insufficient_data", (
            f"There are {table.n_readings} readings; no verdict can rest on so few.",
        )
    if noise.between_run_scatter > thresholds.between_run_scatter:
        return "not_repeatable", (
            f"Runs with the same inputs scatter {noise.between_run_scatter:.1f} times as much as readings within a "
            "run. Find what moves between runs first: it can hide any effect.",
        )
    if noise.drift is not None and noise.drift.size > thresholds.drift:
        way = "more" if noise.drift.share > 0 else "less"
        return "not_repeatable", (
            f"Later runs read {abs(noise.drift.share):.1%} {way} {noise.drift.output} than earlier ones with the same "
            "inputs, and no effect that was tried says why. Find what changes over the session, or with the specimen.",
        )
    if noise.n_effective < thresholds.fewest:
        return "insufficient_data", (
            f"The readings are worth only {noise.n_effective:.0f} independent ones; "
            f"{thresholds.fewest:.0f} are the least that a verdict can rest on.",
        )
    if n_excited < min(2, table.n_candidates):
        return "insufficient_data", (
            "These runs excite next to nothing: under them almost every listed effect would change the readings "
            f"by less than {thresholds.excited:g} of the noise.",
        )
    if probability[first] < thresholds.believed:
        return "ambiguous", ()
    left = table.excess(table.nothing.heldout_square)
    if first == UNKNOWN:
        size = f"{left} times the noise" if math.isfinite(left.ratio) else "well above the noise"
        return "unknown_effect", (
            "It is more than chance, but no effect could take more than that away."
            if left.slight
            else f"The error is {size}, and no listed effect, nor a few of them together, brings it down.",
        )
    if first == NOTHING:
        if not noise.judged:
            return "insufficient_data", (
                "No listed effect helps, but without repeats or a stated sigma nobody can say whether the error "
                "that is left is noise.",
            )
        return "nothing_missing", (
            "The error is what the noise allows, and no listed effect lowers it."
            if left.small or not math.isfinite(left.ratio)
            else "No listed effect lowers it. More such runs would tell whether it is one outside the list.",
        )
    if not predicts_unseen(table, first):
        return "ambiguous", (NOT_PREDICTIVE.format(kinds=named(first), what="runs or conditions"),)
    return "missing_effect", _other_form(table, first)


def _other_form(table: EvidenceTable, kinds: Kinds) -> tuple[str, ...]:
    """That the kind is right and its form is not exactly ours, where more is left than noise."""
    top, noise = table.rows[kinds].mean_square, table.noise
    left = table.excess(top)
    if not noise.judged or not math.isfinite(left.ratio) or left.small:
        return ()
    share = (top - noise.floor_square) / max(table.nothing.mean_square - noise.floor_square, LEAST_SQUARE)
    return (
        f"The kind is right, its form is not exactly ours: with {named(kinds)} the error is still {left} times the "
        f"noise, and {share:.1%} of what it explains is left.",
    )


@dataclass(frozen=True)
class SharedEffect:
    """A group of effects of which one is missing.

    Attributes:
        chosen: the member to take.
        stands_for: all members, the most probable first; one where the hypotheses agree on an effect.
        probability: of all hypotheses with a member.
    """

    chosen: str
    stands_for: Kinds
    probability: float


def shared_effects(
    probability: Mapping[Kinds, float],
    alike: Collection[frozenset[str]],
    at_bound: Mapping[Kinds, frozenset[str]],
    thresholds: EvidenceThresholds,
) -> SharedEffect | None:
    """The group that is most probable; None where no group is believed, or one hypothesis is credible alone.

    Args:
        probability: of every hypothesis, the largest first.
        alike: pairs of kinds that these runs can hardly tell apart.
        at_bound: for hypotheses, the effects of which a shape ended on a bound. Such a member is chosen only where all
            others are, too.
        thresholds: `believed` is the least probability of a group; "nothing" and "outside the list" must hold less than
            the rest together.
    """
    doubt = probability.get(NOTHING, 0.0) + probability.get(UNKNOWN, 0.0)
    credible = [kinds for kinds in credible_set(probability) if kinds not in (NOTHING, UNKNOWN)]
    if len(credible) < 2 or doubt >= 1.0 - thresholds.believed:
        return None
    known = {kinds: p for kinds, p in probability.items() if kinds not in (NOTHING, UNKNOWN)}
    best: SharedEffect | None = None
    for group in _groups(credible, alike):
        total = sum(p for kinds, p in known.items() if not group.isdisjoint(kinds))
        if total < thresholds.believed or (best is not None and total <= best.probability):
            continue
        held = {kind: {kinds: p for kinds, p in known.items() if kind in kinds} for kind in group}
        members = sorted(group, key=lambda kind: (-sum(held[kind].values()), kind))
        leading = {kind: max(held[kind], key=held[kind].__getitem__) for kind in group}
        free = [kind for kind in members if kind not in at_bound.get(leading[kind], frozenset())]
        best = SharedEffect((free or members)[0], tuple(members), total)
    return best


def shapes_at_bound(fits: Mapping[Kinds, EffectFit]) -> dict[Kinds, frozenset[str]]:
    """For each fitted hypothesis the effects of which a parameter other than the strength ended on a bound."""
    found = {}
    for kinds, fit in fits.items():
        ends = zip(fit.candidate.parameters, fit.at_limit, strict=True)
        found[kinds] = frozenset(one.kind for one, there in ends if there and not one.is_strength)
    return found


def _groups(credible: Collection[Kinds], alike: Collection[frozenset[str]]) -> list[frozenset[str]]:
    """Kinds joined by exchanges, directly or over others; each kind of a credible hypothesis is in one."""
    groups = [frozenset((kind,)) for kind in sorted({kind for kinds in credible for kind in kinds})]
    for pair in {frozenset(a) ^ frozenset(b) for a in credible for b in credible if len(a) == len(b)}:
        if len(pair) == 2 and pair in alike:
            joined = [group for group in groups if group & pair]
            groups = [group for group in groups if not group & pair] + [frozenset().union(*joined)]
    return groups
