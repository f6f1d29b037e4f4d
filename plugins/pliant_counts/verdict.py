"""Verdict on counts: the effect, similar explanations, undetectable effects, and the next condition to count."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN, Kinds, credible_set
from pliant.diagnosis.verdict import NOT_PREDICTIVE, Judgement, Verdict, named
from pliant.evidence.excess import Excess
from pliant_counts.binomial import fisher_p, holm
from pliant_counts.comparison import (
    ConditionResult,
    CountComparison,
)
from pliant_counts.evidence import CountEvidence, Explanation

BELIEVED = 0.9
FEWEST_TRIALS, FEWEST_CONDITIONS = 12, 3
LEVEL = 0.05
ALIKE = 0.2  # unexplained share below which two explanations change the conditions alike
WORTH = 0.01  # disagreement about a probability, squared and weighted, below which no condition is decisive


@dataclass(frozen=True)
class NextCount:
    """The measured condition in which the explanations differ most, in words, and the shares that they predict."""

    condition: str
    expected: Mapping[Kinds, float]


@dataclass(frozen=True)
class CountJudgement(Judgement):
    """A verdict on counts with its grounds, as `Judgement`.

    Attributes:
        not_excited: explanations that change no simulated count beyond chance at any level tried.
        smallest: explanation → the smallest change that these conditions would reveal.
        alike: pairs of explanations that change the conditions alike, and the share of one that the other leaves.
        next_count: what to count next; None if the explanations agree everywhere.
    """

    not_excited: tuple[Kinds, ...]
    smallest: Mapping[Kinds, float]
    alike: tuple[tuple[Kinds, Kinds, float], ...]
    next_count: NextCount | None


def judge_counts(evidence: CountEvidence) -> CountJudgement:
    """Return the judgement of the table of evidences."""
    credible = credible_set(evidence.probability, BELIEVED)
    verdict, reasons = _verdict(evidence)
    selected = next(iter(evidence.probability)) if verdict == "missing_effect" else NOTHING
    best = next((kinds for kinds in evidence.probability if kinds not in (NOTHING, UNKNOWN)), NOTHING)
    smallest = {
        kinds: _smallest(evidence, row) for kinds, row in evidence.rows.items() if len(row.parameters) == 1
    }
    return CountJudgement(
        verdict=verdict,
        probability=evidence.probability,
        selected=selected,
        credible=credible,
        reasons=reasons,
        as_it_is=_excess(evidence.comparison),
        best=_excess(evidence.comparisons[best]),
        not_excited=tuple(kinds for kinds, level in smallest.items() if not np.isfinite(level)),
        smallest={kinds: level for kinds, level in smallest.items() if np.isfinite(level)},
        alike=_alike(evidence, credible),
        next_count=_next(evidence, credible),
    )


def _verdict(evidence: CountEvidence) -> tuple[Verdict, tuple[str, ...]]:
    plain = evidence.comparison
    first = next(iter(evidence.probability))
    if plain.contradictory:
        return "not_repeatable", (
            f"Sets of one condition contradict each other ({_named(plain.contradictory)}): a condition changed that no "
            "column states.",
        )
    if plain.n_samples < FEWEST_TRIALS or len(plain.conditions) < FEWEST_CONDITIONS:
        return "insufficient_data", (
            f"There are {plain.n_samples} trials under {len(plain.conditions)} conditions; a verdict needs at least "
            f"{FEWEST_TRIALS} under {FEWEST_CONDITIONS}.",
        )
    allowed = ("The differences are what counting allows, and nothing listed does better.",)
    if first == NOTHING and not plain.disagreeing:
        return "nothing_missing", allowed
    if evidence.probability[first] < BELIEVED:
        return "ambiguous", ()
    if first == UNKNOWN:
        return "unknown_effect", (
            "No listed explanation predicts these counts better than giving each condition a probability of its own.",
        )
    if left := evidence.comparisons[first].disagreeing:
        what = " + ".join(first) or "the model as it is"
        return "unknown_effect", (
            f"Of what is listed, {what} explains these counts best, and it is wrong beyond chance in {_named(left)}.",
        )
    if first == NOTHING:
        return "nothing_missing", allowed
    if evidence.rows[first].unseen.sum() <= evidence.rows[NOTHING].unseen.sum():
        return "ambiguous", (NOT_PREDICTIVE.format(kinds=named(first), what="conditions"),)
    return "missing_effect", ()


def _excess(compared: CountComparison) -> Excess:
    """Return the error over that expected from chance; exact tests decide whether it is more than chance."""
    return Excess(compared.ratio_to_floor)


def _named(conditions: Sequence[ConditionResult]) -> str:
    return "; ".join(one.condition.words for one in conditions[:4])


def _smallest(evidence: CountEvidence, row: Explanation) -> float:
    """Return the detectable level nearest to the present value, with as many trials as counted; NaN without one."""
    plain = evidence.comparison
    seen = []
    for levels, counts in zip(row.grid, row.simulated, strict=True):
        p = [
            fisher_p((round(one.measured[1] * s / m), one.measured[1]), one.simulated)
            for one, (s, m) in zip(plain.conditions, counts, strict=True)
        ]
        if min(holm(p)) < LEVEL:
            seen.append(levels[0])
    parameter = row.parameters[0]
    present = float(np.mean(parameter.levels)) if parameter.neutral is None else parameter.neutral
    return min(seen, key=lambda level: abs(level - present)) if seen else np.nan


def _alike(evidence: CountEvidence, credible: tuple[Kinds, ...]) -> tuple[tuple[Kinds, Kinds, float], ...]:
    """Return similar pairs among the credible ones; the share is 1 − cos² of their changes in the shares of success."""
    base = evidence.rows[NOTHING].shares
    moves = {k: evidence.rows[k].shares - base for k in credible if k not in (NOTHING, UNKNOWN)}
    pairs = []
    for number, (a, x) in enumerate(moves.items()):
        for b, y in list(moves.items())[number + 1 :]:
            size = float((x @ x) * (y @ y))
            share = 1.0 - float(x @ y) ** 2 / size if size > 0 else 0.0
            if share < ALIKE:
                pairs.append((a, b, share))
    return tuple(pairs)


def _next(evidence: CountEvidence, credible: tuple[Kinds, ...]) -> NextCount | None:
    """Return the condition with the largest variance of predicted shares over the credible explanations, or None."""
    rivals = [kinds for kinds in credible if kinds != UNKNOWN]
    if len(rivals) < 2:
        return None
    weights = np.array([evidence.probability[kinds] for kinds in rivals])
    weights = weights / weights.sum()
    shares = np.array([evidence.rows[kinds].shares for kinds in rivals])
    scatter = weights @ (shares - weights @ shares) ** 2
    worst = int(np.argmax(scatter))
    if scatter[worst] < WORTH:
        return None
    words = evidence.comparison.conditions[worst].condition.words
    return NextCount(words, dict(zip(rivals, shares[:, worst].tolist(), strict=True)))
