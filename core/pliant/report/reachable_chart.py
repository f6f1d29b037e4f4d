"""The reachable set: tip positions over the whole range of the inputs, its limits, the chain at some of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pliant.formatting import display_unit
from pliant.inverse.reachable import Reachable
from pliant.records.design import Array
from pliant.report.chart import Chart, ChartLine, Mark
from pliant.report.chart_colours import FAINT, INK, SERIES, SOFT
from pliant.report.contact_charts import TOP
from pliant.report.pose_charts import upright_planes, world_line, world_panel

POSES = 7  # chains drawn among the equilibria
NEAR_LIMIT = 1e-9  # of the range of an input


def reachable_chart(reachable: Reachable, bounds: Array) -> Chart:
    """Return views of the planes in which the tip moves, equal scales; `bounds` (k, 2) low and high of each input."""
    tips, unit = reachable.tips_m, display_unit("m")
    points = np.concatenate([reachable.markers_m.reshape(-1, 3), tips])
    planes = upright_planes(np.ptp(points, axis=0))
    planes += [TOP] if len(planes) > 1 else []
    at_limit, has_data = is_at_limit(reachable, bounds), np.asarray(reachable.inside, bool)
    kinds = (
        ("inputs within their range", ~at_limit & has_data, SERIES[0], False),
        ("an input at its limit", at_limit & has_data, SERIES[1], False),
        ("beyond the data of a law", ~has_data, SOFT, True),
    )
    chosen = np.linspace(0, len(reachable.actuation) - 1, POSES).round().astype(int)
    panels = []
    for plane in planes:
        marks: list[Mark] = [world_line("", m, plane, FAINT, 1.4) for m in reachable.markers_m[chosen]]
        marks += [
            world_line(name, tips[rows], plane, colour, 0.0, 2.5, hollow=hollow)
            for name, rows, colour, hollow in kinds
            if rows.any()
        ]
        marks.append(world_line("", reachable.markers_m[0, :1], plane, INK, 0.0, 6.0, marker="s"))
        low, high = unit.factor * reachable.limits_m[list(plane)].T
        x, y = (
            low[0] + np.array([0, 1, 1, 0, 0]) * (high - low)[0],
            low[1] + np.array([0, 0, 1, 1, 0]) * (high - low)[1],
        )
        marks.append(ChartLine("limits", x, y, "", SOFT, 0.8, dashed=True))
        names = ["xyz"[k] for k in plane]
        spans = ", ".join(f"{name} {a:.1f} to {b:.1f}" for name, a, b in zip(names, low, high, strict=True))
        panels.append(
            world_panel(plane, marks, f"Tip in {' and '.join(names)}", f"limits {spans} {unit.symbol}")
        )
    return Chart(tuple(panels), cell=(640, 640))


def is_at_limit(reachable: Reachable, bounds: Array) -> NDArray[np.bool_]:
    """Return (s,) whether any input is at the low or high end of its range."""
    shares = (reachable.actuation - bounds[:, 0]) / np.ptp(bounds, axis=1)
    return np.asarray(np.any((shares < NEAR_LIMIT) | (shares > 1.0 - NEAR_LIMIT), axis=1))
