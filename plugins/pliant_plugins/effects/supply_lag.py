"""Actuation that reaches the chamber late, through two volumes.

    T y' + y = p_c  while y ≤ p_c (filling),      r T y' + y = p_c  while y > p_c (venting)
    q T p' + p = y

for every input of the chain: y is the pressure behind the regulator, p that of the chamber behind its hose. Either
volume is filled through a resistance and lags to first order, as a resistor charges a capacitor (Beater, Pneumatic
Drives, 2007: charging and discharging a volume through a resistance). Air leaves the regulator by another way than it
comes, with less pressure behind it, so venting has its own time, r = `vent_ratio` times that of filling. A hose is the
same both ways: the second stage has one time, q = `second_ratio` times that of the first one's filling.

The commanded p_c is a straight line of slope s between samples, for which the solution over a step h is exact at any
step. Of the first stage, with a change from venting to filling within the step (`lag.py`),

    y(t + h) = p_c(t + h) − T s + (y(t) − p_c(t) + T s) e^(−h/T),      s = (p_c(t + h) − p_c(t)) / h

and of the second in `second_lag.py`. A run starts in balance, p = y = p_c; behind a closed valve both volumes keep
what they have. Data without times are states reached slowly, and have no lag.
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.records.history import PRESSURE, History
from pliant.units import Ratio, Time
from pliant_plugins.effects.second_lag import lagged_twice


class SupplyLagConfig(EffectConfig):
    """T, in which the regulator has brought two thirds of a step up, and in shares of it: venting, the hose."""

    kind: Literal["supply_lag"] = "supply_lag"
    time_s: Time = parameter(
        neutral=0.0,
        bounds=(0.0, 60.0),
        plausible=(0.05, 2.0),
        description="time constant of the supply's first stage, filling",
    )
    vent_ratio: Ratio = parameter(
        neutral=1.0,
        bounds=(0.2, 5.0),
        plausible=(0.5, 2.0),
        role="shape",
        prior="log_normal",
        description="time constant of venting over that of filling",
    )
    second_ratio: Ratio = parameter(
        neutral=0.15,
        bounds=(0.01, 1.0),
        plausible=(0.05, 0.5),
        role="shape",
        prior="log_normal",
        description="time constant of the second stage over that of the first, filling",
    )


class SupplyLag(Effect):
    """Delays every actuation by two first-order lags in a row."""

    place = "input"
    notes = EffectNotes(
        signature="while the pressure rises the angle is behind, while it falls it is ahead, the more the faster; a "
        "few time constants into a hold nothing is left. What follows a step sets in softly, for there are two "
        "volumes, and venting may take longer than filling. Loads that change at constant pressure are followed at "
        "once.",
        look_alike="viscous_damping",
        told_apart="change the load at constant pressure: damping delays that motion too, a supply does not.",
        excited_by="step the pressure up and down at two or three rates, with a hold after each step, then step a "
        "load at constant pressure.",
        where="every family; recordings with a clock, in engines that follow histories. Tasks and tables have no lag.",
    )
    exciting = ("step_response", "load_steps", "fast_cycles")
    config: SupplyLagConfig

    def apply(self, model: Model) -> Model:
        """The model with one more map of its inputs."""
        return model.with_input(partial(_delayed, self.config))


def _delayed(config: SupplyLagConfig, history: History) -> History:
    time_s, filling_s = history.time_s, config.time_s
    if time_s is None or filling_s == 0.0:
        return history
    times_s, second_s = (filling_s, config.vent_ratio * filling_s), config.second_ratio * filling_s
    open_ = np.ones(len(history) - 1, bool) if history.valve_open is None else history.valve_open[1:] != 0.0
    late = {
        name: lagged_twice(values, time_s, times_s, second_s, open_ if PRESSURE.fullmatch(name) else None)
        for name, values in history.actuation.items()
    }
    return history.with_actuation(**late)
