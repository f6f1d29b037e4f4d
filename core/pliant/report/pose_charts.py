"""Charts of a chain's poses in world views: settled in each engine, against a target, under loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pliant.errors import UserError
from pliant.formatting import actuation_unit, display_unit
from pliant.mechanics.kinematics import ChainGeometry
from pliant.pipeline.run_folder import EngineResult, FinishedRun
from pliant.pipeline.study import StudyRun
from pliant.records.design import Array
from pliant.records.rollout import TaskResult
from pliant.report.chart import Chart, ChartAxis, ChartLine, ChartNote, ChartRule, Mark, Panel, optional_chart
from pliant.report.chart_colours import FAINT, INK, LEVEL_COLOURS, MARKERS, SERIES, SOFT, WARN, ColourScale
from pliant.report.run_view import (
    actuation_text,
    distances_m,
    gravity,
    history_levels,
    payload_kg,
    rest_markers,
)

SIDE = (0, 2)  # world axes (horizontal, vertical)
FLAT = 0.02  # relative to the size: a smaller extent out of the plane needs no second view
LEVELS = 4  # pale poses between rest and full actuation
SHOWN_DECADES = 1e-5  # relative to the largest distance: smaller ones are rounding
CLEAR = 0.06  # of the size, between labels of levels


def upright_planes(size_m: Array) -> list[tuple[int, int]]:
    """Return the planes x z and y z, or the one that suffices for points of this extent (3,)."""
    return [(k, 2) for k in (0, 1) if size_m[k] > FLAT * size_m.max()] or [SIDE]


def world_line(
    name: str,
    points_m: Array,
    plane: tuple[int, int],
    colour: str,
    width: float = 2.0,
    dot: float = 0.0,
    **look: object,
) -> ChartLine:
    """Return points (n, 3) in a view of the world, in display units."""
    x, y = np.asarray(points_m, float)[:, list(plane)].T * display_unit("m").factor
    return ChartLine(name, x, y, colour=colour, width=width, dot=dot, **look)  # type: ignore[arg-type]


def world_panel(plane: tuple[int, int], marks: Sequence[Mark], title: str, below: str = "") -> Panel:
    """Return a view onto a world plane at equal scales."""
    x, y = (ChartAxis("xyz"[k], display_unit("m").symbol) for k in plane)
    return Panel(x, y, tuple(marks), title, below, equal=True)


def pose_chart(run: FinishedRun) -> Chart:
    """Return the views of the poses, and the distances of the markers to the first engine's."""
    panels = [pose_panel(run, plane) for plane in views(run)]
    if len(run.engines) > 1:
        panels.append(_distances_panel(run.engines))
    return Chart(tuple(panels), cell=(720 if len(panels) == 1 else 600, 620))


def views(run: FinishedRun) -> list[tuple[int, int]]:
    """Return world planes (horizontal, vertical axis) that show the chain: one for a planar pose, else two."""
    size = np.ptp(_all_points(run), axis=0)
    flat = FLAT * size.max()
    upright = 2 if size[2] > flat else int(np.argsort(size)[-2])
    across = [axis for axis in np.argsort(-size, kind="stable").tolist() if axis != upright]
    seen = [axis for axis in across if size[axis] > flat] or across[:1]
    return [(axis, upright) for axis in seen]


def pose_panel(run: FinishedRun, plane: tuple[int, int]) -> Panel:
    """Return the rest pose in grey, intermediate levels pale, then every engine's settled pose."""
    unit = display_unit("m")
    levels = actuation_unit(run.designs[0].law.actuation_name)
    rest, marks, notes = rest_markers(run), [], []
    if rest is not None:
        marks.append(world_line("at rest", rest, plane, FAINT, 3.2, 3.0))
    first = run.engines[0]
    labelled = [unit.factor * first.markers_m[-1, list(plane)]]
    clear = CLEAR * unit.factor * float(np.ptp(_all_points(run), axis=0).max())
    for value, _, markers in reversed(history_levels(first.result, LEVELS)):
        text = levels.text(value, 3)
        marks.append(world_line("on the way", markers, plane, "#9cc3de", 1.1, 2.0, run=text))
        tip, before = (unit.factor * markers[k, list(plane)] for k in (-1, -2))
        if min(float(np.linalg.norm(tip - other)) for other in labelled) > clear:
            labelled.append(tip)
            notes.append(ChartNote(text, float(tip[0]), float(tip[1]), _side(tip - before), SOFT, run=text))
    for k, engine in enumerate(run.engines):
        look = {"marker": MARKERS[k % 6], "hollow": k > 0, "dashed": k > 0}
        thick, dot = (3.0, 7.5) if k == 0 else (1.3, 5.5)
        marks.append(world_line(engine.kind, engine.markers_m, plane, SERIES[k % 6], thick, dot, **look))
    marks.append(world_line("base", first.markers_m[:1], plane, INK, 0.0, 10.0, marker="s"))
    if payload := payload_kg(run):
        x, y = labelled[0].tolist()
        notes.append(ChartNote(f"  {display_unit('kg').text(payload, 3)} hung", x, y))
    pull = gravity(run)[list(plane)]
    if np.linalg.norm(pull) > 0:
        right, low = _corner(run, plane)
        notes.append(ChartNote("g ↓" if pull[1] < 0 else "g ↑", right, low, "left", SOFT))
    return world_panel(plane, [*marks, *notes], f"Settled pose{actuation_text(run)}")


