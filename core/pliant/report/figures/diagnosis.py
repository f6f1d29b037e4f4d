"""Pictures of a diagnosis, still and moving: how probable each hypothesis is, what it changes, where the error is."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pliant.diagnosis.evidence_table import NOTHING, UNKNOWN, Kinds
from pliant.diagnosis.verdict import named
from pliant.evidence.covariates import Covariate
from pliant.evidence.prediction import RunReadings
from pliant.formatting import NamedUnit, unit_of, whole_percent
from pliant.measurements.repeats import RepeatGroup, aligned, repeat_groups
from pliant.records.design import Array
from pliant.report.chart import Band, Chart, ChartAxis, ChartLine, Panel
from pliant.report.evidence_view import (
    Compared,
    Diagnosed,
    abscissa,
    clock,
    clock_words,
    fitting,
    input_of,
    thin,
)
from pliant.report.figures import style
from pliant.report.figures.charts import level_line
from pliant.report.fitted import probability_text

FIRST, OTHER = style.SERIES[0], "#9fb3c8"
WIDE = 36  # characters of a name on one line


def hypotheses(diagnosed: Diagnosed) -> style.Png:
    """Bars of probability; beside them the left-out error as dots, and the noise floor as a line, if it is known."""
    shown = diagnosed.hypotheses()
    credible = set(diagnosed.found.judgement.credible)
    colours = [FIRST if kinds in credible else OTHER for kinds in shown]
    errors = np.array([diagnosed.left_out_error(kinds) for kinds in shown])
    with style.canvas(1500, 66 * len(shown) + 190, pad=(0.08, 0.05)) as figure:
        known = bool(np.isfinite(errors).any())
        panels = figure.subplots(1, 2 if known else 1, sharey=True, squeeze=False)[0]
        left = panels[0]
        shares = [100 * diagnosed.found.judgement.probability.get(kinds, 0.0) for kinds in shown]
        left.barh(range(len(shown)), shares, color=colours, height=0.62)
        for row, share in enumerate(shares):
            text = probability_text(share / 100) if share >= 0.05 else "0 %"
            style.note(left, text, (share, row), (4, 0), va="center")
        left.set(xlim=(0, 118), xlabel="probability (%)", title="How probable, given these data")
        left.set_xticks([0, 25, 50, 75, 100])
        if known:
            _left_out(panels[1], shown, errors, colours)
        left.set_yticks(range(len(shown)), [name_of(kinds) for kinds in shown])
        left.set_ylim(len(shown) - 0.4, -0.95)
        for panel in panels:
            panel.grid(axis="y", visible=False)
            panel.tick_params(axis="y", length=0)
        return style.png(figure)


def name_of(kinds: Kinds) -> str:
    """A hypothesis in words, on two lines where it is long."""
    if kinds == NOTHING:
        return "nothing missing (model as it is)"
    text, middle = named(kinds), (len(kinds) + 1) // 2
    return text if len(text) <= WIDE else f"{named(kinds[:middle])} +\n{named(kinds[middle:])}"


def _left_out(panel: Any, shown: list[Kinds], values: Array, colours: list[str]) -> None:
    panel.axvline(1.0, color=style.WARN, lw=1.6)
    place = {"xycoords": ("data", "axes fraction"), "color": style.WARN, "va": "top"}
    style.note(panel, "noise floor", (1.0, 1.0), (3, -3), **place)
    for row, (kinds, value) in enumerate(zip(shown, values, strict=True)):
        if np.isfinite(value):
            panel.plot([0, value], [row, row], color=style.FAINT, lw=1.2, zorder=1)
            panel.plot([value], [row], ls="", marker="o", ms=8, color=colours[row])
            style.note(panel, f"{value:.2f}", (value, row), (8, 0), va="center")
        else:
            text = "any form: reaches the floor" if kinds == UNKNOWN else "not known"
            style.note(panel, text, (1.0, row), (8, 0), va="center", color=style.SOFT)
    panel.set_xlim(0, 1.2 * max(float(np.nanmax(values)), 1.6))
    panel.set_xlabel("rms error on runs left out of the fit, in noise floors")
    panel.set_title("How much error it leaves")


def hypotheses_chart(diagnosed: Diagnosed) -> Chart:
    """Bars of probability, and of the rms error on runs left out over the noise floor where it is known."""
    shown = diagnosed.hypotheses()
    names = tuple(name_of(kinds).replace("\n", " ") for kinds in shown)
    credible = set(diagnosed.found.judgement.credible)
    y, ends = ChartAxis("explanation", names=names), (-len(shown) + 0.4, 0.6)
    shares = [100 * diagnosed.found.judgement.probability.get(kinds, 0.0) for kinds in shown]
    errors = [diagnosed.left_out_error(kinds) for kinds in shown]

    def bars(values: list[float]) -> tuple[ChartLine, ...]:
        return tuple(
            ChartLine(
                name,
                np.array([0.0, v]),
                np.full(2, -float(k)),
                "",
                FIRST if kinds in credible else OTHER,
                7.0,
            )
            for k, (name, kinds, v) in enumerate(zip(names, shown, values, strict=True))
            if np.isfinite(v)
        )

    panels = [Panel(ChartAxis("probability", "%"), y, bars(shares), title="How probable", y_range=ends)]
    if np.isfinite(errors).any():
        floor = ChartLine("noise floor", np.ones(2), np.array(ends), "", style.WARN, 1.2)
        x = ChartAxis("rms error on runs left out of the fit, in noise floors")
        panels.append(Panel(x, y, (*bars(errors), floor), title="How much error it leaves", y_range=ends))
    return Chart(tuple(panels))


MOST = 3  # panels in a row
BAND = 2.0  # floors
BAND_COLOUR = "#e8ecf2"
DASHES = ((4, 2), (), (2, 2))  # lines that lie on one another are all seen
AS_IT_IS = style.WARN
WITH = (style.SERIES[0], style.SERIES[2])
Line = tuple[str, str, tuple[RunReadings, ...]]


def explained_runs(diagnosed: Diagnosed, output: str) -> style.Png:
    """Up to three runs, one per column: readings over time, errors over a band of ±2 floors, loops over the input."""
    names, driver = diagnosed.telling_runs(MOST), abscissa(diagnosed.before)
    drawn: list[tuple[Kinds, str]] = [(NOTHING, AS_IT_IS), *zip(diagnosed.explanations, WITH, strict=False)]
    lines = [
        ("model with " + named(kinds) if kinds else "model as it is", colour, diagnosed.predicted(kinds))
        for kinds, colour in drawn
    ]
    rows, single = 2 if driver is None else 3, len(names) == 1
    size = (1560, 560) if single else (520 * len(names), 330 * rows + 110)
    with style.canvas(*size, pad=(0.05, 0.05)) as figure:
        if single:  # its panels stand side by side
            axes = figure.subplots(1, rows, squeeze=False).T
        else:
            heights = {"height_ratios": [2.2, 1.4, 2.4][:rows]}
            axes = figure.subplots(rows, len(names), squeeze=False, gridspec_kw=heights)
        for column, name in enumerate(names):
            _column(axes[:, column], diagnosed, name, output, lines, driver, column == 0)
        for row in axes:
            style.one_height(row)
            for k, panel in enumerate(row):
                panel.tick_params(labelleft=k == 0)
        style.legend_above(figure, axes[0, 0], "left")
        return style.png(figure)


def _column(
    panels: Any, diagnosed: Diagnosed, name: str, output: str, lines: list[Line],
    driver: tuple[str, NamedUnit] | None, first: bool,
) -> None:  # fmt: skip
    index = next(k for k, one in enumerate(diagnosed.measurement.runs) if one.name == name)
    run, words = diagnosed.measurement.runs[index], unit_of(output)
    (time, label), pick = clock(run), thin(len(run))
    dots = {"marker": "o" if len(pick) < 40 else "", "ms": 3}
    readings = {kind: words.factor * values[index][output] for kind, _, values in lines}
    measured = words.factor * run.outputs[output]
    over = [(panels[0], time)]
    if driver is not None:
        over.append((panels[2], driver[1].factor * input_of(run, driver[0])))
        panels[2].set_xlabel(driver[1].axis)
    for panel, x in over:
        panel.plot(x[pick], measured[pick], color=style.INK, lw=0.9, zorder=5, label="measured", **dots)
        for order, (kind, colour, _) in enumerate(lines):
            dashes = DASHES[order] if len(lines) > 1 else ()
            panel.plot(x[pick], readings[kind][pick], color=colour, lw=1.5, dashes=dashes, label=kind)
        if first:
            panel.set_ylabel(words.axis)
    band = BAND * diagnosed.floor(output) * words.factor
    if np.isfinite(band):
        panels[1].axhspan(-band, band, color=BAND_COLOUR, lw=0)
    for order, (_, colour, predicted) in enumerate(lines):
        error = words.factor * (run.outputs[output] - predicted[index][output])
        panels[1].plot(
            time[pick], error[pick], color=colour, lw=1.0, dashes=DASHES[2] if order == 2 else (), **dots
        )
    panels[1].axhline(0, color=style.SOFT, lw=0.8)
    panels[1].set_xlabel(label)
    if first:
        panels[1].set_ylabel(style.with_unit("error", words))
    before, after = (
        _ratio(diagnosed, index, kinds) for kinds in (NOTHING, (*diagnosed.explanations, NOTHING)[0])
    )
    falls = diagnosed.explanations and np.isfinite(before)
    title = f"{name}: {before:.1f} → {after:.1f} × noise" if falls else diagnosed.before.title(name)
    style.heading(panels[0], title, fitting(diagnosed.before.words(name), 52))


def _ratio(diagnosed: Diagnosed, index: int, kinds: Kinds) -> float:
    """Root mean square error of a run in noise floors, all outputs."""
    mine = diagnosed.found.readings.run == index
    square = np.mean(diagnosed.found.fits[kinds].residual[mine] ** 2) if mine.any() else np.nan
    return diagnosed.found.table.over_floor(float(square))


def explained_chart(diagnosed: Diagnosed, output: str) -> Chart:
    """Per telling run a panel of the readings, one of the errors in a band of ± 2 floors, one of the loop."""
    driver = abscissa(diagnosed.before)
    words = unit_of(output)
    models = [("model as it is", AS_IT_IS, diagnosed.predicted(NOTHING))]
    for kinds, colour in zip(diagnosed.explanations, WITH, strict=False):
        models.append((f"model with {named(kinds)}", colour, diagnosed.predicted(kinds)))
    half = BAND * diagnosed.floor(output) * words.factor
    panels = []
    for name in diagnosed.telling_runs(MOST):
        index = next(k for k, one in enumerate(diagnosed.measurement.runs) if one.name == name)
        run = diagnosed.measurement.runs[index]
        pick = thin(len(run))
        time, measured = clock(run)[0][pick], words.factor * run.outputs[output][pick]
        lines: list[ChartLine] = []
        errors: list[ChartLine] = []
        over = None if driver is None else driver[1].factor * input_of(run, driver[0])[pick]
        for model, colour, predicted in models:
            values = words.factor * predicted[index][output][pick]
            lines.append(ChartLine(model, time, values, name, colour, 1.5))
            errors.append(ChartLine(model, time, measured - values, name, colour, 1.0))
        lines.append(
            ChartLine("measured", time, measured, name, style.INK, 0.9, 3.0 if len(pick) < 40 else 0.0)
        )
        x = ChartAxis(*clock_words(run))
        top = Panel(x, ChartAxis(words.label, words.symbol), tuple(lines), title=name, linked=name)
        bands: tuple[Band, ...] = ()
        if np.isfinite(half):
            ends, high = level_line(time, half)
            bands = (Band("± 2 noise floors", ends, -high, high, name, BAND_COLOUR),)
        below = replace(
            top,
            y=ChartAxis("error", words.symbol),
            lines=tuple(errors),
            bands=bands,
            title="",
            zero=style.SOFT,
        )
        panels += [top, below]
        if driver is not None and over is not None:
            loops = tuple(replace(line, x=over) for line in lines)
            x = ChartAxis(driver[1].label, driver[1].symbol)
            panels.append(replace(top, x=x, lines=loops, title="", linked=""))
    return Chart(tuple(panels), column=2 if driver is None else 3)


def error_depends(diagnosed: Diagnosed, output: str) -> style.Png | None:
    """A panel for each of the circumstances that tell most of the error, before and after; None where none varies."""
    tells = diagnosed.before.comparison.depends_on
    items = [item for item in diagnosed.before.covariates.items if item.name in tells]
    items = sorted(items, key=lambda item: -tells[item.name])[:MOST]
    if not items:
        return None
    models = [(diagnosed.before, AS_IT_IS, "model as it is")]
    if diagnosed.after is not None:
        models.append((diagnosed.after, WITH[0], f"with {' + '.join(diagnosed.explanations[0])}"))
    with style.canvas(max(520 * len(items), 900), 520, pad=(0.05, 0.05)) as figure:
        axes = figure.subplots(1, len(items), squeeze=False, sharey=True)[0]
        for panel, item in zip(axes, items, strict=True):
            panel.axhline(0, color=style.SOFT, lw=0.8)
            for compared, colour, label in models:
                _means(panel, compared, item, output, colour, label)
            told = [whole_percent(one.comparison.depends_on.get(item.name, 0.0)) for one, *_ in models]
            below = f"tells {' → '.join(told)} of the error's variance"
            style.heading(panel, fitting(item.shown.label, 34), below, 8)
        axes[0].set_ylabel(style.with_unit("mean error", unit_of(output)))
        style.legend_above(figure, axes[0], "left")
        return style.png(figure)


def _means(panel: Any, compared: Compared, item: Covariate, output: str, colour: str, label: str) -> None:
    places = [p for p in compared.comparison.places if p.covariate == item.name and output in p.outputs]
    if item.numeric:
        panel.set_xlabel(item.shown.axis)
        x = np.array([p.centre for p in places], float) * item.shown.factor
    else:
        panel.set_xticks(range(len(places)), [fitting(p.condition, 16) for p in places], fontsize=8)
        panel.set_xlim(-0.5, len(places) - 0.5)
        x = np.arange(len(places), dtype=float)
    entries = [p.outputs[output] for p, at in zip(places, x, strict=True) if np.isfinite(at)]
    x, factor = x[np.isfinite(x)], unit_of(output).factor
    mean = np.array([e.mean for e in entries]) * factor
    half = np.array([np.ptp(e.interval) / 2 for e in entries]) * factor
    look = {"color": colour, "marker": "o", "ms": 6}
    line = "-" if item.numeric else ""
    panel.errorbar(x, mean, half, ls=line, lw=1.2, mfc="white", capsize=3, label=label, **look)
    filled = [e.significant for e in entries]
    panel.plot(x[filled], mean[filled], ls="", zorder=6, **look)


def repeats(diagnosed: Diagnosed, output: str) -> style.Png | None:
    """The groups that scatter most, over a band of ±2 times the noise within a run; None without repeats."""
    found = []
    for group in repeat_groups(diagnosed.measurement):
        runs = [diagnosed.measurement.runs[k] for k in group.runs]
        values = aligned(runs, [run.outputs[output] for run in runs]).values
        if min(values.shape) >= 2:
            found.append((group, np.asarray(values - values.mean(axis=0), float)))
    if not found:
        return None
    found = sorted(found, key=lambda item: -float(np.nanmean(item[1] ** 2)))[:MOST]
    with style.canvas(max(520 * len(found), 900), 430, pad=(0.05, 0.05)) as figure:
        axes = figure.subplots(1, len(found), squeeze=False, sharey=True)[0]
        for panel, (group, values) in zip(axes, found, strict=True):
            _scatter(panel, diagnosed, group, values, output)
        low, high = axes[0].get_ylim()
        axes[0].set_ylim(low, high + 0.16 * (high - low))  # the names stand above the lines
        axes[0].set_ylabel(style.with_unit("less their mean", unit_of(output)))
        return style.png(figure)


def _scatter(panel: Any, diagnosed: Diagnosed, group: RepeatGroup, values: Array, output: str) -> None:
    """(runs, t) readings less their mean."""
    runs, factor = [diagnosed.measurement.runs[k] for k in group.runs], unit_of(output).factor
    band = BAND * diagnosed.found.noise.floors[output].within * factor
    if np.isfinite(band):
        panel.axhspan(-band, band, color=BAND_COLOUR, lw=0)
    time, label = clock(runs[0])
    if len(time) != values.shape[1]:
        time, label = np.arange(1.0, values.shape[1] + 1), "reading in common"
    pick = thin(len(time))
    for k, (run, row) in enumerate(zip(runs, values, strict=False)):
        colour = style.SERIES[k % len(style.SERIES)]
        panel.plot(time[pick], factor * row[pick], lw=1.0, color=colour, label=run.name)
    panel.axhline(0, color=style.SOFT, lw=0.8)
    panel.set_xlabel(label)
    many = ", ".join(run.name for run in runs[:5]) + (" …" if len(runs) > 5 else "")
    panel.set_title(f"{many}: the same inputs", fontsize=9.5)
    panel.legend(ncols=min(len(runs), 5), loc="upper right")
