"""The first lines of a page about counts: quality of the model, missing effect, certainty, next step."""

from __future__ import annotations

from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN, Kinds
from pliant.diagnosis.verdict import named
from pliant.formatting import listed, plural
from pliant.report.answers import Answers, contenders_sentence
from pliant.report.document import answers
from pliant.report.fitted import probability_text
from pliant_counts.binomial import Count
from pliant_counts.comparison import CountComparison
from pliant_counts.evidence import CountEvidence
from pliant_counts.verdict import CountJudgement

MOST_NAMED = 3
REPEATS = "Find out what differed between these sets, and count them again."


def counted(count: Count) -> str:
    """Return successes of trials as text, ``29/30``."""
    return f"{count[0]}/{count[1]}"


def good(comparison: CountComparison) -> str:
    """Return the error of the shares of success, and the number of conditions in which it exceeds chance."""
    return (
        f"Shares of success are off by {100 * comparison.rmse:.0f} percentage points (rms), chance alone gives "
        f"{100 * comparison.noise_floor:.0f}; {len(comparison.disagreeing) or 'none'} of "
        f"{plural(len(comparison.conditions), 'condition')} differ{'s' if len(comparison.disagreeing) == 1 else ''} "
        "by more than chance"
    )


def comparison_answers(comparison: CountComparison) -> Answers:
    """Return the answers for a model against counts."""
    wrong = comparison.disagreeing
    missing = "Nothing that these counts show"
    if wrong:
        more_often = [one.error > 0 for one in wrong]
        how = (
            "more often"
            if all(more_often)
            else "less often"
            if not any(more_often)
            else "now more, now less often"
        )
        side = f"The bench succeeds {how}"
        named_ones = [
            f"{one.condition.words} ({counted(one.measured)}, model {counted(one.simulated)})"
            for one in wrong[:MOST_NAMED]
        ]
        more = [f"{len(wrong) - MOST_NAMED} more"] if len(wrong) > MOST_NAMED else []
        missing = f"{side}: {listed([*named_ones, *more])}"
    trials = {one.simulated[1] for one in comparison.conditions}
    each = f"{min(trials)}" if len(trials) == 1 else f"{min(trials)} to {max(trials)}"
    sure = (
        f"{comparison.n_samples} trials counted, {each} simulated for each condition; exact tests, corrected for all "
        f"conditions; {_repeats(comparison)}"
    )
    if comparison.contradictory:
        after = REPEATS
    elif wrong:
        after = (
            "Identify the parameter that would explain it: pliant diagnose (it simulates every level of every "
            "parameter)."
        )
    else:
        after = "No unexplained error; more trials, simulated and counted, would show smaller differences."
    return answers(good(comparison), missing, sure, after)


def _repeats(comparison: CountComparison) -> str:
    if comparison.contradictory:
        return f"the sets of {plural(len(comparison.contradictory), 'condition')} contradict each other"
    if not comparison.n_repeated:
        return "no condition was counted twice"
    return "sets of one condition agree"


def diagnosis_answers(evidence: CountEvidence, judged: CountJudgement, levels: dict[Kinds, str]) -> Answers:
    """Return the answers for a diagnosis of counts.

    Args:
        found, judged: its results.
        levels: the best level of each explanation, in words.
    """
    best = next((kinds for kinds in judged.probability if kinds not in (NOTHING, UNKNOWN)), NOTHING)
    first = good(evidence.comparison)
    if best != NOTHING and judged.verdict in ("missing_effect", "ambiguous", "unknown_effect"):
        first += f"; {len(evidence.comparisons[best].disagreeing) or 'none'} with {levels[best]}"
    missing = {
        "missing_effect": f"Most likely {levels.get(judged.selected, '')}",
        "ambiguous": contenders_sentence(judged),
        "nothing_missing": "Nothing that these counts show",
        "unknown_effect": "An effect that is not in the list",
        "not_repeatable": "Not examined: sets of one condition contradict each other",
        "insufficient_data": "Not determined by so few trials",
    }[judged.verdict]
    return answers(first, missing, _sure(evidence, judged), _after(judged))


def _sure(evidence: CountEvidence, judged: CountJudgement) -> str:
    trials = f"{evidence.comparison.n_samples} trials under {plural(len(evidence.comparison.conditions), 'condition')}"
    if judged.verdict in ("not_repeatable", "insufficient_data"):
        return f"No verdict; {trials}"
    shown = judged.credible[:MOST_NAMED]
    texts = [f"{named(kinds)} {probability_text(judged.probability[kinds])}" for kinds in shown]
    more = [f"{len(judged.credible) - len(shown)} more"] if len(judged.credible) > len(shown) else []
    return f"Probability: {listed([*texts, *more])}; {len(evidence.rows)} explanations tried; {trials}"


def _after(judged: CountJudgement) -> str:
    if judged.verdict == "not_repeatable":
        return REPEATS
    if judged.next_count is not None:
        return f"Count more trials of {judged.next_count.condition}: there the explanations differ most."
    return {
        "missing_effect": "Measure that number on the bench; if it is so, write it into the study.",
        "nothing_missing": "Leave the model as it is for these conditions.",
        "unknown_effect": "Name other numbers that may be wrong under 'measurements.plausible', and diagnose again.",
    }.get(judged.verdict, "Count more trials, of conditions in which some succeed and some do not.")
