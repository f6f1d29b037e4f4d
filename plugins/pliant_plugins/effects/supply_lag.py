"""Actuation that reaches the chamber late.

    T p' + p = p_c  while p ≤ p_c (filling),      r T p' + p = p_c  while p > p_c (venting)

for every input of the chain: a hose and a chamber filled through a throttle, or a regulator's own loop, to first
order, as a resistor charges a capacitor. Air leaves by another way than it comes, with less pressure behind it, so
venting has its own time, r = `vent_ratio` times that of filling (Beater, Pneumatic Drives, 2007: charging and
discharging a volume through a resistance). The commanded p_c is a straight line between samples, for which the
solution over a step h is exact at any step, a change from venting to filling within it included (`lag.py`):

    p(t + h) = p_c(t + h) − T s + (p(t) − p_c(t) + T s) e^(−h/T),      s = (p_c(t + h) − p_c(t)) / h

A run starts in balance, p = p_c; a chamber that a valve closes off keeps its p. Data without times are states reached
slowly, and have no lag.
"""

from __future__ import annotations

from functools import partial
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, EffectParameter, Model, Place
from pliant.records.history import PRESSURE, History
from pliant.units import Ratio, Time
from pliant_plugins.effects.lag import lagged

BOUNDS = (0.0, 60.0)
RATIO_BOUNDS = (0.2, 5.0)


class SupplyLagConfig(EffectConfig):
    """T, the time in which two thirds of a step up have arrived, and r, how much longer a step down takes."""

    kind: Literal["supply_lag"] = "supply_lag"
    time_s: Time = Field(
        default=0.0, ge=BOUNDS[0], le=BOUNDS[1], description="time constant of the supply's first-order lag"
    )
    vent_ratio: Ratio = Field(
        default=1.0,
        ge=RATIO_BOUNDS[0],
        le=RATIO_BOUNDS[1],
        description="time constant of venting over that of filling",
    )


class SupplyLag(Effect):
    """Delays every actuation by a first-order lag."""

    place: ClassVar[Place] = "input"
    parameters: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("time_s", "s", neutral=0.0, bounds=BOUNDS, plausible=(0.05, 2.0)),
        EffectParameter(
            "vent_ratio",
            "1",
            neutral=1.0,
            bounds=RATIO_BOUNDS,
            plausible=(0.5, 2.0),
            role="shape",
            prior="log_normal",
        ),
    )
    notes: ClassVar[EffectNotes] = EffectNotes(
        signature=(
            "while the pressure rises the angle is behind, while it falls it is ahead, the more the "
            "faster; a few time constants into a hold nothing is left. Venting may take longer than filling. Loads "
            "that change at constant pressure are followed at once."
        ),
        look_alike="viscous_damping",
        told_apart="change the load at constant pressure: damping delays that motion too, a supply does not.",
        excited_by=(
            "step the pressure up and down at two or three rates, with a hold after each step, then step "
            "a load at constant pressure."
        ),
        where=(
            "every family; recordings with a clock, in engines that follow histories. Tasks and tables have "
            "no lag."
        ),
    )
    exciting: ClassVar[tuple[str, ...]] = ("step_response", "load_steps", "fast_cycles")
    config: SupplyLagConfig

    def apply(self, model: Model) -> Model:
        """The model with one more map of its inputs."""
        return model.with_input(partial(_delayed, self.config.time_s, self.config.vent_ratio))


def _delayed(filling_s: float, vent_ratio: float, history: History) -> History:
    if history.time_s is None or filling_s == 0.0:
        return history
    steps = len(history) - 1
    open_ = np.ones(steps, bool) if history.valve_open is None else history.valve_open[1:] != 0.0
    late = {
        name: lagged(
            values,
            history.time_s,
            filling_s,
            open_ if PRESSURE.fullmatch(name) else None,
            falling_s=vent_ratio * filling_s,
        )
        for name, values in history.actuation.items()
    }
    return history.with_actuation(**late)
