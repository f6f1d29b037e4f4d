"""The charts of a comparison: runs in time, loops over the input, errors over covariates, a map of conditions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pliant.evidence.covariates import Bins, Covariate, phases
from pliant.evidence.error_bins import ErrorBin, all_bins
from pliant.evidence.scores import GroupError
from pliant.formatting import NamedUnit, number, output_unit, whole_percent
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
    finite,
    level_line,
    one_height,
    optional_chart,
    padded,
    robust_ends,
    strokes,
)
from pliant.report.chart_colours import FAINT, INK, SERIES, SOFT, WARN, ColourScale
from pliant.report.evidence_view import (
    Compared,
    abscissa,
    clock,
    clock_words,
    fitting,
    input_values,
    thin,
    with_ratio,
)

MOST = 12  # runs, or circumstances
BAND = 2.0  # in units of the floor
FEW = 40  # samples that are marked individually
RULE = ChartRule(0.0, SERIES[0])


def runs_chart(compared: Compared, output: str, runs: Sequence[str] | None = None) -> Chart:
    """Return per run a panel of the reading and the model in their band, and one of measured − model below it.

    Args:
        compared: the band is the model's own, or ± 2 floors without one.
        output: name of the output.
        runs: names of runs; the worst by default.
    """
    names = list(runs or compared.worst_runs(MOST)[0])
    words, floor = output_unit(output), compared.comparison.outputs[output].noise_floor
    level = None if compared.bands is None else compared.bands.level
    shown = level is not None and any(compared.band(name, output) is not None for name in names)
    band = f"{whole_percent(level)} band" if shown and level is not None else "model ± 2 floors"
    panels = [panel for name in names for panel in _run_panels(compared, name, output, words, band)]
    sizes = np.abs(finite(np.concatenate([line.y for panel in panels[1::2] for line in panel.lines])))
    high = float(np.quantile(sizes, 0.998)) if len(sizes) else words.factor
    reach = 1.12 * max(high, 2.4 * floor * words.factor if np.isfinite(floor) else 0.0, 1e-12)
    readings = finite(np.concatenate([line.y for panel in panels[::2] for line in panel.lines]))
    ends = padded(float(readings.min()), float(readings.max())) if len(readings) else (0.0, 1.0)
    ranges = [ends, (-reach, reach)]
    return Chart(
        tuple(replace(panel, y=replace(panel.y, ends=ranges[k % 2])) for k, panel in enumerate(panels)),
        column=2, heights=(3.0, 1.6), across=4, cell=(460, 470), legend=("model", "measured", band),
    )  # fmt: skip


def _run_panels(
    compared: Compared, name: str, output: str, words: NamedUnit, band: str
) -> tuple[Panel, Panel]:
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
    error = ChartLine("measured − model", time, measured - predicted, name, INK, 0.7, dot, outside=WARN)
    top: list[Mark] = [
        ChartLine("model", time, predicted, name, SERIES[0], 1.5),
        ChartLine("measured", time, measured, name, INK, 0.9, dot),
    ]
    bottom: list[Mark] = [RULE, error]
    if known:
        top.insert(0, Band(band, time, low, high, name))
        bottom.insert(0, Band(band, time, low - predicted, high - predicted, name))
    x, title = ChartAxis(*clock_words(run)), compared.title(name)
    below = fitting(compared.words(name), 44)
    return (
        Panel(x, ChartAxis(words.label, words.symbol), tuple(top), title, below, linked=name),
        Panel(x, ChartAxis("error", words.symbol), tuple(bottom), linked=name),
    )


MOST_LOOPS = 8
REPEATS = (INK, "#7b8496", "#a9b1bf")
SENSES = ((1, "rising", SERIES[2]), (-1, "falling", SERIES[1]), (0, "held", "#8a93a5"))
LOOP_BAND = "#dcebf6"
SEEN_THROUGH = SERIES[0] + "d9"


def loops_chart(compared: Compared, output: str) -> Chart | None:
    """Return per condition, worst first, panels of the output and its error over the input; None without input."""
    found = abscissa(compared)
    if found is None:
        return None
    worst = sorted(compared.comparison.conditions, key=lambda c: -c.share_of_error / max(c.n, 1))[:MOST_LOOPS]
    panels = [panel for condition in worst for panel in _loop_panels(compared, condition, *found, output)]
    layout = {"column": 2, "heights": (2.2, 1.3), "across": 4, "cell": (460, 620)}
    return optional_chart(one_height(panels, every=2), **layout)


def _loop_panels(
    compared: Compared, condition: GroupError, driver: str, across: NamedUnit, output: str
) -> tuple[Panel, Panel]:
    """Return the panels of all runs of a condition; the error has the colour of the input's direction."""
    up, readings, model, errors = output_unit(output), [], [], []
    for k, name in enumerate(condition.runs):
        run, said = compared.run(name)
        pick = thin(len(run))
        x = across.factor * input_values(run, driver)
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
    marks: list[Mark] = [RULE, *errors]
    if np.isfinite(floor):
        ends, half = level_line(np.concatenate([line.x for line in errors]), 2 * floor * up.factor)
        marks.insert(0, Band("± 2 floors", ends, -half, half, "", LOOP_BAND))
    axis, linked = ChartAxis(across.label, across.symbol), condition.name
    title, below = fitting(with_ratio(condition), 32), fitting(condition.words, 44)
    return (
        Panel(axis, ChartAxis(up.label, up.symbol), (*readings, *model), title, below, linked),
        Panel(axis, ChartAxis("error", up.symbol), tuple(marks), linked=linked),
    )


