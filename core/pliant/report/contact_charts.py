"""Charts of a scene with contact at a few instants, from the side and from above: outlines of every shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull

from pliant.formatting import display_unit
from pliant.records.design import Array
from pliant.records.scene import SceneStill
from pliant.records.shape import Shape
from pliant.report.chart import Chart, ChartLine, ChartRule, Mark, Panel, padded
from pliant.report.chart_colours import INK, SERIES, SOFT
from pliant.report.pose_charts import SIDE, world_panel

ROUND = 48  # points on a circle
TOP = (0, 1)  # world axes (horizontal, vertical)
ARM, OBJECT = SERIES[0], SERIES[4]


def stills_chart(stills: Sequence[SceneStill]) -> Chart:
    """Return a cell per instant: the side view (x, z) above, the view from above (x, y) below."""
    panels = []
    for still in stills:
        side, top = (instant_panel(still, plane, stills) for plane in (SIDE, TOP))
        panels += [side, replace(top, title="")]
    return Chart(tuple(panels), column=2, across=max(len(stills), 1), cell=(430, 880), legend=())


def instant_panel(still: SceneStill, plane: tuple[int, int], stills: Sequence[SceneStill] = ()) -> Panel:
    """Return outlines of one instant, the farthest first, with the range of all `stills`."""
    depth = 3 - sum(plane)
    toward = 1.0 if depth == 2 else -1.0  # from above; from −y
    items = [(shape, "arm", ARM) for arm in still.arms for shape in arm]
    items += [(shape, "object", OBJECT) for shapes in still.objects for shape in shapes]
    items.sort(key=lambda item: toward * float(item[0].position_m[depth]))
    unit, marks = display_unit("m"), []
    for shape, name, colour in items:
        points = unit.factor * outline(shape)[:, plane]
        hull = ConvexHull(points).vertices
        x, y = points[[*hull, hull[0]]].T
        marks.append(ChartLine(name, x, y, "", INK, 0.5, fill=f"{colour}8c"))
    shown: list[Mark] = list(marks)
    if still.floor_m is not None and plane == SIDE:
        shown.append(ChartRule(unit.factor * still.floor_m, SOFT, 1.2))
    title = f"{still.label[:1].upper()}{still.label[1:]}, {still.time_s:.3g} s"
    panel = world_panel(plane, shown, title)
    points = unit.factor * outlines(stills or [still])
    x, y = (padded(float(points[:, k].min()), float(points[:, k].max()), 0.05) for k in plane)
    return replace(panel, x=replace(panel.x, ends=x), y=replace(panel.y, ends=y))


def outline(shape: Shape) -> Array:
    """Return points (n, 3) in the world whose convex hull is the shape, to a picture's accuracy."""
    if shape.kind == "mesh" and shape.mesh is not None:
        local = shape.mesh.vertices_m
    elif shape.kind == "box":
        local = (
            np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * shape.size_m
        )
    elif shape.kind == "cylinder":
        radius, half = shape.size_m
        ring = radius * _circle()
        local = np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for z in (-half, half)])
    else:
        half = shape.size_m[1] if shape.kind == "capsule" else 0.0
        size = np.array(shape.size_m) if shape.kind == "ellipsoid" else np.full(3, shape.size_m[0])
        local = _sphere() * size
        local = np.concatenate([local + [0, 0, half], local - [0, 0, half]])
    return np.asarray(local @ np.asarray(shape.rotation).T + shape.position_m)


def outlines(stills: Sequence[SceneStill]) -> Array:
    """Return points (n, 3) of all colliding shapes at these instants."""
    groups = [group for still in stills for group in (*still.arms, *still.objects)]
    return np.concatenate([outline(shape) for group in groups for shape in group])


def _circle() -> Array:
    angle = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _sphere() -> Array:
    height = np.cos(np.linspace(0, np.pi, ROUND // 2 + 1))
    rings = [np.column_stack([np.sqrt(max(1 - z**2, 0.0)) * _circle(), np.full(ROUND, z)]) for z in height]
    return np.concatenate(rings)
