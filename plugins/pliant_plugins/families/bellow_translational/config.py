"""Parameters of the translational bellow."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.family import FamilyConfig
from pliant.units import Length


class BellowTranslationalConfig(FamilyConfig):
    """A bellow whose wall is the mid-surface of radii r (trough) and 2R − r (crest) ± t/2.

    Which values make a valid design is the family's own check (`BellowProfile.check_mid_surface`).
    """

    kind: Literal["bellow_translational"] = "bellow_translational"
    inner_radius_m: Length = Field(description="r: radius of the mid-surface at the trough")
    average_radius_m: Length = Field(description="R: mean of the mid-surface's radii at trough and crest")
    wall_m: Length = Field(description="t: wall thickness")
    module_length_m: Length = Field(description="l: length of one convolution, the module")
