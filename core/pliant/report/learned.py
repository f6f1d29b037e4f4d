"""A learned term: JSON, the section of a page, and its chart, a curve with its band or a map with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pliant.diagnosis.law_off import LawOff
from pliant.diagnosis.learned_term import LearnedTerm
from pliant.diagnosis.learned_words import covariate_words, described, quantity
from pliant.formatting import display_unit, percent, whole_percent
from pliant.mechanics.learned_curve import MARGIN, CurveAxis, basis
from pliant.records.design import Array
from pliant.report.chart import (
    Band,
    Chart,
    ChartAxis,
    ChartCells,
    ChartLine,
    ChartNote,
    ChartRule,
    Mark,
    Panel,
)
from pliant.report.chart_colours import INK, PAPER, SERIES, SIGNED_COLOURS, SOFT, ColourScale
from pliant.report.document import Picture, Section, capital

NINETY = 1.6449  # half-width of a central 90 % band in standard deviations
POINTS, CELLS = 400, 90


def law_error_json(law_off: LawOff | None) -> dict[str, Any] | None:
    """Return the law's error, SI; the surface in the form of `learned`."""
    if law_off is None:
        return None
    plain = {
        key: getattr(law_off, key)
        for key in ("size", "effort", "output", "change", "drive", "actuation", "reading", "share")
    }
    return {**plain, "surface": learned_json(law_off.term)}


def learned_json(term: LearnedTerm | None) -> dict[str, Any] | None:
    """Return the term as a study's block, the reduction of the error on held-out runs, and its certainty."""
    if term is None:
        return None
    return {
        "effect": term.effect.canonical(),
        "depends_on": [axis.name for axis in term.form.axes],
        "acts_on": term.form.acts_on,
        "rmse_over_floor": {"without": term.before, "with": term.after},
        "left_out": term.on,
        "standard_errors": term.sure,
        "effective_values": term.freedom,
        "forms_tried": term.tried,
        "description": capital(described(term)),
    }


def learned_section(term: LearnedTerm | None) -> Section | None:
    """Return the curve with its band, and its description; None without a term."""
    if term is None:
        return None
    caption = (
        "Line and dots: the learned values; band: 90 %. Grey: beyond the data, where the term falls to zero."
        if len(term.form.axes) == 1
        else "Left: the learned values; right: half the width of their 90 % band. Dashed: where the data end; beyond "
        "it the term falls to zero."
    )
    fall = (
        f"On {term.on} of the fit the error is {term.before:.2f} times the noise without it and {term.after:.2f} "
        f"times with it, a fall of {term.sure:.0f} standard errors; {term.tried} forms were tried, and the smallest "
        "that predicts as well as the best was taken."
    )
    title = "A learned term for what no listed effect explains"
    picture = Picture("learned", caption, learned_chart(term))
    return Section(title, (picture,), text=(capital(described(term)), fall), open=True)


def law_section(law_off: LawOff | None) -> Section | None:
    """Return the law's own error with its band over the data; None without one."""
    if law_off is None:
        return None
    caption = (
        "Line and dots: what has to be added to the law's moment; band: 90 %. Grey: no data."
        if len(law_off.term.form.axes) == 1
        else "Left: what has to be added to the law's moment; right: half the width of its 90 % band. Dashed: where "
        "the data end."
    )
    text = (
        f"The law is off {law_off.words}. Its error is {percent(law_off.size)} of the torque range "
        f"({display_unit('N*m').text(law_off.effort, 3)}) and explains {whole_percent(law_off.share)} of the squared "
        "error.",
        f"On {law_off.term.on} of the fit the error is {law_off.term.before:.2f} times the noise with the law as it is "
        f"and {law_off.term.after:.2f} times with the correction.",
    )
    picture = Picture("law_error", caption, learned_chart(law_off.term))
    return Section("The error of the law", (picture,), text=text, open=True)


def learned_chart(term: LearnedTerm) -> Chart:
    """Return the curve over its covariate with its band, or over two covariates the values and their uncertainty."""
    if (curve := covariate_curve(term)) is not None:
        return Chart((_curve_panel(curve),), cell=(1350, 560))
    return Chart(_map_panels(term), across=2, cell=(850, 640))


