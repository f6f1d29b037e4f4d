"""The page of fitted laws: each law with its band, its errors, their places, learning, slopes and cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.ticker import MaxNLocator

from pliant.formatting import actuation_unit, deformation_unit, number, percent
from pliant.mechanics.one_input import of_one_input
from pliant.pipeline.residuals import Residuals
from pliant.records.design import Array
from pliant.records.law import FitReport
from pliant.report.charts import law_chart
from pliant.report.document import Drawn, Picture, Section, drawn, numbered, page_table, section
from pliant.report.figures import style
from pliant.report.figures.error_bars import coverage_picture
from pliant.report.figures.fem import actuation_words, coordinate_words
from pliant.report.figures.law import law_picture
from pliant.report.figures.learning import learning_picture, state_curves
from pliant.report.fit_tables import (
    SURROGATES,
    axes_table,
    choice_table,
    cost_table,
    coverage_table,
    errors_table,
    learning_table,
    settings_table,
)
from pliant.report.fit_view import ReportedLaw, slope_grid, slope_unit
from pliant.report.folder import DesignResult, FinishedRun
from pliant.report.provenance import Manifests, closing_sections

MARK = 1e-4  # of the range: what the learning curve marks


def fit_drawn(
    fitted: Sequence[ReportedLaw],
    compared: Sequence[ReportedLaw],
    study: Mapping[str, Any],
    manifests: Manifests,
    several: bool,
) -> Drawn:
    """The first law on top; then all of `fitted`, named where they are `several`, those `compared` side by side."""
    if len(fitted[0].law.actuations) > 1:  # pictures are over one actuation: the first, the others at zero
        design = DesignResult(fitted[0].name, None, of_one_input(fitted[0].law), None, None)
        plain = FinishedRun({}, {}, (), (), ())
        made, chart = law_picture(plain, design), law_chart(plain, design)
        caption = f"The law under {design.law.actuation_name} alone, the other inputs at zero."
        return drawn(Picture("fit_law", caption, made, chart), *closing_sections(study, manifests))
    hero, *others = law_pictures(fitted[0])
    sections = [section("The law about the other axes", *others), comparison_section(compared)]
    for count, one in enumerate(fitted):
        prefix = f"{one.name}: " if several else ""
        own = section("the law", *law_pictures(one, count)) if count else None
        every = (own, *of_one(one, count))
        sections += [replace(s, title=f"{prefix}{s.title}") for s in every if s is not None]
    return drawn(hero, *sections, *closing_sections(study, manifests))


def law_pictures(fitted: ReportedLaw, count: int = 0) -> list[Picture]:
    """The law with its band and states, one picture for each axis."""
    pictures = []
    for k, axis in enumerate(fitted.explored):
        form = {key: value for key, value in fitted.axis_details(axis).items() if key == "study_form"}
        scale = float(fitted.misses.ranges[fitted.law.axes.index(axis)])
        report = FitReport(fitted.report.n_fitted, fitted.report.n_heldout, 0.0, 0.0, 0.0, 0.0, scale, form)
        design = DesignResult(fitted.name, fitted.data.axis(axis), fitted.law, report, fitted.data)
        name = numbered("fit_law" if k == 0 else f"fit_law_{axis}", count)
        plain = FinishedRun({}, {}, (), (), ())
        made, chart = law_picture(plain, design), law_chart(plain, design)
        pictures.append(Picture(name, _law_caption(fitted, axis), made, chart))
    return pictures


def _law_caption(fitted: ReportedLaw, axis: str) -> str:
    about = f"Axis {axis}, the others at zero on the curves. " if len(fitted.law.axes) > 1 else ""
    band = (
        "Shaded: the band that holds a state with a probability of 90 %, often thinner than the line; the same band "
        "stands as bars at the states left out. "
        if fitted.law.error is not None
        else "This law states no error bar. "
    )
    form = fitted.axis_details(axis).get("study_form")
    below = " Below: the study's form on the same states." if form else ""
    what = "force" if fitted.law.joint == "prismatic" else "moment"
    return (
        f"{about}τ is the external {what} that opposes actuation. {band}Right: law minus state; filled = fitted, open "
        f"= left out.{below}"
    )


def of_one(fitted: ReportedLaw, count: int = 0) -> tuple[Section | None, ...]:
    """All sections of one law: errors, their places, error bars, learning, slopes, cost."""
    each = fitted.explored if isinstance(fitted.report.details.get("axes"), dict) else fitted.explored[:1]
    errors = section(
        "Errors, and what the fit chose",
        errors_table(fitted),
        axes_table(fitted.data, fitted.law, fitted.ranges),
        *(choice_table(fitted, axis) for axis in each),
        settings_table(fitted),
    )
    caption = (
        "Each state by its error, a share of the range of its axis' effort, all panels on one logarithmic scale of "
        "colours."
    )
    if fitted.study_misses:
        caption += " Beside the law: the form of the published study, fitted to the same states."
    places = Picture(numbered("fit_map", count), caption, residual_map(fitted))
    return (
        errors,
        section("Where the law misses", places, open=True),
        bar_section(fitted, count),
        _learning(fitted, count),
        _slopes(fitted, count),
        section("Cost", cost_table(fitted)),
    )


def bar_section(fitted: ReportedLaw, count: int = 0) -> Section | None:
    """Whether the error bars hold; None for a law without them."""
    curves = fitted.coverage
    if not curves:
        return None
    caption = (
        "Left: share of the states left out inside bands of each stated level; honest bars follow the diagonal within "
        "what chance does with so few states (grey). Right: each state's miss against the half-width of its own band."
    )
    shown = Picture(numbered("fit_bars", count), caption, coverage_picture(curves))
    return section("Are the error bars honest?", shown, coverage_table(curves))


def _learning(fitted: ReportedLaw, count: int = 0) -> Section | None:
    """Error against the number of states; None where it was not asked for or nothing could be fitted."""
    learning = fitted.learning
    if learning is None or not learning["points"]:
        return None
    caption = (
        "The surrogate fitted again to nested subsets of the states, with exact slopes and with values alone, and "
        f"scored on the same {learning['n_check']} check states."
    )
    curves = {"Error by number of states": state_curves(learning)}
    made = learning_picture(curves, "states fitted", "error on check states (% of the effort's range)", MARK)
    shown = Picture(numbered("fit_learning", count), caption, made)
    return section("How many states it takes", shown, learning_table(learning))


def _slopes(fitted: ReportedLaw, count: int = 0) -> Section | None:
    """∂τ/∂u over the box."""
    several, largest = len(fitted.law.axes) > 1, fitted.least_stable
    shown = slope_unit(fitted.law).text(largest, 3)
    verdict = (
        f"Stable over the whole box: the largest ∂τ/∂u is {shown}, below zero."
        if largest < 0
        else f"UNSTABLE somewhere in the box: ∂τ/∂u reaches {shown}, and a joint may snap there."
    )
    if several:
        verdict += " It is the largest eigenvalue of the symmetric part, over random places of the box."
    caption = "∂τ/∂u over the law's box; the ring marks where the joint is softest."
    caption += " Each axis with the others at zero." if several else ""
    made = Picture(numbered("fit_slopes", count), caption, slope_map(fitted))
    return section("Slopes: where the joint is soft", made, text=verdict)


def comparison_section(fitted: Sequence[ReportedLaw]) -> Section | None:
    """Several surrogates on the same states; None for one."""
    if len(fitted) < 2:
        return None
    title, caption = (
        "Surrogates side by side",
        "The same states for all; shorter bars are better for errors and times, longer ones for evaluations.",
    )
    made = Picture("fit_surrogates", caption, surrogate_bars(fitted))
    return section(title, made, page_table(title, SURROGATES, fitted))


LOWEST = 1e-8  # share of the range below which errors are drawn alike
HEIGHT = 470


def residual_map(fitted: ReportedLaw) -> style.Png:
    """One row for each axis, one column for the law and for each of the study's forms."""
    beside = {
        title.replace("the study's form, ", "study's form, "): m for title, m in fitted.study_misses.items()
    }
    columns = {"this law": fitted.misses, **beside}
    names = fitted.explored
    norm = _norm(columns)
    cells = [(name, title) for name in names for title in columns]
    # Panels of one law stand side by side, those of several laws in a row for each axis.
    across = len(columns) if len(columns) > 1 else len(names)
    down = len(cells) // across
    with style.canvas(1560 if across > 1 else 940, HEIGHT * down + 130, wspace=0.03) as figure:
        grid = figure.subplots(
            down, across, squeeze=False, sharex="row" if len(columns) > 1 else False, sharey=True
        )
        for place, (name, title) in zip(grid.ravel(), cells, strict=True):
            shown = title if len(columns) > 1 or len(names) == 1 else ""
            _map_panel(place, fitted, columns[title], name, shown, norm)
        for place in grid[:, 1:].ravel():
            place.set_ylabel("")
        where = {"ax": grid.ravel().tolist(), "pad": 0.015, "fraction": 0.03, "aspect": 45}
        label = "|law − state|, % of the effort's range"
        bar = style.colour_bar(figure, (norm, style.error_map()), label, **where)
        bar.yaxis.set_major_formatter(lambda value, _: number(float(value), 1))
        style.key_below(figure, _legend(fitted.misses))
        return style.png(figure)


