"""The blocks `printer`, `solid` and `mould` of a study: limits of the printer, closing parts, the mould."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pliant.interfaces.base import FrozenModel
from pliant.units import Angle, Length, Ratio

Count = Annotated[int, Field(ge=0, le=12)]


class PrinterConfig(FrozenModel):
    """Limits of the printer; `export` compares the solid with them, and formulas of a search may name them."""

    nozzle_m: Length = Field(0.4e-3, gt=0, description="width of one line")
    min_wall_m: Length = Field(0.8e-3, gt=0, description="thinnest wall that it prints tight")
    max_overhang_rad: Angle = Field(
        0.25 * 3.141592653589793,
        gt=0,
        description="largest angle of a face from the vertical without support",
    )


class SolidConfig(FrozenModel):
    """The parts that close a chain of modules: cap at the tip, flange with inlets at the base."""

    cap_m: Length | None = Field(
        None, gt=0, description="thickness of the cap at the tip; twice the thinnest wall by default"
    )
    flange_m: Length = Field(6e-3, gt=0, description="thickness of the flange at the base")
    flange_margin_m: Length = Field(6e-3, ge=0, description="of the flange around the section")
    inlet_bore_m: Length = Field(2.5e-3, gt=0, description="diameter of the channel through the flange")
    tube_m: Length = Field(4e-3, gt=0, description="outer diameter of the tube that is glued into the flange")
    screws: Count = Field(4, description="number of screw holes through the flange")
    screw_m: Length = Field(3.2e-3, gt=0, description="diameter of a screw hole")
    tendon_bore_m: Length = Field(1e-3, gt=0, description="diameter of the hole for a tendon")
    ribbon_m: Length = Field(
        0.4e-3, gt=0, description="thickness of a band that the FEM has by width and stiffness alone"
    )


class MouldConfig(FrozenModel):
    """The mould for casting: two halves that part across the chain's plane of bending, and cores."""

    shrinkage: Ratio = Field(
        0.0,
        ge=0,
        lt=0.2,
        description="linear, of the cast material: 0.1 % for many silicones of addition cure",
    )
    draft_rad: Angle = Field(
        0.0087, ge=0, lt=0.2, description="of faces along which a half is pulled, of pins and of the sprue"
    )
    wall_m: Length = Field(8e-3, gt=0, description="least thickness of the halves around the part")
    pin_m: Length = Field(5e-3, gt=0, description="diameter of a registration pin")
    clearance_m: Length = Field(0.15e-3, ge=0, description="of a pin in its hole")
    sprue_m: Length = Field(5e-3, gt=0, description="diameter of the sprue at the part")
    core_print_m: Length = Field(12e-3, gt=0, description="length by which a core lies in the halves")
    allowance: Ratio = Field(0.15, ge=0, description="share of the volume that is mixed in addition")
