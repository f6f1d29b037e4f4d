"""The verdict: what the evidence table allows to say, and no more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pliant.diagnosis.table import (
    NOTHING,
    UNKNOWN,
    EvidenceTable,
    Kinds,
    Prices,
    credible_set,
    log_evidence,
    predicts_unseen,
    probabilities,
)

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
    """

    verdict: Verdict
    probability: dict[Kinds, float]
    selected: Kinds
    credible: tuple[Kinds, ...]
    reasons: tuple[str, ...]


def judge(table: EvidenceTable, prices: Prices, n_excited: int) -> Judgement:
    """Weigh the table.

    Args:
        table: all hypotheses.
        prices: thresholds.
        n_excited: effects that these runs could show.
    """
    evidence = log_evidence(table, prices)
    probability = probabilities(evidence, prices.temper)
    first = next(iter(probability))
    verdict, reasons = _verdict(table, prices, n_excited, probability, first)
    selected = first if verdict == "missing_effect" else NOTHING
    return Judgement(verdict, probability, selected, credible_set(probability), reasons)


def _verdict(
    table: EvidenceTable, prices: Prices, n_excited: int, probability: dict[Kinds, float], first: Kinds
) -> tuple[Verdict, tuple[str, ...]]:
    noise = table.noise
    if table.n_readings < prices.fewest:
        return "insufficient_data", (
            f"There are {table.n_readings} readings; no verdict can rest on so few.",
        )
    if noise.slip > prices.slip:
        return "not_repeatable", (
            f"Runs with the same inputs scatter {noise.slip:.1f} times as much as readings within a run. "
            "Find what moves between runs first: it can hide any effect.",
        )
    if noise.drift is not None and noise.drift.size > prices.drift:
        way = "more" if noise.drift.share > 0 else "less"
        return "not_repeatable", (
            f"Later runs read {abs(noise.drift.share):.1%} {way} {noise.drift.output} than earlier ones with the same "
            "inputs, and no effect that was tried says why. Find what changes over the session, or with the specimen.",
        )
    if noise.n_effective < prices.fewest:
        return "insufficient_data", (
            f"The readings are worth only {noise.n_effective:.0f} independent ones; "
            f"{prices.fewest:.0f} are the least that a verdict can rest on.",
        )
    if n_excited < min(2, table.n_candidates):
        return "insufficient_data", (
            "These runs excite next to nothing: under them almost every listed effect would change the readings "
            f"by less than {prices.excited:g} of the noise.",
        )
    if probability[first] < prices.believed:
        return "ambiguous", ("More than one explanation is left, and these data do not decide between them.",)
    if first == UNKNOWN:
        return "unknown_effect", (
            "The error is well above the noise, and no listed effect, nor a few of them together, brings it down.",
        )
    if first == NOTHING:
        if not noise.judged:
            return "insufficient_data", (
                "No listed effect helps, but without repeats or a stated sigma nobody can say whether the error "
                "that is left is noise.",
            )
        return "nothing_missing", ("The error is what the noise allows, and no listed effect lowers it.",)
    if not predicts_unseen(table, first):
        return "ambiguous", (
            f"{' + '.join(first)} fits best, but does not predict runs or conditions that were left out of the fit "
            "better than a simpler model does.",
        )
    return "missing_effect", ()
