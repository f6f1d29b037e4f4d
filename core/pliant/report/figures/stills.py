"""A scene with contact at a few instants, from the side and from above: outlines of every shape."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull

from pliant.records.design import Array
from pliant.records.scene import SceneStill
from pliant.records.shape import Shape
from pliant.report.figures import style

ROUND = 48  # points on a circle
SIDE, TOP = (0, 2), (0, 1)  # world axes (horizontal, vertical) of the views
FLAT = 0.02  # of the size: less than this out of the plane needs no second view
ARM, OBJECT = style.SERIES[0], style.SERIES[4]


def upright_planes(size_m: Array) -> list[tuple[int, int]]:
    """The planes x z and y z, as far as points of this extent (3,) need both."""
    return [(k, 2) for k in (0, 1) if size_m[k] > FLAT * size_m.max()] or [SIDE]


def still_pictures(stills: Sequence[SceneStill]) -> style.Png:
    """One column per instant: the side view (x, z) above, the view from above (x, y) below, one scale."""
    with style.canvas(430 * len(stills) + 120, 900, pad=(0.06, 0.06)) as figure:
        grid = figure.subplots(2, len(stills), squeeze=False, sharex=True)
        for column, still in enumerate(stills):
            for row, plane in enumerate((SIDE, TOP)):
                axes = grid[row, column]
                draw_still(axes, still, plane)
                axes.set_aspect("equal")
                if column == 0:
                    axes.set_ylabel(f"world {'xyz'[plane[1]]} (mm)")
            grid[0, column].set_title(f"{still.label}, {still.time_s:.3g} s")
            grid[1, column].set_xlabel("world x (mm)")
        for row, plane in enumerate((SIDE, TOP)):
            for axes in grid[row]:
                axes.set_ylim(*_limits(stills, plane[1]))
        for axes in grid[1]:
            axes.set_xlim(*_limits(stills, 0))
        return style.png(figure)


def draw_side(axes: Axes, still: SceneStill) -> None:
    """The side view of one instant by itself."""
    draw_still(axes, still, SIDE)
    axes.set_aspect("equal")
    axes.set_xlim(*_limits([still], 0))
    axes.set_ylim(*_limits([still], 2))
    axes.set(
        xlabel="world x (mm)",
        ylabel="world z (mm)",
        title=f"{still.label[:1].upper()}{still.label[1:]}, {still.time_s:.3g} s",
    )


def draw_still(axes: Axes, still: SceneStill, plane: tuple[int, int]) -> None:
    """Outlines of one instant, the farthest first."""
    depth = 3 - sum(plane)
    toward = 1.0 if depth == 2 else -1.0  # from above; from −y
    items = [(shape, ARM) for arm in still.arms for shape in arm]
    items += [(shape, OBJECT) for shapes in still.objects for shape in shapes]
    items.sort(key=lambda item: toward * float(item[0].position_m[depth]))
    for shape, colour in items:
        points = 1e3 * outline(shape)[:, plane]
        corners = points[ConvexHull(points).vertices]
        axes.add_patch(Polygon(corners, closed=True, fc=colour, ec=style.INK, lw=0.5, alpha=0.55))
    if still.floor_m is not None and plane == SIDE:
        axes.axhline(1e3 * still.floor_m, color=style.SOFT, lw=1.2)


def outline(shape: Shape) -> Array:
    """Points (n, 3) in the world whose convex hull is the shape, to a picture's accuracy."""
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
    """Points (n, 3) of all that collides at these instants."""
    groups = [group for still in stills for group in (*still.arms, *still.objects)]
    return np.concatenate([outline(shape) for group in groups for shape in group])


def _limits(stills: Sequence[SceneStill], axis: int) -> tuple[float, float]:
    """Range of a world axis over all instants, with a margin, mm."""
    points = 1e3 * outlines(stills)[:, axis]
    margin = 0.05 * float(np.ptp(points))
    return float(points.min()) - margin, float(points.max()) + margin


def _circle() -> Array:
    angle = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _sphere() -> Array:
    height = np.cos(np.linspace(0, np.pi, ROUND // 2 + 1))
    rings = [np.column_stack([np.sqrt(max(1 - z**2, 0.0)) * _circle(), np.full(ROUND, z)]) for z in height]
    return np.concatenate(rings)
