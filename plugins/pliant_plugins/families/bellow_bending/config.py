"""Parameters of the bending bellow."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.family import FamilyConfig
from pliant.units import Length


class BellowBendingConfig(FamilyConfig):
    """A bellow whose wall has thickness t outside a profile of radii r (trough) and 2R − r (crest).

    Which values make a valid design is the family's own check (`BellowGeometry.check`), so that its message
    can name the inequality.
    """

    kind: Literal["bellow_bending"] = "bellow_bending"
    inner_radius_m: Length = Field(description="r: inner radius of the trough")
    average_radius_m: Length = Field(description="R: mean of the inner radii of trough and crest")
    wall_m: Length = Field(description="t: wall thickness; the plate is 2t thick")
    module_length_m: Length = Field(description="l: length of one convolution, the module")
