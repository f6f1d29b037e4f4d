"""Lines in world views: what tasks with curves measure, and the chain at rest, on the way and settled."""

from __future__ import annotations

from collections.abc import Sequence
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
from pliant.report.figures.stills import upright_planes
from pliant.store.store import whole_file


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
    apart = "target_points_m" in metrics
    if apart:
        backbone, target = (np.array(metrics[f"{name}_points_m"]) for name in ("backbone", "target"))
        lines = [Line("backbone", backbone, backbone[::10], style.SERIES[0])]
        lines.append(Line("target", target, target[::10], style.SERIES[1], dashed=True))
    elif "rings_m" in metrics and "backbone_points_m" in metrics:
        loads = [display_unit("kg").text(load, 3) for load in metrics["loads_kg"]]
        shades = style.pressure_map()(np.linspace(0.0, 1.0, len(loads)))
        curves, rings = np.array(metrics["backbone_points_m"]), np.array(metrics["rings_m"])
        lines = [Line(*one) for one in zip(loads, curves, rings, shades, strict=True)]
    else:
        return None
    planes = upright_planes(np.ptp(np.concatenate([line.points_m for line in lines]), axis=0))
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


def _draw(axes: Any, lines: Sequence[Line], plane: tuple[int, int], legend: bool) -> None:
    for line in lines:
        dashes = "--" if line.dashed else "-"
        axes.plot(*style.flat(line.points_m, plane), color=line.colour, label=line.label, lw=2.0, ls=dashes)
        axes.plot(*style.flat(line.marked_m, plane), "o", ms=4.5, color=line.colour)
    if lines[-1].dashed:
        for pair in zip(lines[0].marked_m, lines[1].marked_m, strict=True):
            axes.plot(*style.flat(np.array(pair), plane), color=style.FAINT, lw=1.0, zorder=1)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    style.world_labels(axes, plane)
    if legend:
        axes.legend(loc="best")
        axes.set_title("Backbone and target" if lines[-1].dashed else "Settled under each load")


def _distances(axes: Any, backbone: Array, target: Array) -> None:
    apart = 1e3 * np.linalg.norm(backbone - target, axis=1)
    axes.plot(np.linspace(0.0, 100.0, len(apart)), apart, color=style.SERIES[0])
    mean = float(np.sqrt(np.mean(apart**2)))
    axes.axhline(mean, color=style.SOFT, lw=1.0, ls=":")
    axes.set_ylim(bottom=0.0)
    axes.set(xlabel="share of the length (%)", ylabel="distance (mm)")
    axes.set_title(f"Distance to the target, rms {mean:.3g} mm")


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
    rest, carrier = geometry.markers(np.zeros_like(result.final.joint_angles)), result.final.carrier
    rest = rest + (settled[0] - geometry.base_position) if carrier is None else carrier.in_world(rest)
    curve = result.metrics.get("target_points_m")
    target = None if curve is None else np.array(curve, float)
    shown = [rest, settled] if target is None else [rest, settled, target]
    if result.rollout is not None:
        shown.extend(result.rollout.markers_m)
    points = np.concatenate(shown)
    middle, half = 0.5 * (points.min(axis=0) + points.max(axis=0)), 0.56 * float(np.ptp(points, axis=0).max())
    with style.canvas(1620, 620, pad=(0.08, 0.08)) as figure:
        for axes, (title, *plane) in zip(figure.subplots(1, 3), VIEWS, strict=True):
            i, j = plane
            _draw_poses(axes, (i, j), rest, result, target)
            _draw_loads(axes, (i, j), run, settled[-1], half)
            axes.set(aspect="equal", title=title)
            axes.set_xlim(1e3 * (middle[i] - half), 1e3 * (middle[i] + half))
            axes.set_ylim(1e3 * (middle[j] - half), 1e3 * (middle[j] + half))
            style.world_labels(axes, (i, j))
        figure.axes[0].legend(loc="best")
        with whole_file(path) as partial:
            figure.savefig(partial, format=path.suffix[1:].lower(), dpi=style.DPI)


def _draw_poses(
    axes: Any, plane: tuple[int, int], rest: Array, result: TaskResult, target: Array | None
) -> None:
    def line(points: Array, **look: Any) -> None:
        axes.plot(*style.flat(points, plane), **look)

    line(rest, color=style.FAINT, lw=3, marker="o", ms=3, label="at rest")
    if target is not None:
        line(target, color=style.SERIES[1], lw=2, ls="--", label="target")
    steps = None if result.rollout is None else result.rollout.markers_m
    if steps is not None and len(steps) > 2:
        for number in np.unique(np.linspace(0, len(steps) - 1, LEVELS + 2).astype(int))[1:-1].tolist():
            line(steps[number], color=style.SERIES[0], alpha=0.3, lw=1.1)
    settled = result.final.markers_m
    line(settled, color=style.SERIES[0], lw=2.2, marker="o", ms=5, label="settled")
    line(settled[:1], color=style.INK, marker="s", ms=9, ls="none")


def _draw_loads(axes: Any, plane: tuple[int, int], run: StudyRun, tip: Array, half_m: float) -> None:
    """Arrows for the force at the tip and the weight that hangs there; those along the view have no length."""
    task, chain = run.study.task, run.chain
    assert chain is not None
    payload = float(getattr(task, "payload_kg", None) or chain.payload_kg)
    stated = getattr(task, "tip_force_n", None)
    loads = [(np.array([0.0, 0.0, -payload * G_M_S2]), f"{1e3 * payload:g} g")] if payload else []
    if stated is not None and np.any(stated):
        loads.append((np.array(stated, float), f"{np.linalg.norm(stated):.3g} N"))
    for force, label in loads:
        direction = 2e3 * ARROW * half_m * force[list(plane)] / np.linalg.norm(force)
        if np.linalg.norm(direction) < 1e-3 * 1e3 * half_m:
            continue
        start = 1e3 * tip[list(plane)]
        look = {"arrowstyle": "-|>", "color": style.WARN, "lw": 2.0}
        axes.annotate("", tuple(start + direction), tuple(start), arrowprops=look, zorder=8)
        style.note(axes, label, tuple(start + direction), (4, 4), color=style.WARN)
