"""The free module at the largest actuation, coloured by its von Mises stress."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from pliant.formatting import stress_unit
from pliant.records.fem import FemDataset
from pliant.report.figures import body, shading, style
from pliant.report.figures.body_row import in_a_row
from pliant.report.figures.module_shape import MESH_LINE, can_show, free_title, last_shape

# Peaks in a few corners would leave all else pale: the colours end at this share of the skin's nodes.
SHOWN_SHARE = 0.995


def has_stress(data: FemDataset | None) -> bool:
    """Whether the last free shape can be drawn and has its stress."""
    return data is not None and can_show(data) and last_shape(data).von_mises_pa is not None


def module_stress(data: FemDataset) -> style.Png:
    """Cut open, with the stress in the section, and whole."""
    last = last_shape(data)
    stress = last.von_mises_pa
    assert stress is not None
    slides = data.joint == "prismatic"
    free = replace(body.unrolled([data.shapes[0], last], slides)[1], values=stress)
    theta, limit = body.piece_angle(last, slides), float(np.quantile(stress, SHOWN_SHARE)) or 1.0
    look = shading.Look(style.stress_map(), (0.0, limit), mesh_lines=MESH_LINE)
    bodies = [(free_title(data, last), body.cut_module(free, theta), look)]
    if "y" in free.mirrors:
        bodies.append(("The whole module", body.module(free, theta), look))
    return in_a_row(bodies, lambda figure, axes: _bar(figure, axes, limit, float(stress.max())))


def stress_caption(data: FemDataset) -> str:
    """What the picture shows and the largest stress of the skin."""
    stress = last_shape(data).von_mises_pa
    assert stress is not None
    largest = stress_unit(float(stress.max())).text(float(stress.max()), 3)
    return (
        "Von Mises stress, Cauchy, at the mesh's nodes (values at Gauss points, fitted in each element, averaged); "
        f"largest on the skin {largest}. 'pliant fem --fields DIR' writes all fields for ParaView."
    )


def _bar(figure: Any, axes: Any, limit: float, largest: float) -> None:
    unit = stress_unit(limit)
    mapped = ScalarMappable(Normalize(0.0, limit * unit.factor), style.stress_map())
    bar = figure.colorbar(mapped, cax=axes, extend="max" if largest > limit else "neither")
    bar.set_label(f"von Mises stress ({unit.symbol})")
    bar.outline.set_visible(False)
    axes.grid(False)
