"""An angle sensor with another scale.

    y' = (1 + s) y

for every angle that is read, about zero: `angle_rad`, `bend_angle_rad`, `tip_angle_rad`, `joint_1_angle_rad`… and each
number of `joint_angles_rad` (the scale error of a potentiometer, of a bend sensor's calibration, of a camera's; the
gain of a linear transducer model). The chain, its markers and its efforts stay as they are: a sensor has no torque.
"""

from __future__ import annotations

from functools import partial
from typing import Any, Literal

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.units import Ratio
from pliant_plugins.effects.angles import with_angles


class SensorScaleConfig(EffectConfig):
    """s, reading / true angle − 1."""

    kind: Literal["sensor_scale"] = "sensor_scale"
    excess: Ratio = parameter(neutral=0.0, bounds=(-0.8, 4.0), plausible=(-0.1, 0.1), example=0.06)
    """reading / true angle − 1"""
    bare_keys = ("curvature_per_rad",)
    curvature_per_rad: float = parameter(
        unit="rad^-1", neutral=0.0, bounds=(-1.0, 2.0), plausible=(-0.4, 0.4), role="form"
    )
    """by how much of itself the excess grows per radian"""


class SensorScale(Effect):
    """A factor on the angles that are read."""

    place = "output"
    notes = EffectNotes(
        signature="every angle is off by the same factor, whatever bends the chain: pressure, a load or a "
        "weight; at zero angle nothing is off, and positions are right.",
        inspection="set the joint to 0°, 45° and 90° with a square and read the sensor at each.",
        confounder="stiffness",
        distinguishing_test="a position or a second sensor: a scale moves no marker. By angles alone a scale "
        "is a joint that is softer under load, pressure and weight at once; a gain of the actuation has "
        "no influence under a load.",
        excitation="film the tip beside the angle in one cycle of pressure, then hang a load on the vented "
        "chain.",
        where="every family of which angles are read; every engine, for it acts on readings only. A chain "
        "read by positions alone does not show it.",
    )
    recommended_experiments = ("second_sensor", "passive_load_steps", "blocked")
    config: SensorScaleConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its readings; where no angle is read it changes nothing."""
        change = partial(_scaled, self.config.excess, self.config.curvature_per_rad)
        return model.with_output(partial(with_angles, change=change))


def _scaled(excess: float, curvature: float, angle: Any) -> Any:
    return angle * (1.0 + excess * (1.0 + curvature * abs(angle)))
