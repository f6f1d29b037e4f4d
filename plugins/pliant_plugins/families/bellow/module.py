"""What bellows share whose wall is the profile as mid-surface ± t/2; what of a bellow collides."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from pydantic import Field

from pliant.families import Need, QuarterModule, geometry_of
from pliant.interfaces.family import FamilyConfig
from pliant.mechanics.rotations import exp_map
from pliant.records.shape import HalfShapes, Shape
from pliant.units import Length
from pliant_plugins.families.bellow.profile import BellowProfile

ALONG_X = exp_map(np.array([0.0, np.pi / 2, 0.0]))


def tube(profile: BellowProfile, start_m: float, outside_m: float, axis_height_m: float) -> Shape:
    """Cylinder from x = `start_m` over half a module, around crests whose outer side is `outside_m` off the profile.

    It fills the troughs, into which nothing reaches that is larger than a module.
    """
    quarter = profile.half_length_m / 2
    size = (profile.crest_radius_m + outside_m, quarter)
    return Shape("cylinder", size, np.array([start_m + quarter, 0.0, axis_height_m]), ALONG_X)


class MidSurfaceConfig(FamilyConfig):
    """Parameters of a bellow whose wall is the mid-surface of radii r (trough) and 2R − r (crest) ± t/2."""

    inner_radius_m: Length = Field(description="r: radius of the mid-surface at the trough")
    average_radius_m: Length = Field(description="R: mean of the mid-surface's radii at trough and crest")
    wall_m: Length = Field(description="t: wall thickness")
    module_length_m: Length = Field(description="l: length of one convolution, the module")


class MidSurfaceBellow(QuarterModule):
    """A bellow whose wall is the profile ± t/2; a module runs from mid-trough to mid-trough."""

    @cached_property
    def geometry(self) -> BellowProfile:
        """The profile."""
        return geometry_of(self.config, BellowProfile)

    def needs(self) -> Iterator[Need]:
        return self.geometry.mid_surface_needs()

    def shapes(self) -> HalfShapes:
        """Cylinders around the crests of the two halves."""
        half, outside, height = self.geometry.half_length_m, self.geometry.wall_m / 2, self.offset_m
        start, end = (tube(self.geometry, x, outside, height) for x in (-half, 0.0))
        return HalfShapes(start=(start,), end=(end,))