POINTS = 1500
MEAN, SIGNIFICANT = "mean in a bin, 95 % under noise", "more than noise"


def places_chart(compared: Compared, output: str) -> Chart | None:
    """Return one panel per covariate, those that explain most of the error first; None where nothing varies."""
    explained = compared.comparison.depends_on
    items = sorted(compared.covariates.items, key=lambda item: -explained.get(item.name, 0.0))[:MOST]
    words = output_unit(output)
    residual = np.concatenate([run[output] for run in compared.residuals]) * words.factor
    values = finite(residual)
    low, high = np.quantile(values, [0.003, 0.997]) if len(values) else (0.0, 0.0)
    ends = padded(min(float(low), 0.0), max(float(high), 0.0), 0.08)
    y = ChartAxis("measured − model", words.symbol, ends=ends)
    panels = [_place_panel(compared, item, output, residual, y) for item in items]
    return optional_chart(panels, cell=(600, 460), legend=("readings", MEAN, SIGNIFICANT))


def _place_panel(compared: Compared, item: Covariate, output: str, residual: Array, y: ChartAxis) -> Panel:
    """Return readings as dots, and the mean of each bin with its interval."""
    places = [p for p in compared.comparison.places if p.covariate == item.name and output in p.outputs]
    share = whole_percent(compared.comparison.depends_on.get(item.name, 0.0))
    real = any(p.outputs[output].significant for p in places)
    title = fitting(f"{item.shown.label}: {f'explains {share}' if real else 'noise'}", 46)
    notes: list[Mark] = []
    if item.numeric:
        places = [p for p in places if np.isfinite(p.centre)]
        centres = np.array([p.centre for p in places]) * item.shown.factor
        values = np.concatenate(item.values) * item.shown.factor
        ends = robust_ends(finite(values))
        x = ChartAxis(item.shown.label, item.shown.symbol, ends=None if ends is None else padded(*ends, 0.04))
        notes = [] if ends is None else beyond_notes(ends, finite(values))
    else:
        ends, centres = None, np.arange(len(places), dtype=float)
        x = ChartAxis(item.shown.label, names=tuple(_short(p.condition, item) for p in places))
        names, codes = [*item.categories, item.rest], np.concatenate(item.values)
        at = {p.condition: float(k) for k, p in enumerate(places)}
        codes = np.where(np.isfinite(codes), codes, len(names) - 1).astype(int)
        values = np.array([at.get(name, np.nan) for name in names])[codes]
    known = np.flatnonzero(np.isfinite(values) & np.isfinite(residual))
    pick = known[thin(len(known), POINTS)]
    spread = 0.0 if item.numeric else np.random.default_rng(0).uniform(-0.28, 0.28, len(pick))
    dots = ChartLine("readings", values[pick] + spread, residual[pick], "", FAINT, 0.0, 2.2)
    marks = [dots, RULE, *_means(centres, places, output, ends, item.numeric), *notes]
    return Panel(x, y, tuple(marks), title)


def _means(
    x: Array, places: Sequence[ErrorBin], output: str, ends: tuple[float, float] | None, joined: bool
) -> list[Mark]:
    """Return means with their intervals; those beyond the panel's ends are triangles at the ends."""
    entries, factor = [place.outputs[output] for place in places], output_unit(output).factor
    mean = np.array([entry.mean for entry in entries]) * factor
    low, high = np.array([entry.interval for entry in entries]).reshape(-1, 2).T * factor
    significant = np.array([entry.significant for entry in entries], bool)
    outer = np.zeros(len(x), bool) if ends is None else (x < ends[0]) | (x > ends[1])
    x = x if ends is None else np.clip(x, *ends)
    marks: list[Mark] = [ChartLine("means", x, mean, "", SOFT, 0.8)] if joined else []
    for name, colour, hollow, mine in (
        (MEAN, INK, True, ~significant),
        (SIGNIFICANT, WARN, False, significant),
    ):
        for chosen, marker in ((mine & ~outer, "o"), (mine & outer, "^")):
            if chosen.any():
                marks.append(ChartLine(name, *strokes(x[chosen], low[chosen], high[chosen]), "", colour, 1.4))
                marks.append(
                    ChartLine(
                        name, x[chosen], mean[chosen], "", colour, 0.0, 6.5, marker=marker, hollow=hollow
                    )
                )
    return marks


