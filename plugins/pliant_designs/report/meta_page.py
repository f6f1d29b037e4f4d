"""The page of a meta-model: sections, tables, charts of parity, free angles, errors over the designs, coverage."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from pliant.formatting import NamedUnit, deformation_unit, effort_unit, number, output_unit, percent, seconds
from pliant.records.design import Array
from pliant.report.chart import Chart, ChartAxis, ChartLine, ChartNote, ChartRule, Mark, Panel, optional_chart
from pliant.report.chart_colours import ERROR_COLOURS, INK, SERIES, SOFT, ColourScale
from pliant.report.document import (
    Column,
    Drawn,
    Picture,
    Section,
    Table,
    drawn,
    named_values,
    optional_table,
    page_table,
    picture,
    section,
)
from pliant.report.learning_chart import Curve, learning_chart
from pliant.report.provenance import Manifests, closing_sections, short_text, words
from pliant_designs.cross_validation import AxisScores, Scores
from pliant_designs.fitted_model import MetaFitted

PLACES = ("interior", "border")
LEFT_OUT = "Every design was predicted by a model that had not seen it."


def meta_drawn(fitted: Sequence[MetaFitted], study: Mapping[str, Any], manifests: Manifests) -> Drawn:
    """Return a page of the first of `fitted` on top and in all sections; the others only in the table of scores."""
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
    where = picture("meta_designs", space, designs_chart(one))
    return drawn(
        Picture("meta_parity", hero, parity_chart(one)),
        section(title, scores, worst_table(one), settings_table(one), open=True),
        section("Free angle", picture("meta_free", free, free_chart(one))),
        section("Where in the space of designs it misses", where, next_table(one)),
        section(
            "Are the error bars calibrated?",
            Picture("meta_bars", bars, design_bars_chart(one)),
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
    error = ChartAxis("error on unused designs", "% of the range", log=True)
    chart = learning_chart("Error by number of designs", curves, "designs fitted", error)
    caption = "The model fitted again to nested subsets of the designs, scored on designs that no fit saw."
    shown = Picture("meta_learning", caption, chart)
    return section("How many designs it takes", shown, learning_table(learning))


def parameter_unit(name: str) -> NamedUnit:
    """Return a parameter's label and display unit: ``average_radius_m`` → average radius, mm."""
    return output_unit(name.removeprefix("material."))


PUBLISHED = (
    "Of each design's own range of effort, and of its largest free angle. Published for the study's meta-models: R² "
    "above 0.99 (coefficients) and above 0.999 (network), both on the designs that they were fitted to; here every "
    "design was left out of the fit that predicts it."
)
WORST = 5
WORTH = {
    "gain": "of the mean squared error that solving it would remove",
    "doubt": "of the largest doubt in the range",
    "distance": "of the range, to the nearest solved design",
}


def share_text(share: float) -> str:
    """Return a share in percent, three digits."""
    return percent(share, 3)


class ScoreRow(NamedTuple):
    """Scores of one axis of a group of designs; `first` for the group's first row."""

    label: str
    scores: Scores
    axis: AxisScores
    first: bool


SCORES: tuple[Column[ScoreRow], ...] = (
    Column("label", head="designs left out", brief="designs left out"),
    Column("scores.n_designs", head="designs", brief="designs"),
    Column("axis.n_states", head="states"),
    Column("axis.r2", head="R²", brief="R²", show=lambda r2: f"{r2:.6f}"),
    Column("axis.rmse_of_range", head="RMS of range", brief="RMS", show=share_text),
    Column("axis.worst_of_range", head="worst of range", brief="worst", show=share_text),
    Column(
        "scores.free_median",
        head="free angle, median",
        brief="free: median",
        text=lambda r: share_text(r.scores.free_median) if r.first else "",
    ),
    Column(
        "scores.free_worst",
        head="free angle, worst",
        brief="worst",
        text=lambda r: _worst_free(r.scores.free_worst, r.scores.free_lost) if r.first else "",
    ),
)


def score_rows(fitted: Sequence[MetaFitted]) -> list[ScoreRow]:
    """Return torque and free angle on held-out designs, interior and border apart, one block for each model."""
    rows = []
    for one in fitted:
        for place, scores in one.stage.scores.items():
            label = f"{one.name}: {place}" if len(fitted) > 1 else place
            for count, (axis, of_axis) in enumerate(scores.axes.items()):
                name = f"{label}, axis {axis}" if len(scores.axes) > 1 else label
                rows.append(ScoreRow(name, scores, of_axis, count == 0))
    return rows