def _side(out: Array) -> str:
    """Return the side of a tip on which its label stands: that to which the last link points."""
    if abs(out[0]) >= abs(out[1]):
        return "right" if out[0] >= 0 else "left"
    return "above" if out[1] >= 0 else "below"


def _corner(run: FinishedRun, plane: tuple[int, int]) -> tuple[float, float]:
    """Return the lower right corner of the poses."""
    points = display_unit("m").factor * _all_points(run)[:, list(plane)]
    return float(points[:, 0].max()), float(points[:, 1].min())


def _distances_panel(engines: Sequence[EngineResult]) -> Panel:
    """Return the distance of each marker to the first engine's, on a logarithmic scale."""
    distances = distances_m(engines)
    worst = max(float(d.max()) for d in distances)
    floor = max(worst * SHOWN_DECADES, 1e-15)
    marks: list[Mark] = []
    for k, (engine, distance) in enumerate(zip(engines, distances, strict=True)):
        if k:
            y = 1e6 * np.where(distance > floor, distance, np.nan)
            marks.append(
                ChartLine(
                    engine.kind,
                    np.arange(float(len(y))),
                    y,
                    "",
                    SERIES[k % 6],
                    1.6,
                    6.0,
                    MARKERS[k % 6],
                    True,
                )
            )
    count = len(distances[0])
    least = min(float(d[d > floor].min(initial=worst)) for d in distances)
    ends = (0.3e6 * least, 5e6 * worst) if worst > 0 else (0.1, 10.0)
    title = f"Distance to {engines[0].kind}" + ("" if worst > 0 else ": identical")
    x = ChartAxis("marker: base, joints, tip", ends=(-0.4, count - 0.6))
    return Panel(x, ChartAxis("distance", "µm", ends=ends, log=True), tuple(marks), title)


def _all_points(run: FinishedRun) -> Array:
    rest = rest_markers(run)
    sets = [r.markers_m for r in run.engines] + ([rest] if rest is not None else [])
    return np.concatenate(sets)


@dataclass(frozen=True, eq=False)
class Backbone:
    """A curve in the world (n, 3) with marked points on it (m, 3)."""

    name: str
    points_m: Array
    marked_m: Array
    colour: str
    dashed: bool = False


def backbone_chart(result: TaskResult) -> Chart | None:
    """Return two views of a task's curves and, against a target, the distance along them; None for other tasks."""
    metrics = result.metrics
    if "target_points_m" in metrics:
        curve, target = (np.array(metrics[f"{name}_points_m"]) for name in ("backbone", "target"))
        lines = [Backbone("backbone", curve, curve[::10], SERIES[0])]
        lines.append(Backbone("target", target, target[::10], SERIES[1], dashed=True))
    elif "rings_m" in metrics and "backbone_points_m" in metrics:
        loads = [display_unit("kg").text(load, 3) for load in metrics["loads_kg"]]
        shades = ColourScale.even("load", "", (0.0, 1.0), LEVEL_COLOURS).to_hex(np.linspace(0, 1, len(loads)))
        curves, rings = np.array(metrics["backbone_points_m"]), np.array(metrics["rings_m"])
        lines = [Backbone(*one) for one in zip(loads, curves, rings, shades, strict=True)]
    else:
        return None
    planes = upright_planes(np.ptp(np.concatenate([line.points_m for line in lines]), axis=0))
    panels = [_backbone_panel(lines, plane) for plane in planes]
    if "target_points_m" in metrics:
        panels.append(_distance_panel(*(line.points_m for line in lines)))
    return optional_chart(panels, cell=(620, 640))


def backbone_caption(result: TaskResult) -> str:
    """Return the caption of `backbone_chart`."""
    if "target_points_m" in result.metrics:
        return "The settled backbone and the target, at equal scales; points correspond at equal shares of length."
    return "The chain settled under each load, at equal scales; dots are base, ends of segments and tip."


def _backbone_panel(lines: Sequence[Backbone], plane: tuple[int, int]) -> Panel:
    marks: list[Mark] = []
    if lines[-1].dashed:
        pairs = zip(lines[0].marked_m, lines[1].marked_m, strict=True)
        marks += [world_line("", np.array(pair), plane, FAINT, 1.0) for pair in pairs]
    for line in lines:
        marks.append(world_line(line.name, line.points_m, plane, line.colour, dashed=line.dashed))
        marks.append(world_line(line.name, line.marked_m, plane, line.colour, 0.0, 4.5))
    return world_panel(plane, marks, "Backbone and target" if lines[-1].dashed else "Settled under each load")


