"""Lines in world views: what tasks with curves measure, and the chain at rest, on the way and settled."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pliant.errors import UserError
from pliant.formatting import display_unit
from pliant.mechanics.kinematics import ChainGeometry
from pliant.pipeline.study import StudyRun
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
    with style.canvas(620 * len(panels), 680, wspace=0.05) as figure:
        axes: dict[str, Any] = figure.subplot_mosaic([panels])
        for k, plane in enumerate(planes):
            _draw(axes[f"view{k}"], lines, plane, legend=k == 0)
        if apart:
            _distances(axes["apart"], *(line.points_m for line in lines))
        return style.png(figure)


def caption(result: TaskResult) -> str:
    """The caption of `backbone_picture`."""
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
    axes.set(xlabel=f"world {NAMES[plane[0]]} (mm)", ylabel=f"world {NAMES[plane[1]]} (mm)")
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
    axes.set(
        xlabel="share of the length (%)",
        ylabel="distance (mm)",
        title=f"Distance to the target, rms {mean:.3g} mm",
    )


# Title, then horizontal and vertical world axis.
VIEWS = (("Front", 0, 2), ("Side", 1, 2), ("Top", 0, 1))
LEVELS = 5  # poses on the way
ARROW = 0.22  # length of a load's arrow, of the largest extent
G_M_S2 = 9.81


def backbone(run: StudyRun, path: Path) -> None:
    """Draw the first engine's result into a .svg, .png or .pdf; the file is there whole or not at all.

    Raises:
        UserError: nothing was simulated, or the task has no chain of its own (a grasp).
    """
    result = run.engines[0].result if run.engines else None
    if result is None or run.chain is None:
        raise UserError("nothing was simulated, so there is no backbone: the study needs a 'task' block.")
    if result.frames is not None:
        raise UserError("a backbone plot is of one chain; a scene with objects is drawn without --backbone.")
    geometry = ChainGeometry.of(run.chain)
    settled = result.final.markers_m
    rest = geometry.markers(np.zeros_like(result.final.joint_angles)) + (settled[0] - geometry.base_position)
    target = _target(result)
    shown = [rest, settled] if target is None else [rest, settled, target]
    if result.rollout is not None:
        shown.extend(result.rollout.markers_m)
    points = np.concatenate(shown)
    middle, half = 0.5 * (points.min(axis=0) + points.max(axis=0)), 0.56 * float(np.ptp(points, axis=0).max())
    with style.canvas(1620, 620, pad=(0.08, 0.08)) as figure:
        for axes, (title, i, j) in zip(figure.subplots(1, 3), VIEWS, strict=True):
            _draw_poses(axes, (i, j), rest, result, target)
            _draw_loads(axes, (i, j), run, settled[-1], half)
            axes.set(
                xlim=(1e3 * (middle[i] - half), 1e3 * (middle[i] + half)),
                ylim=(1e3 * (middle[j] - half), 1e3 * (middle[j] + half)),
                aspect="equal",
                xlabel=f"world {NAMES[i]} (mm)",
                ylabel=f"world {NAMES[j]} (mm)",
                title=title,
            )
        figure.axes[0].legend(loc="best")
        _save(figure, path)


def _draw_poses(
    axes: Any, plane: tuple[int, int], rest: Array, result: TaskResult, target: Array | None
) -> None:
    axes.plot(*_flat(rest, plane), color=style.FAINT, lw=3, marker="o", ms=3, label="at rest")
    if target is not None:
        axes.plot(*_flat(target, plane), color=style.SERIES[1], lw=2, ls="--", label="target")
    if result.rollout is not None and len(result.rollout.markers_m) > 2:
        on_way = np.unique(np.linspace(0, len(result.rollout.markers_m) - 1, LEVELS + 2).astype(int))[1:-1]
        for number in on_way.tolist():
            flat = _flat(result.rollout.markers_m[number], plane)
            axes.plot(*flat, color=style.SERIES[0], alpha=0.3, lw=1.1)
    settled = result.final.markers_m
    axes.plot(*_flat(settled, plane), color=style.SERIES[0], lw=2.2, marker="o", ms=5, label="settled")
    axes.plot(*_flat(settled[:1], plane), color=style.INK, marker="s", ms=9, ls="none")


def _draw_loads(axes: Any, plane: tuple[int, int], run: StudyRun, tip: Array, half_m: float) -> None:
    """Arrows for the force at the tip and the weight that hangs there; those along the view have no length."""
    for force, label in _loads(run):
        direction = 2e3 * ARROW * half_m * force[list(plane)] / np.linalg.norm(force)
        if np.linalg.norm(direction) < 1e-3 * 1e3 * half_m:
            continue
        start = 1e3 * tip[list(plane)]
        look = {"arrowstyle": "-|>", "color": style.WARN, "lw": 2.0}
        axes.annotate("", tuple(start + direction), tuple(start), arrowprops=look, zorder=8)
        axes.annotate(
            label,
            tuple(start + direction),
            (4, 4),
            textcoords="offset points",
            fontsize=8.5,
            color=style.WARN,
        )


def _loads(run: StudyRun) -> list[tuple[Array, str]]:
    """(force in N, words) of the study's chain and task."""
    task, chain = run.study.task, run.chain
    assert chain is not None
    payload = float(getattr(task, "payload_kg", None) or chain.payload_kg)
    force = getattr(task, "tip_force_n", None)
    found: list[tuple[Array, str]] = []
    if payload:
        found.append((np.array([0.0, 0.0, -payload * G_M_S2]), f"{1e3 * payload:g} g"))
    if force is not None and np.any(force):
        found.append((np.array(force, float), f"{np.linalg.norm(force):.3g} N"))
    return found


def _target(result: TaskResult) -> Array | None:
    """The curve to follow, where the task has one."""
    points = result.metrics.get("target_points_m")
    return None if points is None else np.array(points, float)


def _flat(points: Array, plane: tuple[int, int]) -> tuple[Array, Array]:
    return 1e3 * points[:, plane[0]], 1e3 * points[:, plane[1]]


def _save(figure: Any, path: Path) -> None:
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=path.suffix)
    os.close(handle)
    partial = Path(name)
    try:
        figure.savefig(partial, format=path.suffix[1:].lower(), dpi=style.DPI)
        partial.chmod(0o644)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
