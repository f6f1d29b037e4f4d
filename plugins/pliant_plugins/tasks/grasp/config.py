"""Settings of the grasp task."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from pliant.config.chain import Count
from pliant.config.noise import NoiseConfig
from pliant.errors import closest
from pliant.interfaces.base import FrozenModel
from pliant.units import Angle, Density, Length, Mass, Ratio, Time
from pliant_plugins.tasks.ramp import ActuatedConfig

SHAPES = ("egg", "cylinder")


class ObjectConfig(FrozenModel):
    """An egg (ellipsoid of revolution), an upright cylinder, or a part from a file; ``object: egg`` is short.

    An egg is 30 mm in radius, 65 mm high and weighs 50 g, a cylinder 16 mm, 35 mm and 10 g, unless said otherwise.
    An upright ellipsoid that is higher than wide is unstable: an egg has a foot, a disc between its curved end and the
    floor.
    """

    shape: Literal["egg", "cylinder"] | None = Field(default=None, description="this or `mesh`")
    mesh: Path | None = Field(default=None, description="a closed surface: STL, OBJ, PLY, OFF or 3MF")
    scale: Ratio = Field(
        default=1.0, gt=0, description="metres per unit of the file: 0.001 where it is in millimetres"
    )
    radius_m: Length | None = Field(default=None, gt=0, description="of egg or cylinder")
    height_m: Length | None = Field(default=None, gt=0, description="of egg or cylinder")
    foot_radius_m: Length | None = Field(
        default=None, ge=0, description="of the disc on which an egg stands; 8 mm by default, 0 for none"
    )
    convex_parts: Count = Field(
        default=1,
        ge=1,
        le=64,
        description="of a mesh: most convex parts that collide in its place, for hollow ones; 1: its convex hull",
    )
    mass_kg: Mass | None = Field(default=None, gt=0, description="without the extra weights")
    density_kg_m3: Density | None = Field(default=None, gt=0, description="of a part; this or its mass")

    @model_validator(mode="after")
    def _one_object(self) -> ObjectConfig:
        if (self.shape is None) == (self.mesh is None):
            raise ValueError("give either 'shape' (egg or cylinder) or 'mesh' (a file)")
        if self.mesh is None and (self.density_kg_m3 is not None or self.scale != 1.0):
            raise ValueError(
                "'density' and 'scale' are for a part from a 'mesh'; give egg and cylinder a 'mass'"
            )
        if self.mesh is None and self.convex_parts != 1:
            raise ValueError("'convex_parts' are of a part from a 'mesh'; egg and cylinder are convex")
        if self.mesh is not None and (self.radius_m is not None or self.height_m is not None):
            raise ValueError("'radius' and 'height' are for egg and cylinder; a 'mesh' has a 'scale'")
        if self.foot_radius_m is not None and self.shape != "egg":
            raise ValueError("only an egg has a 'foot_radius'")
        if self.mesh is not None and (self.density_kg_m3 is None) == (self.mass_kg is None):
            raise ValueError("a 'mesh' needs either 'mass' or 'density'")
        return self


def _named(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    if value in SHAPES:
        return {"shape": value}
    sentence = f"'{value}' is no object{closest(value, SHAPES)} Known: egg, cylinder, or {{mesh: part.stl, mass: 30 g}}"
    raise PydanticCustomError("object", "{sentence}", {"sentence": sentence})


class HandConfig(ActuatedConfig):
    """Fingers, copies of the chain, around an object: where they stand, and how they take hold and lift."""

    places_base: ClassVar[bool] = True
    object: Annotated[ObjectConfig, BeforeValidator(_named)] = Field(
        description="egg, cylinder, or {mesh: part.stl, scale: 0.001, mass: 30 g}"
    )
    extra_weights: Count = Field(
        default=0, ge=0, le=1000, description="number of weights added to the object"
    )
    weight_kg: Mass = Field(default=0.02, gt=0, description="of each extra weight, a point")
    weights_height_m: Length | None = Field(
        default=None,
        description="of the weights above the object's lowest point; by default at its centre of mass",
    )
    fingers: Count = Field(default=3, ge=1, le=12, description="equally spaced about the vertical")
    inclination_rad: Angle = Field(
        default=math.pi / 6, gt=-1.5, lt=1.5, description="of the fingers, outward from the vertical"
    )
    base_radius_m: Length | None = Field(
        default=None,
        ge=0,
        description="from the vertical to the bases; by default the object's less `base_inset`",
    )
    base_inset_m: Length | None = Field(
        default=None, description="object's radius less base radius; 16 mm for an egg, 2 mm for others"
    )
    grasp_height_m: Length = Field(
        default=8e-3, ge=0, description="of the fingers' lowest point above the floor when lowered, straight"
    )
    lower_height_m: Length = Field(default=0.06, ge=0, description="how far the fingers are lowered")
    lower_time_s: Time = Field(default=2.0, gt=0, description="time for it")
    ramp_time_s: Time = Field(default=1.0, gt=0, description="from no actuation to full, linear")
    hold_time_s: Time = Field(default=0.5, ge=0, description="before lifting")
    lift_height_m: Length = Field(default=0.06, gt=0, description="how far the fingers are lifted")
    lift_time_s: Time = Field(default=2.0, gt=0, description="time for it")
    final_time_s: Time = Field(
        default=0.5, gt=0, description="after lifting; forces and creep are those in it"
    )
    friction: Ratio = Field(default=0.8, ge=0, description="coefficient of the fingers")
    object_friction: Ratio = Field(
        default=1.0, ge=0, description="coefficient of the object; a pair takes the product of both"
    )
    finger_contact: bool = Field(
        default=False,
        description="whether fingers touch each other, and themselves where they curl up; engine mujoco",
    )

    @model_validator(mode="after")
    def _one_radius(self) -> HandConfig:
        if self.base_radius_m is not None and self.base_inset_m is not None:
            raise ValueError("give either 'base_radius' or 'base_inset'")
        return self


class GraspConfig(HandConfig):
    """``task: {kind: grasp, object: egg, extra_weights: 5, pressure: 15 kPa}``; the fingers are copies of the chain.

    Defaults are those of the gripper in Yao, Howard, Maiolino (2026), doi 10.1002/aisy.70406: lowered for 2 s,
    actuated within 1 s, lifted for 2 s, 6 s in all.
    """

    kind: Literal["grasp"] = "grasp"
    noise: NoiseConfig = Field(
        default=NoiseConfig(), description="what varies between trials; or the study's"
    )
    trials: Count = Field(default=1, ge=1, le=10_000, description="episodes, one after another")
    seed: int = Field(
        default=0, ge=0, description="of the trials' noise; trial k is the same for any `trials`"
    )
