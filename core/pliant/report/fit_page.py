"""The page of fitted laws: each law with its band, its errors and where they are, learning, slopes and cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import binom

from pliant.formatting import actuation_unit, deformation_unit, number, percent
from pliant.mechanics.one_input import first_input_law
from pliant.pipeline.residuals import Residuals
from pliant.pipeline.run_folder import DesignResult, FinishedRun
from pliant.records.design import Array
from pliant.records.law import FitReport
from pliant.report.chart import (
    Band,
    Chart,
    ChartAxis,
    ChartBars,
    ChartCells,
    ChartLine,
    ChartNote,
    Mark,
    Panel,
)
from pliant.report.chart_colours import (
    ERROR_COLOURS,
    INK,
    LEVEL_COLOURS,
    MARKERS,
    PAPER,
    SERIES,
    SOFT,
    ColourScale,
)
from pliant.report.document import Drawn, Picture, Section, drawn, numbered, page_table, section
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
from pliant.report.fit_view import BandCoverage, ReportedLaw, slope_grid, slope_unit
from pliant.report.law_charts import actuation_axis, coordinate_axis, law_chart
from pliant.report.learning_chart import learning_chart, state_curves
from pliant.report.provenance import Manifests, closing_sections

MARK = 1e-4  # of the range: the mark in the learning curve


def fit_drawn(
    fitted: Sequence[ReportedLaw],
    compared: Sequence[ReportedLaw],
    study: Mapping[str, Any],
    manifests: Manifests,
    several: bool,
) -> Drawn:
    """Return a page of the first law, then all of `fitted`, named if `several`, and those `compared` together."""
    if len(fitted[0].law.actuations) > 1:  # pictures are over one actuation: the first, the others at zero
        design = DesignResult(fitted[0].name, None, first_input_law(fitted[0].law), None, None)
        plain = FinishedRun({}, {}, (), (), ())
        caption = f"The law under {design.law.actuation_name} alone, the other inputs at zero."
        return drawn(
            Picture("fit_law", caption, law_chart(plain, design)), *closing_sections(study, manifests)
        )
    hero, *others = law_pictures(fitted[0])
    sections = [section("The law about the other axes", *others), comparison_section(compared)]
    for count, one in enumerate(fitted):
        prefix = f"{one.name}: " if several else ""
        own = section("the law", *law_pictures(one, count)) if count else None
        every = (own, *law_sections(one, count))
        sections += [replace(s, title=f"{prefix}{s.title}") for s in every if s is not None]
    return drawn(hero, *sections, *closing_sections(study, manifests))


def law_pictures(fitted: ReportedLaw, count: int = 0) -> list[Picture]:
    """Return the law with its band and states, one picture for each axis."""
    pictures = []
    for k, axis in enumerate(fitted.explored):
        form = {key: value for key, value in fitted.axis_details(axis).items() if key == "study_form"}
        scale = float(fitted.misses.ranges[fitted.law.axes.index(axis)])
        report = FitReport(fitted.report.n_fitted, fitted.report.n_heldout, 0.0, 0.0, 0.0, 0.0, scale, form)
        design = DesignResult(fitted.name, fitted.data.axis(axis), fitted.law, report, fitted.data)
        name = numbered("fit_law" if k == 0 else f"fit_law_{axis}", count)
        plain = FinishedRun({}, {}, (), (), ())
        pictures.append(Picture(name, _law_caption(fitted, axis), law_chart(plain, design)))
    return pictures


def _law_caption(fitted: ReportedLaw, axis: str) -> str:
    about = f"Axis {axis}, the others at zero on the curves. " if len(fitted.law.axes) > 1 else ""
    band = (
        "Shaded: the band that holds a state with a probability of 90 %, often thinner than the line; the same band "
        "stands as bars at the states left out. "
        if fitted.law.states_error
        else "This law states no error bar. "
    )
    form = fitted.axis_details(axis).get("study_form")
    below = " Below: the published form on the same states." if form else ""
    what = "force" if fitted.law.joint == "prismatic" else "moment"
    return (
        f"{about}τ is the external {what} that opposes actuation. {band}Right: law minus state; filled = fitted, open "
        f"= left out.{below}"
    )


def law_sections(fitted: ReportedLaw, count: int = 0) -> tuple[Section | None, ...]:
    """Return all sections of one law: errors, their places, error bars, learning, slopes, cost."""
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
    places = Picture(numbered("fit_map", count), caption, residual_chart(fitted))
    return (
        errors,
        section("Where the law misses", places, open=True),
        bar_section(fitted, count),
        _learning(fitted, count),
        _slopes(fitted, count),
        section("Cost", cost_table(fitted)),
    )


def bar_section(fitted: ReportedLaw, count: int = 0) -> Section | None:
    """Return the section on the coverage of the error bars; None for a law without them."""
    curves = fitted.coverage
    if not curves:
        return None
    caption = (
        "Left: share of the states left out inside bands of each stated level; calibrated bars follow "
        "the diagonal within the scatter of so few states (grey). Right: each state's miss against the half-width of "
        "its own band."
    )
    shown = Picture(numbered("fit_bars", count), caption, coverage_chart(curves))
    return section("Are the error bars calibrated?", shown, coverage_table(curves))


def _learning(fitted: ReportedLaw, count: int = 0) -> Section | None:
    """Return error against the number of states; None if not requested or if nothing could be fitted."""
    learning = fitted.learning
    if learning is None or not learning["points"]:
        return None
    caption = (
        "The surrogate fitted again to nested subsets of the states, with exact slopes and with values alone, and "
        f"scored on the same {learning['n_check']} check states."
    )
    curves = state_curves(learning)
    error = ChartAxis("error on check states", "% of the effort's range", log=True)
    made = learning_chart("Error by number of states", curves, "states fitted", error, MARK)
    shown = Picture(numbered("fit_learning", count), caption, made)
    return section("How many states it takes", shown, learning_table(learning))


def _slopes(fitted: ReportedLaw, count: int = 0) -> Section | None:
    """Return ∂τ/∂u over the box."""
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
    made = Picture(numbered("fit_slopes", count), caption, slope_chart(fitted))
    return section("Slopes: where the joint is soft", made, text=verdict)


def comparison_section(fitted: Sequence[ReportedLaw]) -> Section | None:
    """Return several surrogates on the same states; None for one."""
    if len(fitted) < 2:
        return None
    title, caption = (
        "Surrogates side by side",
        "The same states for all; shorter bars are better for errors and times, longer ones for evaluations.",
    )
    made = Picture("fit_surrogates", caption, surrogates_chart(fitted))
    return section(title, made, page_table(title, SURROGATES, fitted))


LOWEST = 1e-8  # share of the range below which errors are rounding
CHANCE = 0.9
MANY = 400
FEWEST = 10  # fewer states do not give a separate curve


def residual_chart(fitted: ReportedLaw) -> Chart:
    """Return one row for each axis, one column for the law and for each published form."""
    beside = {
        title.replace("the published form, ", "published form, "): m
        for title, m in fitted.study_misses.items()
    }
    columns = {"this law": fitted.misses, **beside}
    scale = _error_scale(list(columns.values()))
    panels = [
        _residual_panel(fitted, missed, name, title if beside or len(fitted.explored) == 1 else "", scale)
        for name in fitted.explored
        for title, missed in columns.items()
    ]
    across = len(columns) if beside else len(fitted.explored)
    return Chart(tuple(panels), across=across, cell=(1560 // across if across > 1 else 940, 500))


def _residual_panel(
    fitted: ReportedLaw, missed: Residuals, name: str, title: str, scale: ColourScale
) -> Panel:
    data, k = fitted.data, missed.axes.index(name)
    part = missed.rows(missed.axis == k)
    x = data.deformation[part.state, data.axes.index(name)] * deformation_unit(data, name).factor
    y = data.actuation[part.state] * actuation_unit(data.actuation_name).factor
    share = 100 * np.maximum(part.share, LOWEST)
    groups = (
        ("fitted", ~part.check & ~part.together, "o", 6.3),
        ("left out", part.check & ~part.together, "D", 7.9),
        ("fitted, all axes held", ~part.check & part.together, "s", 6.3),
        ("left out, all axes held", part.check & part.together, "P", 9.5),
    )
    marks = tuple(
        ChartLine(f"{label} ({count})", x[rows], y[rows], "", SOFT, 0.0, size, marker, values=share[rows])
        for label, rows, marker, size in groups
        if (count := len(np.unique(part.state[rows])))
    )
    worst = part.rows(part.check).worst
    worst_of = f"worst {percent(worst)} left out" if np.isfinite(worst) else f"worst {percent(part.worst)}"
    words = [f"axis {name}" if len(data.axes) > 1 else "", title]
    text = f"{', '.join(word for word in words if word)}: {worst_of}"
    return Panel(
        coordinate_axis(data, name), actuation_axis(data), marks, text[0].upper() + text[1:], scale=scale
    )


def _error_scale(columns: Sequence[Residuals]) -> ColourScale:
    """Return whole decades around all errors that are drawn."""
    shares = np.concatenate([m.share for m in columns])
    shares = 100 * np.maximum(shares[np.isfinite(shares)], LOWEST)
    low = float(np.quantile(shares, 0.15)) if len(shares) else 1e-3
    ends = (low, float(shares.max(initial=low)))
    return ColourScale.decades("|law − state|", "% of the effort's range", ends, ERROR_COLOURS)


def coverage_chart(curves: Sequence[BandCoverage], what: str = "states left out") -> Chart:
    """Return coverage by level with the range of chance (left), and miss against band at 90 % (right)."""
    return Chart((_coverage_panel(curves, what), _widths_panel(curves)), cell=(780, 600))


def _coverage_panel(curves: Sequence[BandCoverage], what: str) -> Panel:
    n, stated = curves[0].n, np.linspace(0.4, 0.9999, 3000)
    low, high = (100 * count / n for count in binom.interval(CHANCE, n, stated))
    diagonal = np.array([40.0, 100.0])
    chance = f"90 % region of calibrated bars ({n})"
    marks: list[Mark] = [
        Band(chance, 100 * stated, low, high, colour="#e7e9ed"),
        ChartLine("as stated", diagonal, diagonal, "", SOFT, 1.1),
    ]
    shown = [(k, curve) for k, curve in enumerate(curves) if k == 0 or curve.n >= FEWEST]
    for k, curve in shown:
        colour, marker = _look(k)
        name = f"{curve.label} ({curve.n})"
        marks.append(ChartLine(name, 100 * curve.levels, 100 * curve.covered, "", colour, 1.6, 6.0, marker))
    lowest = min(float(curve.covered.min()) for _, curve in shown)
    y = ChartAxis(f"{what} inside it", "%", ends=(min(40.0, 100 * lowest - 5), 103.0))
    x = ChartAxis("stated level of the band", "%", ends=(45.0, 101.0))
    return Panel(x, y, tuple(marks), "What the bars state and what they hold")


def _widths_panel(curves: Sequence[BandCoverage]) -> Panel:
    curves = curves[1:] or curves
    first = 1 if len(curves) > 1 else 0
    pairs = [[100 * np.maximum(v, LOWEST) for v in (c.half_width, c.missed)] for c in curves]
    half, missed = (np.concatenate(values) for values in zip(*pairs, strict=True))
    across = np.geomspace(half.min() / 1.8, half.max() * 1.8, 50)
    low, high = min(missed.min(), half.min()) / 1.8, max(missed.max(), half.max()) * 1.8
    marks: list[Mark] = [
        Band("inside its band", across, np.full(len(across), low), across, colour="#e8f5f1"),
        ChartLine("inside its band", across, across, "", SOFT, 1.1),
    ]
    for k, (curve, pair) in enumerate(zip(curves, pairs, strict=True), start=first):
        colour, marker = _look(k)
        name, dot = f"{curve.label} ({curve.n})", 2.5 if curve.n > MANY else 5.5
        marks.append(ChartLine(name, pair[0], pair[1], "", colour, 0.0, dot, marker))
    outside, count = sum(int(np.sum(c.missed > c.half_width)) for c in curves), sum(c.n for c in curves)
    unit, ends = "% of the effort's range", (float(across[0]), float(across[-1]))
    x = ChartAxis("half-width of the 90 % band", unit, ends=ends, log=True)
    y = ChartAxis("miss", unit, ends=(float(low), float(high)), log=True)
    return Panel(x, y, tuple(marks), f"Each band and its miss: {outside} of {count} outside")


def _look(number: int) -> tuple[str, str]:
    """Return colour and marker; the curve of all states is black."""
    return (INK, "o") if number == 0 else (SERIES[(number - 1) % 6], MARKERS[number % 6])


def slope_chart(fitted: ReportedLaw) -> Chart:
    """Return ∂τ/∂u over the law's box, one panel for each explored axis; the ring marks the softest place."""
    panels = tuple(_slope_panel(fitted, name) for name in fitted.explored)
    return Chart(panels, cell=(1000 if len(panels) == 1 else 1560 // len(panels), 600), legend=())


def _slope_panel(fitted: ReportedLaw, name: str) -> Panel:
    law, data = fitted.law, fitted.data
    unit = slope_unit(law, name)
    p, u, slopes = slope_grid(law, name)
    x, y = u * deformation_unit(law, name).factor, p * actuation_unit(law.actuation_name).factor
    shown = unit.factor * slopes
    i, j = np.unravel_index(int(np.argmax(shown)), shown.shape)
    at = x[j : j + 1], y[i : i + 1]
    ring = (
        ChartLine("softest", *at, "", PAPER, 0.0, 11.0),
        ChartLine("softest", *at, "", INK, 0.0, 9.0, hollow=True),
    )
    word = "softest" if shown.max() < 0 else "UNSTABLE"
    text = f"axis {name}: {word}" if len(fitted.explored) > 1 else word
    title = f"{text[0].upper()}{text[1:]} {number(float(shown.max()), 3)} {unit.symbol}"
    scale = ColourScale.even("∂τ/∂u", unit.symbol, _ends(shown), LEVEL_COLOURS[::-1])
    marks = (ChartCells("∂τ/∂u", _edges(x), _edges(y), shown), *ring)
    return Panel(coordinate_axis(data, name), actuation_axis(data), marks, title, scale=scale)


FLAT = 0.02  # of the largest slope: a smaller variation across the box is shown as one colour


def _ends(shown: Array) -> tuple[float, float]:
    """Return the ends of the colours; for an almost constant slope, a range around it."""
    low, high = float(shown.min()), float(shown.max())
    room = max(FLAT * max(abs(low), abs(high)) - (high - low), 0.0) / 2
    return low - room, high + room


def _edges(middles: Array) -> Array:
    """Return the edges of cells around these middles, the first and last at the ends of the range."""
    between = (middles[1:] + middles[:-1]) / 2
    return np.concatenate([middles[:1], between, middles[-1:]])


def surrogates_chart(fitted: Sequence[ReportedLaw]) -> Chart:
    """Return bars of error, time and speed of several surrogates on logarithmic scales."""
    names = ChartAxis("surrogate", names=tuple(one.name for one in fitted))
    worst = [100 * f.report.worst_of_range for f in fitted]
    kinds = (
        ("Worst error on states left out", "error", "% of the effort's range", worst),
        ("Time of the fit", "time", "s", [f.wall_s for f in fitted]),
        ("Evaluations with slopes", "evaluations", "million a second", [f.per_second / 1e6 for f in fitted]),
    )
    panels = []
    for title, label, unit, found in kinds:
        values = np.maximum(found, LOWEST)
        low = float(10.0 ** np.floor(np.log10(values.min() / 2)))
        marks: list[Mark] = []
        for k, (one, value) in enumerate(zip(fitted, values.tolist(), strict=True)):
            at = np.array([float(k)])
            marks.append(ChartBars(one.name, at, np.array([low]), np.array([value]), "", SERIES[k % 6]))
            marks.append(ChartNote(number(value, 3), value, k))
        ends = (low, float(values.max() * (values.max() / low) ** 0.25))
        panels.append(Panel(ChartAxis(label, unit, ends=ends, log=True), names, tuple(marks), title))
    return Chart(tuple(panels), cell=(520, 170 + 70 * len(fitted)), legend=())
