"""An angle sensor that is off by a constant.

    y' = y + b

for every angle that is read: `angle_rad`, `bend_angle_rad`, `tip_angle_rad`, `joint_1_angle_rad`… and each number of
`joint_angles_rad` (the zero error of an encoder or of a camera's calibration; the offset of a linear transducer
model). Each is one reading and gets b once, the sum along the chain too. The chain, its markers and its efforts
stay as they are: a sensor has no torque.
"""

from __future__ import annotations

from functools import partial
from operator import add
from typing import Literal

import numpy as np

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.units import Angle
from pliant_plugins.effects.angles import with_angles


class SensorBiasConfig(EffectConfig):
    """b, reported − true angle."""

    kind: Literal["sensor_bias"] = "sensor_bias"
    bias_rad: Angle = parameter(neutral=0.0, bounds=(-np.pi, np.pi), plausible=(-0.05, 0.05), example="2 deg")
    """reading − true angle"""


class SensorBias(Effect):
    """An offset of the angles that are read."""

    place = "output"
    notes = EffectNotes(
        signature="every angle is off by the same amount, at rest too, at any pressure, load and rate; "
        "positions are right.",
        inspection="hold the joint straight along a ruler, read the sensor and set its zero there.",
        confounder="pressure_offset",
        distinguishing_test="a bias is the same with and without load and moves no marker; what an offset of "
        "pressure does depends on how stiff the joint is there.",
        excitation="record the angle at rest, vented and unloaded, and again under a load; film a marker if "
        "you can.",
        where="every family of which angles are read; every engine, for it acts on readings only.",
    )
    recommended_experiments = ("vented_zero", "passive_load_steps", "second_sensor")
    config: SensorBiasConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its readings; where no angle is read it changes nothing."""
        return model.with_output(partial(with_angles, change=partial(add, self.config.bias_rad)))
