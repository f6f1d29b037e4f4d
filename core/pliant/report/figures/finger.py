"""The headline picture: the finger as a body of FEM modules, its law, and its settled pose in every engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pliant.pipeline.run_folder import FinishedRun
from pliant.records.design import Array
from pliant.records.fem import ModuleShape
from pliant.report.contact_charts import instant_panel
from pliant.report.figures import body, rendering, style
from pliant.report.figures.module import can_show, show, stretch_bar, stretch_limits
from pliant.report.law_charts import law_panel
from pliant.report.pose_charts import SIDE, pose_panel, views
from pliant.report.run_view import (
    actuation,
    actuation_text,
    base_pose,
    chain_config,
    gravity,
    history_levels,
    module_designs,
)
from pliant.report.still import draw_panel

WIDTH_PX, HEIGHT_PX = 1640, 700
BODY_PX = 610  # height of the body's image
GHOSTS = 2  # poses between rest and full actuation
AZIMUTH, ELEVATION = np.radians(-24.0), np.radians(12.0)


@dataclass(frozen=True, eq=False)
class Bodies:
    """The finger at rest, at intermediate poses, and settled, with the settled modules' shapes and its path of ends."""

    rest: rendering.Surface
    between: list[tuple[float, rendering.Surface, Array]]
    settled: rendering.Surface
    sections: list[body.SectionShape]
    path: Array


def finger_picture(run: FinishedRun) -> style.Png:
    """Draw body, law and poses in one wide picture; parts that the run does not have are left out."""
    bodies = finger_bodies(run)
    panels = [*(["body"] if bodies else []), "law", *(["pose"] if run.engines else [])]
    ratios = {"body": 1.5, "law": 1.0, "pose": 1.0}
    width = WIDTH_PX if len(panels) == 3 else 620 * len(panels)
    with style.canvas(width, HEIGHT_PX if len(panels) > 1 else 560, pad=(0.08, 0.09), wspace=0.03) as figure:
        axes: dict[str, Any] = figure.subplot_mosaic([panels], width_ratios=[ratios[p] for p in panels])
        if bodies:
            draw_bodies(figure, axes["body"], run, bodies)
        draw_panel(axes["law"], replace(law_panel(run, run.designs[0]), title="Joint law τ(p, u)"))
        if run.engines and run.engines[0].result.stills:
            draw_panel(axes["pose"], instant_panel(run.engines[0].result.stills[-1], SIDE))
        elif run.engines:
            draw_panel(axes["pose"], pose_panel(run, views(run)[0]), legend=True)
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
        """Return rotations and centres of the middle sections, and the path of the ends, at angles (n,)."""
        pieces = self.pieces(value)
        return body.poses([pieces[d] for d in self.designs], angles, self.turns, self.position, self.rotation)

    def pieces(self, value: float) -> list[body.SectionShape]:
        """Return the shape of each design at an actuation."""
        return [body.at_actuation(s, c, value) for s, c in zip(self.shapes, self.sections, strict=True)]


def shaped_modules(run: FinishedRun) -> ShapedModules | None:
    """Return the finger's modules, or None without shapes."""
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
    """Return the finger's bodies, or None where the shapes do not describe its modules.

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
    """Draw rest and intermediate poses transparent, the settled finger coloured by the stretch of its skin."""
    camera = finger_camera(run)
    left, right, bottom, top = rendering.bounding_box(
        [bodies.rest, bodies.settled, *(b for _, b, _ in bodies.between)], camera, 0.002
    )
    foot = bottom - 0.13 * (top - bottom)  # space for the scales
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
    """Return a view onto the bending plane, slightly from the side and from above."""
    _, rotation = base_pose(run)
    toward, along = rotation[:, 1], rotation[:, 0]
    up = np.array([0.0, 0.0, 1.0])
    if np.linalg.norm(gravity(run)) > 0:
        up = -gravity(run)
    if np.linalg.norm(np.cross(up, toward)) < 0.3 * np.linalg.norm(up):
        up = -along
    return rendering.Camera.looking(toward, up).tilted(AZIMUTH, ELEVATION)
