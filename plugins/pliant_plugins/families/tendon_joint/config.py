"""Parameters of the tendon joint."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.family import FamilyConfig
from pliant.units import Angle, Density, Length


class TendonJointConfig(FamilyConfig):
    """A strip between two rigid links, and a tendon that crosses the gap below it between two holes.

    Which values make a valid design is the family's own check (`JointGeometry.check`), so that its message can
    name the inequality.
    """

    kind: Literal["tendon_joint"] = "tendon_joint"
    module_length_m: Length = Field(description="l: from mid-link to mid-link")
    flexure_length_m: Length = Field(description="gap between the links that the flexure bridges")
    flexure_thickness_m: Length = Field(description="the flexure's height along z")
    flexure_width_m: Length = Field(description="the flexure's width along y")
    tendon_offset_m: Length = Field(description="of the tendon's holes, below the flexure's mid-plane")
    tendon_setback_m: Length = Field(
        description="of the tendon's holes, from the flexure's end into the link"
    )
    link_height_m: Length = Field(description="the links' height along z, centred on the flexure")
    link_width_m: Length = Field(description="the links' width along y")
    link_density_kg_m3: Density = Field(gt=0, description="mean mass per volume of the links")
    closing_angle_rad: Angle = Field(description="joint angle at which the links touch below the flexure")
    opening_angle_rad: Angle = Field(description="joint angle the other way at which they touch above it")
