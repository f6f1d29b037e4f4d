"""The section on the uncertainty of the tip that the laws' error bars cause: tips of drawn laws, intervals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pliant.formatting import Unit, display_unit, fixed, number, output_unit, small_length
from pliant.pipeline.run_folder import FinishedRun
from pliant.records.design import Array
from pliant.report.chart import Band, Chart, ChartAxis, ChartLine, ChartNote, Panel
from pliant.report.chart_colours import SERIES, WARN
from pliant.report.document import Cells, Section, Table, picture, section
from pliant.report.run_view import spread_sentence

TIP = ("tip_x_m", "tip_y_m", "tip_z_m")
COORDINATES = "xyz"
CIRCLE = np.linspace(0, 2 * np.pi, 121)


def uncertainty_section(run: FinishedRun) -> Section | None:
    """Return the cloud of tips, and intervals of the task's metrics; None if the study requests none."""
    spread, engines = run.uncertainty, run.engines
    if spread is None or not engines:
        return None
    first, title = engines[0], "From the laws' error bars to the tip"
    text = spread_sentence(spread, first.kind)
    if "tip_mean_m" not in spread:
        return Section(title, text=(text,))
    text += (
        " Modules of one design share one draw. What the laws leave out (friction, tolerances, the chain itself) is "
        "not in it."
    )
    caption = (
        "Left: tips of the drawn laws, from the tip of the laws themselves, in the two coordinates that vary most. "
        "Right: share of the runs within a distance of their mean."
    )
    cloud = picture("tip_cloud", caption, tip_chart(spread, first.markers_m[-1]))
    return section(title, cloud, _spread_table(spread, run), text=text)


def _spread_table(spread: Mapping[str, Any], run: FinishedRun) -> Table:
    first = run.engines[0]
    rows: list[Cells] = []
    for k, name in enumerate(COORDINATES):
        ends = [spread["tip_low_m"][k], first.markers_m[-1][k], spread["tip_high_m"][k]]
        half = (ends[2] - ends[0]) / 2
        rows.append([f"tip {name} (mm)", *(fixed(1e3 * float(v), 4) for v in ends), small_length(half)])
    for name, interval in spread.get("metrics", {}).items():
        if name in TIP or not interval["high"] > interval["low"]:
            continue
        unit = output_unit(name)
        own = first.result.metrics.get(name)
        factor = unit.factor
        cells = [interval["low"], own, interval["high"]]
        texts = [number(float(v) * factor, 5) if isinstance(v, int | float) else "–" for v in cells]
        half = number((interval["high"] - interval["low"]) / 2 * factor, 2)
        rows.append([unit.axis, *texts, half])
    level = f"{100 * float(spread['level']):g} %"
    head = ["", f"{level} from", "the laws themselves", "to", "half-width"]
    return Table("Intervals", head, rows)


def tip_chart(spread: Mapping[str, Any], tip_m: Array) -> Chart | None:
    """Return the two coordinates that vary most, then the tips' distances from their mean; None without settled runs.

    Args:
        spread: result of `pliant.pipeline.simulate.spread`.
        tip_m: (3,) with the laws themselves.
    """
    tips = np.asarray(spread["tips_m"], float)
    if "tip_mean_m" not in spread or len(tips) < 2:
        return None
    unit = display_unit("m") if float(spread["tip_radius_m"]) >= 1e-4 else Unit("µm", 1e6)
    panels = (_cloud_panel(spread, tips, tip_m, unit), _distance_panel(spread, tips, unit))
    return Chart(panels, cell=(780, 600))


def _cloud_panel(spread: Mapping[str, Any], tips: Array, tip_m: Array, unit: Unit) -> Panel:
    """Return tips relative to the tip of the laws themselves, with the interval in each coordinate and the ball."""
    i, j = (int(k) for k in sorted(np.argsort(-np.ptp(tips, axis=0), kind="stable")[:2]))
    level = f"{100 * float(spread['level']):g} %"
    low, high, centre = (
        unit.factor * (np.asarray(spread[name], float) - tip_m)
        for name in ("tip_low_m", "tip_high_m", "tip_mean_m")
    )
    radius, shown = unit.factor * float(spread["tip_radius_m"]), unit.factor * (tips - tip_m)
    ball = centre[i] + radius * np.cos(CIRCLE), centre[j] + radius * np.sin(CIRCLE)
    sides = np.array([low[i], high[i]]), np.full(2, low[j]), np.full(2, high[j])
    marks = (
        Band(f"{level} in each coordinate", *sides, colour="#e5f1f7"),
        ChartLine(f"{level} in a ball", *ball, "", SERIES[0], 1.2, dashed=True),
        ChartLine(f"drawn laws ({len(tips)})", shown[:, i], shown[:, j], "", SERIES[0], 0.0, 4.5),
        ChartLine("the laws themselves", np.zeros(1), np.zeros(1), "", WARN, 0.0, 10.0, "P"),
    )
    x, y = (ChartAxis(f"tip {COORDINATES[k]} from that of the laws", unit.symbol) for k in (i, j))
    return Panel(x, y, marks, "Where the tip may be", equal=True)


def _distance_panel(spread: Mapping[str, Any], tips: Array, unit: Unit) -> Panel:
    """Return the share of the runs within a distance of the mean tip."""
    distance = np.sort(np.linalg.norm(tips - np.asarray(spread["tip_mean_m"]), axis=1)) * unit.factor
    share = 100 * np.arange(len(distance) + 1) / len(distance)
    level, radius = 100 * float(spread["level"]), unit.factor * float(spread["tip_radius_m"])
    steps = np.repeat([0.0, *distance], 2)[1:], np.repeat(share, 2)[:-1]
    corner = np.array([radius, radius, 0.0]), np.array([0.0, level, level])
    marks = (
        ChartLine("runs within", *steps, "", SERIES[0], 1.6),
        ChartLine(f"{level:g} %", *corner, "", WARN, 1.1, dashed=True),
        ChartNote(f"{level:g} % within {number(radius, 2)} {unit.symbol}", radius, level, "above", WARN),
    )
    x = ChartAxis(
        "distance from the mean tip", unit.symbol, ends=(0.0, 1.06 * max(float(distance[-1]), radius))
    )
    return Panel(x, ChartAxis("runs", "%", ends=(0.0, 104.0)), marks, "How far from the mean")
