"""The `chain` block: how modules are assembled to a robot."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    BeforeValidator,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from pliant.interfaces.base import FrozenModel
from pliant.interfaces.study_loads import either
from pliant.interfaces.surrogate import SurrogateConfig
from pliant.records.actuation import expected, is_known
from pliant.records.chain import GRAVITY_M_S2
from pliant.records.mount import Mount
from pliant.units import Acceleration, Angle, Length, Mass, Ratio, UnitError, parse_quantity


def _no_truth(value: Any) -> Any:
    if isinstance(value, bool):  # Python would count true as 1
        raise PydanticCustomError("count", "it is true or false, not a number")
    return value


Count = Annotated[int, BeforeValidator(_no_truth)]
Vector = tuple[Ratio, Ratio, Ratio]


class RigidConfig(FrozenModel):
    """A rigid piece: a uniform cylinder along the chain axis, or the section of a module, as an end cap has it.

    The length of a closed end, l + 2t, follows its module when a search changes l: ``{module_lengths: 1, length: 3
    mm}``.
    """

    length_m: Length = Field(0.0, ge=0, description="along the chain")
    module_lengths: Ratio = Field(
        0.0,
        ge=0,
        description="added to the length: number of lengths of the module before it, or of the first module",
    )
    section: Literal["rod", "module"] = Field(
        "rod", description="a cylinder about the chain axis, or the shape of the study's module"
    )
    mass_kg: Mass | None = Field(
        None, ge=0, description="by default none for a rod, and a module's mass per length for its section"
    )
    radius_m: Length | None = Field(
        None, gt=0, description="outer radius of a rod; without one it does not collide"
    )

    @model_validator(mode="after")
    def _check_rod_dimensions(self) -> RigidConfig:
        if self.length_m == 0.0 and self.module_lengths == 0.0:
            raise ValueError("a rigid piece needs a 'length' above 0, or 'module_lengths'")
        if self.section == "module" and self.radius_m is not None:
            raise ValueError("a piece with the section of a module has no 'radius'")
        return self

    def along_m(self, module_length_m: float) -> float:
        """Return its length for a given length of the module that it follows."""
        return self.length_m + self.module_lengths * module_length_m


class ActuatorConfig(FrozenModel):
    """A chamber or tendon: `input` names its signal, `sign` and `rotation` the side on which it acts."""

    input: str = Field(description="name of the signal")
    sign: float = Field(1.0, description="1 or -1: the side on which it acts")
    rotation_rad: Angle = Field(
        0.0, description="where it sits about the chain axis, e.g. 120 deg; joints with three axes only"
    )

    @field_validator("input")
    @classmethod
    def _known(cls, name: str) -> str:
        if not is_known(name):
            raise ValueError(f"'{name}' is no input; it should be {expected()}")
        return name

    @model_validator(mode="after")
    def _unit_sign(self) -> ActuatorConfig:
        if abs(self.sign) != 1.0:
            raise ValueError("'sign' must be 1 or -1")
        return self


class SegmentConfig(FrozenModel):
    """A run of equal modules, or a rigid piece between modules.

    `family` has the design parameters that differ from the study's family, `surrogate` is a law for this segment
    alone; without a family, the keys of rods are those that differ from the chain's.
    """

    modules: Count | None = Field(None, ge=1, le=4096, description="number of equal modules")
    rigid: RigidConfig | None = Field(None, description="instead of `modules`: a rigid piece")
    rotation_rad: Angle = Field(0.0, description="about the chain axis, relative to the base")
    turn_rad: Angle | None = Field(
        None, description="about the chain axis, relative to the modules before it; instead of `rotation`"
    )
    actuation_share: Ratio = Field(
        1.0,
        gt=0,
        description="share of the chain's pressure or force that its supply gets, as behind a separate regulator",
    )
    actuators: tuple[ActuatorConfig, ...] = Field(
        (), description="chambers or tendons of this segment; those of the chain by default"
    )
    family: dict[str, Any] = Field(
        default_factory=dict, description="parameters that differ, e.g. {wall: 2 mm}"
    )
    surrogate: SurrogateConfig | None = Field(
        None, description="the law of this segment, instead of the study's; a block with `kind`"
    )
    module_length_m: Length | None = Field(None, gt=0, description="only without a family")
    module_mass_kg: Mass | None = Field(None, ge=0, description="only without a family")
    module_radius_m: Length | None = Field(None, gt=0, description="only without a family")
    module_offset_m: Length | None = Field(None, description="only without a family")

    @model_validator(mode="after")
    def _modules_or_rigid(self) -> SegmentConfig:
        if (self.modules is None) == (self.rigid is None):
            raise ValueError("give either 'modules' or 'rigid'")
        if self.turn_rad is not None and self.rotation_rad != 0.0:
            raise ValueError(
                "give either 'rotation' (relative to the base) or 'turn' (to the modules before)"
            )
        # A study that was written by Pliant states all keys: only their values count.
        if self.rigid is not None and dict(self) != dict(SegmentConfig.model_construct(rigid=self.rigid)):
            raise ValueError("a rigid piece has a length, a mass and a radius, and nothing of modules")
        return self

    def canonical(self) -> dict[str, Any]:
        """Return the JSON values, without empty actuators, so that keys of earlier chains stay equal."""
        return {name: value for name, value in super().canonical().items() if name != "actuators" or value}


Place = Annotated[float, either("rad", "m", example="an angle such as '30 deg' or a length such as '20 mm'")]
Command = Annotated[
    float, either("rad", "m", "N*m", "N", example="a command such as '30 deg', '20 mm', '5 N*m' or '2 N'")
]


class MountConfig(FrozenModel):
    """An arm that carries the chain: its file (MJCF), and the site or body that carries the base."""

    file: Path = Field(description="of the arm, MJCF; its meshes are found from there")
    at: str = Field(min_length=1, description="name of the site or body in whose frame the base's pose is")
    keyframe: str | None = Field(
        None, description="where the arm begins and is held; by default the file's first"
    )
    joints: dict[str, Place] = Field(
        default_factory=dict,
        description="other positions of joints by name; a position servo there holds them",
    )
    ctrl: dict[str, Command] = Field(
        default_factory=dict, description="other commands of actuators by name, in the actuator's own unit"
    )

    _written: dict[str, str] = PrivateAttr(default_factory=dict)

    @model_validator(mode="wrap")
    @classmethod
    def _with_units(cls, value: Any, handler: ModelWrapValidatorHandler[MountConfig]) -> MountConfig:
        """Record whether a position was written as an angle or as a length; the arm's file decides which is right."""
        made = handler(value)
        if isinstance(value, Mapping) and value is not made:
            texts = {
                name: one for name, one in dict(value.get("joints") or {}).items() if isinstance(one, str)
            }
            made._written = {name: _unit(one) for name, one in texts.items()}
        return made

    def record(self) -> Mount:
        """Return the record for engines."""
        return Mount(
            self.file, self.at, self.keyframe, dict(self.joints), dict(self.ctrl), dict(self._written)
        )


