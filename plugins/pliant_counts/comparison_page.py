"""Counts for terminal, page and JSON: trials of the model against counted ones, and a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pliant.formatting import number, whole_percent
from pliant.report.comparison import ROWS, SCORE_COLUMNS, starred, yes
from pliant.report.document import (
    Column,
    Document,
    Drawn,
    Picture,
    Table,
    as_json,
    brief_table,
    drawn,
    page_table,
    section,
)
from pliant.report.fitted import caveat
from pliant_counts.answers import comparison_answers, counted
from pliant_counts.comparison import ConditionResult, CountComparison
from pliant_counts.records import Counts
from pliant_counts.success_chart import Series, success_chart

CONDITIONS_BRIEF = 40  # rows of the terminal's table
NAMED = 4
OUTPUT = "success"


def _likelihoods(row: tuple[str, CountComparison]) -> str:
    own = number(row[1].log_likelihood_own, 4)
    return f"{number(row[1].log_likelihood, 4)}, against {own} of an uninformative model"


# Values of all conditions together: a sentence below the page's table, and the last row of the terminal's table.
TOTAL_COLUMNS: tuple[Column[tuple[str, CountComparison]], ...] = (
    Column("1.log_likelihood", head="log-likelihood", brief="log-lik.", text=_likelihoods, brief_show=4),
    Column("1.deviance", head="deviance", brief="dev.", show=4),
)
COUNT_COLUMNS = (
    *SCORE_COLUMNS,
    *TOTAL_COLUMNS,
    Column("1.n_samples", "n"),
    Column("1.n_effective"),
)
CONDITION_COLUMNS: tuple[Column[ConditionResult], ...] = (
    Column("condition.words", "condition", "condition", "condition"),
    Column(lambda one: dict(one.condition.changes), "set"),
    Column("measured.0", "successes", "measured", "measured", lambda one: counted(one.measured)),
    Column("measured.1", "trials"),
    Column("interval"),
    Column("simulated.0", "simulated_successes", "model", "model", lambda one: counted(one.simulated)),
    Column("simulated.1", "simulated_trials"),
    Column("log_likelihood", head="log-likelihood", brief="log-lik.", show=3),
    Column("deviance", head="deviance", brief="dev.", show=3),
    Column("log_bayes_factor"),
    Column("share_of_error", head="of the deviance", show=whole_percent),
    Column("p"),
    Column("p_adjusted", head="p (Holm)", show=2),
    Column("z", brief="z", text=lambda one: starred(one.z, one.disagrees)),
    Column("disagrees", head="differs", show=yes),
    Column("p_repeats"),
    Column("p_repeats_adjusted"),
    Column(
        "contradictory",
        brief="sets",
        text=lambda one: (
            f"{' '.join(str(s.successes) for s in one.condition.sets[:6])}{' !' if one.contradictory else ''}"
        ),
    ),
)
REPEAT_COLUMNS: tuple[Column[ConditionResult], ...] = (
    Column("condition.words", head="condition"),
    Column(
        "condition.sets",
        head="sets",
        show=lambda sets: ", ".join(counted((s.successes, s.trials)) for s in sets[:12]),
    ),
    Column("p_repeats", head="p of one probability", show=2),
    Column("p_repeats_adjusted", head="p (Holm)", show=2),
    Column("contradictory", head="contradictory", show=yes),
)


def counts_document(title: str, counts: Counts, comparison: CountComparison) -> Document:
    """Return the document of `pliant compare` on a file of counts."""
    stars = f"* more than chance, corrected for looking at {len(comparison.conditions)} conditions"
    shown = comparison.conditions[:CONDITIONS_BRIEF]
    table = brief_table(CONDITION_COLUMNS, shown, stars if comparison.disagreeing else "")
    whole = {column.brief: column.cell((OUTPUT, comparison), True) for column in TOTAL_COLUMNS}
    last = ["all conditions", *(whole.pop(head, "") for head in table.head[1:])]
    more = (f"{name}: {text}" for name, text in whole.items())
    return Document(
        kind="Pliant: model against counts",
        title=title,
        sentence=interpret_counts(comparison),
        data=counts_json(comparison),
        brief=(Table("", table.head, [*table.rows, last], table.note), *more),
        answers=comparison_answers(comparison),
        warnings=tuple(map(caveat, comparison.remarks)),
        draw=lambda: _drawn(comparison),
        footer=f"Counts: {counts.source or 'given in memory'}",
    )


def counts_json(comparison: CountComparison) -> dict[str, Any]:
    """Return the contract's keys (`outputs.success`, `runs`, `worst`, `n_samples`), and those of counts."""
    return {
        "outputs": {OUTPUT: as_json(COUNT_COLUMNS, (OUTPUT, comparison))},
        "rmse_over_floor": comparison.ratio_to_floor,
        "log_likelihood": comparison.log_likelihood,
        "log_likelihood_own": comparison.log_likelihood_own,
        "deviance": comparison.deviance,
        "interpretation": interpret_counts(comparison),
        "judged": True,
        "runs": [
            {
                "run": one.name,
                "words": result.condition.words,
                "successes": one.successes,
                "trials": one.trials,
                "line": one.line,
            }
            for result in comparison.conditions
            for one in result.condition.sets
        ],
        "conditions": [as_json(CONDITION_COLUMNS, one) for one in comparison.conditions],
        "worst": [
            {
                "condition": one.condition.words,
                "share_of_error": one.share_of_error,
                "z": one.z,
                "output": OUTPUT,
                "significant": one.disagrees,
            }
            for one in sorted(comparison.conditions, key=lambda one: -one.deviance)
            if one.deviance > 0
        ],
        "repeats": {
            "conditions": comparison.n_repeated,
            "overdispersion": comparison.overdispersion,
            "p_overdispersion": comparison.p_overdispersion,
            "contradictory": [one.condition.words for one in comparison.contradictory],
        },
        "n_samples": comparison.n_samples,
        "n_effective": comparison.n_effective,
        "remarks": list(comparison.remarks),
    }


