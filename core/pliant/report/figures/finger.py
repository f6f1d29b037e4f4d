"""The headline: the finger as a body of FEM modules beside its law; its settled pose in every engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pliant.formatting import actuation_unit, display_unit
from pliant.records.design import Array
from pliant.records.fem import ModuleShape
from pliant.report.figures import body, rendering, style
from pliant.report.figures.law import draw_law
from pliant.report.figures.module import can_show, show, stretch_bar, stretch_limits
from pliant.report.figures.stills import FLAT, draw_side
from pliant.report.folder import EngineResult, FinishedRun
from pliant.report.run_view import (
    actuation,
    actuation_text,
    base_pose,
    chain_config,
    distances_m,
    gravity,
    history_levels,
    module_designs,
    payload_kg,
    rest_markers,
)

WIDTH_PX, HEIGHT_PX = 1640, 700
BODY_PX = 610  # height of the body's image
GHOSTS = 2  # poses between rest and full actuation
AZIMUTH, ELEVATION = np.radians(-24.0), np.radians(12.0)


@dataclass(frozen=True, eq=False)
class Bodies:
    """The finger at rest, on the way, and settled, with the settled modules' shapes and its path of ends."""

    rest: rendering.Surface
    between: list[tuple[float, rendering.Surface, Array]]
    settled: rendering.Surface
    sections: list[body.SectionShape]
    path: Array


def finger_picture(run: FinishedRun) -> style.Png:
    """Body, law and poses in one wide picture; what the run does not have is left out."""
    bodies = finger_bodies(run)
    panels = [*(["body"] if bodies else []), "law", *(["pose"] if run.engines else [])]
    ratios = {"body": 1.5, "law": 1.0, "pose": 1.0}
    width = WIDTH_PX if len(panels) == 3 else 620 * len(panels)
    with style.canvas(width, HEIGHT_PX if len(panels) > 1 else 560, pad=(0.08, 0.09), wspace=0.03) as figure:
        axes: dict[str, Any] = figure.subplot_mosaic([panels], width_ratios=[ratios[p] for p in panels])
        if bodies:
            draw_bodies(figure, axes["body"], run, bodies)
        draw_law(axes["law"], run, run.designs[0], compact=True)
        if run.engines and run.engines[0].result.stills:
            draw_side(axes["pose"], run.engines[0].result.stills[-1])
        elif run.engines:
            draw_poses(axes["pose"], run, views(run)[0])
            if len(run.engines) > 1:
                axes["pose"].set_title(f"{axes['pose'].get_title(loc='left')}, {len(run.engines)} engines")
        return style.png(figure)


@dataclass(frozen=True, eq=False)
class ShapedModules:
    """A planar finger whose modules have FEM shapes: by design shapes and sections, by module design and turn."""

    shapes: list[Sequence[ModuleShape]]
    sections: list[list[body.SectionShape]]
    designs: list[int]
    turns: Array
    position: Array
    rotation: Array

    def poses(self, value: float, angles: Array) -> tuple[Array, Array, Array]:
        """Of the modules' middle sections at an actuation and angles (n,): rotations, centres, path of the ends."""
        pieces = self.pieces(value)
        return body.poses([pieces[d] for d in self.designs], angles, self.turns, self.position, self.rotation)

    def pieces(self, value: float) -> list[body.SectionShape]:
        """Of each design the shape at an actuation."""
        return [body.at_actuation(s, c, value) for s, c in zip(self.shapes, self.sections, strict=True)]


def shaped_modules(run: FinishedRun) -> ShapedModules | None:
    """The finger's modules, or None where no shapes describe them."""
    data = [d.fem for d in run.designs]
    modules, given, engines = module_designs(run), actuation(run), run.engines
    chain = chain_config(run)
    planar = all(d.law.joint == "revolute" and d.law.axes == ("y",) for d in run.designs)
    if not engines or modules is None or given is None or chain is None or len(chain.actuators) > 1:
        return None
    if not planar or not all(can_show(d) for d in data):
        return None
    if not all(d.shapes[0].mirrors == ("x", "y") for d in data if d is not None):
        return None
    designs, turns = modules
    if len(engines[0].result.final.joint_angles) != len(designs):
        return None
    shapes = [d.shapes for d in data if d is not None]
    position, rotation = base_pose(run)
    return ShapedModules(
        list(shapes), [body.unrolled(s) for s in shapes], designs, np.array(turns), position, rotation
    )


