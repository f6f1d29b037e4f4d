"""Configuration of polynomial, table and neural surrogates."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from pliant.interfaces.base import FrozenModel
from pliant.interfaces.surrogate import SurrogateConfig
from pliant.units import Angle, Length, UnitError, parse_quantity


def _actuation(value: Any) -> Any:
    """Return a pressure or a tendon force: the quantity is unknown before the data are."""
    if not isinstance(value, str):
        return value
    for unit in ("Pa", "N"):
        try:
            return parse_quantity(value, unit)
        except UnitError:
            continue
    raise PydanticCustomError(
        "quantity",
        "'{text}' is neither a pressure such as '15 kPa' nor a force such as '8 N'",
        {"text": value},
    )


Actuation = Annotated[float, BeforeValidator(_actuation)]


class StudyCoefficients(FrozenModel):
    """Coefficients of τ(p, u) = k_n p + (m_a p + b_a) u − (m_e u²/2 + b_e u), in Pa (or N), rad and N·m.

    On a prismatic joint u is in m and τ in N.
    """

    # "k_n" is a name, not a field "k" in newtons.
    model_config = ConfigDict(alias_generator=None)

    k_n: float = Field(description="effort per actuation at u = 0")
    m_a: float = Field(description="change of that slope with u")
    b_a: float = Field(default=0.0, description="only b_a − b_e has an effect")
    m_e: float = Field(description="elastic stiffening")
    b_e: float = Field(description="elastic stiffness at u = 0")


class StatedDomain(FrozenModel):
    """The box in which a stated law is valid, each side as [low, high]; a missing side is unbounded."""

    actuation: tuple[Actuation, Actuation] | None = None
    deformation: tuple[Angle, Angle] | None = None
    extension_m: tuple[Length, Length] | None = Field(
        default=None, description="instead of `deformation` on a prismatic joint"
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for name in ("actuation", "deformation", "extension_m"):
            side = getattr(self, name)
            if side is not None and not side[0] < side[1]:
                raise PydanticCustomError(
                    "domain",
                    "domain.{name} needs [low, high] with low < high, not [{low}, {high}]",
                    {"name": name, "low": side[0], "high": side[1]},
                )
        return self


class AxisConfig(FrozenModel):
    """A polynomial law of one axis, fitted to data or stated.

    `form: adaptive` fits a polynomial whose degree is chosen by cross-validation; `form: study` fits the
    published five-coefficient form, or states it by `coefficients`.
    """

    data: Path | None = Field(default=None, description="CSV with pressure_pa, angle_rad, moment_n_m")
    form: Literal["adaptive", "study"] = Field(
        default="adaptive", description="adaptive: degree by cross-validation; study: the published form"
    )
    max_degree: int = Field(default=9, ge=1, le=12, description="largest degree that form adaptive tries")
    odd: bool = Field(
        default=False, description="form study with u|u| for u²: softens the same way both ways"
    )
    procedure: Literal["least_squares", "finite_differences"] = Field(
        default="least_squares",
        description="how form study is fitted: to the moments, or as published from differences of energies too",
    )
    coefficients: StudyCoefficients | None = Field(default=None, description="states a law of form study")
    domain: StatedDomain | None = Field(default=None, description="box in which the stated law holds")
    actuation_name: Literal["pressure_pa", "tendon_force_n", "tendon_travel_m"] = Field(
        default="pressure_pa", description="input of a stated law"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        problem = None
        if self.form != "study" and self.coefficients is not None:
            problem = "coefficients state a law of the published form: add 'form: study'"
        elif self.form != "study" and self.odd:
            problem = "odd replaces u² by u|u| in the published form: add 'form: study' or leave it out"
        elif self.form != "study" and self.procedure != "least_squares":
            problem = (
                "procedure finite_differences fits the published form: add 'form: study' or leave it out"
            )
        elif self.coefficients is not None and self.procedure != "least_squares":
            problem = "coefficients state the law and procedure says how to fit one: give only one of them"
        elif self.coefficients is None and self.domain is not None:
            problem = (
                "domain belongs to a law stated by coefficients; a fitted law's domain is the box of its data"
            )
        elif self.coefficients is not None and self.data is not None:
            problem = "coefficients state the law and data fits one: give only one of them"
        elif self.coefficients is None and self.actuation_name != "pressure_pa":
            problem = (
                "actuation_name is the input of a law stated by coefficients; a fitted law has that of its data: "
                "leave it out"
            )
        elif self.form == "study" and self.max_degree != AxisConfig.model_fields["max_degree"].default:
            problem = "max_degree limits form adaptive, and form study has five coefficients: leave it out"
        if problem:
            raise PydanticCustomError("polynomial", "{problem}", {"problem": problem})
        return self


class AxesConfig(FrozenModel):
    """The axes of a spherical joint, each with a separate law: x is the twist, y the main axis."""

    x: AxisConfig = Field(description="the twist; keys as those of the law itself")
    y: AxisConfig = Field(description="the main bending axis; {} takes the FEM stage's states")
    z: AxisConfig = Field(description="the second bending axis")

    def each(self) -> dict[str, AxisConfig]:
        """Return the blocks by axis."""
        return {"x": self.x, "y": self.y, "z": self.z}


class PolynomialConfig(AxisConfig, SurrogateConfig):
    """A polynomial law τ(p, u) of one axis, or `axes`: three of them for a spherical joint."""

    kind: Literal["polynomial"] = "polynomial"
    axis: Literal["x", "y", "z"] | None = Field(
        default=None, description="axis of a stated law; y, or x on a prismatic joint, by default"
    )
    joint: Literal["revolute", "prismatic"] = Field(default="revolute", description="joint of a stated law")
    axes: AxesConfig | None = Field(default=None, description="a spherical joint: a law for each of x, y, z")

    @model_validator(mode="after")
    def _one_joint(self) -> Self:
        domain = self.domain or StatedDomain()
        own = PolynomialConfig.model_fields.items()
        beside = [n for n, f in own if n not in ("kind", "axes") and getattr(self, n) != f.default]
        problem = None
        if self.axes is not None and beside:
            problem = f"'{beside[0]}' is given together with 'axes': give it in the axes it belongs to"
            if beside[0] in ("joint", "axis"):
                problem = f"'{beside[0]}' is given together with 'axes': a joint with axes is spherical; leave one out"
        elif self.axis is not None and self.coefficients is None:
            problem = "axis is that of a law stated by coefficients; a fitted law's is that of its data: leave it out"
        elif self.joint == "prismatic" and self.coefficients is None:
            problem = "joint prismatic is for a law stated by coefficients, in N and m: give 'coefficients'"
        elif self.joint == "prismatic" and domain.deformation is not None:
            problem = "a prismatic joint has no angle: give 'domain.extension' for 'domain.deformation'"
        elif self.joint == "revolute" and domain.extension_m is not None:
            problem = (
                "domain.extension belongs to 'joint: prismatic'; an angle's range is 'domain.deformation'"
            )
        if problem:
            raise PydanticCustomError("polynomial", "{problem}", {"problem": problem})
        return self


class TableAxisConfig(FrozenModel):
    """The table of one axis; {} takes the FEM stage's states."""

    data: Path | None = Field(default=None, description="CSV with pressure_pa, angle_rad, moment_n_m")


