"""Bodies beside each other at one scale, with a colour bar: what the pictures of a module share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pliant.report.figures import raster, shading, style

HEIGHT_PX = 620
FEWEST_PX = 380  # height that the colour bar's label needs
ROW_PX = 1100  # width that the bodies together may take
MARGIN_M = 0.0008
GAP_PX = 45
TITLE_PX = 190  # a title's room at least
AZIMUTH, ELEVATION = np.radians(-22.0), np.radians(16.0)

Titled = tuple[str, raster.Surface, shading.Look]


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


def in_a_row(bodies: Sequence[Titled], bar: Callable[[Any, Any], None]) -> style.Png:
    """The bodies with their titles above, a scale below the first, and a bar that `bar(figure, axes)` draws."""
    camera = module_camera()
    boxes = [raster.box_of([surface], camera, MARGIN_M) for _, surface, _ in bodies]
    bottom, top = min(b[2] for b in boxes), max(b[3] for b in boxes)
    widths = [b[1] - b[0] for b in boxes]
    scale = min((HEIGHT_PX - 110) / (top - bottom), ROW_PX / sum(widths))
    slots = [max(scale * w, _title_px(title)) for w, (title, _, _) in zip(widths, bodies, strict=True)]
    height = scale * (top - bottom)
    picture_px = max(round(height + 110), FEWEST_PX)
    total = sum(slots) + GAP_PX * len(slots) + 170
    with style.canvas(round(total), picture_px) as figure:
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
            window = raster.Window((box[0], box[1], bottom, top), scale)
            show(axes, raster.draw(surface, camera, window, look), window)
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


def _title_px(title: str) -> float:
    """About how wide a title is."""
    return max(TITLE_PX, 13.0 * max(len(line) for line in title.split("\n")))