def _unit(text: str) -> str:
    """Return rad or m, the unit of a text that is one of both."""
    try:
        parse_quantity(text, "rad")
    except UnitError:
        return "m"
    return "rad"


class BaseConfig(FrozenModel):
    """Pose of the chain's base: a quaternion (w, x, y, z), or the direction of the chain axis and a roll.

    In the world or, with `mount`, in the frame of a site or body of an arm.
    """

    position_m: tuple[Length, Length, Length] = Field((0.0, 0.0, 0.0), description="in the world")
    quaternion: tuple[Ratio, Ratio, Ratio, Ratio] | None = Field(None, description="w, x, y, z")
    direction: Vector | None = Field(None, description="where chain x points, in the world")
    roll_rad: Angle | None = Field(None, description="about the chain axis, with or without direction")
    mount: MountConfig | None = Field(
        None, description="an arm that carries the base, {file: arm.xml, at: attachment_site}; engine mujoco"
    )

    @model_validator(mode="after")
    def _one_way(self) -> BaseConfig:
        if self.quaternion is not None and (self.direction is not None or self.roll_rad is not None):
            raise ValueError("give either 'quaternion' or 'direction' and 'roll', not both")
        for name in ("quaternion", "direction"):
            vector = getattr(self, name)
            if vector is not None and np.linalg.norm(vector) < 1e-9:
                raise ValueError(f"'{name}' has no length")
        return self


class ChainConfig(FrozenModel):
    """N equal modules, or segments of them; gravity, base pose, payload and actuators."""

    modules: Count | None = Field(None, ge=1, le=4096, description="number of equal modules")
    segments: tuple[SegmentConfig, ...] = Field((), description="instead of `modules`")
    gravity_m_s2: tuple[Acceleration, Acceleration, Acceleration] = Field(
        GRAVITY_M_S2, description="in the world; [0, 0, 0] switches weight off"
    )
    base: BaseConfig = Field(BaseConfig(), description="pose of the base")
    payload_kg: Mass = Field(0.0, ge=0, description="hung at the tip")
    actuators: tuple[ActuatorConfig, ...] = Field(
        (), description="opposed chambers or tendons; one chamber by default"
    )
    module_length_m: Length | None = Field(None, gt=0, description="only without a family")
    module_mass_kg: Mass = Field(0.0, ge=0, description="only without a family; a uniform rod")
    module_radius_m: Length | None = Field(
        None, gt=0, description="only without a family: radius of the rod, for contact and pictures"
    )
    module_offset_m: Length = Field(
        0.0,
        description="only without a family: how far the rod's centre line lies from its joint, along module z",
    )

    @model_validator(mode="after")
    def _modules_or_segments(self) -> ChainConfig:
        if (self.modules is None) == (not self.segments):
            raise ValueError("give either 'modules' or 'segments'")
        if self.segments and all(segment.rigid is not None for segment in self.segments):
            raise ValueError("a chain needs modules, and all its segments are rigid")
        return self

    def canonical(self) -> dict[str, Any]:
        """Return the JSON values, without an empty `mount`, so that keys of earlier chains stay equal."""
        told = super().canonical()
        if self.base.mount is None:
            del told["base"]["mount"]
        return told

    def as_segments(self) -> tuple[SegmentConfig, ...]:
        """Return the chain as segments, also when only `modules` is given, with every turn as a rotation."""
        told, rotation = [], 0.0
        for segment in self.segments or (SegmentConfig.model_construct(modules=self.modules or 1),):
            if segment.turn_rad is not None:
                rotation += segment.turn_rad
                segment = segment.model_copy(update={"rotation_rad": rotation, "turn_rad": None})
            elif segment.rigid is None:
                rotation = segment.rotation_rad
            told.append(segment)
        return tuple(told)
