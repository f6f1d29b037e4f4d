"""A module: its mesh at rest and deformed, cut open along its mirror plane, and its von Mises stress."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from matplotlib.colors import Normalize

from pliant.formatting import actuation_unit, deformation_unit, display_unit, fixed, stress_unit
from pliant.records.fem import FemDataset, ModuleShape
from pliant.report.figures import body, rendering, style

HEIGHT_PX = 620
FEWEST_PX = 380  # height of the colour bar's label
ROW_PX = 1100  # total width of the bodies
MARGIN_M = 0.0008
GAP_PX = 45
TITLE_PX = 190  # least space for a title
AZIMUTH, ELEVATION = np.radians(-22.0), np.radians(16.0)

Titled = tuple[str, rendering.Surface, rendering.Look]


def module_camera() -> rendering.Camera:
    """Return a view in the module frame: x to the right, z upwards, the cut toward the viewer."""
    front = rendering.Camera.looking(np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    return front.tilted(AZIMUTH, ELEVATION)


def show(axes: Any, image: rendering.Image, window: rendering.Window) -> None:
    """Put a drawn body on an axis whose unit is the millimetre."""
    style.bare(axes)
    left, right, bottom, top = (1e3 * v for v in window.box)
    axes.imshow(
        image, extent=(left, right, bottom, top), origin="lower", interpolation="antialiased", zorder=3
    )


def in_a_row(bodies: Sequence[Titled], bar: Callable[[Any, Any], None]) -> style.Png:
    """Draw the bodies with their titles above, a scale below the first, and a bar that `bar(figure, axes)` draws."""
    camera = module_camera()
    boxes = [rendering.bounding_box([surface], camera, MARGIN_M) for _, surface, _ in bodies]
    bottom, top = min(b[2] for b in boxes), max(b[3] for b in boxes)
    widths = [b[1] - b[0] for b in boxes]
    scale = min((HEIGHT_PX - 110) / (top - bottom), ROW_PX / sum(widths))
    slots = [
        max(scale * w, max(TITLE_PX, 13.0 * max(len(line) for line in title.split("\n"))))
        for w, (title, _, _) in zip(widths, bodies, strict=True)
    ]
    height = scale * (top - bottom)
    picture_px = max(round(height + 110), FEWEST_PX)
    total = sum(slots) + GAP_PX * len(slots) + 170
    with style.canvas(round(total), picture_px, pad=None) as figure:
        left = 20.0
        for (title, surface, look), box, width, slot in zip(bodies, boxes, widths, slots, strict=True):
            start = left + (slot - scale * width) / 2
            place = (
                start / total,
                (picture_px - height - 60) / picture_px,
                scale * width / total,
                height / picture_px,
            )
            axes = figure.add_axes(place)
            window = rendering.Window((box[0], box[1], bottom, top), scale)
            show(axes, rendering.draw(surface, camera, window, look), window)
            axes.set_title(title, loc="center")
            left += slot + GAP_PX
        bar_mm = style.round_length(0.45e3 * widths[0])
        foot = 22e3 / scale  # pixels as millimetres
        first = figure.axes[0]
        style.scale_bar(first, 1e3 * boxes[0][0] + 1, 1e3 * bottom - foot, bar_mm, f"{bar_mm:g} mm")
        first.set_ylim(1e3 * bottom, 1e3 * top)
        for line, label in zip(first.lines, first.texts, strict=True):
            line.set_clip_on(False)
            label.set(annotation_clip=False)
        bar(figure, figure.add_axes((left / total, 0.18, 14 / total, 0.6)))
        return style.png(figure)


MESH_LINE = 0.45  # pixels


def can_show(data: FemDataset | None) -> bool:
    """Return whether the data have a rest shape and a deformed one of a piece that bends about y or slides along x."""
    if data is None or len(data.shapes) < 2 or not len(data.shapes[0].faces):
        return False
    known = data.axis == "x" if data.joint == "prismatic" else data.axis == "y"
    return known and abs(data.shapes[0].angle_rad) < body.STRAIGHT


def module_shape(data: FemDataset) -> style.Png:
    """Draw the rest shape and the free shape at the largest actuation, at one scale."""
    last = last_shape(data)
    slides = data.joint == "prismatic"
    rest, free = body.unrolled([data.shapes[0], last], slides)
    theta, limits = body.piece_angle(last, slides), stretch_limits([free])
    coloured = rendering.Look(style.stretch_map(), limits, mesh_lines=MESH_LINE)
    plain = rendering.Look(colour="#e9e5dc", mesh_lines=MESH_LINE)
    opened = "y" in rest.mirrors
    bodies = [
        ("At rest, cut open" if opened else "At rest", body.cut_module(rest, 0.0), plain),
        (free_title(data, last), body.cut_module(free, theta), coloured),
    ]
    if opened:
        bodies.append(("The whole module", body.module(free, theta), coloured))
    return in_a_row(bodies, lambda figure, axes: stretch_bar(figure, axes, limits))


def last_shape(data: FemDataset) -> ModuleShape:
    """Return the free shape at the largest actuation."""
    return max(data.shapes, key=lambda shape: shape.actuation)


def stretch_limits(sections: Sequence[body.SectionShape]) -> tuple[float, float]:
    """Return 1 and the largest stretch of the skin, rounded up to a twentieth."""
    largest = max(float(s.values.max()) for s in sections)
    return 1.0, max(1.05, float(np.ceil(largest * 20 - 1e-6) / 20))


def stretch_bar(
    figure: Any,
    axes: Any,
    limits: tuple[float, float],
    orientation: Literal["vertical", "horizontal"] = "vertical",
) -> None:
    """Draw the colour bar of the skin's stretch."""
    place = {"cax": axes, "orientation": orientation}
    style.colour_bar(
        figure, (Normalize(*limits), style.stretch_map()), "largest stretch of the skin", **place
    )
    axes.grid(False)


