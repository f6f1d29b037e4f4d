"""A comparison of counts as a document: the model's trials against counted trials, for terminal, page and JSON."""

from __future__ import annotations

from typing import Any

from pliant.evidence.binomial import Count
from pliant.evidence.counts import ConditionResult, CountComparison
from pliant.formatting import number, whole_percent
from pliant.records.counts import Counts
from pliant.report.document import (
    Column,
    Document,
    Drawn,
    Picture,
    Section,
    Table,
    Warned,
    as_json,
    brief_table,
    page_table,
)

OUTPUT = "success"
ROWS = 60  # of a page's table or picture
ROWS_BRIEF = 40  # of the terminal's
NAMED = 4

OUTPUT_COLUMNS: tuple[Column[CountComparison], ...] = (
    Column(lambda c: c.rmse, "rmse"),
    Column(lambda _: "1", "unit"),
    Column(lambda c: c.noise_floor, "noise_floor"),
    Column(lambda _: "binomial", "floor_source"),
    Column(lambda c: c.ratio_to_floor, "ratio_to_floor"),
    Column(lambda c: c.bias, "bias"),
    Column(lambda c: c.log_likelihood, "log_likelihood"),
    Column(lambda c: c.deviance, "deviance"),
    Column(lambda c: c.n_samples, "n"),
    Column(lambda c: c.n_effective, "n_effective"),
)
CONDITION_COLUMNS: tuple[Column[ConditionResult], ...] = (
    Column(lambda one: one.condition.words, "condition", "condition", "condition"),
    Column(lambda one: dict(one.condition.changes), "set"),
    Column(
        lambda one: one.measured[0], "successes", "measured", "measured", lambda one: counted(one.measured)
    ),
    Column(lambda one: one.measured[1], "trials"),
    Column(lambda one: list(one.interval), "interval"),
    Column(
        lambda one: one.simulated[0],
        "simulated_successes",
        "model",
        "model",
        lambda one: counted(one.simulated),
    ),
    Column(lambda one: one.simulated[1], "simulated_trials"),
    Column(
        lambda one: one.log_likelihood,
        "log_likelihood",
        "log-likelihood",
        "log-lik.",
        lambda one: number(one.log_likelihood, 3),
    ),
    Column(lambda one: one.deviance, "deviance", "deviance", "dev.", lambda one: number(one.deviance, 3)),
    Column(lambda one: one.log_bayes_factor, "log_bayes_factor"),
    Column(
        lambda one: one.share_of_error,
        "share_of_error",
        "of the deviance",
        text=lambda one: whole_percent(one.share_of_error),
    ),
    Column(lambda one: one.p, "p"),
    Column(lambda one: one.p_adjusted, "p_adjusted", "p (Holm)", text=lambda one: number(one.p_adjusted, 2)),
    Column(
        lambda one: one.z,
        "z",
        brief="z",
        text=lambda one: f"{number(one.z, 2)}{'*' if one.disagrees else ' '}",
    ),
    Column(
        lambda one: one.disagrees, "disagrees", "differs", text=lambda one: "yes" if one.disagrees else "no"
    ),
    Column(lambda one: one.p_repeats, "p_repeats"),
    Column(lambda one: one.p_repeats_adjusted, "p_repeats_adjusted"),
    Column(
        lambda one: one.contradictory,
        "contradictory",
        brief="sets",
        text=lambda one: (
            f"{' '.join(str(s.successes) for s in one.condition.sets[:6])}{' !' if one.contradictory else ''}"
        ),
    ),
)
REPEAT_COLUMNS: tuple[Column[ConditionResult], ...] = (
    Column(lambda one: one.condition.words, head="condition"),
    Column(
        lambda one: one.condition.sets,
        head="sets",
        text=lambda one: ", ".join(counted((s.successes, s.trials)) for s in one.condition.sets[:12]),
    ),
    Column(lambda one: one.p_repeats, head="p of one probability", text=lambda one: number(one.p_repeats, 2)),
    Column(
        lambda one: one.p_repeats_adjusted,
        head="p (Holm)",
        text=lambda one: number(one.p_repeats_adjusted, 2),
    ),
    Column(
        lambda one: one.contradictory,
        head="contradictory",
        text=lambda one: "yes" if one.contradictory else "no",
    ),
)


def counts_document(title: str, counts: Counts, found: CountComparison) -> Document:
    """The document of `pliant compare` on a file of counts."""
    return Document(
        kind="Pliant: model against counts",
        title=title,
        sentence=interpret_counts(found),
        data=counts_json(found),
        brief=_brief(found),
        warnings=tuple(Warned(remark) for remark in found.remarks),
        draw=lambda: _drawn(found),
        footer=f"Counts: {counts.source or 'given in memory'}",
    )