def _parameters(fitted: MetaFitted, values: Iterable[float]) -> list[str]:
    """Return the cells of a design's parameters, in their display units."""
    units = map(parameter_unit, fitted.designs.names)
    return [number(float(v) * unit.factor, 4) for v, unit in zip(values, units, strict=True)]


def worst_table(fitted: MetaFitted) -> Table:
    """Return the designs with the largest errors."""
    rows = [
        [
            percent(float(fitted.worst[design]), 3),
            "border" if fitted.border[design] else "interior",
            *_parameters(fitted, fitted.designs.values[design]),
        ]
        for design in fitted.worst_designs(WORST)
    ]
    head = ["worst of range", "place", *(parameter_unit(name).axis for name in fitted.designs.names)]
    return Table("Designs that were missed most", head, rows, numeric=2)


def coverage_table(fitted: MetaFitted) -> Table:
    """Return the coverage of the bars."""
    levels = list(dict.fromkeys(level for found in fitted.stage.coverage.values() for level in found))
    rows = [
        [place, *(percent(found[level], 3) if level in found else "–" for level in levels)]
        for place, found in fitted.stage.coverage.items()
    ]
    head = ["", *(f"in the {100 * float(level):g} % band" for level in levels)]
    note = "Each design's states in bars that the other designs give; each design counts alike."
    return Table("What the error bars hold", head, rows, note)


LEARNING: tuple[Column[Mapping[str, Any]], ...] = (
    Column("n", head="designs"),
    *(
        Column(f"{place}.{key}", head=f"{place}, {label}", show=share_text)
        for place in ("all", "interior")
        for key, label in (("rms", "RMS"), ("worst", "worst"))
    ),
    Column("wall_s", head="fit", show=seconds),
)


def learning_table(learning: Mapping[str, Any]) -> Table:
    """Return errors by number of designs."""
    count, inside = len(learning["test"]), len(learning["interior"])
    note = (
        f"Shares of each design's range at {count} designs that no fit saw, {inside} of them inside the range. "
        "Subsets are nested: corners first, then the design farthest from those before it."
    )
    if learning["left_out"]:
        sizes = ", ".join(str(p["n"]) for p in learning["left_out"])
        note += f" Not fitted: {sizes} ({learning['left_out'][0]['cause']})"
    return page_table("Error by number of designs", LEARNING, learning["points"], note)


def next_table(fitted: MetaFitted) -> Table | None:
    """Return the designs to solve next; None if not requested."""
    rows = [
        [str(count), *_parameters(fitted, one.values), percent(one.gain, 3)]
        for count, one in enumerate(fitted.proposals, start=1)
    ]
    gain = [WORTH.get(one.basis, one.basis) for one in fitted.proposals[:1]]
    head = ["", *(parameter_unit(name).axis for name in fitted.designs.names), *gain]
    return optional_table("Solve these next", head, rows)


def cost_table(fitted: MetaFitted) -> Table:
    """Return the cost of FEM and of the model, per design."""
    n, stage, each = len(fitted.designs), fitted.stage, fitted.fem_s / len(fitted.designs)
    states = sum(len(one) for one in fitted.designs.data)
    values: dict[str, str | None] = {
        "designs solved": f"{n}, {states} states, from {stage.solved.source}",
        "FEM, all designs": seconds(fitted.fem_s) if each else None,
        "FEM, one design": seconds(each) if each else None,
        "fit of the model": seconds(stage.fit_s),
        f"scoring: {stage.parts} refits without some designs": seconds(stage.scoring_s),
        "law of an unseen design, with its error bar": seconds(fitted.law_s),
        "evaluations of it with slopes": f"{number(fitted.per_second / 1e6, 3)} million a second",
    }
    if each:
        ratio = number(float(f"{each / fitted.law_s:.2g}"))
        hours = number(1000 * (each - fitted.law_s) / 3600, 2)
        values["a design by the model instead of FEM"] = f"{ratio} times faster"
        values["FEM saved by every thousand further designs"] = f"{hours} hours of one core"
    note = (
        "The law and its evaluations were timed when this page was made; FEM as measured when it was solved."
    )
    return named_values("Cost", values, note)


