"""A learned term as JSON and as a section of a page."""

from __future__ import annotations

from typing import Any

from pliant.diagnosis.learned_term import LearnedTerm
from pliant.diagnosis.learned_words import described
from pliant.report.document import Picture, Section, capital
from pliant.report.learned_curve import curve_of


def learned_json(found: LearnedTerm | None) -> dict[str, Any] | None:
    """What it is as a study's block, how far the error falls on runs left out, how sure that is."""
    if found is None:
        return None
    return {
        "effect": found.effect.canonical(),
        "depends_on": [axis.name for axis in found.form.axes],
        "acts_on": found.form.acts_on,
        "rmse_over_floor": {"without": found.before, "with": found.after},
        "left_out": found.on,
        "standard_errors": found.sure,
        "effective_values": found.freedom,
        "forms_tried": found.tried,
        "description": capital(described(found)),
    }


def learned_section(found: LearnedTerm | None) -> Section | None:
    """The curve with its band, and what it says; None without one."""
    if found is None:
        return None
    from pliant.report.figures.learned import learned  # matplotlib takes a second to import

    curve = curve_of(found)
    one = curve is not None
    caption = (
        "Line and dots: the learned values; band: 90 %. Grey: beyond the data, where the term dies out."
        if one
        else "Left: the learned values; right: half the width of their 90 % band. Dashed: where the data end; beyond "
        "it the term dies out."
    )
    fall = (
        f"On {found.on} of the fit the error is {found.before:.2f} times the noise without it and {found.after:.2f} "
        f"times with it, a fall of {found.sure:.0f} standard errors; {found.tried} forms were tried, and the smallest "
        "that predicts as well as the best was taken."
    )
    text = (capital(described(found)), fall)
    return Section(
        "A learned term for what no listed effect explains",
        (Picture("learned", caption, learned(found), None if curve is None else curve.chart),),
        text=text,
        open=True,
    )
