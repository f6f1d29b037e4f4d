"""Angle readings that come late.

    T y' + y = u

for every angle u that is recorded over time: the filter of a sensor's electronics or of a tracker, to first order.
Between samples the angle is a straight line, for which the solution is exact at any step (`lag.py`). A run starts
in balance, y = u. Readings without a clock, as tasks and quasi-static tables give them, have no lag, and the chain
itself and its positions are not late.
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, Readings, parameter
from pliant.records.design import Array
from pliant.units import Ratio, Time
from pliant_plugins.effects.angles import with_recorded_angles
from pliant_plugins.effects.lag import lagged


class SensorLagConfig(EffectConfig):
    """T, the time in which two thirds of a step are read."""

    kind: Literal["sensor_lag"] = "sensor_lag"
    time_s: Time = parameter(neutral=0.0, bounds=(0.0, 60.0), plausible=(0.05, 2.0), example="0.3 s")
    """time constant of the sensor's first-order lag"""
    second_ratio: Ratio = parameter(neutral=0.0, bounds=(0.0, 1.0), plausible=(0.0, 0.4), role="form")
    """time constant of a second lag behind it, as a share of the first"""
    delay_s: Time = parameter(neutral=0.0, bounds=(0.0, 5.0), plausible=(0.0, 0.3), role="form")
    """by which the record is late in all"""


class SensorLag(Effect):
    """A first-order lag of every recorded angle."""

    place = "output"
    notes = EffectNotes(
        signature="the angle that is read is behind in every motion, by the same time, whatever moves the "
        "chain; a few time constants into a hold nothing is left. Positions are not late.",
        inspection="flick the joint by hand, compare the film with the reading, and look for a filter or an "
        "averaging in the recorder.",
        confounder="supply_lag",
        distinguishing_test="step a load at constant pressure: a sensor is late there too, a supply is not. "
        "Positions tell it from damping and from a supply: they are in time.",
        excitation="step the pressure, then a load at constant pressure, sampled at ten times a second or "
        "more, and film the tip beside the angle.",
        where="every family of which angles are read with a clock; every engine that follows histories, for "
        "it acts on readings only.",
    )
    recommended_experiments = ("step_response", "load_steps", "second_sensor")
    config: SensorLagConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its readings; where no angle is read over time it changes nothing."""
        return model.with_output(partial(_delayed, self.config))


def _delayed(config: SensorLagConfig, readings: Readings) -> Readings:
    time_s, constant_s = readings.get("time_s"), config.time_s
    if constant_s == 0.0 or not isinstance(time_s, np.ndarray) or time_s.ndim != 1:
        return readings

    def late(angle: Array) -> Array:
        if len(angle) != len(time_s):
            return angle
        if config.delay_s:
            angle = np.interp(time_s - config.delay_s, time_s, angle)
        for lag_s in (constant_s, config.second_ratio * constant_s):
            angle = lagged(angle, time_s, lag_s) if lag_s else angle
        return angle

    return with_recorded_angles(readings, late)