def settings_table(fitted: MetaFitted) -> Table | None:
    """Return every detail of the fit that is one word or number."""
    values = {words(name): short_text(value) for name, value in fitted.stage.details.items()}
    return named_values("Details of the fit", values) if any(values.values()) else None


def _worst_free(share: float, lost: int) -> str:
    return f"no equilibrium in {lost} states" if np.isinf(share) else percent(share, 3)


MANY = 500
COLOURS = {"interior": SERIES[0], "border": SERIES[1]}
ZERO = ChartRule(0.0, SOFT, 0.9)


def parity_chart(fitted: MetaFitted) -> Chart:
    """Return for each axis solved against predicted, interior and border apart, then misses of both."""
    effort, misses = effort_unit(fitted.designs.data[0]), fitted.misses
    outer, panels = fitted.border[misses.design], []
    for a, name in enumerate(fitted.axes):
        symbol = f"τ{name}" if len(fitted.axes) > 1 else "τ"
        solved = ChartAxis(f"solved {symbol}", effort.symbol)
        groups = {place: misses.counts[:, a] & (outer == (place == "border")) for place in PLACES}
        for place, rows in list(groups.items())[:2]:
            tau = effort.factor * misses.tau[rows, a]
            predicted = tau + effort.factor * misses.miss[rows, a]
            scores = fitted.stage.scores[place].axes if place in fitted.stage.scores else {}
            r2 = f"{scores[name].r2:.6f}" if name in scores else "–"
            title = f"{symbol}, {place}: {len(np.unique(misses.design[rows]))} designs, R² {r2}"
            y = ChartAxis(f"predicted {symbol}", effort.symbol)
            panels.append(Panel(solved, y, tuple(_parity(tau, predicted, place)), title))
        dots = [
            _dots(effort.factor * misses.tau[rows, a], 100 * fitted.shares[rows, a], place)
            for place, rows in reversed(groups.items())
        ]
        y = ChartAxis("miss", "% of the design's range")
        panels.append(Panel(solved, y, (ZERO, *dots), "Predicted − solved"))
    return Chart(tuple(panels), cell=(520, 480))


def free_chart(fitted: MetaFitted) -> Chart | None:
    """Return free angles of held-out designs: predicted against solved, and misses; None without free states."""
    misses, data = fitted.misses, fitted.designs.data[0]
    if not len(misses.free_design):
        return None
    unit = deformation_unit(data)
    word = "extension" if data.joint == "prismatic" else "angle"
    u, miss = unit.factor * misses.free_angle, unit.factor * misses.free_miss
    largest = np.array([np.abs(u[misses.free_design == d]).max() for d in misses.free_design])
    parity: list[Mark] = []
    missed: list[Mark] = [ZERO]
    for place in PLACES[::-1]:
        rows = (fitted.border[misses.free_design] == (place == "border")) & np.isfinite(miss)
        if rows.any():
            parity += _parity(u[rows], u[rows] + miss[rows], place)
            missed.append(_dots(u[rows], 100 * miss[rows] / largest[rows], place))
    every = fitted.stage.scores["all"]
    worst = "no equilibrium" if np.isinf(every.free_worst) else percent(every.free_worst)
    title = f"Free {word}: median miss {percent(every.free_median)}, worst {worst}"
    solved, predicted = (ChartAxis(f"{side} free {word}", unit.symbol) for side in ("solved", "predicted"))
    share = ChartAxis("miss", f"% of the design's largest free {word}")
    panels = (
        Panel(solved, predicted, tuple(parity), title),
        Panel(solved, share, tuple(missed), "Predicted − solved"),
    )
    return Chart(panels, cell=(780, 520))


def _parity(solved: Array, predicted: Array, place: str) -> list[Mark]:
    if not len(solved):
        return []
    ends = np.array([min(solved.min(), predicted.min()), max(solved.max(), predicted.max())])
    return [ChartLine("", ends, ends, "", SOFT, 1.0), _dots(solved, predicted, place)]


def _dots(x: Array, y: Array, place: str) -> ChartLine:
    dot, opacity = (2.2, "8c") if len(x) > MANY else (3.7, "cc")
    return ChartLine(place, x, y, "", COLOURS[place] + opacity, 0.0, dot)


MOST_PANELS = 6
SPREAD = 0.042  # of a parameter's range: designs at the same point of a panel are drawn next to each other


