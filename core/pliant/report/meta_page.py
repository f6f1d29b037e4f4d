"""The page of a meta-model: errors on designs left out, where in the space of designs, bars, learning, cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm

from pliant.formatting import deformation_unit, effort_unit, percent
from pliant.report.document import Drawn, Picture, Section, drawn, page_table, picture, section
from pliant.report.figures import style
from pliant.report.figures.error_bars import design_bars
from pliant.report.figures.learning import Curve, learning_picture
from pliant.report.meta_view import (
    PLACES,
    PUBLISHED,
    SCORES,
    MetaFitted,
    cost_table,
    coverage_table,
    learning_table,
    next_table,
    parameter_unit,
    score_rows,
    settings_table,
    worst_table,
)
from pliant.report.provenance import Manifests, closing_sections

LEFT_OUT = "Every design was predicted by a model that had not seen it."


def meta_drawn(fitted: Sequence[MetaFitted], study: Mapping[str, Any], manifests: Manifests) -> Drawn:
    """The first of `fitted` on top and in all sections; the others stand beside its scores."""
    one, title = fitted[0], "Scores on designs left out"
    hero = (
        f"{LEFT_OUT} Left and middle: predicted against solved torque, inside the range of designs and on its border, "
        "where the model extrapolates. Right: what is missed."
    )
    free = f"{LEFT_OUT} The free branch: no external load, every pressure at which it was solved."
    space = "Each design by its worst miss when left out; designs that share a place in a panel stand side by side."
    if one.proposals:
        space += " Stars: what should be solved next, in order."
    bars = "Share of states of designs left out inside bands of each stated level, made without the design."
    scores = page_table(title, SCORES, score_rows(fitted), PUBLISHED)
    where = Picture("meta_designs", space, design_errors(one))
    return drawn(
        Picture("meta_parity", hero, parity_picture(one)),
        section(title, scores, worst_table(one), settings_table(one), open=True),
        section("Free angle", picture("meta_free", free, free_picture(one))),
        section("Where in the space of designs it misses", where, next_table(one)),
        section(
            "Are the error bars honest?",
            Picture("meta_bars", bars, design_bars(one)),
            coverage_table(one),
        )
        if one.stage.coverage
        else None,
        _learning(one),
        section("Cost", cost_table(one)),
        *closing_sections(study, manifests),
    )


def _learning(fitted: MetaFitted) -> Section | None:
    learning = fitted.learning.value if fitted.learning is not None else {"points": ()}
    if not learning["points"]:
        return None
    curves = []
    for colour, place in enumerate(("all", "interior")):
        points = [p for p in learning["points"] if p[place]]
        for score, label in (("rms", "RMS"), ("worst", "worst")):
            found = [(int(p["n"]), float(p[place][score])) for p in points]
            if found:
                curves.append(Curve(f"{place}, {label}", found, colour, dashed=score == "worst"))
    axes = "designs fitted", "error on unused designs (% of the range)"
    caption = "The model fitted again to nested subsets of the designs, scored on designs that no fit saw."
    shown = Picture("meta_learning", caption, learning_picture({"Error by number of designs": curves}, *axes))
    return section("How many designs it takes", shown, learning_table(learning))


MANY = 500
COLOURS = {"interior": style.SERIES[0], "border": style.SERIES[1]}


def parity_picture(fitted: MetaFitted) -> style.Png:
    """One row for each axis: solved against predicted, interior and border apart, then misses of both."""
    effort, names, misses = effort_unit(fitted.designs.data[0]), fitted.axes, fitted.misses
    outer = fitted.border[misses.design]
    with style.canvas(1560, 500 * len(names) + 40, wspace=0.04) as figure:
        grid = figure.subplots(len(names), 3, squeeze=False)
        for row, (a, name) in zip(grid, enumerate(names), strict=True):
            symbol = rf"$\tau_{name}$" if len(names) > 1 else r"$\tau$"
            solved = f"solved {symbol} ({effort.symbol})"
            groups = {place: misses.counts[:, a] & (outer == (place == "border")) for place in PLACES}
            for axes, (place, rows) in zip(row, groups.items(), strict=False):
                tau, miss = misses.tau[rows, a], misses.miss[rows, a]
                _parity(axes, effort.factor * tau, effort.factor * (tau + miss), COLOURS[place])
                count = len(np.unique(misses.design[rows]))
                scores = fitted.stage.scores[place].axes if place in fitted.stage.scores else {}
                r2 = f"{scores[name].r2:.6f}" if name in scores else "–"
                title = axes.set_title(f"{symbol}, {place}: {count} designs, R² {r2}", fontsize=9.5)
                title.set_parse_math(True)
                axes.set(xlabel=solved, ylabel=f"predicted {symbol} ({effort.symbol})")
                style.with_math(axes)
            for place, rows in reversed(groups.items()):
                tau = effort.factor * misses.tau[rows, a]
                _dots(row[2], tau, 100 * fitted.shares[rows, a], COLOURS[place], place)
            _missed(row[2], solved, "% of the design's range", fontsize=9.5)
            style.with_math(row[2])
        return style.png(figure)


def _missed(axes: Any, solved: str, share: str, **look: float) -> None:
    """What a panel of misses has around its dots."""
    axes.axhline(0, color=style.SOFT, lw=0.9, zorder=1)
    axes.set_title("Predicted − solved", **look)
    axes.set(xlabel=solved, ylabel=share)
    axes.legend(loc="best", markerscale=1.6)


def free_picture(fitted: MetaFitted) -> style.Png | None:
    """Free angles of designs left out: predicted against solved, and misses; None without free states."""
    misses, data = fitted.misses, fitted.designs.data[0]
    if not len(misses.free_design):
        return None
    unit = deformation_unit(data)
    word = "extension" if data.joint == "prismatic" else "angle"
    u, miss = unit.factor * misses.free_angle, unit.factor * misses.free_miss
    largest = np.array([np.abs(u[misses.free_design == d]).max() for d in misses.free_design])
    with style.canvas(1560, 560, wspace=0.04) as figure:
        left, right = figure.subplots(1, 2)
        for place in PLACES[::-1]:
            rows = fitted.border[misses.free_design] == (place == "border")
            rows &= np.isfinite(miss)
            if rows.any():
                _parity(left, u[rows], u[rows] + miss[rows], COLOURS[place])
                _dots(right, u[rows], 100 * miss[rows] / largest[rows], COLOURS[place], place)
        every = fitted.stage.scores["all"]
        worst = "no equilibrium" if np.isinf(every.free_worst) else percent(every.free_worst)
        left.set_title(f"Free {word}: median miss {percent(every.free_median)}, worst {worst}")
        solved, predicted = (f"{side} free {word} ({unit.symbol})" for side in ("solved", "predicted"))
        left.set(xlabel=solved, ylabel=predicted)
        _missed(right, solved, f"% of the design's largest free {word}")
        return style.png(figure)


def _parity(axes: Any, solved: Any, predicted: Any, colour: str) -> None:
    if not len(solved):
        return
    limits = np.array([min(solved.min(), predicted.min()), max(solved.max(), predicted.max())])
    axes.plot(limits, limits, color=style.SOFT, lw=1.0, zorder=1)
    _dots(axes, solved, predicted, colour)


def _dots(axes: Any, x: Any, y: Any, colour: str, label: str | None = None) -> None:
    many = len(x) > MANY
    look = {"color": colour, "alpha": 0.55 if many else 0.8, "label": label}
    axes.scatter(x, y, 5 if many else 14, linewidths=0, zorder=3, **look)


MOST_PANELS = 6  # panels
SPREAD = 0.042  # of a parameter's range: designs of a grid that share a place in a panel stand side by side


def design_errors(fitted: MetaFitted) -> style.Png:
    """One panel for each pair of parameters, at most six; one parameter alone stands against its error."""
    names = fitted.designs.names
    pairs = list(combinations(range(len(names)), 2))[:MOST_PANELS]
    worst, count = (
        np.where(np.isfinite(fitted.worst), fitted.worst, np.nanmax(fitted.worst)),
        max(len(pairs), 1),
    )
    shares = 100 * np.maximum(worst, 1e-8)
    norm = style.decades(float(np.nanmin(shares)), float(np.nanmax(shares)))
    columns = min(count, 3)
    rows = -(-count // columns)
    with style.canvas(1560 if columns > 1 else 1000, 540 * rows + 60, wspace=0.04) as figure:
        panels = style.panels(figure, count, columns)
        for axes, (i, j) in zip(panels, pairs, strict=False):
            _pair(axes, fitted, i, j, shares, norm)
        if not pairs:
            unit = parameter_unit(names[0])
            _scatter(panels[0], fitted.designs.values[:, 0] * unit.factor, shares, fitted, shares, norm)
            panels[0].set_yscale("log")
            style.log_labels(panels[0].yaxis)
            panels[0].set(xlabel=unit.axis, ylabel="worst miss (% of the design's range)")
        place = {"ax": figure.axes, "pad": 0.015, "fraction": 0.03, "aspect": 40}
        label = "worst miss when left out (% of range)"
        style.log_labels(style.colour_bar(figure, (norm, style.error_map()), label, **place).yaxis)
        look, inner = {"mfc": style.FAINT, "mec": style.INK}, int((~fitted.border).sum())
        handles = [
            style.entry(f"inside the range ({inner})", "o", ms=7, **look),
            style.entry(f"on its border ({int(fitted.border.sum())})", "s", ms=6.5, **look),
        ]
        if fitted.proposals:
            star = {"color": style.SERIES[0], "mec": "white", "ms": 14}
            handles.append(style.entry("solve next, in order", "*", **star))
        style.key_below(figure, handles)
        return style.png(figure)


def _pair(axes: Any, fitted: MetaFitted, i: int, j: int, shares: Any, norm: LogNorm) -> None:
    units = [parameter_unit(fitted.designs.names[k]) for k in (i, j)]
    x, y = (fitted.designs.values[:, k] * unit.factor for k, unit in zip((i, j), units, strict=True))
    dx, dy = _apart(x, y)
    _scatter(axes, x + dx * np.ptp(x), y + dy * np.ptp(y), fitted, shares, norm)
    for number, proposal in enumerate(fitted.proposals, start=1):
        place = proposal.values[i] * units[0].factor, proposal.values[j] * units[1].factor
        axes.plot(*place, "*", ms=14, mfc=style.SERIES[0], mec="white", mew=0.9, zorder=6)
        look = {"fontsize": 9.5, "weight": "bold", "color": style.SERIES[0], "zorder": 7}
        style.note(axes, str(number), place, (8, 5), **look)
    axes.margins(0.1)
    axes.set(xlabel=units[0].axis, ylabel=units[1].axis)


def _scatter(axes: Any, x: Any, y: Any, fitted: MetaFitted, shares: Any, norm: LogNorm) -> None:
    for marker, chosen, size in (("o", ~fitted.border, 62), ("s", fitted.border, 46)):
        axes.scatter(
            x[chosen], y[chosen], size, c=shares[chosen], cmap=style.error_map(), norm=norm, marker=marker,
            edgecolor=style.INK, linewidths=0.5, zorder=3,
        )  # fmt: skip


def _apart(x: Any, y: Any) -> tuple[Any, Any]:
    """Small shifts, shares of the ranges, so that designs with the same pair of values do not hide each other."""
    _, place = np.unique(np.round(np.stack([x, y], axis=1), 9), axis=0, return_inverse=True)
    place = place.ravel()
    dx, dy = np.zeros(len(x)), np.zeros(len(x))
    for value in range(int(place.max()) + 1):
        rows = np.flatnonzero(place == value)
        side = int(np.ceil(np.sqrt(len(rows))))
        k = np.arange(len(rows))
        if len(rows) > 1:
            dx[rows] = SPREAD * (k % side - (side - 1) / 2)
            dy[rows] = SPREAD * 1.6 * (k // side - (side - 1) / 2)
    return dx, dy