@dataclass(frozen=True, eq=False)
class LearnedCurve:
    """A learned curve in display units.

    Attributes:
        over, what: covariate, and quantity that the term changes, with their display units.
        x, value, half: (n,) abscissae, values, half-widths of the 90 % band.
        knots_x, knots: nodes of the term, and its values there.
        ends: of the data; beyond them the term decays to zero.
    """

    over: ChartAxis
    what: ChartAxis
    x: Array
    value: Array
    half: Array
    knots_x: Array
    knots: Array
    ends: tuple[float, float]


def covariate_curve(term: LearnedTerm) -> LearnedCurve | None:
    """Return the curve over one covariate; None for a term over two."""
    if len(term.form.axes) != 1:
        return None
    (axis,) = term.form.axes
    label, unit = quantity(term)
    words = covariate_words(axis, term.drive)
    x = _around(axis, POINTS)
    weights = basis(term.form.axes, [x])
    return LearnedCurve(
        ChartAxis(words.label, words.symbol),
        ChartAxis(label, unit.symbol),
        x * words.factor,
        weights @ term.value * unit.factor,
        NINETY * _deviation(term, weights) * unit.factor,
        np.asarray(axis.at) * words.factor,
        term.value * unit.factor,
        (axis.low * words.factor, axis.high * words.factor),
    )


def _curve_panel(curve: LearnedCurve) -> Panel:
    x, low, high = curve.x, curve.value - curve.half, curve.value + curve.half
    outside = [
        Band("no data", np.array(side), np.zeros(2), np.ones(2), colour="#ebedf1", rim=True)
        for side in ((x[0], curve.ends[0]), (curve.ends[1], x[-1]))
    ]
    marks: tuple[Mark, ...] = (
        *outside,
        Band("90 % band", x, low, high, colour="#c9dfee"),
        ChartRule(0.0, SOFT, 0.9),
        ChartLine("learned term", x, curve.value, "", SERIES[0], 2.2),
        ChartLine("knots", curve.knots_x, curve.knots, "", SERIES[0], 0.0, 4.0),
    )
    over = replace(curve.over, ends=(float(x[0]), float(x[-1])))
    return Panel(over, curve.what, marks, "What the learned term adds")


def _map_panels(term: LearnedTerm) -> tuple[Panel, ...]:
    label, unit = quantity(term)
    words = [covariate_words(axis, term.drive) for axis in term.form.axes]
    sides = [_around(axis, CELLS) for axis in term.form.axes]
    weights = basis(term.form.axes, [v.ravel() for v in np.meshgrid(*sides, indexing="ij")])
    value = (weights @ term.value).reshape(CELLS, CELLS) * unit.factor
    band = NINETY * unit.factor * _deviation(term, weights).reshape(CELLS, CELLS)
    reach = float(np.abs(value).max()) or 1.0
    x, y = (ChartAxis(one.label, one.symbol) for one in words)
    edges = [_edges(side * one.factor) for side, one in zip(sides, words, strict=True)]
    (left, right), (low, high) = (
        (axis.low * one.factor, axis.high * one.factor)
        for axis, one in zip(term.form.axes, words, strict=True)
    )
    corners = np.array([left, right, right, left, left]), np.array([low, low, high, high, low])
    box = ChartLine("ends of the data", *corners, width=1.0, dashed=True)
    note = ChartNote("data end here", left, high, "right")
    scales = (
        ColourScale.even(label, unit.symbol, (-reach, reach), SIGNED_COLOURS),
        ColourScale.even(label, unit.symbol, (0.0, float(band.max())), (PAPER, SOFT, INK)),
    )
    titles = "What the learned term adds", "What is not sure of it: ± of 90 %"
    return tuple(
        Panel(x, y, (ChartCells(label, edges[0], edges[1], shown.T), box, note), title, scale=scale)
        for title, shown, scale in zip(titles, (value, band), scales, strict=True)
    )


def _around(axis: CurveAxis, count: int) -> Array:
    """Return points over the range and slightly more than the margins in which the curve decays."""
    more = 1.5 * MARGIN * (axis.high - axis.low)
    return np.linspace(axis.low - more, axis.high + more, count)


def _deviation(term: LearnedTerm, weights: Array) -> Array:
    return np.sqrt(np.einsum("tk,kl,tl->t", weights, term.covariance, weights))


def _edges(middles: Array) -> Array:
    """Return the edges of cells around evenly spaced middles."""
    step = middles[1] - middles[0]
    return np.append(middles - step / 2, middles[-1] + step / 2)
