"""What of the bending bellow collides: the plate on its gripping side, and the bellow behind it."""

from __future__ import annotations

import numpy as np

from pliant.mechanics.rotations import exp_map
from pliant.records.shape import HalfShapes, Shape
from pliant_plugins.families.bellow_bending.geometry import BellowGeometry

ALONG_X = exp_map(np.array([0.0, np.pi / 2, 0.0]))


def half_shapes(geometry: BellowGeometry) -> HalfShapes:
    """For each half a box, the plate, 2R wide and 2t thick, and a cylinder around the crests, of radius Rc + t.

    Pressure turns the tip toward −z: the plate's face z = −t is the side that grips. The cylinder fills the
    troughs, into which nothing reaches that is larger than a module.
    """

    def half(start_m: float) -> tuple[Shape, Shape]:
        centre = start_m + geometry.half_length_m / 2
        quarter = geometry.half_length_m / 2
        plate = (quarter, geometry.average_radius_m, geometry.wall_m)
        tube = (geometry.crest_radius_m + geometry.wall_m, quarter)
        return (
            Shape("box", plate, np.array([centre, 0.0, 0.0]), np.eye(3)),
            Shape("cylinder", tube, np.array([centre, 0.0, geometry.axis_height_m]), ALONG_X),
        )

    return HalfShapes(start=half(-geometry.half_length_m), end=half(0.0))