def finger_bodies(run: FinishedRun) -> Bodies | None:
    """The finger's bodies, or None where the shapes do not describe its modules.

    Each module has the free FEM shape at the present pressure, bent to its joint's angle in the first engine.
    """
    modules, given, engines = shaped_modules(run), actuation(run), run.engines
    if modules is None or given is None:
        return None

    def at(value: float, angles: Array) -> tuple[list[body.SectionShape], rendering.Surface, Array]:
        pieces = modules.pieces(value)
        own = [pieces[d] for d in modules.designs]
        return pieces, *body.finger(own, angles, modules.turns, modules.position, modules.rotation)

    final = engines[0].result.final.joint_angles[:, 0]
    levels = history_levels(engines[0].result, GHOSTS)
    between = [(value, *at(value, angles[:, 0])[1:]) for value, angles, _ in levels]
    pieces, settled, path = at(given[1], final)
    return Bodies(at(0.0, 0 * final)[1], between, settled, pieces, path)


def draw_bodies(figure: Any, axes: Any, run: FinishedRun, bodies: Bodies) -> None:
    """Rest and intermediate poses as ghosts, the settled finger coloured by the stretch of its skin."""
    camera = finger_camera(run)
    left, right, bottom, top = rendering.box_of(
        [bodies.rest, bodies.settled, *(b for _, b, _ in bodies.between)], camera, 0.002
    )
    foot = bottom - 0.13 * (top - bottom)  # room for the scales
    scale = BODY_PX / max(top - foot, 0.9 * (right - left))
    window = rendering.Window((left, right, bottom, top), scale)
    rough, limits = replace(window, fine=1), stretch_limits(bodies.sections)
    image = rendering.draw(bodies.rest, camera, rough, rendering.Look(colour="#e3e6ec", opacity=0.5))
    for number, (_, surface, _) in enumerate(bodies.between):
        ghost = rendering.Look(colour="#e9dcc6", opacity=0.22 + 0.1 * number)
        image = rendering.over(rendering.draw(surface, camera, rough, ghost), image)
    look = rendering.Look(style.stretch_map(), limits)
    image = rendering.over(rendering.draw(bodies.settled, camera, window, look), image)
    show(axes, image, window)
    axes.set_ylim(1e3 * foot, 1e3 * top)
    axes.set_anchor("N")
    bar_mm = style.round_length(0.3e3 * (right - left))
    style.scale_bar(axes, 1e3 * left + 2, 1e3 * (foot + 0.045 * (top - foot)), bar_mm, f"{bar_mm:g} mm")
    inset = axes.inset_axes((0.52, 0.06, 0.45, 0.018))
    stretch_bar(figure, inset, limits, "horizontal")
    inset.tick_params(labelsize=8)
    inset.xaxis.label.set_size(8)
    inset.xaxis.set_label_position("top")
    count = len(bodies.path) - 1
    axes.set_title(f"{count} FEM module{'s' * (count > 1)}, at rest and{actuation_text(run)}")


def finger_camera(run: FinishedRun) -> rendering.Camera:
    """A view onto the bending plane, from a little beside and above it."""
    _, rotation = base_pose(run)
    toward, along = rotation[:, 1], rotation[:, 0]
    up = np.array([0.0, 0.0, 1.0])
    if np.linalg.norm(gravity(run)) > 0:
        up = -gravity(run)
    if np.linalg.norm(np.cross(up, toward)) < 0.3 * np.linalg.norm(up):
        up = -along
    return rendering.Camera.looking(toward, up).tilted(AZIMUTH, ELEVATION)