def free_title(data: FemDataset, shape: ModuleShape) -> str:
    """Return the position of a shape on the free branch, as a title."""
    value = actuation_unit(data.actuation_name).text(shape.actuation)
    unit = deformation_unit(data)
    u = fixed(shape.angle_rad * unit.factor, 1 if unit is display_unit("rad") else 2)
    return f"Free at {value}: u = {u}{'' if unit is display_unit('rad') else ' '}{unit.symbol}"


# Peaks in a few corners would make the rest pale: the colours end at this share of the skin's nodes.
SHOWN_SHARE = 0.995


def has_stress(data: FemDataset | None) -> bool:
    """Return whether the last free shape can be drawn and has its stress."""
    return data is not None and can_show(data) and last_shape(data).von_mises_pa is not None


def module_stress(data: FemDataset) -> style.Png:
    """Draw the module cut open, with the stress in the section, and whole."""
    last = last_shape(data)
    stress = last.von_mises_pa
    assert stress is not None
    slides = data.joint == "prismatic"
    free = replace(body.unrolled([data.shapes[0], last], slides)[1], values=stress)
    theta, limit = body.piece_angle(last, slides), float(np.quantile(stress, SHOWN_SHARE)) or 1.0
    look = rendering.Look(style.stress_map(), (0.0, limit), mesh_lines=MESH_LINE)
    bodies = [(free_title(data, last), body.cut_module(free, theta), look)]
    if "y" in free.mirrors:
        bodies.append(("The whole module", body.module(free, theta), look))
    return in_a_row(bodies, lambda figure, axes: _bar(figure, axes, limit, float(stress.max())))


def stress_caption(data: FemDataset) -> str:
    """Return a caption with the largest stress of the skin."""
    stress = last_shape(data).von_mises_pa
    assert stress is not None
    largest = stress_unit(float(stress.max())).text(float(stress.max()), 3)
    return (
        "Von Mises stress, Cauchy, at the mesh's nodes (values at Gauss points, fitted in each element, averaged); "
        f"largest on the skin {largest}. 'pliant fem --fields DIR' writes all fields for ParaView."
    )


def _bar(figure: Any, axes: Any, limit: float, largest: float) -> None:
    unit = stress_unit(limit)
    mapped = (Normalize(0.0, limit * unit.factor), style.stress_map())
    place = {"cax": axes, "extend": "max" if largest > limit else "neither"}
    style.colour_bar(figure, mapped, f"von Mises stress ({unit.symbol})", **place)
    axes.grid(False)
