"""The FEM mesh of a module at rest and deformed, cut open along its mirror plane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from pliant.records.fem import FemDataset, ModuleShape
from pliant.report import units
from pliant.report.figures import body, raster, shading, style

HEIGHT_PX = 620
MESH_LINE = 0.45  # pixels
AZIMUTH, ELEVATION = np.radians(-22.0), np.radians(16.0)


def can_show(data: FemDataset | None) -> bool:
    """Whether the data hold a rest shape and a deformed one of a piece that bends."""
    if data is None or len(data.shapes) < 2 or not len(data.shapes[0].faces):
        return False
    rest = data.shapes[0]
    return abs(rest.angle_rad) < body.STRAIGHT and data.axis == "y"


def module_shape(data: FemDataset) -> style.Png:
    """Rest shape and the free shape at the largest actuation, at one scale."""
    last = max(data.shapes, key=lambda shape: shape.actuation)
    rest, free = body.unrolled([data.shapes[0], last])
    theta, camera, limits = last.angle_rad / 2, module_camera(), stretch_limits([free])
    coloured = shading.Look(style.stretch_map(), limits, mesh_lines=MESH_LINE)
    bodies = [
        (
            "At rest, cut open",
            body.cut_module(rest, 0.0),
            shading.Look(colour="#e9e5dc", mesh_lines=MESH_LINE),
        ),
        (_title(data, last), body.cut_module(free, theta), coloured),
        ("The whole module", body.module(free, theta), coloured),
    ]
    boxes = [raster.box_of([surface], camera, 0.0008) for _, surface, _ in bodies]
    bottom, top = min(b[2] for b in boxes), max(b[3] for b in boxes)
    widths = [b[1] - b[0] for b in boxes]
    scale = min((HEIGHT_PX - 110) / (top - bottom), 1100 / sum(widths))
    total = scale * sum(widths) + 260
    with style.canvas(round(total), HEIGHT_PX) as figure:
        left = 20.0
        for number, ((title, surface, look), box) in enumerate(zip(bodies, boxes, strict=True)):
            width, height = scale * widths[number], scale * (top - bottom)
            axes = figure.add_axes((left / total, 50 / HEIGHT_PX, width / total, height / HEIGHT_PX))
            window = raster.Window((box[0], box[1], bottom, top), scale)
            show(axes, raster.draw(surface, camera, window, look), window)
            axes.set_title(title, loc="center")
            left += width + 45
        bar_mm = style.round_length(0.45e3 * widths[0])
        style.scale_bar(figure.axes[0], 1e3 * boxes[0][0] + 1, 1e3 * bottom - 0.6, bar_mm, f"{bar_mm:g} mm")
        figure.axes[0].set_ylim(1e3 * bottom - 0.8, 1e3 * top)
        stretch_bar(figure, figure.add_axes((left / total, 0.2, 14 / total, 0.55)), limits)
        return style.png(figure)


def module_camera() -> raster.Camera:
    """A view in the module frame: x to the right, z upwards, the cut toward the viewer."""
    front = raster.Camera.looking(np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    return front.tilted(AZIMUTH, ELEVATION)


def show(axes: Any, image: shading.Image, window: raster.Window) -> None:
    """Put a drawn body on an axis whose unit is the millimetre."""
    style.bare(axes)
    left, right, bottom, top = (1e3 * v for v in window.box)
    axes.imshow(
        image, extent=(left, right, bottom, top), origin="lower", interpolation="antialiased", zorder=3
    )


def stretch_limits(sections: Sequence[body.SectionShape]) -> tuple[float, float]:
    """1 to the largest stretch of the skin, rounded up to a twentieth."""
    largest = max(float(s.stretch.max()) for s in sections)
    return 1.0, max(1.05, float(np.ceil(largest * 20 - 1e-6) / 20))


def stretch_bar(
    figure: Any,
    axes: Any,
    limits: tuple[float, float],
    orientation: Literal["vertical", "horizontal"] = "vertical",
) -> None:
    """The colour bar of the skin's stretch."""
    mapped = ScalarMappable(Normalize(*limits), style.stretch_map())
    bar = figure.colorbar(mapped, cax=axes, orientation=orientation)
    bar.set_label("largest stretch of the skin")
    bar.outline.set_visible(False)
    axes.grid(False)


def _title(data: FemDataset, shape: ModuleShape) -> str:
    value = units.of_actuation(data.actuation_name).text(shape.actuation)
    return f"Free at {value}: u = {units.fixed(np.degrees(shape.angle_rad), 1)}°"
