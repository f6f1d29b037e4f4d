"""A comparison, or a diagnosis, of counts as one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Sequence

from pliant import __version__
from pliant.diagnosis.counts_evidence import CountEvidence
from pliant.diagnosis.counts_words import told
from pliant.diagnosis.table import Kinds
from pliant.diagnosis.words import named
from pliant.evidence.counts import CountComparison
from pliant.evidence.counts_words import counted, interpret_counts
from pliant.formatting import number, whole_percent
from pliant.records.counts import Counts
from pliant.report.document import Page, Picture, Section, Table, Warned
from pliant.report.figures.success_shares import Series, success_shares
from pliant.report.template import page_template

ROWS = 60  # of a table or a picture


def counts_page(title: str, counts: Counts, found: CountComparison) -> Page:
    """Draw and write the page. The same comparison gives the same bytes."""
    shown = found.conditions
    if len(shown) > ROWS:
        shown = tuple(sorted(shown, key=lambda one: -one.deviance)[:ROWS])
    whole = "" if len(shown) == len(found.conditions) else f" The {ROWS} conditions that differ most."
    flags = [one.disagrees for one in shown]
    png = success_shares(
        [one.condition.words for one in shown],
        Series("measured", [one.measured for one in shown], [True] * len(shown)),
        [Series("model", [one.simulated for one in shown], flags)],
    )
    caption = (
        "Share of successes by condition: measured and simulated, each with the interval that counting alone gives it. "
        f"Filled model: it differs from the measurement by more than chance, all conditions being looked at.{whole}"
    )
    hero = Picture("runs", caption, png)
    sections = [Section("Numbers", (), (_conditions(found), _sets(found)))]
    text = page_template().render(
        kind="Pliant: model against counts",
        title=title,
        sentence=interpret_counts(found),
        hero=hero,
        warnings=[Warned(remark) for remark in found.remarks],
        sections=sections,
        version=__version__,
        footer=f"Counts: {counts.source or 'given in memory'}",
    )
    return Page(text, {hero.name: hero.png})


def counts_diagnosis_page(
    title: str, counts: Counts, found: CountEvidence, sentences: Sequence[str], best: Kinds | None
) -> Page:
    """The page of `pliant diagnose` on counts: the conditions with the best explanation, and every hypothesis."""
    plain = found.comparison.conditions[:ROWS]
    models = [Series("model", [one.simulated for one in plain], [one.disagrees for one in plain])]
    if best is not None:
        moved = found.comparisons[best].conditions[:ROWS]
        flags = [one.disagrees for one in moved]
        models.append(Series(f"with {told(found.rows[best])}", [one.simulated for one in moved], flags))
    png = success_shares(
        [one.condition.words for one in plain],
        Series("measured", [one.measured for one in plain], [True] * len(plain)),
        models,
    )
    caption = (
        "Share of successes by condition, each with the interval that counting alone gives it. Filled models differ "
        "from the measurement by more than chance, all conditions being looked at."
    )
    hero = Picture("changes", caption, png)
    text = page_template().render(
        kind="Pliant: which explanation do these counts allow?",
        title=title,
        sentence=sentences[0],
        points=list(sentences[1:]),
        hero=hero,
        warnings=[Warned(remark) for remark in found.comparison.remarks],
        sections=[Section("Every hypothesis", (), (_hypotheses(found),))],
        version=__version__,
        footer=f"Counts: {counts.source or 'given in memory'}",
    )
    return Page(text, {hero.name: hero.png})


def _hypotheses(found: CountEvidence) -> Table:
    rows = []
    for kinds, probability in found.probability.items():
        row = found.rows.get(kinds)
        rows.append(
            [
                named(kinds),
                whole_percent(probability),
                number(found.log_evidence[kinds], 4),
                told(row) if row is not None and kinds else "",
                number(found.comparisons[kinds].log_likelihood, 4) if row is not None else "",
                number(float(row.unseen.sum()), 4) if row is not None else "",
                str(len(found.comparisons[kinds].disagreeing)) if row is not None else "",
            ]
        )
    head = [
        "hypothesis",
        "probability",
        "log-evidence",
        "best level",
        "log-likelihood there",
        "left out",
        "still wrong",
    ]
    note = (
        "Log-evidence: log of the mean likelihood over the levels tried. Left out: log-likelihood of each condition "
        "when the others choose the level. Still wrong: conditions beyond chance at the best level."
    )
    return Table("Every hypothesis", head, rows, note)


def _conditions(found: CountComparison) -> Table:
    rows = [
        [
            one.condition.words,
            counted(one.measured),
            counted(one.simulated),
            number(one.log_likelihood, 3),
            number(one.deviance, 3),
            whole_percent(one.share_of_error),
            number(one.p_adjusted, 2),
            "yes" if one.disagrees else "no",
        ]
        for one in found.conditions[:ROWS]
    ]
    head = [
        "condition",
        "measured",
        "model",
        "log-likelihood",
        "deviance",
        "of the deviance",
        "p (Holm)",
        "differs",
    ]
    note = (
        f"Together: log-likelihood {number(found.log_likelihood, 4)}, against "
        f"{number(found.log_likelihood_own, 4)} of a model that says nothing about any condition; deviance "
        f"{number(found.deviance, 4)}. The likelihood is beta-binomial, because "
        "both sides are finite samples; p is Fisher's exact test."
    )
    return Table("Condition by condition", head, rows, note)


def _sets(found: CountComparison) -> Table:
    repeated = [one for one in found.conditions if len(one.condition.sets) > 1]
    rows = [
        [
            one.condition.words,
            ", ".join(counted((s.successes, s.trials)) for s in one.condition.sets[:12]),
            number(one.p_repeats, 2),
            number(one.p_repeats_adjusted, 2),
            "yes" if one.contradictory else "no",
        ]
        for one in repeated[:ROWS]
    ]
    note = (
        f"χ² per degree of freedom over all repeats: {number(found.overdispersion, 2)}; 1 is what counting alone gives."
        if repeated
        else "No condition has more than one set: whether the bench repeats is not known."
    )
    head = ["condition", "sets", "p of one probability", "p (Holm)", "contradictory"]
    return Table("Do the repeats agree?", head, rows, note)
