"""A module's solved free states: whole or cut open, coloured by stretch or by stress."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.colors import Colormap, to_hex

from pliant.formatting import effort_unit, stress_unit
from pliant.records.design import Array
from pliant.records.fem import FemDataset, ModuleShape
from pliant.records.law import JointLaw
from pliant.report.figures import body, style
from pliant.report.figures.module import (
    SHOWN_SHARE,
    can_show,
    free_title,
    module_camera,
    stretch_limits,
)
from pliant.report.scene import Colouring, Copy, DrawnScene, SceneBody, SceneSkin, ball

WHOLE, CUT = "whole", "cut open"
STRETCH, STRESS, ERROR = "stretch", "stress", "error"
RAMP = 9  # colours of a colour bar


def module_scene(data: FemDataset, law: JointLaw | None = None) -> DrawnScene | None:
    """Return the solved piece at each free state, with its mirror images; None where the data have no shapes.

    Args:
        data: with the shapes of its free branch.
        law: fitted to them; free states have no effort, so the law's value there is its error.
    """
    if not can_show(data):
        return None
    slides = data.joint == "prismatic"
    order = np.argsort([shape.actuation for shape in data.shapes], kind="stable")
    shapes = [data.shapes[k] for k in order]
    unrolled = body.unrolled(data.shapes, slides)
    sections = [unrolled[k] for k in order]
    stresses = [shape.von_mises_pa for shape in shapes]
    values, colourings = {STRETCH: np.stack([s.values for s in sections])}, [stretch_colouring(sections)]
    if all(stress is not None for stress in stresses):
        stress_pa = np.stack([stress for stress in stresses if stress is not None])
        limit = max(float(np.quantile(one, SHOWN_SHARE)) for one in stress_pa) or 1.0
        unit = stress_unit(limit)
        values[STRESS] = unit.factor * stress_pa
        label, limits = f"von Mises stress ({unit.symbol})", (0.0, unit.factor * limit)
        colourings.append(Colouring(STRESS, label, limits, ramp(style.stress_map())))
    by_state: dict[str, Array] = {}
    if law is not None and data.axis in law.axes:
        u, axis, effort = np.zeros((len(shapes), len(law.axes))), law.axes.index(data.axis), effort_unit(data)
        u[:, axis] = [shape.angle_rad for shape in shapes]
        given = law.evaluate(np.array([shape.actuation for shape in shapes]), u)
        by_state[ERROR] = effort.factor * np.abs(given.tau[:, axis])
        limits = (0.0, float(by_state[ERROR].max()) or 1.0)
        label = f"error of the law in this state ({effort.symbol})"
        colourings.append(Colouring(ERROR, label, limits, ramp(style.stretch_map())))
    count, opened = len(shapes), "y" in sections[0].mirrors
    angles = np.array([body.piece_angle(shape, slides) for shape in shapes])
    piece = SceneBody(
        0,
        _copies(sections[0].mirrors),
        np.arange(float(count)),
        angles,
        np.tile(np.eye(3), (count, 1, 1)),
        np.zeros((count, 3)),
        by_state,
    )
    camera = module_camera()
    middle, radius = ball(np.stack([shape.points_m * _both(shape) for shape in shapes]))
    return DrawnScene(
        "state",
        tuple(free_title(data, shape) for shape in shapes),
        (section_skin(sections, values),),
        (piece,),
        tuple(colourings),
        np.stack([camera.right, camera.up, camera.toward]),
        middle,
        radius,
        (WHOLE, CUT) if opened else (),
    )


def section_skin(sections: Sequence[body.SectionShape], values: Mapping[str, Array]) -> SceneSkin:
    """Return sections at their levels as a skin whose faces are its sides and each of its lids."""
    first = sections[0]
    lids = dict(first.lids)
    sides = ~np.any(list(lids.values()), axis=0) if lids else np.ones(len(first.faces), bool)
    faces = {"sides": first.faces[sides], **{name: first.faces[lid] for name, lid in lids.items()}}
    return SceneSkin(
        np.stack([s.section for s in sections]), np.array([s.length_m for s in sections]), faces, values
    )


def mirror_signs(mirrors: Sequence[str], planes: str = "xyz") -> list[tuple[int, int, int]]:
    """Return the signs of the piece and its mirror images in those of the planes that it has."""
    ways = [(1, -1) if name in planes and name in mirrors else (1,) for name in "xyz"]
    return [(x, y, z) for x, y, z in product(*ways)]


def stretch_colouring(sections: Sequence[body.SectionShape]) -> Colouring:
    """Return the colouring by the largest stretch of the skin, as in the static pictures."""
    return Colouring(
        STRETCH, "largest stretch of the skin", stretch_limits(sections), ramp(style.stretch_map())
    )


def ramp(colours: Colormap) -> tuple[str, ...]:
    """Return a colour map as a few colours between which a page interpolates."""
    return tuple(to_hex(colours(place)) for place in np.linspace(0, 1, RAMP))


def _copies(mirrors: Sequence[str]) -> tuple[Copy, ...]:
    """Return the whole module with end lids, and the module cut open along y = 0 if that is a mirror plane."""
    ends = ("end",) if "x" in mirrors else ("start", "end")
    found: list[Copy] = []
    for view, planes, faces in ((WHOLE, "xyz", ("sides", *ends)), (CUT, "xz", ("sides", *ends, "y"))):
        if view == CUT and "y" not in mirrors:
            continue
        named: dict[str, Any] = {"view": view if "y" in mirrors else ""}
        found += [Copy(part, signs, **named) for signs in mirror_signs(mirrors, planes) for part in faces]
    return tuple(found)


def _both(shape: ModuleShape) -> Array:
    """Return (2, 1, 3) signs: the shape, and its image in all mirror planes, between which all other images are."""
    far = [-1.0 if name in shape.mirrors else 1.0 for name in "xyz"]
    return np.array([[[1.0, 1.0, 1.0]], [far]])
