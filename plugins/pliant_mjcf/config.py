"""Config of the model `mjcf`; cheap to import."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, field_validator

from pliant.interfaces.base import FrozenModel
from pliant.interfaces.model import ModelConfig
from pliant.units import Ratio, UnitError, parse_quantity

FIRST, SETTLED = "first", "settled"


class InputSource(FrozenModel):
    """The actuator that a column of the recording drives: its name alone, or with a curve from the column to `ctrl`."""

    actuator: str = Field(description="name of the actuator in the MJCF")
    curve: tuple[tuple[float, float], ...] = Field(
        (),
        description="points [column's value in SI, ctrl], straight lines between them; without it ctrl is the value",
    )

    @field_validator("curve")
    @classmethod
    def _check_curve(cls, curve: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        if len(curve) == 1 or any(not a[0] < b[0] for a, b in pairwise(curve)):
            raise ValueError("needs two points or more, [column's value, ctrl], the first numbers increasing")
        return curve


class MjcfModelConfig(ModelConfig):
    """``model: {kind: mjcf, file: robot.xml}``."""

    kind: Literal["mjcf"] = "mjcf"
    file: Path = Field(description="the MJCF, relative to the study", examples=["robot.xml"])
    inputs: Mapping[str, InputSource] = Field(
        default_factory=dict,
        description="column → actuator, or {actuator: …, curve: [[0, 0], [50000, 1.0]]}; actuators that are not named "
        "here are columns of their own name",
    )
    outputs: Mapping[str, str] = Field(
        default_factory=dict,
        description="column → sensor, joint or site, with a component behind a point (`tip.x`, `elbow.velocity`); "
        "without it every sensor of the MJCF",
    )
    fixed: Mapping[str, float] = Field(
        default_factory=dict, description="actuator → constant ctrl; a list of names means ctrl 0"
    )
    number_error: Ratio = Field(
        0.005,
        ge=0.0,
        le=0.2,
        description="share by which each mass, inertia, length, damping, stiffness and gain of the file may be off; a "
        "diagnosis takes no such error for an effect, and 0 takes them as exact",
    )
    initial: str | Mapping[str, float] | None = Field(
        None,
        description="state at the start of a run: `first` (joints as their first readings), `settled` (at rest under "
        "the first inputs), the name of a keyframe, or joint → position (`30 deg`, `5 mm`, or SI); without it `first` "
        "where all joints are read, else `settled`",
    )

    @field_validator("initial", mode="before")
    @classmethod
    def _read_positions(cls, value: Any) -> Any:
        """Return positions of joints as numbers; raise `ValueError` for what is neither a word nor a mapping."""
        if value is None or isinstance(value, str):
            return value
        if not isinstance(value, Mapping):
            raise ValueError("needs a word (first, settled, a keyframe), or joint: position")
        return {str(joint): _position(str(joint), one) for joint, one in value.items()}

    @field_validator("inputs", mode="before")
    @classmethod
    def _expand_inputs(cls, value: Any) -> Any:
        """Return ``column: {actuator: name}`` for ``column: name``."""
        if not isinstance(value, Mapping):
            return value
        return {key: {"actuator": one} if isinstance(one, str) else one for key, one in value.items()}

    @field_validator("fixed", mode="before")
    @classmethod
    def _expand_fixed(cls, value: Any) -> Any:
        """Return 0 for actuators without a value."""
        if isinstance(value, list | tuple):
            return dict.fromkeys(value, 0.0)
        if not isinstance(value, Mapping):
            return value
        return {key: 0.0 if one is None else one for key, one in value.items()}


def _position(joint: str, value: Any) -> float:
    """Return a position in rad or m; raise `ValueError` for something else."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    for unit in ("rad", "m") if isinstance(value, str) else ():
        try:
            return parse_quantity(value, unit)
        except UnitError:
            continue
    raise ValueError(f"{joint} is {value!r}; write an angle or a length, such as '30 deg' or '5 mm'")