def _map_panel(
    axes: Any, fitted: ReportedLaw, missed: Residuals, name: str, title: str, norm: LogNorm
) -> None:
    data, k = fitted.data, missed.axes.index(name)
    part = missed.rows(missed.axis == k)
    p_unit, u_unit = actuation_unit(data.actuation_name), deformation_unit(data, name)
    x = data.deformation[part.state, data.axes.index(name)] * u_unit.factor
    y = data.actuation[part.state] * p_unit.factor
    share = 100 * np.maximum(part.share, LOWEST)
    looks = (
        (~part.check & ~part.together, "o", 40),
        (~part.check & part.together, "s", 40),
        (part.check & ~part.together, "D", 62),
        (part.check & part.together, "P", 90),
    )
    for chosen, marker, size in looks:
        axes.scatter(
            x[chosen], y[chosen], size, c=share[chosen], cmap=style.error_map(), norm=norm, marker=marker,
            edgecolor=style.INK, linewidths=[1.1 if marker in "DP" else 0.4], zorder=4 if marker in "DP" else 3,
        )  # fmt: skip
    axes.margins(0.07)
    axes.set(xlabel=coordinate_words(data, name), ylabel=actuation_words(data))
    style.with_math(axes)
    worst = part.rows(part.check).worst
    says = f"worst {percent(worst)} left out" if np.isfinite(worst) else f"worst {percent(part.worst)}"
    words = [f"axis {name}" if len(data.axes) > 1 else "", title]
    text = f"{', '.join(word for word in words if word)}:{' ' if len(fitted.study_misses) < 2 else chr(10)}{says}"
    axes.set_title(text[0].upper() + text[1:], fontsize=9)


