"""Parameters of the helical bellow."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.family import FamilyConfig
from pliant.units import Force, Length

OFFSET = 0.825  # of r


class BellowHelicalConfig(FamilyConfig):
    """A bellow of mid-surface radii r (trough) and 2R − r (crest), wall ± t/2, with a constraint along one side.

    The constraint's shape is not published. Its distance from the tube's axis and its stiffness are fitted to the
    published bending data of one design, on its free curve and its moments at 15 kPa. Its width decides bending about
    z and is not identified by them. See `benchmarks/families/helical.py`. Which values make a valid design is the
    family's own check.
    """

    kind: Literal["bellow_helical"] = "bellow_helical"
    inner_radius_m: Length = Field(description="r: radius of the mid-surface at the trough")
    average_radius_m: Length = Field(description="R: mean of the mid-surface's radii at trough and crest")
    wall_m: Length = Field(description="t: wall thickness")
    module_length_m: Length = Field(description="l: length of one convolution, the module")
    constraint_offset_m: Length | None = Field(
        default=None,
        description=f"distance of the constraint from the tube's axis; {OFFSET} r unless given",
    )
    constraint_width_m: Length | None = Field(
        default=None,
        description="width of the constraint along y, which stiffens bending about z; unless given, that of the "
        "study's rod (diameter R − t, touching the line at r) at the constraint's height",
    )
    constraint_stiffness_n: Force = Field(
        default=60.0, description="EA: force per strain of the constraint; 40 to 100 N fit alike"
    )
    crest: Literal["rigid", "free"] = Field(
        default="rigid",
        description="rigid: the crest's section stays plane and keeps its shape, as the troughs' do; free: it may "
        "breathe and warp",
    )
    twist_pivot: Literal["hinge", "free"] = Field(
        default="hinge",
        description="hinge: end sections turn about the constraint's line, as a chain's joint does; free: they may "
        "also shift along y",
    )
