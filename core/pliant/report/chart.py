"""A picture's data: lines and bands of runs on panels, from which the still picture and the moving one are drawn."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pliant.records.design import Array
from pliant.user_text import visible

LEVELS = 65_534  # of a packed value: it is off by at most 1 / 131 068 of its list's range
MISSING = 65_535


@dataclass(frozen=True)
class ChartAxis:
    """What an axis shows: its name in words and the unit of the values on it.

    `names` stand at 0, −1, −2 … instead of numbers, the first of them uppermost.
    """

    label: str
    unit: str = ""
    names: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """As it stands beside the axis: ``tip x (mm)``."""
        return f"{self.label} ({self.unit})" if self.unit else self.label


@dataclass(frozen=True, eq=False)
class ChartLine:
    """Values over others, in the units of the panel's axes.

    Attributes:
        name: what it is; lines and bands of one name are switched together, e.g. "measured".
        x, y: (n,) places and values; NaN where nothing is known, and the line is broken.
        run: the run it belongs to, which can be switched off; "" where it belongs to none.
        colour: as #rrggbb or #rrggbbaa.
        width: of the line, in points.
        dot: size of a dot at each value, in points; 0 without dots.
        outside: colour that fills, from zero, what leaves the panel's first band; "" fills nothing.
    """

    name: str
    x: Array
    y: Array
    run: str = ""
    colour: str = "#1d2433"
    width: float = 1.0
    dot: float = 0.0
    outside: str = ""


@dataclass(frozen=True, eq=False)
class Band:
    """A filled stripe between `low` and `high` (n,) over `x` (n,), in the units of the panel's axes."""

    name: str
    x: Array
    low: Array
    high: Array
    run: str = ""
    colour: str = "#bcd9ee"


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes.

    Attributes:
        title: above it; `below` in small print beneath the title.
        lines, bands: what is drawn, in this order, bands behind lines.
        zero: colour of a line at zero; "" without one.
        y_range: ends of y that suit every panel of the picture; None: its own.
        linked: panels of one such name share the stretch of x that is looked at.
        equal: whether a length is as long across as upward, as in a view of a body.
    """

    x: ChartAxis
    y: ChartAxis
    lines: tuple[ChartLine, ...]
    bands: tuple[Band, ...] = ()
    title: str = ""
    below: str = ""
    zero: str = ""
    y_range: tuple[float, float] | None = None
    linked: str = ""
    equal: bool = False


@dataclass(frozen=True, eq=False)
class Chart:
    """All panels of one picture, `column` of them below one another: the first and third tall, the second low."""

    panels: tuple[Panel, ...]
    column: int = 1


@dataclass
class PackedLists:
    """Lists of numbers as 16-bit levels between their ends, each list once: what a page of 3 MB needs."""

    lists: dict[tuple[float, float, str], int] = field(default_factory=dict)

    def place(self, values: Array) -> int:
        """The list's number among all; an array of more axes is read row by row."""
        values = np.asarray(values, float).ravel()
        known = np.isfinite(values)
        low = float(values[known].min()) if known.any() else 0.0
        span = float(values[known].max()) - low if known.any() else 0.0
        codes = np.full(len(values), MISSING, "<u2")
        codes[known] = np.rint((values[known] - low) / (span or 1.0) * LEVELS).astype("<u2")
        packed = (low, span, base64.b64encode(codes.tobytes()).decode("ascii"))
        return self.lists.setdefault(packed, len(self.lists))

    def as_json(self) -> list[dict[str, Any]]:
        """All lists by their numbers."""
        return [{"low": low, "span": span, "levels": levels} for low, span, levels in self.lists]


def as_script_data(chart: Chart) -> str:
    """The chart as JSON that may stand inside a script element, whatever names its runs have."""
    pool = PackedLists()
    panels = [_panel(panel, pool) for panel in chart.panels]
    return script_json({"column": chart.column, "lists": pool.as_json(), "panels": panels})


def script_json(values: Mapping[str, Any]) -> str:
    """JSON that no name in it can end early: the element cannot be closed, no comment opened."""
    text = json.dumps(values, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _panel(panel: Panel, pool: PackedLists) -> dict[str, Any]:
    lines = [
        {
            **_named(line),
            "x": pool.place(line.x),
            "y": pool.place(line.y),
            "width": line.width,
            "dot": line.dot,
            "outside": line.outside,
        }
        for line in panel.lines
    ]
    bands = [
        {**_named(band), "x": pool.place(band.x), "low": pool.place(band.low), "high": pool.place(band.high)}
        for band in panel.bands
    ]
    return {
        "title": visible(panel.title),
        "below": visible(panel.below),
        "x": _axis(panel.x),
        "y": _axis(panel.y),
        "lines": lines,
        "bands": bands,
        "zero": panel.zero,
        "range": panel.y_range,
        "linked": visible(panel.linked),
        "equal": panel.equal,
    }


def _axis(axis: ChartAxis) -> dict[str, Any]:
    words = {"label": visible(axis.label), "unit": visible(axis.unit), "text": visible(axis.text)}
    return {**words, "names": [visible(name) for name in axis.names]}


def _named(part: ChartLine | Band) -> dict[str, str]:
    return {"name": visible(part.name), "run": visible(part.run), "colour": part.colour}
