"""Visible surface of a module: its family's, or one from a file, cut at the joint."""

from __future__ import annotations

import numpy as np

from pliant.errors import UserError
from pliant.interfaces.family import ActuatorFamily
from pliant.meshing.stl import read_stl
from pliant.meshing.surfaces import side
from pliant.records.shape import HalfSurfaces

# Allowed ratio of a drawn module's length along x to the module's: beyond it unit or file is wrong.
SHORTEST, LONGEST = 0.2, 5.0


def seen_surface(family: ActuatorFamily) -> HalfSurfaces:
    """Return the family's surface, or that of its config's `visual` file, in the module frame.

    Raises:
        UserError: the file is missing, empty, not an STL, or its size does not match the module.
    """
    config = family.config
    if config.visual is None:
        return family.surface()
    surface = read_stl(config.visual, config.visual_scale)
    length, module = float(np.ptp(surface.vertices_m[:, 0])), family.module_length_m
    if not SHORTEST * module < length < LONGEST * module:
        raise UserError(
            f"family.visual '{config.visual.name}' is {length:.4g} m long along x with visual_scale "
            f"{config.visual_scale:g}, but a module is {module:.4g} m long; the file is in metres and in the module "
            "frame (x along the chain, origin at the joint); a file in millimetres needs 'visual_scale: 0.001'."
        )
    return HalfSurfaces(start=side(surface, -1.0), end=side(surface, 1.0))
