"""Pictures of a comparison: runs in time, errors over what varied, loops over the input, a map of conditions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, TwoSlopeNorm
from matplotlib.lines import Line2D

from pliant.evidence.covariates import Bins, Covariate, phases
from pliant.evidence.places import Place, all_bins
from pliant.evidence.scores import GroupError
from pliant.formatting import NamedUnit, number, unit_of, whole_percent
from pliant.records.design import Array
from pliant.report.chart import Band, Chart, ChartAxis, ChartLine, Panel
from pliant.report.evidence_view import (
    Compared,
    abscissa,
    clock,
    clock_words,
    fitting,
    grid,
    input_of,
    thin,
    with_ratio,
)
from pliant.report.figures import charts, style

MOST = 12  # runs, or circumstances
COLUMNS = 4
BAND = 2.0  # floors
FEW = 40  # samples that are marked one by one
BAND_COLOUR = "#bcd9ee"


def runs_chart(compared: Compared, output: str, runs: Sequence[str] | None = None) -> Chart:
    """Per run a panel of the reading and the model in their band, and one of measured − model below it.

    Args:
        compared: the band is the model's own, or ± 2 floors where it has none.
        output: which one.
        runs: names of runs; the worst by default.
    """
    names = list(runs or compared.worst_runs(MOST)[0])
    words, floor = unit_of(output), compared.comparison.outputs[output].noise_floor
    panels = [panel for name in names for panel in _run_panels(compared, name, output, words)]
    sizes = np.abs(_finite(np.concatenate([line.y for panel in panels[1::2] for line in panel.lines])))
    high = float(np.quantile(sizes, 0.998)) if len(sizes) else words.factor
    reach = 1.12 * max(high, 2.4 * floor * words.factor if np.isfinite(floor) else 0.0, 1e-12)
    flat = _finite(np.concatenate([line.y for panel in panels[::2] for line in panel.lines]))
    ends = (float(flat.min()), float(flat.max())) if len(flat) else (0.0, 1.0)
    margin = 0.06 * max(ends[1] - ends[0], 1e-9)
    ranges = [(ends[0] - margin, ends[1] + margin), (-reach, reach)]
    return Chart(tuple(replace(panel, y_range=ranges[k % 2]) for k, panel in enumerate(panels)), column=2)


def _run_panels(compared: Compared, name: str, output: str, words: NamedUnit) -> tuple[Panel, Panel]:
    run, model = compared.run(name)
    pick = thin(len(run))
    time = clock(run)[0][pick]
    measured, predicted = (words.factor * np.asarray(v[output], float)[pick] for v in (run.outputs, model))
    half = BAND * compared.comparison.outputs[output].noise_floor * words.factor
    low, high, known = predicted - half, predicted + half, bool(np.isfinite(half))
    if compared.bands is not None and (ends := compared.band(name, output)) is not None:
        low, high = (words.factor * end[pick] for end in ends)
        known = True
    dot = 3.0 if len(pick) < FEW else 0.0
    bands = [("band", low, high), ("band", low - predicted, high - predicted)] if known else [None, None]
    x = ChartAxis(*clock_words(run))
    top = (
        ChartLine("model", time, predicted, name, style.SERIES[0], 1.5),
        ChartLine("measured", time, measured, name, style.INK, 0.9, dot),
    )
    error = (
        ChartLine("measured − model", time, measured - predicted, name, style.INK, 0.7, dot, style.WARN),
    )
    labels = (ChartAxis(words.label, words.symbol), ChartAxis("error", words.symbol))
    made = [
        Panel(
            x,
            y,
            lines,
            () if band is None else (Band(band[0], time, *band[1:], name, BAND_COLOUR),),
            linked=name,
        )
        for y, lines, band in zip(labels, (top, error), bands, strict=True)
    ]
    return replace(made[0], title=compared.title(name), below=compared.words(name)), replace(
        made[1], zero=style.SERIES[0]
    )


def runs_in_time(compared: Compared, output: str, runs: Sequence[str] | None = None) -> style.Png:
    """Small multiples: the reading in ink over the model in blue; below, measured − model over a band.

    Args: those of `runs_chart`, whose still picture it is.
    """
    drawn = runs_chart(compared, output, runs).panels
    count, words = len(drawn) // 2, unit_of(output)
    rows, columns = grid(count, COLUMNS)
    band = "model ± 2 floors"
    if compared.bands is not None and any(compared.band(p.linked, output) is not None for p in drawn):
        band = f"{whole_percent(compared.bands.level)} band"
    key = {"model": "model", "measured": "measured", "band": band}
    with style.canvas(max(460 * columns, 900), 430 * rows + 90, pad=(0.05, 0.04), wspace=0.03) as figure:
        pairs = _pairs(figure, count, columns, (3.0, 1.25))
        for place, (top, bottom) in enumerate(pairs):
            bottom.sharex(top)
            above, below = drawn[2 * place : 2 * place + 2]
            charts.draw(top, above, key)
            charts.draw(bottom, below)
            top.tick_params(labelbottom=False)
            style.heading(top, above.title, fitting(above.below, 44))
            top.set_ylim(above.y_range)
            bottom.set_ylim(below.y_range)
            _label_pair(top, bottom, words, place % columns)
            if place >= count - columns:
                bottom.set_xlabel(below.x.text)
        style.legend_above(figure, pairs[0][0])
        return style.png(figure)


def _pairs(
    figure: Any, count: int, columns: int, heights: tuple[float, float], **shared: Any
) -> list[tuple[Any, Any]]:
    """So many panels above one another in rows of `columns`; places that are left stay empty."""
    rows = -(-count // columns)
    ratios = {"height_ratios": heights * rows}
    axes = figure.subplots(2 * rows, columns, squeeze=False, gridspec_kw=ratios, **shared)
    pairs = [(top, bottom) for row in range(rows) for top, bottom in axes[2 * row : 2 * row + 2].T]
    for panel in np.ravel(pairs[count:]):
        panel.set_axis_off()
    return pairs[:count]


def _label_pair(top: Any, bottom: Any, words: NamedUnit, column: int) -> None:
    """Labels of y at the left of a row only."""
    if column == 0:
        top.set_ylabel(words.axis)
        bottom.set_ylabel(style.with_unit("error", words))
    for panel in (top, bottom):
        panel.tick_params(labelleft=column == 0)


def _finite(values: Array) -> Array:
    return values[np.isfinite(values)]


MOST_LOOPS = 8
REPEATS = (style.INK, "#7b8496", "#a9b1bf")
SENSES = ((1, "rising", style.SERIES[2]), (-1, "falling", style.SERIES[1]), (0, "held", "#8a93a5"))
LOOP_BAND = "#dcebf6"
SEEN_THROUGH = style.SERIES[0] + "d9"


def loops_chart(compared: Compared, output: str) -> Chart | None:
    """Per condition, the worst first, a panel of the output over its input and one of the error; None without input."""
    found = abscissa(compared)
    if found is None:
        return None
    worst = sorted(compared.comparison.conditions, key=lambda c: -c.share_of_error / max(c.n, 1))[:MOST_LOOPS]
    return Chart(tuple(p for c in worst for p in _loop_panels(compared, c, *found, output)), column=2)


def _loop_panels(
    compared: Compared, condition: GroupError, driver: str, across: NamedUnit, output: str
) -> tuple[Panel, Panel]:
    """All runs of a condition; the error in the colour of what the input does."""
    up, readings, model, errors = unit_of(output), [], [], []
    for k, name in enumerate(condition.runs):
        run, said = compared.run(name)
        pick = thin(len(run))
        x = across.factor * input_of(run, driver)
        measured, predicted = (up.factor * np.asarray(v[output], float) for v in (run.outputs, said))
        dot = 3.0 if len(pick) < FEW else 0.0
        readings.append(ChartLine("measured", x[pick], measured[pick], name, REPEATS[k % 3], 1.0, dot))
        if k == 0:
            model.append(ChartLine("model", x[pick], predicted[pick], "", SEEN_THROUGH, 2.0))
        direction = phases(x, run.history.time_s).direction
        for sense, word, colour in SENSES:
            error = np.where(direction == sense, measured - predicted, np.nan)[pick]
            errors.append(ChartLine(f"error, {word}", x[pick], error, name, colour, 1.0, 2.2 if dot else 1.1))
    floor = compared.comparison.outputs[output].noise_floor
    bands: tuple[Band, ...] = ()
    if np.isfinite(floor):
        ends, half = charts.level_line(np.concatenate([line.x for line in errors]), 2 * floor * up.factor)
        bands = (Band("± 2 floors", ends, -half, half, "", LOOP_BAND),)
    x_axis, linked = ChartAxis(across.label, across.symbol), condition.name
    top = Panel(x_axis, ChartAxis(up.label, up.symbol), (*readings, *model), linked=linked)
    bottom = Panel(
        x_axis, ChartAxis("error", up.symbol), tuple(errors), bands, zero=style.SERIES[0], linked=linked
    )
    return replace(top, title=with_ratio(condition), below=condition.words), bottom


def loops(compared: Compared, output: str) -> style.Png | None:
    """Small multiples of conditions, the worst first: the output over its input, and the error; None without input."""
    chart = loops_chart(compared, output)
    if chart is None:
        return None
    count, up = len(chart.panels) // 2, unit_of(output)
    rows, columns = grid(count, COLUMNS)
    key = {"measured": "measured (shades: repeats)", "model": "model"}
    key |= {f"error, {word}": f"error, {word}" for _, word, _ in SENSES}
    with style.canvas(max(460 * columns, 900), 600 * rows + 90, pad=(0.05, 0.04)) as figure:
        pairs = _pairs(figure, count, columns, (2.2, 1.3), sharex=True)
        for place, (top, bottom) in enumerate(pairs):
            above, below = chart.panels[2 * place : 2 * place + 2]
            last = place + columns >= count
            charts.draw(top, above, key)
            charts.draw(bottom, below, key)
            style.heading(top, fitting(above.title, 32), fitting(above.below, 44))
            _label_pair(top, bottom, up, place % columns)
            top.tick_params(labelbottom=False)
            bottom.tick_params(labelbottom=last)
            if last:
                bottom.set_xlabel(below.x.text)
        for half in zip(*pairs, strict=True):
            style.one_height(half)
        style.legend_above(figure, pairs[0])
        return style.png(figure)


PLACE_COLUMNS = 3
POINTS = 1500
LOUD = 0.05  # a circumstance that tells so much of the error has its title in colour


def residual_places(compared: Compared, output: str) -> style.Png | None:
    """One panel per covariate, those that tell most of the error first; None where nothing varies."""
    tells = compared.comparison.depends_on
    items = sorted(compared.covariates.items, key=lambda item: -tells.get(item.name, 0.0))[:MOST]
    if not items:
        return None
    rows, columns = grid(len(items), PLACE_COLUMNS)
    words = unit_of(output)
    residual = np.concatenate([run[output] for run in compared.residuals]) * words.factor
    there = _finite(residual)
    low, high = np.quantile(there, [0.003, 0.997]) if len(there) else (0.0, 0.0)
    low, high = min(low, 0.0), max(high, 0.0)
    margin = 0.08 * max(high - low, 1e-12)
    with style.canvas(max(600 * columns, 900), 430 * rows + 90, pad=(0.06, 0.06)) as figure:
        for k, panel in enumerate(style.panels(figure, len(items), columns)):
            _places(panel, compared, items[k], output, residual)
            panel.set_ylim(float(low - margin), float(high + margin))
            panel.tick_params(labelleft=k % columns == 0)
            if k % columns == 0:
                panel.set_ylabel(style.with_unit("measured − model", words))
        entries = [
            Line2D([], [], ls="", marker=".", color=style.FAINT, label="readings"),
            Line2D([], [], marker="o", mfc="white", color=style.INK, label="mean in a bin, 95 % under noise"),
            Line2D([], [], marker="o", color=style.WARN, label="more than noise"),
        ]
        figure.legend(handles=entries, loc="outside upper right", ncols=3)
        return style.png(figure)


def _places(panel: Any, compared: Compared, item: Covariate, output: str, residual: Array) -> None:
    """Readings as dots, and the mean of each bin with its interval."""
    places = [p for p in compared.comparison.places if p.covariate == item.name and output in p.outputs]
    told = compared.comparison.depends_on.get(item.name, 0.0)
    real = any(p.outputs[output].significant for p in places)
    title = fitting(f"{item.shown.label}: {f'tells {whole_percent(told)}' if real else 'noise'}", 46)
    panel.set_title(title, fontsize=9.5, color=style.WARN if real and told >= LOUD else style.INK)
    if item.numeric:
        places = [p for p in places if np.isfinite(p.centre)]
        x = np.array([p.centre for p in places]) * item.shown.factor
        panel.set_xlabel(item.shown.axis)
        values = np.concatenate(item.values) * item.shown.factor
    else:
        x = np.arange(len(places), dtype=float)
        panel.set_xticks(x, [_short(p.condition, item) for p in places])
        panel.set_xlim(-0.6, len(places) - 0.4)
        names, codes = [*item.categories, item.rest], np.concatenate(item.values)
        at = {p.condition: float(k) for k, p in enumerate(places)}
        codes = np.where(np.isfinite(codes), codes, len(names) - 1).astype(int)
        values = np.array([at.get(name, np.nan) for name in names])[codes]
    known = np.flatnonzero(np.isfinite(values) & np.isfinite(residual))
    pick = known[thin(len(known), POINTS)]
    spread = 0.0 if item.numeric else np.random.default_rng(0).uniform(-0.28, 0.28, len(pick))
    dots = {"marker": ".", "ms": 2.2, "color": style.FAINT, "zorder": 1, "mew": 0}
    panel.plot(values[pick] + spread, residual[pick], ls="", **dots)
    panel.axhline(0, color=style.SERIES[0], lw=1.2, zorder=2)
    ends = style.robust_ends(values[known]) if item.numeric else None
    _means(panel, x, places, output, ends)
    if ends is not None:
        style.cut_at(panel, ends, values[known])


def _means(
    panel: Any, x: Any, places: Sequence[Place], output: str, ends: tuple[float, float] | None = None
) -> None:
    """Means with their intervals; what lies beyond the panel's ends stands at them, as a triangle."""
    entries, factor = [place.outputs[output] for place in places], unit_of(output).factor
    mean = np.array([e.mean for e in entries]) * factor
    low, high = np.array([e.interval for e in entries]).reshape(-1, 2).T * factor
    marks = ["o"] * len(entries)
    if ends is not None:
        marks = ["<" if value < ends[0] else ">" if value > ends[1] else "o" for value in x]
        x = np.clip(x, *ends)
    for k, entry in enumerate(entries):
        colour = style.WARN if entry.significant else style.INK
        look = {
            "marker": marks[k],
            "ms": 6.5,
            "mfc": colour if entry.significant else "white",
            "capsize": 3,
        }
        bar = [[mean[k] - low[k]], [high[k] - mean[k]]]
        panel.errorbar(x[k], mean[k], bar, color=colour, lw=1.4, zorder=5, **look)
    if np.isfinite(places[0].centre if places else np.nan):
        panel.plot(x, mean, color=style.INK, lw=0.8, alpha=0.5, zorder=3)


