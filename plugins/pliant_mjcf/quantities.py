"""What numbers of a MuJoCo model mean: units of controls and sensors, and the names of a vector's components."""

from __future__ import annotations

from typing import Any

import mujoco

from pliant_mjcf.mjcf import HINGE, SLIDE, word

AXES = ("x", "y", "z")
QUATERNION = ("w", "x", "y", "z")
QUATERNIONS = ("framequat", "ballquat")
# Sensors whose unit is the same wherever they are.
UNITS = {
    "touch": "N",
    "accelerometer": "m/s^2",
    "velocimeter": "m/s",
    "gyro": "rad/s",
    "force": "N",
    "torque": "N*m",
    "rangefinder": "m",
    "ballangvel": "rad/s",
    "framepos": "m",
    "framelinvel": "m/s",
    "frameangvel": "rad/s",
    "framelinacc": "m/s^2",
    "frameangacc": "rad/s^2",
    "subtreecom": "m",
    "subtreelinvel": "m/s",
    "geomdist": "m",
    "geomfromto": "m",
    "clock": "s",
    "e_potential": "J",
    "e_kinetic": "J",
}
POSITIONS = ("jointpos", "jointlimitpos", "tendonpos", "tendonlimitpos", "actuatorpos")
VELOCITIES = ("jointvel", "jointlimitvel", "tendonvel", "tendonlimitvel", "actuatorvel")
FORCES = (
    "jointactfrc",
    "jointlimitfrc",
    "tendonactfrc",
    "tendonlimitfrc",
    "actuatorfrc",
)
FORCE_OF = {"rad": "N*m", "m": "N"}
# Dynamics of actuators that end where ctrl asks them to be.
DIRECT = tuple(
    int(one)
    for one in (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)
)


def component_names(kind: Any, size: int) -> tuple[str, ...]:
    """Return the names of a sensor's numbers: x, y, z of vectors, w, x, y, z of quaternions, else counted."""
    if word(kind) in QUATERNIONS:
        return QUATERNION
    if size == 3:
        return AXES
    return tuple(str(k + 1) for k in range(size))


def sensor_unit(model: Any, k: int) -> str:
    """Return the SI unit of a sensor's numbers; "" for pure numbers and where it is not known."""
    kind, target = word(mujoco.mjtSensor(int(model.sensor_type[k]))), int(model.sensor_objid[k])
    if kind in UNITS:
        return UNITS[kind]
    if kind.startswith("joint"):
        length = joint_unit(model, target)
    elif kind.startswith("tendon"):
        length = "m" if is_spatial(model, target) else ""
    elif kind.startswith("actuator"):
        length = transmission_units(model, target)[0]
    else:
        return ""
    if kind in POSITIONS:
        return length
    if kind in VELOCITIES:
        return f"{length}/s" if length else ""
    return FORCE_OF.get(length, "") if kind in FORCES else ""


def joint_unit(model: Any, joint: int) -> str:
    """Return the unit of a joint's coordinate; "" for ball and free joints."""
    return {HINGE: "rad", SLIDE: "m"}.get(int(model.jnt_type[joint]), "")


def control_unit(model: Any, k: int) -> str:
    """Return the SI unit of an actuator's ctrl; "" where MJCF does not say it: voltages, muscles, cylinders.

    A motor is a gain of one without a bias; a servo has the bias −gain times position or velocity.
    """
    gain, bias = model.actuator_gainprm[k], model.actuator_biasprm[k]
    if int(model.actuator_gaintype[k]) != int(mujoco.mjtGain.mjGAIN_FIXED) or not gain[0]:
        return ""
    dynamics, kind = int(model.actuator_dyntype[k]), int(model.actuator_biastype[k])
    integrated = dynamics == int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
    length, force = transmission_units(model, k)
    if kind == int(mujoco.mjtBias.mjBIAS_NONE):
        return force if dynamics in DIRECT and gain[0] == 1.0 else ""
    if kind != int(mujoco.mjtBias.mjBIAS_AFFINE) or bias[0]:
        return ""
    if bias[1] == -gain[0]:
        return length if dynamics in DIRECT else f"{length}/s" if integrated and length else ""
    velocity = dynamics in DIRECT and bias[1] == 0.0 and bias[2] == -gain[0]
    return f"{length}/s" if velocity and length else ""


def transmission_units(model: Any, k: int) -> tuple[str, str]:
    """Return the units of an actuator's length and force; "" where they depend on more than the joint's kind."""
    kind, target = int(model.actuator_trntype[k]), int(model.actuator_trnid[k][0])
    if kind in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
        length = joint_unit(model, target)
        return length, FORCE_OF.get(length, "")
    spatial = kind == int(mujoco.mjtTrn.mjTRN_TENDON) and is_spatial(model, target)
    return ("m", "N") if spatial or kind == int(mujoco.mjtTrn.mjTRN_SLIDERCRANK) else ("", "")


def is_spatial(model: Any, tendon: int) -> bool:
    """Return whether a tendon is a path in space, instead of a sum of joint coordinates."""
    return int(model.wrap_type[model.tendon_adr[tendon]]) != int(mujoco.mjtWrap.mjWRAP_JOINT)
