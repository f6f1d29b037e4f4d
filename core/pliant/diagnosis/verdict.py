"""Verdict from the evidence, in one sentence with its reasons."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from pliant.diagnosis.evidence_table import (
    LAW,
    NOTHING,
    UNKNOWN,
    EvidenceTable,
    EvidenceThresholds,
    Kinds,
    credible_set,
    log_evidence,
    predicts_unseen,
    probabilities,
    sorted_kinds,
)
from pliant.diagnosis.noise import LEAST_SQUARE
from pliant.evidence.excess import Excess
from pliant.formatting import plural

# The sentence of each verdict, on measurements and on counts: if the error of the unchanged model is small, and if it
# is clearly above the noise (`Judgement.small`). `reasons` contain more detail.
UNDECIDED = "These data do not decide: {contenders}."
HEADLINES = {
    "missing_effect": ("Missing: {kinds}. The error without it is {left}.", "Missing: {kinds}."),
    "ambiguous": (f"{UNDECIDED} The error is {{left}}.", UNDECIDED),
    "class": (
        "Missing: {kinds}; these data do not determine which. The error without it is {left}.",
        "Missing: {kinds}; these data do not determine which.",
    ),
    "class_with_law": (
        "{either} is off, or {kinds} is missing; these data do not determine which. The error is {left}.",
        "{either} is off, or {kinds} is missing; these data do not determine which.",
    ),
    "law_off": ("No effect is missing; the joint law is off{law}.",) * 2,
    "nothing_missing": (
        "These data show no missing effect.",
        "No listed effect helps, and the error is {ratio} times the noise: these data are too few to say more.",
    ),
    "numbers_off": (
        "No effect is missing; errors of at most {numbers:.2g} % in the model's own numbers explain the error, which "
        "is {ratio} times the noise.",
    )
    * 2,
    "unknown_effect": (
        "What is left is {left}; no listed effect explains it.",
        "Something is missing, and it is not in the list.",
    ),
    "not_repeatable": ("The bench does not repeat well enough for a verdict.",) * 2,
    "insufficient_data": ("These data are not sufficient for a verdict.",) * 2,
}
NOT_PREDICTIVE = (
    "{kinds} fits best, but does not predict {what} left out of the fit better than a simpler model does."
)
MOST_NAMED = 4
# From this ratio to the noise on, the error left by the best explanation is stated first.
MUCH_LEFT = 2.0
# A class with more effects is not informative enough for a user.
MOST_IN_CLASS = 4
# An error that is lowered by less than to this share is not said to be lowered.
LOWERED = 0.9

Verdict = Literal[
    "missing_effect",
    "ambiguous",
    "nothing_missing",
    "law_off",
    "unknown_effect",
    "not_repeatable",
    "insufficient_data",
]


@dataclass(frozen=True)
class Judgement:
    """A verdict with its grounds.

    Attributes:
        verdict: see docs/which_effect.md.
        probability: of every hypothesis, the largest first.
        selected: effects of the verdict; empty unless it is `missing_effect`.
        credible: hypotheses with a total probability of 90 %.
        reasons: sentences.
        selected_class: effects one of which is missing, the most probable first, if the verdict is `ambiguous` only
            about which of them; else empty. With `LAW` among them it may be the law's own shape instead.
        beside: effects that are missing in addition to one of `selected_class`, whichever it is.
        law: size and place of the law's error, in words that follow "off"; empty if it is not examined.
        number_error: largest share by which numbers of the model may be off, if such errors explain the error and
            nothing is missing; else 0.
        as_it_is: error of the unchanged model on left-out runs, over the floor.
        best: that of the most probable listed explanation; of the unchanged model if none was tried.
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
    law: str = field(default="", kw_only=True)
    number_error: float = field(default=0.0, kw_only=True)

    @property
    def contenders(self) -> str:
        """Return the remaining explanations, in words."""
        names = [named(kinds) for kinds in self.credible[:MOST_NAMED]]
        if more := len(self.credible) - len(names):
            names.append(f"{more} more")
        return " or ".join(names)

    @property
    def sentence(self) -> str:
        """Return the verdict in one sentence, with the remaining explanations."""
        first = ""
        if (
            self.verdict in ("missing_effect", "ambiguous")
            and self.best.ratio - 2.0 * self.best.se > MUCH_LEFT
        ):
            which = "this does not explain" if self.verdict == "missing_effect" else "none of these explains"
            first = f"{self.best} times the noise is left: {which} all of the error. "
        known: str = "class" if self.selected_class else self.verdict
        listed_kinds = [kind for kind in self.selected_class if kind != LAW]
        group = " or ".join(listed_kinds)
        if len(listed_kinds) < len(self.selected_class):
            known = "class_with_law"
        if self.number_error:
            known = "numbers_off"
        return first + HEADLINES[known][0 if self.small else 1].format(
            kinds=" and ".join(
                [*self.beside, f"({group})" if self.beside else group] if group else self.selected
            ),
            contenders=self.contenders,
            either="The joint law",
            law=self.law,
            numbers=100.0 * self.number_error,
            left=self.as_it_is.words,
            ratio=self.as_it_is,
        )

    @property
    def small(self) -> bool:
        """Return whether there is little to gain; the standard error counts while "nothing is missing" is credible."""
        if not math.isfinite(self.as_it_is.ratio):  # readings without noise have no ratio to judge by
            return self.verdict == "nothing_missing"
        return self.as_it_is.small if NOTHING in self.credible else self.as_it_is.slight


