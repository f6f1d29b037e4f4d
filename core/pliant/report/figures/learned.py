"""A learned term: a curve with its band, or a map with what is not sure of it, and where its data end."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.diagnosis.learned_term import LearnedTerm
from pliant.diagnosis.learned_words import covariate_words, quantity
from pliant.mechanics.learned_curve import MARGIN, CurveAxis, basis
from pliant.records.design import Array
from pliant.report.figures import style

# Half-width of a central 90 % band in standard deviations.
NINETY = 1.6449
POINTS, CELLS = 400, 90


def learned(found: LearnedTerm) -> style.Png:
    """The curve over its covariate, or two maps over two."""
    if len(found.form.axes) == 1:
        with style.canvas(1350, 620) as figure:
            _curve(figure.subplots(), found)
            return style.png(figure)
    with style.canvas(1700, 640) as figure:
        _maps(figure, found)
        return style.png(figure)


def _beyond(axis: CurveAxis, count: int) -> Array:
    """Places over the range and a little more than the margins in which the curve dies out."""
    more = 1.5 * MARGIN * (axis.high - axis.low)
    return np.linspace(axis.low - more, axis.high + more, count)


def _curve(panel: Any, found: LearnedTerm) -> None:
    axis = found.form.axes[0]
    label, unit = quantity(found)
    words = covariate_words(axis, found.drive)
    x = _beyond(axis, POINTS)
    weights = basis(found.form.axes, [x])
    value = weights @ found.value * unit.factor
    sd = np.sqrt(np.einsum("tk,kl,tl->t", weights, found.covariance, weights)) * unit.factor
    shown, ends = x * words.factor, (axis.low * words.factor, axis.high * words.factor)
    for side in ((shown[0], ends[0]), (ends[1], shown[-1])):
        panel.axvspan(*side, color=style.FAINT, alpha=0.35, lw=0)
    panel.axhline(0.0, color=style.SOFT, lw=0.9)
    panel.fill_between(
        shown, value - NINETY * sd, value + NINETY * sd, color=style.SERIES[0], alpha=0.22, lw=0
    )
    panel.plot(shown, value, color=style.SERIES[0], lw=2.2)
    knots = found.value * unit.factor
    panel.plot(axis.at * words.factor, knots, ls="", marker="o", ms=4, color=style.SERIES[0])
    for at, anchor in zip(ends, ("right", "left"), strict=True):
        where = {"xycoords": ("data", "axes fraction"), "ha": anchor, "va": "top", "color": style.SOFT}
        style.note(panel, "no data", (at, 1.0), (-4 if anchor == "right" else 4, -4), **where)
    panel.set(xlim=(shown[0], shown[-1]), xlabel=words.axis, ylabel=f"{label} ({unit.symbol})")
    panel.set_title("What the learned term adds")


def _maps(figure: Any, found: LearnedTerm) -> None:
    first, second = found.form.axes
    label, unit = quantity(found)
    words = [covariate_words(axis, found.drive) for axis in found.form.axes]
    x, y = _beyond(first, CELLS), _beyond(second, CELLS)
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
