"""Parameters of the eccentric tube."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.family import FamilyConfig
from pliant.units import Length


class EccentricTubeConfig(FamilyConfig):
    """A round tube and its bore. Which values make a valid design is checked by `Section.check`."""

    kind: Literal["eccentric_tube"] = "eccentric_tube"
    outer_radius_m: Length = Field(description="R: radius of the tube")
    bore_radius_m: Length = Field(description="a: radius of the bore")
    offset_m: Length = Field(description="d: bore's axis above the tube's; the wall is R − a − d thin there")
    module_length_m: Length = Field(description="l: length of tube that one joint stands for")