def named(kinds: Kinds) -> str:
    """Return a hypothesis in words."""
    if kinds == NOTHING:
        return "nothing missing"
    return "an effect outside the list" if kinds == UNKNOWN else " + ".join(kinds)


def judge(table: EvidenceTable, thresholds: EvidenceThresholds, n_excited: int, law: str = "") -> Judgement:
    """Return the judgement of the table.

    Args:
        table: all hypotheses.
        thresholds: thresholds.
        n_excited: effects that these runs could show.
        law: size and place of the law's error without any effect, in words that follow "off".
    """
    evidence = log_evidence(table, thresholds)
    probability = probabilities(evidence, thresholds.temperature)
    first = next(iter(probability))
    verdict, reasons = _verdict(table, thresholds, n_excited, probability, first)
    selected = first if verdict == "missing_effect" else NOTHING
    best = next((kinds for kinds in probability if kinds not in (NOTHING, UNKNOWN)), NOTHING)
    squares = (table.nothing.as_it_is, table.rows[best].heldout_square if best else table.nothing.as_it_is)
    left_out = [table.excess(square) for square in squares]
    credible = credible_set(probability)
    off = _with_law(table, credible)
    group, beside = _common_class(off) if verdict == "ambiguous" and not reasons else ((), ())
    return Judgement(
        verdict,
        probability,
        selected,
        credible,
        reasons,
        *left_out,
        selected_class=group,
        beside=beside,
        law=law,
        number_error=table.number_error
        if verdict == "nothing_missing" and table.numbers_are_off(NOTHING)
        else 0.0,
    )


def _with_law(table: EvidenceTable, credible: Sequence[Kinds]) -> tuple[Kinds, ...]:
    """Return the hypotheses, with `LAW` added to those of one effect less that need an error of the law."""
    most = max(map(len, credible))
    return tuple(
        sorted_kinds((*kinds, LAW))
        if kinds != UNKNOWN and len(kinds) == most - 1 and table.law_is_off(kinds)
        else kinds
        for kinds in credible
    )


