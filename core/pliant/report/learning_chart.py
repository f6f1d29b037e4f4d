"""Error against the number of states or of designs that a model was fitted to: curves, and the table of states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.formatting import percent
from pliant.pipeline.learning import states_needed
from pliant.report.chart import Band, Chart, ChartAxis, ChartLine, ChartRule, Mark, Panel
from pliant.report.chart_colours import SERIES
from pliant.report.document import Cells, Table

SMALLEST = 1e-8
MARKS = (1e-3, 1e-4, 1e-5)  # shares of the range, for which the table states the number of states


@dataclass(frozen=True)
class Curve:
    """One line: `points` of (n, share), several for one n if orders differ; `dashed` for the worst error."""

    label: str
    points: Sequence[tuple[int, float]]
    colour: int = 0
    dashed: bool = False


def state_curves(learning: Mapping[str, Any]) -> list[Curve]:
    """Return the lines of a surrogate's learning curve: RMS and worst, with slopes and without."""
    curves = []
    names = list(dict.fromkeys(p["slopes"] for p in learning["points"]))
    for name in names:
        colour = 0 if name == "with slopes" else 1
        chosen = [p for p in learning["points"] if p["slopes"] == name]
        curves.append(Curve(f"{name}, RMS", [(p["n"], p["rms"]) for p in chosen], colour))
        curves.append(Curve(f"{name}, worst", [(p["n"], p["worst"]) for p in chosen], colour, dashed=True))
    return curves


def learning_chart(
    title: str, curves: Sequence[Curve], counted: str, error: ChartAxis, mark: float | None = None
) -> Chart:
    """Return the curves over the number of what is `counted`, on logarithmic axes; `mark` draws a line at a share."""
    marks: list[Mark] = []
    if mark is not None:
        marks.append(ChartRule(100 * mark, SERIES[2], 1.2, text=percent(mark)))
    for curve in curves:
        n = np.array(sorted({count for count, _ in curve.points}))
        by_n = [[100 * max(s, SMALLEST) for count, s in curve.points if count == size] for size in n]
        colour, middle = SERIES[curve.colour % len(SERIES)], np.array([np.median(values) for values in by_n])
        if any(len(values) > 1 for values in by_n):
            low, high = (np.array([end(values) for values in by_n]) for end in (min, max))
            marks.append(Band(curve.label, n, low, high, colour=f"{colour}22"))
        marker, dashed = ("D", True) if curve.dashed else ("o", False)
        marks.append(ChartLine(curve.label, n, middle, "", colour, 1.6, 5.5, marker, dashed, dashed))
    panel = Panel(ChartAxis(counted, log=True), error, tuple(marks), title)
    return Chart((panel,), cell=(1000, 580))


def learning_table(learning: Mapping[str, Any]) -> Table:
    """Return errors by number of states, and the number of states that an error needs."""
    names = list(dict.fromkeys(p["slopes"] for p in learning["points"]))
    sizes = sorted({p["n"] for p in learning["points"]})
    rows: list[Cells] = []
    for n in sizes:
        cells = [str(n)]
        for name in names:
            found = [p for p in learning["points"] if p["slopes"] == name and p["n"] == n]
            for score in ("rms", "worst"):
                cells.append(percent(float(np.median([p[score] for p in found]))) if found else "–")
        rows.append(cells)
    for mark in MARKS:
        cells = [f"states for {percent(mark)}"]
        for name in names:
            for score in ("rms", "worst"):
                needed = states_needed(learning, mark, name, score)
                cells.append("not reached" if needed is None else str(needed))
        rows.append(cells)
    head = ["states", *(f"{name}, {score}" for name in names for score in ("RMS", "worst"))]
    note = (
        f"Shares of the effort's range at {learning['n_check']} check states. Subsets are nested: corners of the box "
        "first, then the state farthest from those before it; with several axes each gets one in turn."
    )
    if untrusted := learning.get("untrusted"):
        note += f" {untrusted} states that are not trusted (self-contact) are not used."
    impossible = sorted({p["n"] for p in learning["left_out"]})
    if impossible:
        note += f" Too few to fit: {', '.join(map(str, impossible))} ({learning['left_out'][0]['cause']})."
    return Table("Error by number of states", head, rows, note)
