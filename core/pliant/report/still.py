"""The still of a chart, drawn with matplotlib."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from functools import singledispatch
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pliant.formatting import number
from pliant.report.chart import (
    Band,
    Chart,
    ChartAxis,
    ChartBars,
    ChartCells,
    ChartLine,
    ChartNote,
    ChartRule,
    Mark,
    Panel,
)
from pliant.report.chart_colours import INK, PAPER, SOFT, ColourScale
from pliant.report.figures import style
from pliant.store.store import whole_file

NARROWEST_PX, LEGEND_PX, TITLE = 800, 60, 9.5
LINE_OF_ROW, LINE_OF_COLUMN = 40, 14  # characters of a name on one line
STEEP = 4  # longer names of more columns are turned
ENTRY_PX = 190  # of a legend
SIDES = {  # horizontal and vertical alignment of a note, and its distance in points
    "right": ("left", "center", (5, 0)),
    "left": ("right", "center", (-5, 0)),
    "above": ("center", "bottom", (0, 4)),
    "below": ("center", "top", (0, -4)),
    "centre": ("center", "center", (0, 0)),
}


def still(chart: Chart) -> style.Png:
    """Return the chart as PNG bytes, of few colours where no value is shown by its colour."""
    with drawn(chart) as figure:
        shaded = any(panel.scale is not None for panel in chart.panels)
        return style.png(figure) if shaded else style.small_png(figure)


@contextmanager
def drawn(chart: Chart) -> Iterator[Any]:
    """Yield the chart's figure: cells in rows, the legend above, scales of colour at the right."""
    count = len(chart.panels) // chart.column
    columns = min(count, chart.across)
    rows = -(-count // columns)
    columns = -(-count // rows)
    width, height = chart.cell
    size = max(columns * width, NARROWEST_PX), rows * height + (LEGEND_PX if chart.keyed else 0)
    ratios = {"height_ratios": (chart.heights or (1.0,) * chart.column) * rows}
    ratios |= {"width_ratios": chart.widths} if len(chart.widths) == columns else {}
    with style.canvas(*size, pad=(0.06, 0.05), wspace=0.03) as figure:
        grid = figure.subplots(chart.column * rows, columns, squeeze=False, gridspec_kw=ratios)
        for axes in grid.ravel():
            axes.set_axis_off()
        done = []
        for k, panel in enumerate(chart.panels):
            cell, level = divmod(k, chart.column)
            axes = grid[cell // columns * chart.column + level, cell % columns]
            axes.set_axis_on()
            draw_panel(axes, panel)
            done.append((axes, panel))
            if level and panel.x.text == done[k - 1][1].x.text:
                _join(done[k - 1][0], axes)
            if cell % columns and _same_height(panel.y, done[k - chart.column][1].y):
                axes.set_ylabel("")
                axes.tick_params(labelleft=False)
        _colour_bars(figure, done)
        if chart.keyed:
            _legend(figure, chart)
        yield figure


def write_still(chart: Chart, path: Path) -> None:
    """Write the chart into a .svg, .png or .pdf; the file is written completely or not at all."""
    with drawn(chart) as figure, whole_file(path) as partial:
        figure.savefig(partial, format=path.suffix[1:].lower(), dpi=style.DPI)


def draw_panel(axes: Any, panel: Panel, legend: bool = False) -> None:
    """Draw a panel on matplotlib axes."""
    for axis, shown, line in ((axes.xaxis, panel.x, LINE_OF_COLUMN), (axes.yaxis, panel.y, LINE_OF_ROW)):
        _set_axis(axes, axis, shown, line)
    if panel.equal:
        fixed = panel.x.ends is not None or panel.y.ends is not None
        axes.set_aspect("equal", adjustable="box" if fixed else "datalim")
        axes.margins(0.1)
    for order, mark in enumerate(panel.marks):
        draw(mark, axes, panel, 2.0 + 0.01 * order)
    if panel.x.ends is not None:
        axes.set_xlim(panel.x.ends)
    if panel.y.names:
        axes.set_ylim((panel.y.ends or (-0.6, len(panel.y.names) - 0.4))[::-1])
    elif panel.y.ends is not None:
        axes.set_ylim(panel.y.ends)
    axes.set(xlabel=panel.x.text, ylabel="" if panel.y.names else panel.y.text)
    if panel.below:
        style.heading(axes, panel.title, panel.below)
    elif panel.title:
        axes.set_title(panel.title, fontsize=TITLE)
    if legend:
        axes.legend(handles=_entries((panel,), tuple(dict.fromkeys(m.name for m in panel.marks if m.name))))


def _set_axis(axes: Any, axis: Any, shown: ChartAxis, line: int) -> None:
    if shown.log:
        (axes.set_xscale if axis is axes.xaxis else axes.set_yscale)("log")
    if shown.names:
        steep = axis is axes.xaxis and len(shown.names) > STEEP and max(map(len, shown.names)) > line
        look = {"rotation": 35, "ha": "right", "rotation_mode": "anchor", "fontsize": 8} if steep else {}
        names = shown.names if steep else [textwrap.fill(name, line) for name in shown.names]
        axis.set_ticks(range(len(names)), names, **look)
        axis.set_tick_params(length=0)
    if shown.names or not shown.label:
        axis.grid(visible=False)
    if not shown.names and not shown.label:
        axis.set_ticks([])
        axes.spines["bottom" if axis is axes.xaxis else "left"].set_visible(False)


def _join(above: Any, axes: Any) -> None:
    """Share the visible range of x with the panel above, which loses its numbers."""
    axes.sharex(above)
    above.set_xlabel("")
    above.tick_params(labelbottom=False)


def _same_height(one: ChartAxis, other: ChartAxis) -> bool:
    return one == other and (one.ends is not None or bool(one.names))


@singledispatch
def draw(mark: Mark, axes: Any, panel: Panel, order: float) -> None:
    """Draw a mark."""
    raise TypeError(f"{type(mark).__name__} is no mark of a chart")


@draw.register
def _line(mark: ChartLine, axes: Any, panel: Panel, order: float) -> None:
    rim = {"transform": axes.get_xaxis_transform(), "clip_on": False} if mark.rim else {}
    if mark.values is not None and panel.scale is not None:
        colours = dict(zip(("cmap", "norm"), _mapped(panel.scale), strict=True))
        look = {"marker": mark.marker, "edgecolor": INK, "linewidths": 0.5, "zorder": order, **colours}
        axes.scatter(mark.x, mark.y, mark.dot**2, c=mark.values, **look)
        return
    dots: dict[str, Any] = {"ms": mark.dot, "mew": 0.6, "mec": mark.colour, "marker": mark.marker}
    if mark.hollow:
        dots |= {"mfc": PAPER, "mew": 1.2}
    look = {
        "color": mark.colour,
        "lw": mark.width,
        "ls": "none" if not mark.width else "--" if mark.dashed else "-",
    }
    axes.plot(mark.x, mark.y, zorder=order, **look, **(dots if mark.dot else {}), **rim)
    if mark.fill:
        axes.fill(mark.x, mark.y, color=mark.fill, lw=0, zorder=order)
    if mark.outside and panel.bands:
        beyond = (mark.y < panel.bands[0].low) | (mark.y > panel.bands[0].high)
        area = {"color": mark.outside, "alpha": 0.75, "lw": 0, "interpolate": False, "zorder": order}
        axes.fill_between(mark.x, 0, mark.y, where=beyond, **area)


@draw.register
def _band(mark: Band, axes: Any, panel: Panel, order: float) -> None:
    rim = {"transform": axes.get_xaxis_transform()} if mark.rim else {}
    axes.fill_between(mark.x, mark.low, mark.high, color=mark.colour, lw=0, zorder=order - 1, **rim)


@draw.register
def _bars(mark: ChartBars, axes: Any, panel: Panel, order: float) -> None:
    low, size = np.asarray(mark.low), np.asarray(mark.high) - np.asarray(mark.low)
    if mark.upright:
        axes.bar(mark.at, size, mark.thick, low, color=mark.colour, zorder=order)
    else:
        axes.barh(mark.at, size, mark.thick, low, color=mark.colour, zorder=order)


@draw.register
def _cells(mark: ChartCells, axes: Any, panel: Panel, order: float) -> None:
    assert panel.scale is not None
    colours, norm = _mapped(panel.scale)
    axes.pcolormesh(mark.x, mark.y, mark.values, cmap=colours, norm=norm, rasterized=True, zorder=order - 1)
    axes.grid(visible=False)
    middles = [(np.asarray(edges)[1:] + np.asarray(edges)[:-1]) / 2 for edges in (mark.x, mark.y)]
    for (row, column), value in np.ndenumerate(mark.values if mark.digits else np.zeros((0, 0))):
        if np.isfinite(value):
            dark = np.dot(colours(norm(value))[:3], (0.3, 0.59, 0.11)) < 0.5
            look = {"ha": "center", "va": "center", "fontsize": 7.5, "color": PAPER if dark else INK}
            axes.text(
                middles[0][column], middles[1][row], number(float(value), mark.digits), zorder=order, **look
            )


@draw.register
def _rule(mark: ChartRule, axes: Any, panel: Panel, order: float) -> None:
    look = {"color": mark.colour, "lw": mark.width, "ls": "--" if mark.dashed else "-", "zorder": order - 0.5}
    (axes.axvline if mark.upright else axes.axhline)(mark.at, **look)
    if mark.text and mark.upright:
        where = {"xycoords": ("data", "axes fraction"), "va": "top"}
        style.note(axes, mark.text, (mark.at, 1.0), (3, -3), color=mark.colour, **where)
    elif mark.text:
        where = {"xycoords": ("axes fraction", "data"), "ha": "right"}
        style.note(axes, mark.text, (1.0, mark.at), (-4, 3), color=mark.colour, **where)


@draw.register
def _note(mark: ChartNote, axes: Any, panel: Panel, order: float) -> None:
    across, up, shift = SIDES[mark.side]
    look: dict[str, Any] = {"ha": across, "va": up, "color": mark.colour, "zorder": order + 1}
    look |= {"weight": "bold"} if mark.bold else {}
    look |= {"xycoords": ("data", "axes fraction")} if mark.rim else {}
    style.note(axes, mark.text, (mark.x, mark.y), shift, fontsize=8, annotation_clip=False, **look)


def _mapped(scale: ColourScale) -> tuple[LinearSegmentedColormap, Normalize]:
    """Return matplotlib's form of a scale of colours."""
    norm = (LogNorm if scale.log else Normalize)(scale.at[0], scale.at[-1], clip=True)
    places = np.clip(np.asarray(norm(np.array(scale.at))), 0.0, 1.0)
    places[0], places[-1] = 0.0, 1.0
    stops = list(zip(places.tolist(), scale.colours, strict=True))
    return LinearSegmentedColormap.from_list("scale", stops, N=512), norm


def _colour_bars(figure: Any, drawn: list[tuple[Any, Panel]]) -> None:
    """Draw one bar of colours for the picture where all panels have the same scale, else one beside each panel."""
    scaled = [(axes, panel.scale) for axes, panel in drawn if panel.scale is not None]
    alike = len({scale for _, scale in scaled}) == 1
    groups = [([axes for axes, _ in scaled], scaled[0][1])] if alike else [([a], s) for a, s in scaled]
    for axes, scale in groups:
        colours, norm = _mapped(scale)
        label = f"{scale.label} ({scale.unit})" if scale.unit else scale.label
        bar = style.colour_bar(figure, (norm, colours), label, ax=axes, pad=0.015, fraction=0.04, aspect=30)
        if scale.log:
            style.log_labels(bar.yaxis)


def _legend(figure: Any, chart: Chart) -> None:
    handles = _entries(chart.panels, chart.keyed)
    columns = min(len(handles), int(figure.get_figwidth() * style.DPI / ENTRY_PX))
    figure.legend(handles=handles, loc="outside upper right", ncols=columns, handletextpad=0.5)


def _entries(panels: tuple[Panel, ...], names: tuple[str, ...]) -> list[Any]:
    """Return an entry of the legend for each name: the look of its first mark."""
    first: dict[str, Mark] = {}
    for mark in (mark for panel in panels for mark in panel.marks):
        first.setdefault(mark.name, mark)
    return [_entry(first[name], name) for name in names if name in first]


def _entry(mark: Mark, name: str) -> Any:
    if isinstance(mark, ChartLine):
        dot: dict[str, Any] = {
            "marker": mark.marker,
            "ms": min(mark.dot, 7.0),
            "mfc": PAPER if mark.hollow else None,
        }
        style_of = "none" if not mark.width else "--" if mark.dashed else "-"
        colour = SOFT if mark.values is not None else mark.colour
        return Line2D(
            [], [], color=colour, lw=mark.width, ls=style_of, label=name, **(dot if mark.dot else {})
        )
    if isinstance(mark, Band | ChartBars):
        return Patch(color=mark.colour, lw=0, label=name)
    return Line2D([], [], color=getattr(mark, "colour", INK), label=name)