def designs_chart(fitted: MetaFitted) -> Chart | None:
    """Return one panel for each pair of parameters, at most six; a single parameter over its error."""
    names = fitted.designs.names
    pairs = list(combinations(range(len(names)), 2))[:MOST_PANELS]
    worst = np.where(np.isfinite(fitted.worst), fitted.worst, np.nanmax(fitted.worst))
    shares = 100 * np.maximum(worst, 1e-8)
    ends = float(np.nanmin(shares)), float(np.nanmax(shares))
    scale = ColourScale.decades("worst miss when left out", "% of range", ends, ERROR_COLOURS)
    panels = [_pair_panel(fitted, i, j, shares, scale) for i, j in pairs]
    if not pairs:
        unit = parameter_unit(names[0])
        y = ChartAxis("worst miss", "% of the design's range", log=True)
        dots = _designs(fitted.designs.values[:, 0] * unit.factor, shares, fitted, shares)
        panels = [Panel(ChartAxis(unit.label, unit.symbol), y, dots, scale=scale)]
    return optional_chart(panels, cell=(1560 // min(len(panels), 3) if len(panels) > 1 else 1000, 540))


def _pair_panel(fitted: MetaFitted, i: int, j: int, shares: Array, scale: ColourScale) -> Panel:
    units = [parameter_unit(fitted.designs.names[k]) for k in (i, j)]
    x, y = (fitted.designs.values[:, k] * unit.factor for k, unit in zip((i, j), units, strict=True))
    dx, dy = _beside(x, y)
    marks: list[Mark] = list(_designs(x + dx * np.ptp(x), y + dy * np.ptp(y), fitted, shares))
    for count, proposal in enumerate(fitted.proposals, start=1):
        place = proposal.values[i] * units[0].factor, proposal.values[j] * units[1].factor
        star = np.array(place[:1]), np.array(place[1:])
        marks.append(ChartLine("solve next, in order", *star, "", SERIES[0], 0.0, 13.0, "*"))
        marks.append(ChartNote(f"  {count}", *place, colour=SERIES[0], bold=True))
    axes = [ChartAxis(unit.label, unit.symbol) for unit in units]
    return Panel(axes[0], axes[1], tuple(marks), scale=scale)


def _designs(x: Array, y: Array, fitted: MetaFitted, shares: Array) -> tuple[ChartLine, ...]:
    inner = ~fitted.border
    groups = (
        (f"inside the range ({int(inner.sum())})", inner, "o", 7.9),
        (f"on its border ({int(fitted.border.sum())})", fitted.border, "s", 6.8),
    )
    return tuple(
        ChartLine(name, x[rows], y[rows], "", SOFT, 0.0, size, marker, values=shares[rows])
        for name, rows, marker, size in groups
        if rows.any()
    )


def _beside(x: Array, y: Array) -> tuple[Array, Array]:
    """Return small shifts, shares of the ranges, so that designs with the same two values do not hide each other."""
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


LOOKS = {"all": (INK, "o"), "interior": (SERIES[0], "D"), "border": (SERIES[1], "s")}
LOW, HIGH = 85.0, 95.0  # percent inside the 90 % band: the target of this project


def design_bars_chart(fitted: MetaFitted) -> Chart:
    """Return stated against observed coverage, one line for each place."""
    diagonal = np.array([45.0, 100.0])
    wanted = np.full(2, 90.0), np.array([LOW, HIGH])
    marks: list[Mark] = [
        ChartLine("as stated", diagonal, diagonal, "", SOFT, 1.1),
        ChartLine("wanted of the 90 % band: 85 to 95 %", *wanted, "", SERIES[2], 2.4),
    ]
    lowest = 45.0
    for place, found in fitted.stage.coverage.items():
        levels = 100 * np.array([float(level) for level in found])
        covered = 100 * np.array(list(found.values()))
        colour, marker = LOOKS.get(place, (SERIES[2], "v"))
        marks.append(ChartLine(place, levels, covered, "", colour, 1.6, 7.0, marker))
        lowest = min(lowest, float(covered.min()) - 5)
    y = ChartAxis("states of designs left out inside it", "%", ends=(lowest, 103.0))
    x = ChartAxis("stated level of the band", "%", ends=(45.0, 101.0))
    return Chart((Panel(x, y, tuple(marks), "What the bars of unseen designs hold"),), cell=(1000, 600))