def _common_class(credible: Sequence[Kinds]) -> tuple[Kinds, Kinds]:
    """Return effects one of which each credible hypothesis has, and their common ones; empty if they differ in more."""
    if (
        len(set(credible)) < 2
        or {NOTHING, UNKNOWN} & set(credible)
        or len({len(kinds) for kinds in credible}) > 1
    ):
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
        return "insufficient_data", (f"A verdict cannot be based on {plural(table.n_readings, 'reading')}.",)
    if noise.between_run_scatter > thresholds.between_run_scatter:
        return "not_repeatable", (
            f"Runs with the same inputs scatter {noise.between_run_scatter:.1f} times as much as readings within a "
            "run. Find what moves between runs first: it can hide any effect.",
        )
    if noise.drift is not None and noise.drift.size > thresholds.drift:
        way = "more" if noise.drift.share > 0 else "less"
        return "not_repeatable", (
            f"Later runs read {abs(noise.drift.share):.1%} {way} {noise.drift.output} than earlier ones with the same "
            "inputs, and no effect that was tried explains it. Find what changes over the session, or with the "
            "specimen.",
        )
    if noise.n_effective < thresholds.fewest:
        return "insufficient_data", (
            f"The effective sample size of the readings is only {noise.n_effective:.0f}; "
            f"a verdict requires {thresholds.fewest:.0f}.",
        )
    if n_excited < min(2, table.n_candidates):
        return "insufficient_data", (
            "These runs excite almost no effect: under them almost every listed effect would change the readings "
            f"by less than {thresholds.excited:g} of the noise.",
        )
    if probability[first] < thresholds.accepted:
        return "ambiguous", ()
    left = table.excess(table.nothing.as_it_is)
    if first == UNKNOWN:
        size = f"{left} times the noise" if math.isfinite(left.ratio) else "well above the noise"
        return "unknown_effect", (
            "It is significant, but no effect could remove more than that."
            if left.slight
            else _unexplained(table, size),
        )
    if first == NOTHING:
        if table.law_is_off(NOTHING):
            return "law_off", ()
        if not noise.judged:
            return "insufficient_data", (
                "No listed effect helps, but without repeats or a stated sigma it is unknown whether the error "
                "that is left is noise.",
            )
        if table.numbers_are_off(NOTHING):
            return "nothing_missing", ()
        return "nothing_missing", (
            "The error is what the noise allows, and no listed effect lowers it."
            if left.small or not math.isfinite(left.ratio)
            else "No listed effect lowers it. More such runs would decide whether it is one outside the list.",
        )
    if not predicts_unseen(table, first):
        return "ambiguous", (NOT_PREDICTIVE.format(kinds=named(first), what="runs or conditions"),)
    return "missing_effect", _other_form(table, first)


def _unexplained(table: EvidenceTable, size: str) -> str:
    """Return how far the listed effects lower an error that they do not explain."""
    tried = [row for kinds, row in table.rows.items() if kinds and math.isfinite(row.heldout_square)]
    best = min(tried, key=lambda row: row.heldout_square, default=table.nothing)
    if best.heldout_square > LOWERED**2 * table.nothing.as_it_is:
        return f"The error is {size}, and no listed effect, nor a few of them together, brings it down."
    lowered = table.excess(best.heldout_square)
    left = f"to {lowered} times the noise" if math.isfinite(lowered.ratio) else "by a part"
    return (
        f"The error is {size}. Of the listed effects and sets of them, {named(best.kinds)} lowers it most, {left} on "
        "runs left out; none explains all of it."
    )


def _other_form(table: EvidenceTable, kinds: Kinds) -> tuple[str, ...]:
    """Return a sentence if the effect is identified and its functional form leaves more than noise; else empty."""
    top, noise = table.rows[kinds].mean_square, table.noise
    left = table.excess(top)
    if not noise.judged or not math.isfinite(left.ratio) or left.small:
        return ()
    share = (top - noise.floor_square) / max(table.nothing.mean_square - noise.floor_square, LEAST_SQUARE)
    return (
        f"The kind is right, but its form differs from the catalogue's: with {named(kinds)} the error is still "
        f"{left} times the noise, and {share:.1%} of what it explains is left.",
    )
