"""Effects of inputs as numbers of actuators, where MJCF can say them.

An effect that acts on the command of an actuator, u' = f(u), becomes

    actuation_gain    force = (g k) u + bias(L, dL/dt), ctrlrange / g: the gain of the command, not that of a servo's
                      position feedback
    input_offset      biasprm[0] + k b, ctrlrange − b
    saturation        ctrlrange cut to ±m
    supply_lag        dyntype filterexact with the time constant, for actuators without dynamics
    dead_time         delay, for actuators without one

in its plain form. Gain and offset are exact. The others act between the samples of a recording as well, where the study
draws straight lines, so that they agree to the spacing of the samples or to a step of the model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import mujoco
import numpy as np

from pliant.interfaces.effect import Effect
from pliant_systems.input_effects import DeadTime, InputGain, InputLag, InputOffset, Saturation

FIXED, AFFINE = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE)
NO_BIAS, AFFINE_BIAS = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
STATIC = int(mujoco.mjtDyn.mjDYN_NONE)
FILTERS = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
LINEAR = 1  # interpolation of a delayed control between steps
BEFORE_DRIVES = (InputGain, InputOffset)  # that may act in front of drives which the module moves

# (actuator of the specification, effect, largest recorded magnitude, specification, compiled model, its number)
Write = Callable[[Any, Any, float, Any, Any, int], bool]


def write_native(effect: Effect, scale: float, spec: Any, model: Any, name: str) -> bool:
    """Write an effect before everything that the actuator does; return False, and change nothing, if MJCF cannot.

    Args:
        effect: of inputs.
        scale: largest recorded magnitude of the input.
        spec: the specification, changed in place.
        model: compiled from it.
        name: of the actuator.
    """
    write = WRITES.get(type(effect))
    number = model.actuator(name).id
    plain = all(
        getattr(effect.config, one.name) == one.neutral for one in type(effect.config).form_parameters()
    )
    return write is not None and plain and write(spec.actuator(name), effect, scale, spec, model, number)


def is_exact(effect: Effect) -> bool:
    """Return whether the study and the MJCF mean the same to rounding."""
    return isinstance(effect, BEFORE_DRIVES)


def _is_linear(model: Any, k: int) -> bool:
    """Return whether the force is a linear function of the command, filtered or not."""
    dynamics = int(model.actuator_dyntype[k])
    filtered = dynamics in FILTERS and not model.actuator_actlimited[k] and not model.nkey
    return int(model.actuator_gaintype[k]) in (FIXED, AFFINE) and (dynamics == STATIC or filtered)


def _set_range(one: Any, model: Any, k: int, low: float, high: float) -> None:
    one.inheritrange = 0.0
    one.ctrllimited, one.ctrlrange = mujoco.mjtLimited.mjLIMITED_TRUE, np.array([low, high])


def _gain(one: Any, effect: InputGain, scale: float, spec: Any, model: Any, k: int) -> bool:
    factor = effect.config.factor
    if not _is_linear(model, k) or factor == 0.0:
        return False
    gain = np.array(model.actuator_gainprm[k][: len(one.gainprm)])
    gain[:3] *= factor
    one.gainprm = gain
    if model.actuator_ctrllimited[k]:
        low, high = sorted(model.actuator_ctrlrange[k] / factor)
        _set_range(one, model, k, low, high)
    return True


def _offset(one: Any, effect: InputOffset, scale: float, spec: Any, model: Any, k: int) -> bool:
    bias = int(model.actuator_biastype[k])
    if (
        not _is_linear(model, k)
        or int(model.actuator_gaintype[k]) != FIXED
        or bias not in (NO_BIAS, AFFINE_BIAS)
    ):
        return False
    shift = effect.config.share * scale
    numbers = np.array(model.actuator_biasprm[k][: len(one.biasprm)])
    numbers[0] += model.actuator_gainprm[k][0] * shift
    one.biastype, one.biasprm = mujoco.mjtBias.mjBIAS_AFFINE, numbers
    if model.actuator_ctrllimited[k]:
        low, high = model.actuator_ctrlrange[k] - shift
        _set_range(one, model, k, low, high)
    return True


def _saturation(one: Any, effect: Saturation, scale: float, spec: Any, model: Any, k: int) -> bool:
    most = (1.0 - effect.config.loss) * scale
    low, high = model.actuator_ctrlrange[k] if model.actuator_ctrllimited[k] else (-math.inf, math.inf)
    low, high = max(low, -most), min(high, most)
    if not low < high:
        return False
    _set_range(one, model, k, low, high)
    return True


def _lag(one: Any, effect: InputLag, scale: float, spec: Any, model: Any, k: int) -> bool:
    config = effect.config
    static = int(model.actuator_dyntype[k]) == STATIC and model.actuator_actadr[k] < 0
    if not static or model.nkey or config.time_s <= 0.0:
        return False
    numbers = np.zeros(len(one.dynprm))
    numbers[0] = config.time_s
    one.dyntype, one.dynprm = mujoco.mjtDyn.mjDYN_FILTEREXACT, numbers
    return True


def _dead_time(one: Any, effect: DeadTime, scale: float, spec: Any, model: Any, k: int) -> bool:
    if model.actuator_history[k][0] or model.actuator_delay[k] or effect.config.delay_s <= 0.0:
        return False
    one.delay, one.interp = effect.config.delay_s, LINEAR
    one.nsample = math.ceil(effect.config.delay_s / model.opt.timestep) + 2
    return True


WRITES: Mapping[type, Write] = {
    InputGain: _gain,
    InputOffset: _offset,
    Saturation: _saturation,
    InputLag: _lag,
    DeadTime: _dead_time,
}
