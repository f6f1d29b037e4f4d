"""What a study may say about a table surrogate."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from pliant.interfaces.base import FrozenModel
from pliant.interfaces.surrogate import SurrogateConfig


class TableAxisConfig(FrozenModel):
    """The table of one axis; {} takes the FEM stage's states."""

    data: Path | None = Field(default=None, description="CSV with pressure_pa, angle_rad, moment_n_m")


class TableAxesConfig(FrozenModel):
    """The axes of a spherical joint, each with a table of its own: x is the twist, y the main axis."""

    x: TableAxisConfig = Field(description="the twist")
    y: TableAxisConfig = Field(description="the main bending axis")
    z: TableAxisConfig = Field(description="the second bending axis")

    def each(self) -> dict[str, TableAxisConfig]:
        """The blocks by axis."""
        return {"x": self.x, "y": self.y, "z": self.z}


class TableConfig(SurrogateConfig):
    """A law interpolated from measurements or FEM, of one axis, or `axes`: three of them for a spherical joint."""

    kind: Literal["table"] = "table"
    axes: TableAxesConfig | None = Field(
        default=None, description="a spherical joint: a table for each of x, y, z"
    )

    @model_validator(mode="after")
    def _one_joint(self) -> Self:
        if self.axes is not None and self.data is not None:
            problem = "'data' stands beside 'axes': give it in the axes it belongs to"
            raise PydanticCustomError("table", "{problem}", {"problem": problem})
        return self
