"""Actuation that reaches the chamber late.

    T p' + p = p_c

for every input of the chain: a hose and a chamber filled through a throttle, or a regulator's own loop, to first
order, as a resistor charges a capacitor. The commanded p_c is a straight line between samples, for which the
solution over a step h is exact at any step:

    p(t + h) = p_c(t + h) − T s + (p(t) − p_c(t) + T s) e^(−h/T),      s = (p_c(t + h) − p_c(t)) / h

A run starts in balance, p = p_c; a chamber that a valve closes off keeps its p. Data without times are states reached
slowly, and have no lag.
"""

from __future__ import annotations

import math
from functools import partial
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, EffectParameter, Model, Place
from pliant.records.design import Array
from pliant.records.history import PRESSURE, History
from pliant.units import Time

BOUNDS = (0.0, 60.0)


class SupplyLagConfig(EffectConfig):
    """T, the time in which two thirds of a step have arrived."""

    kind: Literal["supply_lag"] = "supply_lag"
    time_s: Time = Field(
        default=0.0, ge=BOUNDS[0], le=BOUNDS[1], description="time constant of the supply's first-order lag"
    )


class SupplyLag(Effect):
    """Delays every actuation by a first-order lag."""

    place: ClassVar[Place] = "input"
    parameters: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("time_s", "s", neutral=0.0, bounds=BOUNDS, plausible=(0.05, 2.0)),
    )
    notes: ClassVar[EffectNotes] = EffectNotes(
        signature=(
            "while the pressure rises the angle is behind, while it falls it is ahead, the more the "
            "faster; a few time constants into a hold nothing is left. Loads that change at constant "
            "pressure are followed at once."
        ),
        look_alike="viscous_damping",
        told_apart="change the load at constant pressure: damping delays that motion too, a supply does not.",
        excited_by=(
            "step the pressure up and down at two or three rates, with a hold after each step, then step "
            "a load at constant pressure."
        ),
    )
    config: SupplyLagConfig

    def apply(self, model: Model) -> Model:
        """The model with one more map of its inputs."""
        return model.with_input(partial(_delayed, self.config.time_s))


def _delayed(time: float, history: History) -> History:
    if history.time_s is None or time == 0.0:
        return history
    steps = np.diff(history.time_s)
    valve = np.ones(len(history)) if history.valve_open is None else history.valve_open
    late = {
        name: _lagged(values, steps, valve[1:] != 0.0 if PRESSURE.fullmatch(name) else steps >= 0.0, time)
        for name, values in history.actuation.items()
    }
    return history.with_actuation(**late)


def _lagged(commanded: Array, steps: Array, flows: NDArray[np.bool_], time: float) -> Array:
    """The equation at the samples; plain floats, for a recurrence cannot be vectorised."""
    arriving = [float(commanded[0])]
    slopes = np.diff(commanded) / steps
    for end, slope, step, start, flowing in zip(
        commanded[1:].tolist(),
        slopes.tolist(),
        steps.tolist(),
        commanded[:-1].tolist(),
        flows.tolist(),
        strict=True,
    ):
        behind = arriving[-1] - start + time * slope
        late = end - time * slope + behind * math.exp(-step / time)
        arriving.append(late if flowing else arriving[-1])
    return np.array(arriving)