LEVELS = 4  # faint poses on the way to the full actuation
SHOWN_DECADES = 1e-5  # of the largest distance: smaller ones are rounding
MARKS = ("o", "s", "^", "D", "v", "P")


def chain_pose(run: FinishedRun) -> style.Png:
    """One or two projections of the poses, and the distances of the markers to the first engine's."""
    engines = run.engines
    planes = views(run)
    several = len(engines) > 1
    panels = [*(f"view{n}" for n in range(len(planes))), *(["apart"] if several else [])]
    ratios = [1.15] * len(planes) + ([0.85] if several else [])
    with style.canvas(720 + 500 * (len(panels) - 1), 720, wspace=0.05) as figure:
        axes: dict[str, Any] = figure.subplot_mosaic([panels], width_ratios=ratios)
        for number, plane in enumerate(planes):
            draw_poses(axes[f"view{number}"], run, plane, legend=number == 0)
        if several:
            draw_distances(axes["apart"], engines)
        return style.png(figure)


def views(run: FinishedRun) -> list[tuple[int, int]]:
    """World planes (horizontal, vertical axis) that show the chain: one for a flat pose, else two."""
    points = _all_points(run)
    size = np.ptp(points, axis=0)
    flat = FLAT * size.max()
    upright = 2 if size[2] > flat else int(np.argsort(size)[-2])
    across = [axis for axis in np.argsort(-size, kind="stable").tolist() if axis != upright]
    seen = [axis for axis in across if size[axis] > flat] or across[:1]
    return [(axis, upright) for axis in seen]


def draw_poses(axes: Any, run: FinishedRun, plane: tuple[int, int], legend: bool = True) -> None:
    """Rest pose in grey, levels on the way faint, then every engine's settled pose, in mm."""
    engines = run.engines
    rest = rest_markers(run)
    if rest is not None:
        line: dict[str, Any] = {"color": style.FAINT, "lw": 3.2, "zorder": 1, "solid_capstyle": "round"}
        axes.plot(*style.flat(rest, plane), label="at rest", marker="o", ms=3, **line)
    _levels(axes, run, engines[0], plane)
    for number, engine in enumerate(engines):
        colour = style.SERIES[number % 6]
        look: dict[str, Any] = {"lw": 1.3, "ls": (0, (4, 2 + 2 * number)), "mfc": "white", "alpha": 1.0}
        if number == 0:
            look = {"lw": 3.4, "ls": "-", "mfc": colour, "alpha": 0.55}
        look |= {"marker": MARKS[number % 6], "ms": 8.5 - 2.6 * min(number, 2), "mec": colour}
        x, y = style.flat(engine.markers_m, plane)
        axes.plot(x, y, label=engine.kind, color=colour, zorder=5 + number, **look)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.1)
    style.world_labels(axes, plane)
    _annotate(axes, run, engines[0], plane)
    if legend:
        axes.set_title(f"Settled pose{actuation_text(run)}")
        axes.legend(loc="best", handlelength=2.6)


