"""Designs that a search found, as they settled or grasped, side by side at one scale."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from pliant.records.design import Array
from pliant.report.figures import style
from pliant.report.figures.stills import SIDE, TOP, draw_still, outline
from pliant.report.search_folder import Drawing

MOST = 8
FLAT = 0.02  # of the chain's size: less than this out of the plane needs no second view


def search_designs(drawn: Sequence[Drawing]) -> style.Png | None:
    """A column per design, a row per view; None without designs."""
    shown = drawn[:MOST]
    if not shown:
        return None
    scenes = all(d.result.stills for d in shown)
    points = np.concatenate([_points(d) for d in shown])
    size = np.ptp(points, axis=0)
    planes = [p for p in (SIDE, (1, 2)) if size[p[0]] > FLAT * size.max()] or [SIDE]
    planes = [SIDE, TOP] if scenes else planes
    low, high = points.min(axis=0), points.max(axis=0)
    pad = 0.06 * float(size.max())
    width = 430 if len(shown) > 1 else 620
    with style.canvas(max(width * len(shown) + 90, 700), 500 * len(planes) + 60, pad=(0.06, 0.06)) as figure:
        grid = figure.subplots(len(planes), len(shown), squeeze=False, sharey="row", sharex="row")
        for column, one in enumerate(shown):
            for row, plane in enumerate(planes):
                axes = grid[row, column]
                _draw(axes, one, plane)
                axes.set(
                    aspect="equal",
                    xlim=(1e3 * (low[plane[0]] - pad), 1e3 * (high[plane[0]] + pad)),
                    ylim=(1e3 * (low[plane[1]] - pad), 1e3 * (high[plane[1]] + pad)),
                    xlabel=f"world {'xyz'[plane[0]]} (mm)",
                )
                if column == 0:
                    axes.set_ylabel(f"world {'xyz'[plane[1]]} (mm)")
            grid[0, column].set_title(textwrap.fill(one.label, 26))
        handles = grid[0, 0].get_legend_handles_labels()
        if handles[0]:
            figure.legend(*handles, loc="outside lower center", ncols=4)
        return style.png(figure)


def _draw(axes: Any, one: Drawing, plane: tuple[int, int]) -> None:
    if one.result.stills:
        draw_still(axes, one.result.stills[-1], plane)
        return
    if one.rest_m is not None:
        axes.plot(*_flat(one.rest_m, plane), color=style.FAINT, lw=3, label="at rest")
    if (target := _curve(one, "target_points_m")) is not None:
        axes.plot(*_flat(target, plane), color=style.SERIES[1], lw=2, ls="--", label="target")
    line = _curve(one, "backbone_points_m")
    if line is not None and line.ndim == 2:
        axes.plot(*_flat(line, plane), color=style.SERIES[0], lw=2.2, label="settled")
        axes.plot(
            *_flat(one.result.final.markers_m[1:-1], plane),
            "o",
            ms=3.5,
            color=style.SERIES[0],
            label="joints",
        )
    else:
        axes.plot(
            *_flat(one.result.final.markers_m, plane), "o-", ms=4, color=style.SERIES[0], label="settled"
        )
    axes.plot(*_flat(one.result.final.markers_m[:1], plane), "s", ms=9, color=style.INK)


def _points(one: Drawing) -> Array:
    """(n, 3) everything that must be inside the picture."""
    if one.result.stills:
        still = one.result.stills[-1]
        return np.concatenate([outline(s) for group in (*still.arms, *still.objects) for s in group])
    sets = [one.result.final.markers_m, one.rest_m, _curve(one, "target_points_m")]
    return np.concatenate([np.asarray(s) for s in sets if s is not None])


def _curve(one: Drawing, name: str) -> Array | None:
    points = one.result.metrics.get(name)
    return None if points is None else np.array(points, float)


def _flat(points: Array, plane: tuple[int, int]) -> tuple[Array, Array]:
    return 1e3 * points[:, plane[0]], 1e3 * points[:, plane[1]]