class TableAxesConfig(FrozenModel):
    """The axes of a spherical joint, each with a separate table: x is the twist, y the main axis."""

    x: TableAxisConfig = Field(description="the twist")
    y: TableAxisConfig = Field(description="the main bending axis")
    z: TableAxisConfig = Field(description="the second bending axis")

    def each(self) -> dict[str, TableAxisConfig]:
        """Return the blocks by axis."""
        return {"x": self.x, "y": self.y, "z": self.z}


class TableConfig(SurrogateConfig):
    """A law interpolated from measurements or FEM, of one axis, or `axes`: three of them for a spherical joint.

    Of one axis it may have up to three actuations.
    """

    kind: Literal["table"] = "table"
    axes: TableAxesConfig | None = Field(
        default=None, description="a spherical joint: a table for each of x, y, z"
    )

    @model_validator(mode="after")
    def _one_joint(self) -> Self:
        if self.axes is not None and self.data is not None:
            problem = "'data' is given together with 'axes': give it in the axes it belongs to"
            raise PydanticCustomError("table", "{problem}", {"problem": problem})
        return self


class NeuralConfig(SurrogateConfig):
    """A law from a small network of an energy, fitted to states or to a table, of one to three axes and any inputs."""

    kind: Literal["neural"] = "neural"
    units: int = Field(default=48, ge=4, le=256, description="units of the network's one hidden layer")
    seed: int = Field(default=0, ge=0, description="of the start and of the parts that are left out")