def interpret_counts(comparison: CountComparison) -> str:
    """Return a sentence on the comparison, beginning with contradictions within the counts."""
    sentences = []
    if comparison.contradictory:
        first, *more = comparison.contradictory
        sets = " and ".join(counted((one.successes, one.trials)) for one in first.condition.sets[:NAMED])
        others = f" (and {len(more)} more conditions)" if more else ""
        sentences.append(
            f"The repeats contradict each other: {first.condition.words} gave {sets}{others}, more than chance allows. "
            "Find out what differed between the sets before believing anything about the model."
        )
    if comparison.disagreeing:
        worst, n, of = (
            comparison.disagreeing[0],
            len(comparison.disagreeing),
            f"of {len(comparison.conditions)}",
        )
        which = f"{n} {of} conditions differ" if n > 1 else f"One {of} conditions differs"
        sentences.append(
            f"{which} from the model by more than chance. Most: {worst.condition.words}, measured "
            f"{counted(worst.measured)}, simulated {counted(worst.simulated)} "
            f"({whole_percent(worst.share_of_error)} of the deviance, z {number(worst.z, 2)})."
        )
    else:
        fewest = min(one.simulated[1] for one in comparison.conditions)
        sentences.append(
            f"No condition differs from the model by more than chance; with {fewest} simulated trials each, smaller "
            "differences would not show."
        )
    if comparison.log_likelihood < comparison.log_likelihood_own:
        sentences.append(
            "Over all conditions the model predicts these counts worse than an uninformative one."
        )
    return " ".join(sentences)


def shares_picture(name: str, caption: str, models: Mapping[str, Sequence[ConditionResult]]) -> Picture:
    """Return measured and simulated shares of success of these conditions, with one colour for each model."""
    shown = next(iter(models.values()))
    chart = success_chart(
        [one.condition.words for one in shown],
        Series("measured", [one.measured for one in shown], [True] * len(shown)),
        [Series(n, [c.simulated for c in of], [c.disagrees for c in of]) for n, of in models.items()],
    )
    return Picture(name, caption, chart)


def _drawn(comparison: CountComparison) -> Drawn:
    shown = comparison.conditions
    if len(shown) > ROWS:
        shown = tuple(sorted(shown, key=lambda one: -one.deviance)[:ROWS])
    whole = "" if len(shown) == len(comparison.conditions) else f" The {ROWS} conditions that differ most."
    caption = (
        "Share of successes by condition: measured and simulated, each with the interval that counting alone gives it. "
        f"Filled model: it differs from the measurement by more than chance, all conditions being looked at.{whole}"
    )
    totals = "; ".join(f"{column.head} {column.cell((OUTPUT, comparison))}" for column in TOTAL_COLUMNS)
    note = (
        f"Together: {totals}. The likelihood is beta-binomial, because both sides are finite samples; p is Fisher's "
        "exact test."
    )
    repeated = [one for one in comparison.conditions if len(one.condition.sets) > 1]
    per_freedom = f"χ² per degree of freedom over all repeats: {number(comparison.overdispersion, 2)}"
    sets = (
        f"{per_freedom}; 1 is what counting alone gives."
        if repeated
        else "No condition has more than one set: whether the bench repeats is not known."
    )
    tables = (
        page_table("Condition by condition", CONDITION_COLUMNS, comparison.conditions[:ROWS], note),
        page_table("Do the repeats agree?", REPEAT_COLUMNS, repeated[:ROWS], sets),
    )
    return drawn(shares_picture("runs", caption, {"model": shown}), section("Numbers", *tables))
