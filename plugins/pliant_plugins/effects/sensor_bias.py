"""An angle sensor that is off by a constant.

    y' = y + b

for every angle that the task reports among its metrics: `angle_rad`, `bend_angle_rad`, `tip_angle_rad`,
`joint_1_angle_rad`… and `joint_angles_rad` (the zero error of an encoder or of a camera's calibration; the
offset of a linear transducer model). The chain, its markers and its efforts stay as they are: a sensor has
no torque.

Signature: the same shift at every pressure and load, at rest too; positions measured otherwise do not
show it.
Nearest look-alike: `pressure_offset`, whose shift changes with the local stiffness and disappears when
the chamber is opened; `base_misalignment` shifts positions as well.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from pliant.errors import UserError
from pliant.interfaces.effect import Effect, EffectConfig, EffectParameter, Model, Place
from pliant.records.rollout import TaskResult
from pliant.units import Angle

BOUNDS = (-np.pi, np.pi)
READING = re.compile(r"((bend|tip|joint_\d+)_)?angle_rad|joint_angles_rad")


class SensorBiasConfig(EffectConfig):
    """b, reported − true angle."""

    kind: Literal["sensor_bias"] = "sensor_bias"
    bias_rad: Angle = Field(default=0.0, ge=BOUNDS[0], le=BOUNDS[1], description="reading − true angle")


class SensorBias(Effect):
    """Shifts the angles that the task reports."""

    place: ClassVar[Place] = "output"
    parameters: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("bias_rad", "rad", neutral=0.0, bounds=BOUNDS, plausible=(-0.05, 0.05)),
    )
    config: SensorBiasConfig

    def apply(self, model: Model) -> Model:
        """The model with one more map of its results.

        The map raises `UserError` if the bias is not 0 and the task reports no angle.
        """
        return model.with_(outputs=(*model.outputs, partial(_biased, self.config.bias_rad)))


def _biased(bias: float, result: TaskResult) -> TaskResult:
    readings = [name for name in result.metrics if READING.fullmatch(name)]
    if bias and not readings:
        raise UserError(
            "effect 'sensor_bias' shifts reported angles, and the task reports only "
            f"{', '.join(sorted(result.metrics)) or 'nothing'}"
        )
    shifted = {name: _shift(result.metrics[name], bias) for name in readings}
    return replace(result, metrics={**result.metrics, **shifted})


def _shift(value: Any, bias: float) -> Any:
    """A number stays a number, a list a list, an array an array."""
    if isinstance(value, list | tuple):
        return [_shift(item, bias) for item in value]
    return value + bias
