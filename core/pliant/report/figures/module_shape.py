"""The FEM mesh of a module at rest and deformed, cut open along its mirror plane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from pliant.formatting import actuation_unit, deformation_unit, fixed
from pliant.records.fem import FemDataset, ModuleShape
from pliant.report.figures import body, shading, style
from pliant.report.figures.body_row import in_a_row

MESH_LINE = 0.45  # pixels


def can_show(data: FemDataset | None) -> bool:
    """Whether the data hold a rest shape and a deformed one of a piece that bends about y or slides along x."""
    if data is None or len(data.shapes) < 2 or not len(data.shapes[0].faces):
        return False
    known = data.axis == "x" if data.joint == "prismatic" else data.axis == "y"
    return known and abs(data.shapes[0].angle_rad) < body.STRAIGHT


def module_shape(data: FemDataset) -> style.Png:
    """Rest shape and the free shape at the largest actuation, at one scale."""
    last = last_shape(data)
    slides = data.joint == "prismatic"
    rest, free = body.unrolled([data.shapes[0], last], slides)
    theta, limits = body.piece_angle(last, slides), stretch_limits([free])
    coloured = shading.Look(style.stretch_map(), limits, mesh_lines=MESH_LINE)
    plain = shading.Look(colour="#e9e5dc", mesh_lines=MESH_LINE)
    opened = "y" in rest.mirrors
    bodies = [
        ("At rest, cut open" if opened else "At rest", body.cut_module(rest, 0.0), plain),
        (free_title(data, last), body.cut_module(free, theta), coloured),
    ]
    if opened:
        bodies.append(("The whole module", body.module(free, theta), coloured))
    return in_a_row(bodies, lambda figure, axes: stretch_bar(figure, axes, limits))


def last_shape(data: FemDataset) -> ModuleShape:
    """The free shape at the largest actuation."""
    return max(data.shapes, key=lambda shape: shape.actuation)


def stretch_limits(sections: Sequence[body.SectionShape]) -> tuple[float, float]:
    """1 to the largest stretch of the skin, rounded up to a twentieth."""
    largest = max(float(s.values.max()) for s in sections)
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


def free_title(data: FemDataset, shape: ModuleShape) -> str:
    """Where on the free branch a shape is."""
    value = actuation_unit(data.actuation_name).text(shape.actuation)
    unit = deformation_unit(data)
    u = fixed(shape.angle_rad * unit.factor, 2 if data.joint == "prismatic" else 1)
    return f"Free at {value}: u = {unit.attached(u)}"
