"""Actuation that reaches the chamber late, through two volumes.

    T y' + y = p_c  while y ≤ p_c (filling),      r T y' + y = p_c  while y > p_c (venting)
    q T p' + p = y

for every input of the chain: y is the pressure behind the regulator, p that of the chamber behind its hose. Either
volume is filled through a resistance and lags to first order, as a resistor charges a capacitor (Beater, Pneumatic
Drives, 2007: charging and discharging a volume through a resistance). Air leaves the regulator by another way than it
comes, with less pressure behind it, so venting has its own time, r = `vent_ratio` times that of filling. A hose is the
same both ways: the second stage has one time, q = `second_ratio` times that of the first one's filling. Where the first
flows through an orifice, T y' = sign(p_c − y) p̂ (|p_c − y|/p̂)^n with p̂ the law's largest pressure and n = 1/2 where it
is turbulent; what is late in all, a slow valve or a clock that started late, is a delay before both.

The commanded p_c is a straight line of slope s between samples, for which the solution over a step h is exact at any
step. Of the first stage, with a change from venting to filling within the step (`lag.py`),

    y(t + h) = p_c(t + h) − T s + (y(t) − p_c(t) + T s) e^(−h/T),      s = (p_c(t + h) − p_c(t)) / h

and of the second in `lagged_twice`. A run starts in balance, p = y = p_c; behind a closed valve both volumes keep
what they have. Data without times are states reached slowly, and have no lag.
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, Model, parameter
from pliant.mechanics.full_scale import full_scale
from pliant.records.design import Array
from pliant.records.history import PRESSURE, History
from pliant.units import Ratio, Time
from pliant_plugins.effects.lag import lagged, step_changes


class SupplyLagConfig(EffectConfig):
    """T, in which the regulator has brought two thirds of a step up, and in shares of it: venting, the hose."""

    kind: Literal["supply_lag"] = "supply_lag"
    time_s: Time = parameter(neutral=0.0, bounds=(0.0, 60.0), plausible=(0.05, 2.0), example="0.4 s")
    """time constant of the supply's first stage, filling"""
    vent_ratio: Ratio = parameter(
        neutral=1.0,
        bounds=(0.2, 5.0),
        plausible=(0.5, 2.0),
        role="shape",
        prior="log_normal",
        simpler={1.0: "it vents as fast as it fills"},
    )
    """time constant of venting over that of filling"""
    second_ratio: Ratio = parameter(
        neutral=0.15,
        bounds=(0.01, 1.0),
        plausible=(0.05, 0.5),
        role="shape",
        prior="log_normal",
        simpler={0.01: "one volume is enough", 1.0: "both volumes are as slow"},
    )
    """time constant of the second stage over that of the first, filling"""
    power: float = parameter(unit="1", neutral=1.0, bounds=(0.4, 1.5), plausible=(0.5, 1.2), role="form")
    """power of the pressure's difference with which the first stage flows: 1/2 through an orifice"""
    delay_s: Time = parameter(neutral=0.0, bounds=(0.0, 5.0), plausible=(0.0, 0.3), role="form")
    """by which everything sets in late"""


class SupplyLag(Effect):
    """Two first-order lags in series on every actuation."""

    place = "input"
    notes = EffectNotes(
        signature="while the pressure rises the angle is behind, while it falls it is ahead, the more the faster; a "
        "few time constants into a hold nothing is left. What follows a step sets in softly, for there are two "
        "volumes, and venting may take longer than filling. Loads that change at constant pressure are followed at "
        "once.",
        inspection="time the pressure at the chamber beside the commanded one; shorten or widen the hose.",
        confounder="viscous_damping",
        distinguishing_test="change the load at constant pressure: damping delays that motion too, a supply does not.",
        excitation="step the pressure up and down at two or three rates, with a hold after each step, then step a "
        "load at constant pressure.",
        where="every family; recordings with a clock, in engines that follow histories. Tasks and tables have no lag.",
    )
    recommended_experiments = ("step_response", "load_steps", "fast_cycles")
    config: SupplyLagConfig

    def apply(self, model: Model) -> Model:
        """Return the model with one more map of its inputs."""
        return model.with_input(partial(_delayed, self.config, full_scale(model.chain)))


def _delayed(config: SupplyLagConfig, full: float, history: History) -> History:
    """Delay the inputs; `full` is the difference at which the first stage flows as fast as a linear one."""
    time_s, filling_s = history.time_s, config.time_s
    if time_s is None or filling_s == 0.0:
        return history
    if config.delay_s:
        sooner = time_s - config.delay_s
        history = history.with_actuation(
            **{name: np.interp(sooner, time_s, values) for name, values in history.actuation.items()}
        )
    times_s, second_s = (filling_s, config.vent_ratio * filling_s), config.second_ratio * filling_s
    open_ = np.ones(len(history) - 1, bool) if history.valve_open is None else history.valve_open[1:] != 0.0
    late = {}
    for name, values in history.actuation.items():
        flows = open_ if PRESSURE.fullmatch(name) else None
        if config.power == 1.0:
            late[name] = lagged_twice(values, time_s, times_s, second_s, flows)
        else:
            scale = full if np.isfinite(full) else float(np.abs(values).max()) or 1.0
            first = through_orifice(values / scale, time_s, times_s, config.power, flows) * scale
            late[name] = lagged(first, time_s, second_s, flows)
    return history.with_actuation(**late)


def through_orifice(
    values: Array,
    time_s: Array,
    times_s: tuple[float, float],
    power: float,
    flows: NDArray[np.bool_] | None = None,
) -> Array:
    """Return (t,) y of T y' = sign(u − y) |u − y|^n, `values` u (t,) of order 1, starting in balance.

    Over a step u is constant at its mean, for which the solution is exact,

        |y − u|^(1−n) (t + h) = |y − u|^(1−n) (t) − (1 − n) h / T,

    and the difference is zero once the right side is negative: of second order in the step. `times_s` are T while y
    rises and while it falls.
    """
    from pliant_plugins.effects import recurrences

    _, steps, running = step_changes(values, time_s, flows)
    middle, first = 0.5 * (values[1:] + values[:-1]), float(values[0])
    late: Array = recurrences.through_orifice(middle, steps, running, *times_s, power, first)
    return late


def lagged_twice(
    values: Array,
    time_s: Array,
    times_s: tuple[float, float],
    second_s: float,
    flows: NDArray[np.bool_] | None = None,
) -> Array:
    """Return z (t,), the response to u = `values` (t,) at `time_s` (t,) after both stages, y and z, from balance.

    `times_s` are the first stage's time constants while it rises and while it falls, `second_s` the second one's, all
    above zero. `flows` (t − 1,) marks steps with flow; by default all.

    u is a straight line of slope s between samples. Within a piece in which T does not change, y = u + d with
    d = −s T + c e^(−t/T), so with w = z − u, a step h is exact:

        w(t + h) = E₂ w(t) + G (d(t) + s T) − (T + T₂)(1 − E₂) s
        E₂ = e^(−h/T₂),      G = T/(T − T₂) (e^(−h/T) − e^(−h/T₂)),      G → h/T e^(−h/T) where T₂ → T

    The second stage is linear: where y passes u within a step, the step is two pieces (d = 0 between them), and every
    piece has one T. Without flow both stages are constant.
    """
    from pliant_plugins.effects.recurrences import lagging_twice

    late: Array = values + lagging_twice(*step_changes(values, time_s, flows), *times_s, second_s)
    return late