def beyond_notes(ends: tuple[float, float], values: Array) -> list[Mark]:
    """Return notes on how many values are beyond the ends of an axis and how far they extend."""
    below, above = values[values < ends[0]], values[values > ends[1]]
    notes: list[Mark] = []
    if len(below):
        text = f"◂ {len(below)} beyond, to {number(float(below.min()), 3)}"
        notes.append(ChartNote(text, ends[0], 0.97, "right", SOFT, rim=True))
    if len(above):
        text = f"{len(above)} beyond, to {number(float(above.max()), 3)} ▸"
        notes.append(ChartNote(text, ends[1], 0.97, "left", SOFT, rim=True))
    return notes


def _short(condition: str, item: Covariate) -> str:
    """Return a category without the words that all share: "falling pressure" → "falling"."""
    for common in ("specimen ", "tip force toward ", "moment that "):
        condition = condition.removeprefix(common)
    return condition.split()[0] if item.name == "direction" else fitting(condition, 14)


MOST_RUNS = 40
PREFERRED = ("direction × pressure", "direction × tendon", "direction", "pressure", "moment")
# Blue below the noise, white at it, orange to dark red above.
SHADES = ("#a9c4de", "#ffffff", "#fbd3a6", "#ee8a4a", "#c4421f", "#6e1410")
SHADED_FROM_NOISE = (0.24, 0.5, 0.76, 1.0)  # shares of the range above the noise


def condition_map(compared: Compared) -> Chart | None:
    """Return runs as rows, outputs (if several) and bins of the actuation as columns; None without a column."""
    comparison = compared.comparison
    runs = sorted(comparison.runs, key=lambda run: -run.share_of_error / max(run.n, 1))[:MOST_RUNS]
    order = {run.name: k for k, run in enumerate(compared.measurement.runs)}
    rows = sorted(order[run.name] for run in runs)
    noise = {name: error.noise.total for name, error in comparison.outputs.items()}
    scaled = [np.stack([compared.residuals[k][name] / total for name, total in noise.items()]) for k in rows]
    parts: list[tuple[str, list[str], Array]] = []
    if len(noise) > 1:
        of_output = np.array([[_rms(values) for values in of_run] for of_run in scaled])
        parts.append(("by output", [output_unit(name).label for name in noise], of_output))
    if (bins := _bins(compared)) is not None:
        picked = [
            [of_run[:, bins.codes[k] == j] for j in range(len(bins))]
            for k, of_run in zip(rows, scaled, strict=True)
        ]
        of_bin = np.array([[_rms(values) for values in of_run] for of_run in picked])
        parts.append(("by what the actuation does", list(bins.words), of_bin))
    found = [comparison.runs[k] for k in rows]
    names = tuple(fitting(f"{run.name}: {run.words}" if run.words else run.name, 40) for run in found)
    top = max([2.0, *(float(np.nanmax(values)) for _, _, values in parts)])
    against = "rms error in noise floors" if comparison.judged else "rms error against that of all runs"
    at = (0.0, 1.0, *(1.0 + (top - 1.0) * share for share in SHADED_FROM_NOISE))
    scale, y = ColourScale(against, "", at, SHADES), ChartAxis("run", names=names)
    panels = []
    for title, words, values in parts:
        lines, columns = (np.arange(count + 1) - 0.5 for count in values.shape)
        x = ChartAxis(title, names=tuple(fitting(word, 42) for word in words), ends=(-0.5, len(words) - 0.5))
        y = replace(y, ends=(-0.5, len(names) - 0.5))
        panels.append(
            Panel(x, y, (ChartCells("error", columns, lines, values, digits=2),), title, scale=scale)
        )
    counts = [len(words) for _, words, _ in parts]
    width = (420 + 96 * sum(counts) + 60 * len(parts)) // max(len(parts), 1)
    height = min(
        190 + 44 * len(rows) + 9 * max([len(word) for _, words, _ in parts for word in words], default=0),
        1700,
    )
    return optional_chart(panels, cell=(width, height), widths=tuple(count + 0.5 for count in counts))


def _bins(compared: Compared) -> Bins | None:
    few = [bins for bins in all_bins(compared.covariates) if len(bins) <= 16]
    return next((bins for name in PREFERRED for bins in few if bins.name.startswith(name)), None)


def _rms(values: Array) -> float:
    known = finite(values)
    return float(np.sqrt(np.mean(known**2))) if len(known) else np.nan
