"""A learned term on a page: its curve with its band, or a map with what is not sure of it, and where its data end."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.diagnosis.law_off import LawOff
from pliant.diagnosis.learned_term import LearnedTerm
from pliant.diagnosis.learned_words import covariate_words, described, quantity
from pliant.formatting import display_unit, percent, whole_percent
from pliant.mechanics.learned_curve import basis
from pliant.report.document import Picture, Section, capital
from pliant.report.figures import style
from pliant.report.learned_curve import NINETY, LearnedCurve, beyond, curve_of

CELLS = 90


def learned_section(found: LearnedTerm | None) -> Section | None:
    """The curve with its band, and what it says; None without one."""
    if found is None:
        return None
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
        (Picture("learned", caption, learned_picture(found), None if curve is None else curve.chart),),
        text=text,
        open=True,
    )


def law_section(found: LawOff | None) -> Section | None:
    """Return the law's own error with its band over the data; None without one."""
    if found is None:
        return None
    curve = curve_of(found.term)
    caption = (
        "Line and dots: what has to be added to the law's moment; band: 90 %. Grey: no data."
        if curve is not None
        else "Left: what has to be added to the law's moment; right: half the width of its 90 % band. Dashed: where "
        "the data end."
    )
    text = (
        f"The law is off {found.words}. Its error is {percent(found.size)} of the torque range "
        f"({display_unit('N*m').text(found.effort, 3)}) and explains {whole_percent(found.share)} of the squared "
        "error.",
        f"On {found.term.on} of the fit the error is {found.term.before:.2f} times the noise with the law as it is "
        f"and {found.term.after:.2f} times with the correction.",
    )
    picture = Picture(
        "law_error", caption, learned_picture(found.term), None if curve is None else curve.chart
    )
    return Section("The error of the law", (picture,), text=text, open=True)


def learned_picture(found: LearnedTerm) -> style.Png:
    """The curve over its covariate, or two maps over two."""
    if (curve := curve_of(found)) is not None:
        with style.canvas(1350, 620) as figure:
            _curve(figure.subplots(), curve)
            return style.png(figure)
    with style.canvas(1700, 640) as figure:
        _maps(figure, found)
        return style.png(figure)


def _curve(panel: Any, curve: LearnedCurve) -> None:
    shown, ends = curve.x, curve.ends
    for side in ((shown[0], ends[0]), (ends[1], shown[-1])):
        panel.axvspan(*side, color=style.FAINT, alpha=0.35, lw=0)
    panel.axhline(0.0, color=style.SOFT, lw=0.9)
    low, high = curve.value - curve.half, curve.value + curve.half
    panel.fill_between(shown, low, high, color=style.SERIES[0], alpha=0.22, lw=0)
    panel.plot(shown, curve.value, color=style.SERIES[0], lw=2.2)
    panel.plot(curve.knots_x, curve.knots, ls="", marker="o", ms=4, color=style.SERIES[0])
    for at, anchor in zip(ends, ("right", "left"), strict=True):
        where = {"xycoords": ("data", "axes fraction"), "ha": anchor, "va": "top", "color": style.SOFT}
        style.note(panel, "no data", (at, 1.0), (-4 if anchor == "right" else 4, -4), **where)
    panel.set(xlim=(shown[0], shown[-1]), xlabel=curve.over.text, ylabel=curve.what.text)
    panel.set_title("What the learned term adds")


def _maps(figure: Any, found: LearnedTerm) -> None:
    first, second = found.form.axes
    label, unit = quantity(found)
    words = [covariate_words(axis, found.drive) for axis in found.form.axes]
    x, y = beyond(first, CELLS), beyond(second, CELLS)
    at = [v.ravel() for v in np.meshgrid(x, y, indexing="ij")]
    weights = basis(found.form.axes, at)
    value = (weights @ found.value).reshape(CELLS, CELLS) * unit.factor
    sd = np.sqrt(np.einsum("tk,kl,tl->t", weights, found.covariance, weights)).reshape(value.shape)
    reach = float(np.abs(value).max()) or 1.0
    drawn = (
        ("What the learned term adds", value, {"cmap": "RdBu_r", "vmin": -reach, "vmax": reach}),
        ("What is not sure of it: ± of 90 %", NINETY * sd * unit.factor, {"cmap": "Greys", "vmin": 0.0}),
    )
    for panel, (title, values, look) in zip(figure.subplots(1, 2), drawn, strict=True):
        mesh = panel.pcolormesh(
            x * words[0].factor, y * words[1].factor, values.T, shading="gouraud", rasterized=True, **look
        )
        low = [axis.low * w.factor for axis, w in zip(found.form.axes, words, strict=True)]
        high = [axis.high * w.factor for axis, w in zip(found.form.axes, words, strict=True)]
        corners = ([low[0], high[0], high[0], low[0], low[0]], [low[1], low[1], high[1], high[1], low[1]])
        panel.plot(*corners, color=style.INK, lw=1.0, ls=(0, (4, 2)))
        style.note(panel, "data end here", (low[0], high[1]), (2, 4), fontsize=7.5, color=style.INK)
        panel.grid(visible=False)
        panel.set(xlabel=words[0].axis, ylabel=words[1].axis, title=title)
        style.colour_bar(figure, mesh, f"{label} ({unit.symbol})", ax=panel)
