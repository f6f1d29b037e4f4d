"""The picture of curves: drawn for tasks that have some, and for no other task."""

from __future__ import annotations

from typing import Any

import numpy as np

from pliant.records.rollout import Equilibrium, TaskResult
from pliant.report.pose_charts import backbone_caption, backbone_chart
from pliant.report.still import still

LINE = np.linspace([0.0, 0, 0], [0.0, 0.01, -0.05], 61)


def result(**metrics: Any) -> TaskResult:
    final = Equilibrium(np.zeros((1, 1)), np.zeros((3, 3)), 0.0, True, True, 1, 0.0)
    return TaskResult(final, metrics)


def test_only_tasks_with_curves_are_drawn() -> None:
    assert backbone_chart(result(tip_x_m=0.0)) is None
    hung = result(
        loads_kg=[0.0, 0.01], rings_m=[LINE[::30].tolist()] * 2, backbone_points_m=[LINE.tolist()] * 2
    )
    followed = result(backbone_points_m=LINE.tolist(), target_points_m=(LINE + 1e-3).tolist())
    charts = [backbone_chart(one) for one in (hung, followed)]
    assert all(chart is not None and bytes(still(chart)[:4]) == b"\x89PNG" for chart in charts)
    distance = charts[1].panels[-1].lines[0].y
    assert np.allclose(distance, np.sqrt(3))  # mm, everywhere
    assert "each load" in backbone_caption(hung) and "target" in backbone_caption(followed)
