"""The page of a meta-model: errors on designs left out, bars, learning, cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pliant.report.document import Drawn, Picture, Section, page_table
from pliant.report.figures.designs import design_errors, free_picture, parity_picture
from pliant.report.figures.error_bars import design_bars
from pliant.report.figures.learning import Curve, learning_picture
from pliant.report.meta_tables import (
    PUBLISHED,
    SCORES,
    cost_table,
    coverage_table,
    learning_table,
    next_table,
    score_rows,
    settings_table,
    worst_table,
)
from pliant.report.meta_view import MetaFitted
from pliant.report.provenance import Manifests, closing_sections

LEFT_OUT = "Every design was predicted by a model that had not seen it."


def meta_drawn(fitted: Sequence[MetaFitted], study: Mapping[str, Any], manifests: Manifests) -> Drawn:
    """The first of `fitted` on top and in all sections; the others stand beside its scores."""
    one = fitted[0]
    caption = (
        f"{LEFT_OUT} Left and middle: predicted against solved torque, inside the range of designs and on its border, "
        "where the model extrapolates. Right: what is missed."
    )
    sections = [_scores(fitted), _free(one), _space(one), _bars(one), _learning(one)]
    cost = Section("Cost", tables=(cost_table(one),))
    kept = [section for section in sections if section is not None]
    hero = Picture("meta_parity", caption, parity_picture(one))
    return Drawn(hero, (*kept, cost, *closing_sections(study, manifests)))


def _scores(fitted: Sequence[MetaFitted]) -> Section:
    scores = page_table("Scores on designs left out", SCORES, score_rows(fitted), PUBLISHED)
    tables = [scores, worst_table(fitted[0]), settings_table(fitted[0])]
    return Section("Scores on designs left out", tables=tuple(t for t in tables if t is not None))


def _free(fitted: MetaFitted) -> Section | None:
    picture = free_picture(fitted)
    if picture is None:
        return None
    caption = f"{LEFT_OUT} The free branch: no external load, every pressure at which it was solved."
    return Section("Free angle", (Picture("meta_free", caption, picture),))


def _space(fitted: MetaFitted) -> Section:
    caption = "Each design by its worst miss when left out; designs that share a place in a panel stand side by side."
    if fitted.proposals:
        caption += " Stars: what should be solved next, in order."
    found = next_table(fitted)
    picture = Picture("meta_designs", caption, design_errors(fitted))
    return Section("Where in the space of designs it misses", (picture,), (found,) if found else ())


def _bars(fitted: MetaFitted) -> Section | None:
    if not fitted.coverage:
        return None
    caption = (
        "Share of states of designs left out inside bands of each stated level, made without the design."
    )
    return Section(
        "Are the error bars honest?",
        (Picture("meta_bars", caption, design_bars(fitted)),),
        (coverage_table(fitted),),
    )


def _learning(fitted: MetaFitted) -> Section | None:
    learning = fitted.learning
    if learning is None or not learning["points"]:
        return None
    curves = []
    for colour, place in enumerate(("all", "interior")):
        points = [p for p in learning["points"] if p[place]]
        for score, label in (("rms", "RMS"), ("worst", "worst")):
            found = [(int(p["n"]), float(p[place][score])) for p in points]
            if found:
                curves.append(Curve(f"{place}, {label}", found, colour, dashed=score == "worst"))
    picture = learning_picture(
        {"Error by number of designs": curves}, "designs fitted", "error on unused designs (% of the range)"
    )
    caption = "The model fitted again to nested subsets of the designs, scored on designs that no fit saw."
    return Section(
        "How many designs it takes",
        (Picture("meta_learning", caption, picture),),
        (learning_table(learning),),
    )