def _norm(columns: Mapping[str, Residuals]) -> LogNorm:
    """Whole decades around all errors that are drawn."""
    shares = np.concatenate([m.share for m in columns.values()])
    shares = 100 * np.maximum(shares[np.isfinite(shares)], LOWEST)
    low = float(np.quantile(shares, 0.15)) if len(shares) else 1e-3
    return style.decades(low, float(shares.max(initial=low)))


def _legend(missed: Residuals) -> list[Any]:
    groups = (
        ("fitted", "o", ~missed.check & ~missed.together),
        ("left out", "D", missed.check & ~missed.together),
        ("fitted, all axes held", "s", ~missed.check & missed.together),
        ("left out, all axes held", "P", missed.check & missed.together),
    )
    return [
        style.entry(f"{label} ({count})", marker, mfc=style.FAINT, mec=style.INK, ms=6)
        for label, marker, chosen in groups
        if (count := len(np.unique(missed.state[chosen])))
    ]


LEVELS = 14
FLAT = 0.02  # of the largest slope: less than that across the box is shown as one colour


def slope_map(fitted: ReportedLaw) -> style.Png:
    """One panel for each axis that was explored."""
    law, data, names = fitted.law, fitted.data, fitted.explored
    p_unit = actuation_unit(law.actuation_name)
    with style.canvas(1000 if len(names) == 1 else 1560, 600, wspace=0.03) as figure:
        grid = figure.subplots(1, len(names), squeeze=False)[0]
        for axes, name in zip(grid, names, strict=True):
            u_unit, unit = deformation_unit(law, name), slope_unit(law, name)
            p, u, slopes = slope_grid(law, name)
            x, y, shown = u * u_unit.factor, p * p_unit.factor, unit.factor * slopes
            mesh = axes.contourf(x, y, shown, _levels(shown), cmap=style.pressure_map().reversed())
            if shown.max() >= 0 > shown.min():
                axes.contour(x, y, shown, [0.0], colors=style.WARN, linewidths=2)
            i, j = np.unravel_index(int(np.argmax(shown)), shown.shape)
            for colour, width, order in (("white", 2.6, 5), (style.INK, 1.3, 6)):
                ring = {"mfc": "none", "mec": colour, "mew": width, "clip_on": False, "zorder": order}
                axes.plot([x[j]], [y[i]], "o", ms=9, **ring)
            label = rf"$\partial\tau/\partial u$ ({unit.symbol})"
            bar = style.colour_bar(figure, mesh, label, ax=axes, pad=0.02)
            style.with_math(bar)
            bar.yaxis.set_major_formatter(lambda value, _: number(float(value), 4))
            axes.grid(False)
            axes.set(xlabel=coordinate_words(data, name), ylabel=actuation_words(data))
            style.with_math(axes)
            word = "softest" if shown.max() < 0 else "UNSTABLE"
            text = f"axis {name}: {word}" if len(names) > 1 else word
            largest = number(float(shown.max()), 3)
            axes.set_title(f"{text[0].upper()}{text[1:]} {largest} {unit.symbol}")
        return style.png(figure)