def _distance_panel(backbone: Array, target: Array) -> Panel:
    unit = display_unit("m")
    distance = unit.factor * np.linalg.norm(backbone - target, axis=1)
    mean = float(np.sqrt(np.mean(distance**2)))
    share = np.linspace(0.0, 100.0, len(distance))
    marks = (
        ChartLine("distance", share, distance, "", SERIES[0], 1.6),
        ChartRule(mean, SOFT, dashed=True, text="rms"),
    )
    y = ChartAxis("distance", unit.symbol, ends=(0.0, 1.06 * float(distance.max()) or 1.0))
    title = f"Distance to the target, rms {mean:.3g} {unit.symbol}"
    return Panel(ChartAxis("share of the length", "%"), y, marks, title)


# Title, then horizontal and vertical world axis.
VIEWS = (("Front", 0, 2), ("Side", 1, 2), ("Top", 0, 1))
STEPS = 5  # intermediate poses
ARROW = 0.22  # length of a load's arrow relative to the largest extent
G_M_S2 = 9.81


def three_views(run: StudyRun) -> Chart:
    """Return the first engine's result from the front, from the side and from above, with its loads.

    Raises:
        UserError: nothing was simulated, or the task has no single chain (a grasp).
    """
    result = run.engines[0].result if run.engines else None
    if result is None or run.chain is None:
        raise UserError("nothing was simulated, so there is no backbone: the study needs a 'task' block.")
    if result.frames is not None:
        raise UserError("a backbone plot is of one chain; a scene with objects is drawn without --backbone.")
    geometry = ChainGeometry.from_chain(run.chain)
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
    factor, panels = display_unit("m").factor, []
    for title, *axes in VIEWS:
        plane = (axes[0], axes[1])
        panel = world_panel(
            plane, [*_pose_marks(plane, rest, result, target), *_loads(plane, run, settled[-1], half)], title
        )
        x, y = ((float(factor * (middle[k] - half)), float(factor * (middle[k] + half))) for k in plane)
        panels.append(replace(panel, x=replace(panel.x, ends=x), y=replace(panel.y, ends=y)))
    return Chart(tuple(panels), cell=(540, 570))


def _pose_marks(plane: tuple[int, int], rest: Array, result: TaskResult, target: Array | None) -> list[Mark]:
    marks: list[Mark] = [world_line("at rest", rest, plane, FAINT, 3.0, 3.0)]
    if target is not None:
        marks.append(world_line("target", target, plane, SERIES[1], 2.0, dashed=True))
    steps = None if result.rollout is None else result.rollout.markers_m
    if steps is not None and len(steps) > 2:
        for number in np.unique(np.linspace(0, len(steps) - 1, STEPS + 2).astype(int))[1:-1].tolist():
            marks.append(world_line("on the way", steps[number], plane, "#9cc3de", 1.1))
    settled = result.final.markers_m
    marks.append(world_line("settled", settled, plane, SERIES[0], 2.2, 5.0))
    return [*marks, world_line("base", settled[:1], plane, INK, 0.0, 9.0, marker="s")]


def _loads(plane: tuple[int, int], run: StudyRun, tip: Array, half_m: float) -> list[Mark]:
    """Return strokes for the force at the tip and the payload's weight; those along the view have no length."""
    task, chain, factor = run.study.task, run.chain, display_unit("m").factor
    assert chain is not None
    payload = float(getattr(task, "payload_kg", None) or chain.payload_kg)
    stated = getattr(task, "tip_force_n", None)
    loads = (
        [(np.array([0.0, 0.0, -payload * G_M_S2]), display_unit("kg").text(payload, 3))] if payload else []
    )
    if stated is not None and np.any(stated):
        loads.append((np.array(stated, float), f"{np.linalg.norm(stated):.3g} N"))
    marks: list[Mark] = []
    for force, label in loads:
        end = tip + 2 * ARROW * half_m * force / np.linalg.norm(force)
        if np.linalg.norm((end - tip)[list(plane)]) > 1e-3 * half_m:
            marks.append(world_line("load", np.array([tip, end]), plane, WARN, 2.0))
            marks.append(
                world_line("load", end[None], plane, WARN, 0.0, 6.0, marker=_head(force[list(plane)]))
            )
            x, y = (factor * end[list(plane)]).tolist()
            marks.append(ChartNote(f"  {label}", x, y, "right", WARN))
    return marks


def _head(force: Array) -> str:
    """Return the marker at the end of a load: a triangle that points up or down, a dot for one to the side."""
    return "o" if abs(force[0]) > abs(force[1]) else "v" if force[1] < 0 else "^"
