"""Loads of the published study's sampling, by kind of module and axis; this is the only place of these numbers."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from pliant.interfaces.base import FrozenModel
from pliant.units import UnitError, parse_quantity


def either(*units: str, example: str) -> Any:
    """Return the type of a quantity in one of several units, chosen by the module."""

    def parse(value: Any) -> Any:
        if not isinstance(value, str):
            return value
        for unit in units:
            try:
                return parse_quantity(value, unit)
            except UnitError:
                continue
        raise PydanticCustomError("quantity", "'{text}' is not " + example, {"text": value})

    return BeforeValidator(parse)


Actuation = Annotated[
    float, either("Pa", "N", example="a pressure such as '0.5 kPa' or a force such as '1 N'")
]
Effort = Annotated[
    float,
    either("N*m", "N", example="a moment such as '0.6 mN*m' or, on a prismatic joint, a force such as '1 N'"),
]


class StudyLoads(FrozenModel):
    """External loads of one axis in equal steps, at actuations in equal steps; positive loads oppose actuation.

    Pa or N, N·m or N.
    """

    actuation_low: Actuation = Field(default=0.0, ge=0, description="smallest actuation with loads")
    actuation_step: Actuation = Field(gt=0, description="between actuations")
    effort_low: Effort = Field(default=0.0, le=0, description="largest load in the opposite direction")
    effort_high: Effort = Field(ge=0, description="largest load")
    effort_step: Effort = Field(gt=0, description="between loads")


_GRIPPER = StudyLoads(actuation_step=500.0, effort_high=0.02, effort_step=0.0006)
_HELICAL_Y = StudyLoads(actuation_step=500.0, effort_low=-0.006, effort_high=0.006, effort_step=0.0002)
_HELICAL_XZ = StudyLoads(
    actuation_low=5e3, actuation_step=2.5e3, effort_low=-0.006, effort_high=0.006, effort_step=0.0002
)
_TENDON = StudyLoads(actuation_step=0.5, effort_high=0.05, effort_step=0.0025)

# By actuation, number of axes and joint type; the translational module has no loads in the study.
STUDY_LOADS = {
    ("pressure_pa", 1, "revolute"): {"y": _GRIPPER},
    ("pressure_pa", 3, "spherical"): {"x": _HELICAL_XZ, "y": _HELICAL_Y, "z": _HELICAL_XZ},
    ("tendon_force_n", 1, "revolute"): {"y": _TENDON},
}
