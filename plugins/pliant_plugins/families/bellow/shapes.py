"""What of a bellow collides: a cylinder around its crests."""

from __future__ import annotations

import numpy as np

from pliant.mechanics.rotations import exp_map
from pliant.records.shape import HalfShapes, Shape
from pliant_plugins.families.bellow.profile import BellowProfile

ALONG_X = exp_map(np.array([0.0, np.pi / 2, 0.0]))


def tube(profile: BellowProfile, start_m: float, outside_m: float, axis_height_m: float) -> Shape:
    """Cylinder from x = `start_m` over half a module, around crests whose outer side is `outside_m` off the profile.

    It fills the troughs, into which nothing reaches that is larger than a module.
    """
    quarter = profile.half_length_m / 2
    size = (profile.crest_radius_m + outside_m, quarter)
    return Shape("cylinder", size, np.array([start_m + quarter, 0.0, axis_height_m]), ALONG_X)


def half_tubes(profile: BellowProfile, axis_height_m: float = 0.0) -> HalfShapes:
    """The cylinders of both halves of a module whose wall is the mid-surface ± t/2."""
    outside = profile.wall_m / 2
    return HalfShapes(
        start=(tube(profile, -profile.half_length_m, outside, axis_height_m),),
        end=(tube(profile, 0.0, outside, axis_height_m),),
    )
