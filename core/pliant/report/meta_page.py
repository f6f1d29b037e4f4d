"""The page of `pliant fit` for a meta-model: errors on designs left out, bars, cost; self-contained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pliant import __version__
from pliant.formatting import percent, seconds, units_of_page
from pliant.report.document import Picture, Section, Warned
from pliant.report.facts import input_table, provenance_table
from pliant.report.figures.design_bars import design_bars
from pliant.report.figures.design_errors import design_errors
from pliant.report.figures.learning import Curve, learning_picture
from pliant.report.figures.parity import free_picture, parity_picture
from pliant.report.folder import FinishedRun
from pliant.report.meta_reading import MetaFitted
from pliant.report.meta_tables import (
    cost_table,
    coverage_table,
    learning_table,
    next_table,
    scores_table,
    settings_table,
    worst_table,
)
from pliant.report.template import page_template

FAR = 0.05  # of the range: a worst error beyond this is warned of
LEFT_OUT = "Every design was predicted by a model that had not seen it."


def render_meta(
    title: str,
    fitted: MetaFitted,
    study: Mapping[str, Any],
    provenance: Sequence[Mapping[str, Any]],
    compared: Sequence[MetaFitted] = (),
) -> str:
    """The page as HTML with its pictures inside; `compared` are other models of the same designs."""
    caption = (
        f"{LEFT_OUT} Left and middle: predicted against solved torque, inside the range of designs and on its border, "
        "where the model extrapolates. Right: what is missed."
    )
    hero = Picture("meta_parity", caption, parity_picture(fitted))
    sections = [
        s for s in (_scores(fitted, compared), _free(fitted), _space(fitted), _bars(fitted)) if s is not None
    ]
    sections += [s for s in (_learning(fitted), _cost(fitted)) if s is not None]
    page = FinishedRun({}, study, (), (), tuple(provenance))
    sections.append(Section("Inputs", tables=(input_table(page),)))
    if provenance:
        sections.append(Section("Provenance", tables=(provenance_table(page),)))
    text: str = page_template().render(
        title=title,
        kind="Pliant fit: meta-model",
        sentence=sentence(fitted),
        hero=hero,
        warnings=warned(fitted),
        sections=sections,
        version=provenance[0].get("pliant", __version__) if provenance else __version__,
        footer=units_of_page(lengths="m", pressures="Pa", moments="N*m", angles="rad"),
    )
    return text


def sentence(fitted: MetaFitted) -> str:
    """How well laws of unseen designs do, and how fast they come."""
    inner = fitted.scores.get("interior", fitted.scores["all"])
    where = "inside the range" if "interior" in fitted.scores else "left out"
    parts = [
        f"laws of designs {where} that the model has not seen miss torques by at most "
        f"{percent(inner.worst_of_range)} of the range, R² {inner.r2:.5f}"
    ]
    if np.isfinite(inner.free_median):
        parts.append(f"free angles by {percent(inner.free_median)} at the median")
    if "border" in fitted.scores:
        parts.append(f"on the border of the range by up to {percent(fitted.scores['border'].worst_of_range)}")
    if (band := fitted.coverage.get("all", {}).get("0.9")) is not None:
        parts.append(f"the 90 % band holds {percent(band, 3)}")
    parts.append(f"a law takes {seconds(fitted.law_s)}")
    text = "; ".join(parts) + "."
    return text[0].upper() + text[1:]


def warned(fitted: MetaFitted) -> list[Warned]:
    """What limits the model."""
    found = []
    for place, scores in fitted.scores.items():
        if place != "all" and scores.worst_of_range > FAR:
            text = (
                f"Designs {'on the border' if place == 'border' else 'inside the range'} are missed by up to "
            )
            found.append(Warned(f"{text}{percent(scores.worst_of_range)} of their range of torque."))
    if lost := fitted.scores["all"].free_lost:
        found.append(Warned(f"In {lost} states the law of a design left out has no free equilibrium."))
    return found


def _scores(fitted: MetaFitted, compared: Sequence[MetaFitted]) -> Section:
    models = [fitted, *(one for one in compared if one is not fitted)]
    tables = [scores_table(models), worst_table(fitted), settings_table(fitted)]
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


def _cost(fitted: MetaFitted) -> Section:
    return Section("Cost", tables=(cost_table(fitted),))