def counts_json(found: CountComparison) -> dict[str, Any]:
    """The contract's keys (`outputs.success`, `runs`, `worst`, `n_samples`), and what belongs to counts."""
    return {
        "outputs": {OUTPUT: as_json(OUTPUT_COLUMNS, found)},
        "rmse_over_floor": found.ratio_to_floor,
        "log_likelihood": found.log_likelihood,
        "log_likelihood_own": found.log_likelihood_own,
        "deviance": found.deviance,
        "interpretation": interpret_counts(found),
        "judged": True,
        "runs": [
            {
                "run": one.name,
                "words": result.condition.words,
                "successes": one.successes,
                "trials": one.trials,
                "line": one.line,
            }
            for result in found.conditions
            for one in result.condition.sets
        ],
        "conditions": [as_json(CONDITION_COLUMNS, one) for one in found.conditions],
        "worst": [
            {
                "condition": one.condition.words,
                "share_of_error": one.share_of_error,
                "z": one.z,
                "output": OUTPUT,
                "significant": one.disagrees,
            }
            for one in sorted(found.conditions, key=lambda one: -one.deviance)
            if one.deviance > 0
        ],
        "repeats": {
            "conditions": found.n_repeated,
            "overdispersion": found.overdispersion,
            "p_overdispersion": found.p_overdispersion,
            "contradictory": [one.condition.words for one in found.contradictory],
        },
        "n_samples": found.n_samples,
        "n_effective": found.n_effective,
        "remarks": list(found.remarks),
    }


def interpret_counts(found: CountComparison) -> str:
    """What the comparison says, the bench's own contradictions first."""
    sentences = []
    if found.contradictory:
        sentences.append(_contradiction(found))
    if found.disagreeing:
        sentences.append(_disagreement(found))
    else:
        sentences.append(
            "No condition differs from the model by more than chance; with "
            f"{min(one.simulated[1] for one in found.conditions)} simulated trials each, smaller differences would "
            "not show."
        )
    if found.log_likelihood < found.log_likelihood_own:
        sentences.append(
            "Over all conditions the model predicts these counts worse than one that says nothing about any of them."
        )
    return " ".join(sentences)


def counted(count: Count) -> str:
    """``29/30``."""
    return f"{count[0]}/{count[1]}"


def _contradiction(found: CountComparison) -> str:
    first = found.contradictory[0]
    sets = " and ".join(counted((one.successes, one.trials)) for one in first.condition.sets[:NAMED])
    more = len(found.contradictory) - 1
    others = f" (and {more} more conditions)" if more else ""
    return (
        f"The repeats contradict each other: {first.condition.words} gave {sets}{others}, more than chance allows. "
        "Find out what differed between the sets before believing anything about the model."
    )


def _disagreement(found: CountComparison) -> str:
    worst = found.disagreeing[0]
    n, of = len(found.disagreeing), f"of {len(found.conditions)}"
    which = f"{n} {of} conditions differ" if n > 1 else f"One {of} conditions differs"
    return (
        f"{which} from the model by more than chance. Most: {worst.condition.words}, measured "
        f"{counted(worst.measured)}, simulated {counted(worst.simulated)} "
        f"({whole_percent(worst.share_of_error)} of the deviance, z {number(worst.z, 2)})."
    )


def _brief(found: CountComparison) -> tuple[Table | str, ...]:
    stars = f"* more than chance, corrected for looking at {len(found.conditions)} conditions"
    table = brief_table(CONDITION_COLUMNS, found.conditions[:ROWS_BRIEF], stars if found.disagreeing else "")
    whole = {"log-lik.": number(found.log_likelihood, 4), "dev.": number(found.deviance, 4)}
    last = ["all conditions", *(whole.get(head, "") for head in table.head[1:])]
    return (Table("", table.head, [*table.rows, last], table.note),)


def _drawn(found: CountComparison) -> Drawn:
    from pliant.report.figures.success_shares import Series, success_shares

    shown = found.conditions
    if len(shown) > ROWS:
        shown = tuple(sorted(shown, key=lambda one: -one.deviance)[:ROWS])
    whole = "" if len(shown) == len(found.conditions) else f" The {ROWS} conditions that differ most."
    png = success_shares(
        [one.condition.words for one in shown],
        Series("measured", [one.measured for one in shown], [True] * len(shown)),
        [Series("model", [one.simulated for one in shown], [one.disagrees for one in shown])],
    )
    caption = (
        "Share of successes by condition: measured and simulated, each with the interval that counting alone gives it. "
        f"Filled model: it differs from the measurement by more than chance, all conditions being looked at.{whole}"
    )
    return Drawn(Picture("runs", caption, png), (Section("Numbers", (), (_conditions(found), _sets(found))),))


def _conditions(found: CountComparison) -> Table:
    note = (
        f"Together: log-likelihood {number(found.log_likelihood, 4)}, against "
        f"{number(found.log_likelihood_own, 4)} of a model that says nothing about any condition; deviance "
        f"{number(found.deviance, 4)}. The likelihood is beta-binomial, because "
        "both sides are finite samples; p is Fisher's exact test."
    )
    return page_table("Condition by condition", CONDITION_COLUMNS, found.conditions[:ROWS], note)


def _sets(found: CountComparison) -> Table:
    repeated = [one for one in found.conditions if len(one.condition.sets) > 1]
    note = (
        f"χ² per degree of freedom over all repeats: {number(found.overdispersion, 2)}; 1 is what counting alone gives."
        if repeated
        else "No condition has more than one set: whether the bench repeats is not known."
    )
    return page_table("Do the repeats agree?", REPEAT_COLUMNS, repeated[:ROWS], note)