def _levels(shown: Array) -> Array:
    """Round contours over the slopes; around a slope that hardly varies, a range of its own size."""
    low, high = float(shown.min()), float(shown.max())
    room = max(FLAT * max(abs(low), abs(high)) - (high - low), 0.0) / 2 + np.finfo(float).tiny
    return np.asarray(MaxNLocator(LEVELS).tick_values(low - room, high + room))


SMALLEST = 1e-8


def surrogate_bars(fitted: Sequence[ReportedLaw]) -> style.Png:
    """Three panels of horizontal bars on log scales, the first surrogate at the top."""
    worst = [100 * f.report.worst_of_range for f in fitted]
    panels = (
        ("Worst error on states left out", "% of the effort's range", worst),
        ("Time of the fit", "s", [f.wall_s for f in fitted]),
        ("Evaluations with slopes", "million a second", [f.per_second / 1e6 for f in fitted]),
    )
    rows = np.arange(len(fitted))
    colours = [style.SERIES[k % len(style.SERIES)] for k in rows]
    with style.canvas(1560, 170 + 70 * len(fitted), wspace=0.04) as figure:
        grid = figure.subplots(1, 3, sharey=True)
        for axes, (title, unit, found) in zip(grid, panels, strict=True):
            values = np.maximum(found, SMALLEST)
            low = 10.0 ** np.floor(np.log10(values.min() / 2))
            axes.barh(rows, values - low, left=low, height=0.6, color=colours, zorder=3)
            axes.set(xscale="log", xlim=(low, values.max() * (values.max() / low) ** 0.25))
            axes.set_yticks(rows, [one.name for one in fitted])
            axes.grid(axis="y", visible=False)
            style.log_labels(axes.xaxis)
            for row, value in zip(rows, values, strict=True):
                style.note(axes, number(float(value), 3), (value, row), (4, 0), va="center")
            axes.set(title=title, xlabel=unit)
        grid[0].invert_yaxis()
        return style.png(figure)
