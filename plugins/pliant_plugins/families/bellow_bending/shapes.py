"""What of the bending bellow collides: the plate on its gripping side, and the bellow behind it."""

from __future__ import annotations

import numpy as np

from pliant.records.shape import HalfShapes, Shape
from pliant_plugins.families.bellow.shapes import tube
from pliant_plugins.families.bellow_bending.geometry import BellowGeometry


def half_shapes(geometry: BellowGeometry) -> HalfShapes:
    """For each half a box, the plate, 2R wide and 2t thick, and a cylinder around the crests, of radius Rc + t.

    Pressure turns the tip toward −z: the plate's face z = −t is the side that grips.
    """

    def half(start_m: float) -> tuple[Shape, Shape]:
        quarter = geometry.half_length_m / 2
        plate = (quarter, geometry.average_radius_m, geometry.wall_m)
        return (
            Shape("box", plate, np.array([start_m + quarter, 0.0, 0.0]), np.eye(3)),
            tube(geometry, start_m, geometry.wall_m, geometry.axis_height_m),
        )

    return HalfShapes(start=half(-geometry.half_length_m), end=half(0.0))