def _short(condition: str, item: Covariate) -> str:
    """A category without the words that all share: "falling pressure" → "falling"."""
    for common in ("specimen ", "tip force toward ", "moment that "):
        condition = condition.removeprefix(common)
    return condition.split()[0] if item.name == "direction" else fitting(condition, 14)


MOST_RUNS = 40
PREFERRED = ("direction × pressure", "direction × tendon", "direction", "pressure", "moment")
NO_DATA = "#eceef2"
DARK = 0.78  # of the colour range: white digits from here on
# Blue below the noise, white at it, orange to dark red above.
SHADES = {0.0: "#a9c4de", 0.5: "#ffffff", 0.62: "#fbd3a6", 0.75: "#ee8a4a", 0.88: "#c4421f", 1.0: "#6e1410"}
FLOORS = LinearSegmentedColormap.from_list("floors", list(SHADES.items()))


def condition_map(compared: Compared) -> style.Png | None:
    """Rows are runs; columns are outputs (if several) and bins of the actuation. None where there is no column."""
    comparison = compared.comparison
    runs = sorted(comparison.runs, key=lambda run: -run.share_of_error / max(run.n, 1))[:MOST_RUNS]
    order = {run.name: k for k, run in enumerate(compared.measurement.runs)}
    rows = sorted(order[run.name] for run in runs)
    noise = {name: error.noise.total for name, error in comparison.outputs.items()}
    scaled = [np.stack([compared.residuals[k][name] / total for name, total in noise.items()]) for k in rows]
    parts: list[tuple[str, list[str], Array]] = []
    if len(noise) > 1:
        of_output = np.array([[_rms(values) for values in of_run] for of_run in scaled])
        parts.append(("by output", [unit_of(name).label for name in noise], of_output))
    if (bins := _bins(compared)) is not None:
        picked = [
            [of_run[:, bins.codes[k] == j] for j in range(len(bins))]
            for k, of_run in zip(rows, scaled, strict=True)
        ]
        of_bin = np.array([[_rms(values) for values in of_run] for of_run in picked])
        parts.append(("by what the actuation does", list(bins.words), of_bin))
    if not parts:
        return None
    widths = [len(words) for _, words, _ in parts]
    longest = max(len(word) for _, words, _ in parts for word in words)
    width, height = 420 + 96 * sum(widths) + 60 * len(parts), 190 + 44 * len(rows) + 9 * longest
    with style.canvas(width, height, pad=(0.06, 0.06)) as figure:
        axes = figure.subplots(1, len(parts), squeeze=False, width_ratios=widths)[0]
        top = max(float(np.nanmax(values)) for _, _, values in parts)
        norm = TwoSlopeNorm(1.0, 0.0, max(top, 2.0))
        for axis, (title, words, values) in zip(axes, parts, strict=True):
            picture = _heat(axis, values, words, norm)
            axis.set_title(title)
        found = [comparison.runs[k] for k in rows]
        names = [fitting(f"{run.name}: {run.words}" if run.words else run.name, 40) for run in found]
        axes[0].set_yticks(range(len(rows)), names)
        for axis in axes[1:]:
            axis.set_yticks([])
        against = "in noise floors" if comparison.judged else "against that of all runs"
        shrink = min(1.0, 8 / max(len(rows), 1))
        figure.colorbar(picture, ax=list(axes), label=f"rms error {against}", shrink=shrink, aspect=18)
        return style.png(figure)


def _heat(axis: Any, values: Array, words: list[str], norm: TwoSlopeNorm) -> Any:
    picture = axis.imshow(values, aspect="auto", cmap=FLOORS, norm=norm, interpolation="nearest")
    labels = [fitting(word, 42) for word in words]
    axis.set_xticks(range(len(words)), labels, rotation=35, ha="right", fontsize=8)
    axis.grid(False)
    axis.set_facecolor(NO_DATA)
    for side in axis.spines.values():
        side.set_visible(False)
    axis.tick_params(length=0)
    for (i, j), value in np.ndenumerate(values):
        if np.isfinite(value):
            colour = "white" if norm(value) > DARK else style.INK
            axis.text(j, i, number(value, 2), ha="center", va="center", fontsize=7.5, color=colour)
    return picture


def _bins(compared: Compared) -> Bins | None:
    few = [bins for bins in all_bins(compared.covariates) if len(bins) <= 16]
    return next((bins for name in PREFERRED for bins in few if bins.name.startswith(name)), None)


def _rms(values: Array) -> float:
    there = _finite(values)
    return float(np.sqrt(np.mean(there**2))) if len(there) else np.nan
