"""What bellows share whose wall is the profile as mid-surface ± t/2."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

from pydantic import Field

from pliant.families import Need, QuarterModule, design_geometry, half_cylinders
from pliant.interfaces.family import FamilyConfig
from pliant.records.shape import HalfShapes
from pliant.units import Length
from pliant_plugins.families.bellow.profile import BellowProfile


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
        return design_geometry(self.config, BellowProfile)

    def needs(self) -> Iterator[Need]:
        return self.geometry.mid_surface_needs()

    def shapes(self) -> HalfShapes:
        """Return cylinders around the crests of the halves; no object larger than a module enters the troughs."""
        radius = self.geometry.crest_radius_m + self.geometry.wall_m / 2
        return half_cylinders(self.module_length_m, radius, self.offset_m)
