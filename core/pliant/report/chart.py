"""The description of a chart: axes, scales of colour and marks on panels.

`report/still.py` draws it with matplotlib, `report/chart_json.py` and `templates/chart.js` on the page.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from pliant.records.design import Array
from pliant.report.chart_colours import INK, SERIES, SOFT, ColourScale


@dataclass(frozen=True)
class ChartAxis:
    """The quantity on an axis: its name in words and the unit of its values. Without a name the axis has no numbers.

    Attributes:
        names: texts instead of numbers, at 0, 1, 2 …; on an upright axis the first is uppermost.
        ends: of the shown range; by default those of the data.
        log: whether the scale is logarithmic.
    """

    label: str = ""
    unit: str = ""
    names: tuple[str, ...] = ()
    ends: tuple[float, float] | None = None
    log: bool = False

    @property
    def text(self) -> str:
        """Return the label of the axis: ``tip x (mm)``."""
        return f"{self.label} ({self.unit})" if self.unit else self.label


@dataclass(frozen=True, eq=False)
class ChartLine:
    """Values over others, in the units of the panel's axes, as a line, as dots, or as both.

    Attributes:
        name: of the mark; marks of one name have one entry in the legend and are switched together, e.g. "measured".
        x, y: (n,) abscissae and values; NaN where nothing is known, which interrupts the line.
        run: the run it belongs to, which can be switched off; "" without a run.
        colour: as #rrggbb or #rrggbbaa.
        width: of the line, in points; 0 without a line.
        dot: size of a dot at each value, in points; 0 without dots.
        marker: shape of the dots, one of "osD^vPx+*|".
        hollow: whether dots are filled with the colour of the paper.
        dashed: whether the line is dashed.
        outside: colour that fills the area from zero where y leaves the panel's first band; "" fills nothing.
        fill: colour of the enclosed area; "" fills nothing.
        rim: whether y are shares of the panel's height instead of values.
        values: (n,) values that colour the dots on the panel's scale; None for dots in the line's colour.
    """

    name: str
    x: Array
    y: Array
    run: str = ""
    colour: str = INK
    width: float = 1.0
    dot: float = 0.0
    marker: str = "o"
    hollow: bool = False
    dashed: bool = False
    outside: str = ""
    fill: str = ""
    rim: bool = False
    values: Array | None = None


@dataclass(frozen=True, eq=False)
class Band:
    """A filled stripe from `low` to `high` (n,) over `x` (n,); with `rim` these are shares of the panel's height."""

    name: str
    x: Array
    low: Array
    high: Array
    run: str = ""
    colour: str = "#bcd9ee"
    rim: bool = False


@dataclass(frozen=True, eq=False)
class ChartBars:
    """Bars of one colour from `low` to `high` (n,) at the places `at` (n,), `thick` wide; lying, or `upright`."""

    name: str
    at: Array
    low: Array
    high: Array
    run: str = ""
    colour: str = SERIES[0]
    thick: float = 0.62
    upright: bool = False


@dataclass(frozen=True, eq=False)
class ChartCells:
    """Values (rows, columns) as colours of the panel's scale, between edges `x` and `y`; NaN stays empty.

    `digits`: write each value with so many digits into its cell.
    """

    name: str
    x: Array
    y: Array
    values: Array
    run: str = ""
    digits: int = 0


@dataclass(frozen=True)
class ChartRule:
    """A straight line across the whole panel, at a value of y or, `upright`, of x; `text` stands at its end."""

    at: float
    colour: str = SOFT
    width: float = 1.0
    dashed: bool = False
    upright: bool = False
    text: str = ""
    name: str = ""
    run: str = ""


@dataclass(frozen=True)
class ChartNote:
    """A text at a place, on that side of it ("left", "right", "above", "below", "centre"); `rim` as in `ChartLine`."""

    text: str
    x: float
    y: float
    side: str = "right"
    colour: str = INK
    rim: bool = False
    bold: bool = False
    name: str = ""
    run: str = ""