def draw_distances(axes: Any, engines: Sequence[EngineResult]) -> None:
    """Distance of each marker to the first engine's, on a logarithmic scale."""
    distances = distances_m(engines)
    worst = max(float(d.max()) for d in distances)
    floor = max(worst * SHOWN_DECADES, 1e-15)
    for number, (engine, distance) in enumerate(zip(engines, distances, strict=True)):
        if number:
            shown = 1e6 * np.where(distance > floor, distance, np.nan)
            look = {"color": style.SERIES[number % 6], "marker": MARKS[number % 6], "mfc": "white", "ms": 6}
            axes.plot(shown, label=engine.kind, **look)
    count = len(distances[0])
    step = max(1, round((count - 2) / 8))
    ticks = [0, *range(step, count - 1 - step // 2, step), count - 1]
    axes.set_yscale("log")
    axes.grid(True, which="major")
    axes.set_xticks(ticks, labels=[{0: "base", count - 1: "tip"}.get(k, str(k)) for k in ticks])
    axes.set(xlim=(-0.4, count - 0.6), ylabel="distance (µm)", xlabel="marker (joint)")
    axes.set_title(f"Distance to {engines[0].kind}")
    if worst == 0:
        axes.text(0.5, 0.5, "identical", transform=axes.transAxes, ha="center")
        return
    least = min(float(d[d > floor].min(initial=worst)) for d in distances)
    axes.set_ylim(0.3e6 * least, 5e6 * worst)
    axes.legend(loc="lower right")


def _levels(axes: Any, run: FinishedRun, engine: EngineResult, plane: tuple[int, int]) -> None:
    """Faint poses at lower levels; a level is labelled where its tip is clear of those labelled before."""
    unit = actuation_unit(run.designs[0].law.actuation_name)
    labelled = [np.array([v[-1] for v in style.flat(engine.markers_m, plane)])]
    clear = 0.06 * 1e3 * float(np.ptp(_all_points(run), axis=0).max())
    for value, _, markers in reversed(history_levels(engine.result, LEVELS)):
        x, y = style.flat(markers, plane)
        axes.plot(x, y, color=style.SERIES[0], alpha=0.28, lw=1.1, zorder=2)
        tip = np.array([x[-1], y[-1]])
        if min(float(np.linalg.norm(tip - other)) for other in labelled) < clear:
            continue
        labelled.append(tip)
        out = tip - [x[-2], y[-2]]
        out = out / max(float(np.linalg.norm(out)), 1e-9)
        if _beside(tip, engine, plane) < 0.5 * clear:  # a chain that only grows: the label stands beside it
            out = np.array([1.4, 0.0]) if abs(out[1]) > abs(out[0]) else np.array([0.0, 1.4])
        across, up = (0 if abs(part) <= 0.35 else int(np.sign(part)) for part in out)
        sides = {"ha": ("center", "left", "right")[across], "va": ("center", "bottom", "top")[up]}
        style.note(
            axes, unit.text(value, 3), tuple(tip), tuple(9 * out), fontsize=7.5, color=style.SOFT, **sides
        )


def _beside(tip: Any, engine: EngineResult, plane: tuple[int, int]) -> float:
    """Distance of a point from the settled chain, mm."""
    x, y = (np.asarray(c, float) for c in style.flat(engine.markers_m, plane))
    start, along = np.stack([x, y], axis=1)[:-1], np.diff(np.stack([x, y], axis=1), axis=0)
    length = np.maximum(np.sum(along**2, axis=1), 1e-12)
    part = np.clip(np.sum((tip - start) * along, axis=1) / length, 0, 1)
    return float(np.linalg.norm(start + part[:, None] * along - tip, axis=1).min())


def _annotate(axes: Any, run: FinishedRun, engine: EngineResult, plane: tuple[int, int]) -> None:
    """Base, tip with its coordinates, payload, direction of gravity."""
    x, y = style.flat(engine.markers_m, plane)
    axes.plot(x[0], y[0], marker="s", ms=11, color=style.INK, zorder=9)
    if payload := payload_kg(run):
        text = f"{display_unit('kg').text(payload, 3)} hung"
        style.note(axes, text, (x[-1], y[-1]), (12, 0), ha="left", va="center")
    g = gravity(run)[list(plane)]
    if np.linalg.norm(g) > 0:
        at = np.array([0.94, 0.19])
        place = {"xycoords": "axes fraction", "textcoords": "axes fraction"}
        arrow = {"arrowstyle": "-|>", "color": style.SOFT, "lw": 1.8}
        axes.annotate("", tuple(at + 0.13 * g / np.linalg.norm(g)), tuple(at), arrowprops=arrow, **place)
        look = {"style": "italic", "color": style.SOFT, "ha": "right"}
        axes.text(*(at + [-0.02, 0.02]), "g", transform=axes.transAxes, **look)


def _all_points(run: FinishedRun) -> Array:
    rest = rest_markers(run)
    sets = [r.markers_m for r in run.engines] + ([rest] if rest is not None else [])
    return np.concatenate(sets)
