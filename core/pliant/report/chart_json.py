"""The page's form of a chart: JSON for a script element, with numbers as 16-bit levels."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np

from pliant.records.design import Array
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
from pliant.user_text import escape_controls

LEVELS = 65_534  # largest level of a packed value: its error is at most 1 / 131 068 of its list's range
MISSING = 65_535
KINDS = {
    ChartLine: "line", Band: "band", ChartBars: "bars", ChartCells: "cells", ChartRule: "rule", ChartNote: "note",
}  # fmt: skip
LISTS = ("x", "y", "low", "high", "at", "values")


@dataclass
class PackedLists:
    """Lists of numbers as 16-bit levels between their ends, each list stored once, to keep a page below 3 MB."""

    lists: dict[tuple[float, float, str], int] = field(default_factory=dict)

    def place(self, values: Array) -> int:
        """Return the list's index; an array of several axes is read row by row."""
        values = np.asarray(values, float).ravel()
        known = np.isfinite(values)
        low = float(values[known].min()) if known.any() else 0.0
        span = float(values[known].max()) - low if known.any() else 0.0
        codes = np.full(len(values), MISSING, "<u2")
        codes[known] = np.rint((values[known] - low) / (span or 1.0) * LEVELS).astype("<u2")
        packed = (low, span, base64.b64encode(codes.tobytes()).decode("ascii"))
        return self.lists.setdefault(packed, len(self.lists))

    def as_json(self) -> list[dict[str, Any]]:
        """Return all lists by index."""
        return [{"low": low, "span": span, "levels": levels} for low, span, levels in self.lists]


def as_script_data(chart: Chart) -> str:
    """Return the chart as JSON that is safe inside a script element, whatever names its runs have."""
    pool = PackedLists()
    panels = [_panel(panel, pool) for panel in chart.panels]
    layout = {"column": chart.column, "heights": chart.heights}
    return script_json({**layout, "lists": pool.as_json(), "panels": panels})


def script_json(values: Mapping[str, Any]) -> str:
    """Return JSON in which no text can close the script element or open a comment."""
    text = json.dumps(values, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _panel(panel: Panel, pool: PackedLists) -> dict[str, Any]:
    return {
        "title": escape_controls(panel.title),
        "below": escape_controls(panel.below),
        "x": _axis(panel.x),
        "y": _axis(panel.y),
        "marks": [_mark(mark, pool) for mark in panel.marks],
        "linked": escape_controls(panel.linked),
        "equal": panel.equal,
        "scale": None if panel.scale is None else asdict(panel.scale),
    }


def _axis(axis: ChartAxis) -> dict[str, Any]:
    words = {
        "label": escape_controls(axis.label),
        "unit": escape_controls(axis.unit),
        "text": escape_controls(axis.text),
    }
    return {
        **words,
        "names": [escape_controls(name) for name in axis.names],
        "ends": axis.ends,
        "log": axis.log,
    }


def _mark(mark: Mark, pool: PackedLists) -> dict[str, Any]:
    """Return the mark's fields; numbers 0, empty texts and false are left out."""
    packed: dict[str, Any] = {"kind": KINDS[type(mark)]}
    plain = isinstance(mark, ChartRule | ChartNote)
    for name in (one.name for one in fields(mark)):
        value = getattr(mark, name)
        if name in LISTS and not plain:
            if value is not None:
                packed[name] = pool.place(value)
        elif isinstance(value, str):
            packed |= {name: escape_controls(value)} if value else {}
        elif value:
            packed[name] = value
    return packed