Mark = ChartLine | Band | ChartBars | ChartCells | ChartRule | ChartNote
One = TypeVar("One", bound=Mark)


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes.

    Attributes:
        marks: drawn in this order.
        title: above the panel; `below` is small print beneath the title.
        linked: panels with the same name here share the visible range of x.
        equal: whether both axes have the same scale, as in a view of a body.
        scale: of the marks that are coloured by a value.
    """

    x: ChartAxis
    y: ChartAxis
    marks: tuple[Mark, ...]
    title: str = ""
    below: str = ""
    linked: str = ""
    equal: bool = False
    scale: ColourScale | None = None

    @property
    def lines(self) -> tuple[ChartLine, ...]:
        """Return the lines and dots."""
        return self.select(ChartLine)

    @property
    def bands(self) -> tuple[Band, ...]:
        """Return the bands."""
        return self.select(Band)

    def select(self, kind: type[One]) -> tuple[One, ...]:
        """Return the marks of one kind."""
        return tuple(mark for mark in self.marks if isinstance(mark, kind))


@dataclass(frozen=True, eq=False)
class Chart:
    """All panels of one picture, `column` of them below one another in a cell.

    Attributes:
        heights: relative heights of the panels in a cell; equal by default.
        widths: relative widths of the cells in the still; equal by default.
        across: number of cells in a row of the still, at most.
        cell: width and height of a cell of the still, in pixels.
        legend: names of the marks in the legend of the still; None: all, if there are two to twelve.
    """

    panels: tuple[Panel, ...]
    column: int = 1
    heights: tuple[float, ...] = ()
    widths: tuple[float, ...] = ()
    across: int = 3
    cell: tuple[int, int] = (760, 620)
    legend: tuple[str, ...] | None = None

    @property
    def keyed(self) -> tuple[str, ...]:
        """Return the names in the legend."""
        if self.legend is not None:
            return self.legend
        marks = (mark for panel in self.panels for mark in panel.marks)
        names = dict.fromkeys(mark.name for mark in marks if mark.name and not isinstance(mark, ChartCells))
        return tuple(names) if 2 <= len(names) <= 12 else ()


def optional_chart(panels: Iterable[Panel | None], **layout: object) -> Chart | None:
    """Return the chart of the panels that exist; None without any."""
    shown = tuple(panel for panel in panels if panel is not None)
    return Chart(shown, **layout) if shown else None  # type: ignore[arg-type]


def finite(values: Array) -> Array:
    """Return the finite values."""
    values = np.asarray(values, float).ravel()
    return values[np.isfinite(values)]


def padded(low: float, high: float, share: float = 0.06) -> tuple[float, float]:
    """Return the ends moved apart by a share of their distance, or by something if they are equal."""
    pad = share * (high - low) or 0.5 * abs(high) or 1.0
    return low - pad, high + pad


def finite_heights(marks: Iterable[Mark]) -> Array:
    """Return all finite y of lines, bands and rules that are values."""
    found = [np.zeros(0)]
    for mark in marks:
        if isinstance(mark, ChartLine) and not mark.rim:
            found.append(finite(mark.y))
        elif isinstance(mark, Band) and not mark.rim:
            found += [finite(mark.low), finite(mark.high)]
    return np.concatenate(found)


def one_height(panels: Sequence[Panel], every: int = 1) -> tuple[Panel, ...]:
    """Return the panels with common ends of y; of panels stacked by `every`, those of one row share them."""
    ends: list[tuple[float, float] | None] = []
    for row in range(every):
        heights = finite_heights(mark for panel in panels[row::every] for mark in panel.marks)
        ends.append(padded(float(heights.min()), float(heights.max())) if len(heights) else None)
    return tuple(replace(panel, y=replace(panel.y, ends=ends[k % every])) for k, panel in enumerate(panels))


def level_line(x: Array, value: float) -> tuple[Array, Array]:
    """Return the ends of a horizontal stripe under readings at `x` (n,), and its value at them."""
    known = finite(x)
    ends = np.array([known.min(), known.max()]) if len(known) else np.zeros(2)
    return ends, np.full(2, value)


def staircase(x: Array, y: Array) -> tuple[Array, Array]:
    """Return the corners of a staircase that keeps each value until it changes."""
    turns = np.flatnonzero(np.append(True, y[1:] != y[:-1]) | (np.arange(len(y)) == len(y) - 1))
    return np.repeat(x[turns], 2)[1:], np.repeat(y[turns], 2)[:-1]


def strokes(x: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return a line of separate upright strokes from `low` to `high` (n,) at `x` (n,)."""
    gap = np.full(len(x), np.nan)
    return np.stack([x, x, gap], axis=1).ravel(), np.stack([low, high, gap], axis=1).ravel()


def spread_labels(heights: Sequence[float], gap: float, floor: float = -np.inf) -> Array:
    """Return heights of labels, moved as little as necessary to keep a gap between them, none below the floor."""
    order = np.argsort(heights, kind="stable")
    places = np.array(heights, float)[order]
    for _ in range(200):
        for k in range(len(places) - 1):
            short = gap - (places[k + 1] - places[k])
            if short > 1e-9 * gap:
                places[k] -= short / 2
                places[k + 1] += short / 2
    if len(places):
        places += max(floor - places[0], 0.0)
    result = np.empty_like(places)
    result[order] = places
    return result


OUTER, FAR_OUT = 0.05, 4.0


def robust_ends(values: Array) -> tuple[float, float] | None:
    """Return the ends of an axis without a few far outliers that would compress the others; None without outliers.

    Outliers: the whole range is more than `FAR_OUT` times that without `OUTER` of the values at each end.
    """
    if not len(values):
        return None
    low, high = (float(end) for end in np.quantile(values, [OUTER, 1 - OUTER]))
    first, last, span = float(values.min()), float(values.max()), high - low
    if not 0 < FAR_OUT * span < last - first:
        return None
    return max(first, low - 0.25 * span), min(last, high + 0.25 * span)
