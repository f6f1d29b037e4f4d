"""What counts say, for terminal, page and JSON: trials of the model against counted ones, and a diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from pliant.diagnosis.counts_diagnosis import CountEvidence, CountJudgement, Explanation
from pliant.diagnosis.verdict import NOTHING, UNKNOWN, Kinds, named
from pliant.evidence.binomial import Count
from pliant.evidence.counts import ConditionResult, CountComparison
from pliant.formatting import number, whole_percent
from pliant.records.counts import Counts
from pliant.registry.discovery import Registry
from pliant.report.comparison import ROWS, SCORE_COLUMNS, starred, yes
from pliant.report.document import (
    Column,
    Document,
    Drawn,
    Picture,
    Table,
    Warned,
    as_json,
    brief_table,
    drawn,
    page_table,
    section,
)
from pliant.report.fitted import probability_text, verdict_json

CONDITIONS_BRIEF, HYPOTHESES_BRIEF = 40, 12  # rows of the terminal's tables
NAMED = 4
OUTPUT = "success"
NEARER = "trials nearer to the threshold: other pressures or loads, until some succeed and some do not"


def counted(count: Count) -> str:
    """Successes of trials as text, ``29/30``."""
    return f"{count[0]}/{count[1]}"


# Of all conditions together; on the terminal below those of each, under the same heading.
TOTAL_COLUMNS: tuple[Column[tuple[str, CountComparison]], ...] = (
    Column("1.log_likelihood", brief="log-lik.", show=4),
    Column("1.deviance", brief="dev.", show=4),
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


def counts_document(title: str, counts: Counts, found: CountComparison) -> Document:
    """The document of `pliant compare` on a file of counts."""
    stars = f"* more than chance, corrected for looking at {len(found.conditions)} conditions"
    shown = found.conditions[:CONDITIONS_BRIEF]
    table = brief_table(CONDITION_COLUMNS, shown, stars if found.disagreeing else "")
    whole = {column.brief: column.cell((OUTPUT, found), True) for column in TOTAL_COLUMNS}
    last = ["all conditions", *(whole.get(head, "") for head in table.head[1:])]
    return Document(
        kind="Pliant: model against counts",
        title=title,
        sentence=interpret_counts(found),
        data=counts_json(found),
        brief=(Table("", table.head, [*table.rows, last], table.note),),
        warnings=tuple(map(Warned, found.remarks)),
        draw=lambda: _drawn_counts(found),
        footer=f"Counts: {counts.source or 'given in memory'}",
    )


def counts_json(found: CountComparison) -> dict[str, Any]:
    """The contract's keys (`outputs.success`, `runs`, `worst`, `n_samples`), and what belongs to counts."""
    return {
        "outputs": {OUTPUT: as_json(COUNT_COLUMNS, (OUTPUT, found))},
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
        first, *more = found.contradictory
        sets = " and ".join(counted((one.successes, one.trials)) for one in first.condition.sets[:NAMED])
        others = f" (and {len(more)} more conditions)" if more else ""
        sentences.append(
            f"The repeats contradict each other: {first.condition.words} gave {sets}{others}, more than chance allows. "
            "Find out what differed between the sets before believing anything about the model."
        )
    if found.disagreeing:
        worst, n, of = found.disagreeing[0], len(found.disagreeing), f"of {len(found.conditions)}"
        which = f"{n} {of} conditions differ" if n > 1 else f"One {of} conditions differs"
        sentences.append(
            f"{which} from the model by more than chance. Most: {worst.condition.words}, measured "
            f"{counted(worst.measured)}, simulated {counted(worst.simulated)} "
            f"({whole_percent(worst.share_of_error)} of the deviance, z {number(worst.z, 2)})."
        )
    else:
        fewest = min(one.simulated[1] for one in found.conditions)
        sentences.append(
            f"No condition differs from the model by more than chance; with {fewest} simulated trials each, smaller "
            "differences would not show."
        )
    if found.log_likelihood < found.log_likelihood_own:
        sentences.append(
            "Over all conditions the model predicts these counts worse than one that says nothing about any of them."
        )
    return " ".join(sentences)


def shares_picture(name: str, caption: str, models: Mapping[str, Sequence[ConditionResult]]) -> Picture:
    """Measured and simulated shares of success of these conditions, each of the models in its colour."""
    from pliant.report.figures.success_shares import Series, success_shares

    shown = next(iter(models.values()))
    png = success_shares(
        [one.condition.words for one in shown],
        Series("measured", [one.measured for one in shown], [True] * len(shown)),
        [Series(n, [c.simulated for c in of], [c.disagrees for c in of]) for n, of in models.items()],
    )
    return Picture(name, caption, png)


def _drawn_counts(found: CountComparison) -> Drawn:
    shown = found.conditions
    if len(shown) > ROWS:
        shown = tuple(sorted(shown, key=lambda one: -one.deviance)[:ROWS])
    whole = "" if len(shown) == len(found.conditions) else f" The {ROWS} conditions that differ most."
    caption = (
        "Share of successes by condition: measured and simulated, each with the interval that counting alone gives it. "
        f"Filled model: it differs from the measurement by more than chance, all conditions being looked at.{whole}"
    )
    note = (
        f"Together: log-likelihood {number(found.log_likelihood, 4)}, against "
        f"{number(found.log_likelihood_own, 4)} of a model that says nothing about any condition; deviance "
        f"{number(found.deviance, 4)}. The likelihood is beta-binomial, because "
        "both sides are finite samples; p is Fisher's exact test."
    )
    repeated = [one for one in found.conditions if len(one.condition.sets) > 1]
    per_freedom = f"χ² per degree of freedom over all repeats: {number(found.overdispersion, 2)}"
    sets = (
        f"{per_freedom}; 1 is what counting alone gives."
        if repeated
        else "No condition has more than one set: whether the bench repeats is not known."
    )
    tables = (
        page_table("Condition by condition", CONDITION_COLUMNS, found.conditions[:ROWS], note),
        page_table("Do the repeats agree?", REPEAT_COLUMNS, repeated[:ROWS], sets),
    )
    return drawn(shares_picture("runs", caption, {"model": shown}), section("Numbers", *tables))


def counts_diagnosis_document(
    title: str, counts: Counts, found: CountEvidence, judged: CountJudgement, registry: Registry
) -> Document:
    """The document of `pliant diagnose` on a file of counts."""
    reasons, columns = counts_why(found, judged), hypothesis_columns(found)
    return Document(
        kind="Pliant: which explanation do these counts allow?",
        title=title,
        sentence=judged.sentence,
        data=counts_diagnosis_json(found, judged, registry),
        brief=(brief_table(columns, list(found.probability)[:HYPOTHESES_BRIEF]),),
        points=tuple(reasons),
        warnings=tuple(map(Warned, found.comparison.remarks)),
        closing=(judged.sentence, *reasons),
        draw=lambda: _drawn_diagnosis(found, columns),
        footer=f"Counts: {counts.source or 'given in memory'}",
    )


def counts_diagnosis_json(found: CountEvidence, judged: CountJudgement, registry: Registry) -> dict[str, Any]:
    """The contract's keys; the comparison of the model as it is stands under `comparison`."""
    plain, next_count, columns = found.comparison, judged.next_count, hypothesis_columns(found)
    proposed = next_count and {
        "run": f"more trials of {next_count.condition}",
        "why": "the explanations that are left expect different shares of success there",
        "separates": [[list(kinds) for kinds in next_count.expected]],
        "minutes": None,
    }
    smallest = [(found.rows[kinds].parameters[0], level) for kinds, level in judged.smallest.items()]
    silent = [found.rows[kinds].parameters[0] for kinds in judged.not_excited]
    excited_by = {
        one.name: registry.get("effect", one.kind).implementation_class().notes.excited_by
        if one.model
        else ""
        for one in silent
    }
    return {
        **verdict_json(judged),
        "hypotheses": [_hypothesis_json(found, columns, kinds) for kinds in found.probability],
        "not_excited": [
            {"kind": name, "run_that_would_excite_it": run or NEARER} for name, run in excited_by.items()
        ],
        "indistinguishable": [
            {"a": named(a), "b": named(b), "unexplained_share": share} for a, b, share in judged.alike
        ],
        "covariates": [],
        "next_experiment": proposed,
        "smallest_detectable": [
            {"kind": one.name.rpartition(".")[0], "parameter": one.name, "value": level, "unit": one.unit}
            for one, level in smallest
        ],
        "n_samples": plain.n_samples,
        "n_effective": plain.n_effective,
        "comparison": counts_json(plain),
        "remarks": list(plain.remarks),
    }


def counts_why(found: CountEvidence, judged: CountJudgement) -> list[str]:
    """Reasons, the level of the best explanation, what is alike, what to count next."""
    lines = list(judged.reasons)
    best = best_listed(found)
    if best is not None and judged.verdict in ("missing_effect", "ambiguous", "unknown_effect"):
        left = found.comparisons[best].disagreeing
        rest = f"{len(left)} conditions are still wrong" if left else "no condition is wrong beyond chance"
        lines.append(f"Best of what is listed: {level_text(found.rows[best])}; with it {rest}.")
    for a, b, share in judged.alike[:NAMED]:
        lines.append(f"{named(a)} and {named(b)} move these conditions alike ({whole_percent(share)} apart).")
    if judged.next_count is not None:
        shares = judged.next_count.expected.items()
        expected = ", ".join(f"{named(kinds)} {whole_percent(share)}" for kinds, share in shares)
        lines.append(f"Next: more trials of {judged.next_count.condition}; expected successes: {expected}.")
    return lines


def best_listed(found: CountEvidence) -> Kinds | None:
    """The most probable explanation that moves something; None where none was tried."""
    return next((kinds for kinds in found.probability if kinds not in (NOTHING, UNKNOWN)), None)


def level_text(row: Explanation) -> str:
    """The best level of each number: ``task.friction 0.9``."""
    values = zip(row.parameters, row.grid[row.best], strict=True)
    return ", ".join(
        f"{one.name} {number(v, 3)} {one.unit if one.unit != '1' else ''}".strip() for one, v in values
    )


def hypothesis_columns(found: CountEvidence) -> tuple[Column[Kinds], ...]:
    """What is said of any hypothesis, one outside the list included."""
    rows, comparisons = found.rows, found.comparisons

    def scanned(text: Callable[[Kinds], str]) -> Callable[[Kinds], str]:
        return lambda kinds: text(kinds) if kinds in rows else ""

    level = scanned(lambda kinds: level_text(rows[kinds]))
    level_alone = scanned(
        lambda kinds: level_text(rows[kinds]).rpartition(kinds[0] + " ")[2] if kinds else ""
    )
    likelihood = scanned(lambda kinds: number(comparisons[kinds].log_likelihood, 4))
    left_out = scanned(lambda kinds: number(float(rows[kinds].unseen.sum()), 4))
    wrong = scanned(lambda kinds: str(len(comparisons[kinds].disagreeing)))
    probability = found.probability.__getitem__
    return (
        Column(list, "kinds", "hypothesis", "hypothesis", named),
        Column(
            probability,
            "probability",
            "probability",
            "probability",
            show=whole_percent,
            brief_show=probability_text,
        ),
        Column(
            found.log_evidence.__getitem__, "log_evidence", "log-evidence", "evidence", show=4, brief_show=3
        ),
        Column(
            lambda kinds: _levels_json(rows[kinds]) if kinds in rows else {},
            "parameters",
            "best level",
            "best at",
            level,
            level_alone,
        ),
        Column(list, "", "log-likelihood there", text=likelihood),
        Column(list, "", "left out", text=left_out),
        Column(list, "", "still wrong", "still wrong", wrong),
    )


def _hypothesis_json(
    found: CountEvidence, columns: tuple[Column[Kinds], ...], kinds: Kinds
) -> dict[str, Any]:
    said = {**as_json(columns, kinds), "rmse_over_floor": None, "heldout": {}}
    if kinds not in found.rows:
        return said
    row, comparison = found.rows[kinds], found.comparisons[kinds]
    return said | {
        "heldout": {OUTPUT: {"rmse": _unseen_rmse(found, row), "unit": "1"}},
        "heldout_log_likelihood": float(row.unseen.sum()),
        "rmse_over_floor": comparison.ratio_to_floor,
        "log_likelihood": comparison.log_likelihood,
        "levels": [list(levels) for levels in row.grid],
        "log_likelihood_of_levels": row.log_likelihood.sum(axis=1),
        "simulated": row.simulated,
        "still_wrong": [one.condition.words for one in comparison.disagreeing],
    }


def _levels_json(row: Explanation) -> dict[str, Any]:
    """The best level of each number, and its standard deviation over the levels."""
    values = np.array(row.grid, float).reshape(len(row.grid), len(row.parameters))
    sd = np.sqrt(row.weights @ (values - row.weights @ values) ** 2)
    return {
        one.name: {"value": float(v), "sd": float(s), "unit": one.unit, "plausible": True}
        for one, v, s in zip(row.parameters, values[row.best], sd, strict=True)
    }


def _unseen_rmse(found: CountEvidence, row: Explanation) -> float:
    """Of the shares of success of conditions that had no part in choosing the level."""
    likelihood = row.log_likelihood.sum(axis=1, keepdims=True) - row.log_likelihood
    weights = np.exp(likelihood - likelihood.max(axis=0))
    s, m = np.moveaxis(np.array(row.simulated, float), 2, 0)
    expected = (weights * s / m).sum(axis=0) / weights.sum(axis=0)
    measured = np.array([one.measured[0] / one.measured[1] for one in found.comparison.conditions])
    return float(np.sqrt(np.mean((measured - expected) ** 2)))


def _drawn_diagnosis(found: CountEvidence, columns: tuple[Column[Kinds], ...]) -> Drawn:
    best = best_listed(found)
    models = {"model": found.comparison.conditions[:ROWS]}
    if best is not None:
        models[f"with {level_text(found.rows[best])}"] = found.comparisons[best].conditions[:ROWS]
    caption = (
        "Share of successes by condition, each with the interval that counting alone gives it. Filled models differ "
        "from the measurement by more than chance, all conditions being looked at."
    )
    note = (
        "Log-evidence: log of the mean likelihood over the levels tried. Left out: log-likelihood of each condition "
        "when the others choose the level. Still wrong: conditions beyond chance at the best level."
    )
    title = "Every hypothesis"
    table = page_table(title, columns, list(found.probability), note)
    return drawn(shares_picture("changes", caption, models), section(title, table))
