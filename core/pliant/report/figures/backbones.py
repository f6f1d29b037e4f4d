"""What the tasks with curves measure: the chain under one load after the other, and the backbone beside its target."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pliant.formatting import display_unit
from pliant.records.design import Array
from pliant.records.rollout import TaskResult
from pliant.report.figures import style

FLAT = 0.02  # of the curves' size: less than this out of the plane needs no second view
NAMES = "xyz"


@dataclass(frozen=True, eq=False)
class Line:
    """A curve in the world (n, 3) with points on it that are marked (m, 3)."""

    label: str
    points_m: Array
    marked_m: Array
    colour: Any
    dashed: bool = False


def backbone_picture(result: TaskResult) -> style.Png | None:
    """Two views of a task's curves and, against a target, the distance along them; None for other tasks."""
    metrics = result.metrics
    if "target_points_m" in metrics:
        lines = _against_target(metrics)
    elif "rings_m" in metrics and "backbone_points_m" in metrics:
        lines = _under_loads(metrics)
    else:
        return None
    planes = _planes(np.concatenate([line.points_m for line in lines]))
    apart = "target_points_m" in metrics
    panels = [*(f"view{k}" for k in range(len(planes))), *(["apart"] if apart else [])]
    with style.canvas(620 * len(panels), 680) as figure:
        axes: dict[str, Any] = figure.subplot_mosaic([panels])
        for k, plane in enumerate(planes):
            _draw(axes[f"view{k}"], lines, plane, legend=k == 0)
        if apart:
            _distances(axes["apart"], *(line.points_m for line in lines))
        figure.set_layout_engine("constrained", w_pad=0.09, h_pad=0.09, wspace=0.05)
        return style.png(figure)


def caption(result: TaskResult) -> str:
    """What `backbone_picture` shows."""
    if "target_points_m" in result.metrics:
        return "The settled backbone and the target, at equal scales; points correspond at equal shares of length."
    return "The chain settled under each load, at equal scales; dots are base, ends of segments and tip."


def _under_loads(metrics: Mapping[str, Any]) -> list[Line]:
    """One curve for each load."""
    loads = metrics["loads_kg"]
    shades = style.pressure_map()(np.linspace(0.0, 1.0, len(loads)))
    rings, curves = np.array(metrics["rings_m"]), np.array(metrics["backbone_points_m"])
    return [
        Line(display_unit("kg").text(load, 3), curve, ring, shade)
        for load, curve, ring, shade in zip(loads, curves, rings, shades, strict=True)
    ]


def _against_target(metrics: Mapping[str, Any]) -> list[Line]:
    backbone, target = (np.array(metrics[f"{name}_points_m"]) for name in ("backbone", "target"))
    return [
        Line("backbone", backbone, backbone[::10], style.SERIES[0]),
        Line("target", target, target[::10], style.SERIES[1], dashed=True),
    ]


def _planes(points: Array) -> list[tuple[int, int]]:
    """World planes (horizontal, vertical) that show the curves: x z and y z, as far as they have an extent."""
    size = np.ptp(points, axis=0)
    seen = [axis for axis in (0, 1) if size[axis] > FLAT * size.max()]
    return [(axis, 2) for axis in seen or [0]]


def _draw(axes: Any, lines: Sequence[Line], plane: tuple[int, int], legend: bool) -> None:
    for line in lines:
        x, y = 1e3 * line.points_m[:, plane].T
        axes.plot(x, y, color=line.colour, label=line.label, lw=2.0, ls="--" if line.dashed else "-")
        axes.plot(*(1e3 * line.marked_m[:, plane].T), "o", ms=4.5, color=line.colour)
    if lines[-1].dashed:
        for one, other in zip(lines[0].marked_m, lines[1].marked_m, strict=True):
            axes.plot(*(1e3 * np.array([one, other])[:, plane].T), color=style.FAINT, lw=1.0, zorder=1)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    axes.set_xlabel(f"world {NAMES[plane[0]]} (mm)")
    axes.set_ylabel(f"world {NAMES[plane[1]]} (mm)")
    if legend:
        axes.legend(loc="best")
        axes.set_title("Backbone and target" if lines[-1].dashed else "Settled under each load")


def _distances(axes: Any, backbone: Array, target: Array) -> None:
    apart = 1e3 * np.linalg.norm(backbone - target, axis=1)
    share = np.linspace(0.0, 100.0, len(apart))
    axes.plot(share, apart, color=style.SERIES[0])
    mean = float(np.sqrt(np.mean(apart**2)))
    axes.axhline(mean, color=style.SOFT, lw=1.0, ls=":")
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("share of the length (%)")
    axes.set_ylabel("distance (mm)")
    axes.set_title(f"Distance to the target, rms {mean:.3g} mm")
