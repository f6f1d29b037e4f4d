"""A comparison of counts as one self-contained HTML page."""

from __future__ import annotations

from pliant import __version__
from pliant.evidence.counts import CountComparison
from pliant.evidence.counts_words import counted, interpret_counts
from pliant.evidence.words import number, percent
from pliant.records.counts import Counts
from pliant.report.facts import Table
from pliant.report.figures.success_shares import Series, success_shares
from pliant.report.layout import Page, Picture, Section
from pliant.report.template import page_template
from pliant.report.words import Warned

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


def _conditions(found: CountComparison) -> Table:
    rows = [
        [
            one.condition.words,
            counted(one.measured),
            counted(one.simulated),
            number(one.log_likelihood, 3),
            number(one.deviance, 3),
            percent(one.share_of_error),
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
        f"{number(found.deviance, 4)}. The likelihood is beta-binomial, because both sides are finite samples; p is Fisher's exact test."
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
