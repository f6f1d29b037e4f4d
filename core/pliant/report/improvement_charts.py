"""The chart of an improvement: the error on held-out runs after each step, over the noise floor."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pliant.diagnosis.steps import Improvement
from pliant.formatting import number, output_unit
from pliant.report.chart import Band, Chart, ChartAxis, ChartLine, ChartNote, ChartRule, Mark, Panel, strokes
from pliant.report.chart_colours import SERIES, SOFT

MOST_OUTPUTS = 2
HEIGHT_PX, STEP_PX, MARGIN_PX, SMALLEST_PX, WIDEST_PX = 540, 200, 160, 880, 1770


def steps_chart(improvement: Improvement) -> Chart:
    """Return a panel per output, the largest error over its floor first: a staircase with short labels."""
    first = improvement.steps[0].locked.rmse

    def above(name: str) -> float:
        floor = improvement.floors[name].value
        return first[name] / floor if floor > 0.0 else math.inf

    outputs = sorted(first, key=above, reverse=True)[:MOST_OUTPUTS]
    width = max(SMALLEST_PX, STEP_PX * len(improvement.steps) + MARGIN_PX)
    panels = tuple(_step_panel(improvement, name) for name in outputs)
    return Chart(panels, cell=(min(width, WIDEST_PX // len(outputs)), HEIGHT_PX))


def _step_panel(improvement: Improvement, name: str) -> Panel:
    words, floor = output_unit(name), improvement.floors[name]
    places = np.arange(len(improvement.steps), dtype=float)
    locked = np.array([step.locked.rmse[name] for step in improvement.steps]) * words.factor
    training = np.array([step.training.rmse.get(name, np.nan) for step in improvement.steps]) * words.factor
    share = np.nan_to_num([step.locked_se / step.locked.over_floor for step in improvement.steps])
    level, error = floor.value * words.factor, floor.se * words.factor
    ends = (-0.5, len(places) - 0.5)
    known = f"noise floor {words.text(floor.value, 2)}" if level > 0.0 else "no noise floor is known"
    label = "runs held out at the start" if improvement.locked.runs else improvement.scored_on
    treads = np.repeat([ends[0], *(places[:-1] + 0.5), ends[1]], 2)[1:-1]
    marks: list[Mark] = [
        Band(
            "noise floor",
            np.array(ends),
            np.full(2, level - 2 * error),
            np.full(2, level + 2 * error),
            colour="#dfe2e8",
        ),
        ChartRule(level, SOFT, 1.2, dashed=True),
        ChartNote(known, ends[1], level if level > 0.0 else 0.0, "left", SOFT),
        ChartLine(label, treads, np.repeat(locked, 2), "", f"{SERIES[0]}59", 2.2),
        ChartLine("training runs, left out in turn", places, training, "", SOFT, 1.0, 4.0, dashed=True),
        ChartLine(label, *strokes(places, locked * (1 - share), locked * (1 + share)), "", SERIES[0], 2.2),
        ChartLine(label, places, locked, "", SERIES[0], 0.0, 8.0),
    ]
    marks += [
        ChartNote(f"  {number(value, 3)}", at, value, "above", SERIES[0], bold=True)
        for at, value in zip(places.tolist(), locked.tolist(), strict=True)
    ]
    top = 1.38 * float(np.nanmax([*(locked * (1 + share)), *training, level])) or 1.0
    names = tuple(_label(k, step.added) for k, step in enumerate(improvement.steps, start=1))
    x = ChartAxis("step", names=names, ends=ends)
    return Panel(x, ChartAxis("rms error", words.symbol, ends=(0.0, top)), tuple(marks), words.label)


def _label(place: int, added: Sequence[str]) -> str:
    name = " + ".join(kind.replace("_", " ") for kind in added)
    return f"{place}: + {name}" if added else f"{place}: as it was"
