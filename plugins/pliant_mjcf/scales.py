"""Sizes of a MuJoCo model, in which the plausible ranges of effects are stated.

Effects declare what is plausible in a reference system: joints with a torque of 1 N·m, a range of 1 rad and a speed of
1 rad/s (slides: 1 N, 1 m, 1 m/s), tendons with 10 N, 0.1 m and 0.1 m/s, bodies with 1 kg and 0.1 m. `adapted_parameter`
multiplies by the size at the place where the effect acts over that of the reference. It follows from the MJCF at qpos0
alone, never from a recording:

- force T of a joint: the largest of what its actuators can give (their limits times moment arms) and the weight that
  it may carry (g times the mass that it moves, for a hinge times the lever arm of its centre of mass). Without either,
  what swings its inertia through its range once per second.
- range θ: half of the joint's limits; 1 rad or 0.1 m without limits.
- speed ω = √(T θ / I), with the inertia I that the joint moves: that reached by T over θ from rest. Damping is T / ω
  and stiffness T / θ, so that size one is about critical damping; what the MJCF states counts if it is larger.
- mass of a body: its own. Length: its radius of gyration, √(trace of the inertia / 2 m).
- force of a tendon: what its actuators can give, else the smallest T of its joints over their moment arms; its range is
  the change of its length over the ranges of its joints.

An effect on several places has the median of their sizes. Ratios, times and angles stay as they are, but a parameter in
rad is one in m for a slide, and is multiplied by its range. Bounds stay too: they are limits of the effect's equation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any

import mujoco
import numpy as np

from pliant.interfaces.effect import AT, EffectParameter
from pliant.records.design import Array
from pliant_mjcf.mjcf import SLIDE, element_names
from pliant_mjcf.places import BODY, JOINT, PLACE_OF_KIND, TENDON
from pliant_mjcf.quantities import joint_unit

FREE_RANGE = {"rad": 1.0, "m": 0.1}
ONE_HERTZ = (2.0 * np.pi) ** 2
LIGHTEST = 1e-12  # inertia
# Unit of a parameter → its size; slides and tendons have the second spelling.
MOTIONS: Mapping[str, str] = {
    "N*m": "force",
    "N": "force",
    "N*m/rad": "stiffness",
    "N/m": "stiffness",
    "N*m*s": "damping",
    "N*m*s/rad": "damping",
    "N*s/m": "damping",
    "rad/s": "speed",
    "s^-1": "speed",
    "m/s": "speed",
    "m": "range",
    "rad": "angle",
}
MASSES: Mapping[str, str] = {"kg": "mass", "m": "length", "kg*m^2": "inertia", "m^2*kg": "inertia"}
# Sizes of a place by their names.
Sizes = Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Scales:
    """Sizes by place.

    Attributes:
        joints, tendons: force, range, speed, stiffness, damping and angle by name; the angle of a slide is its range.
        bodies: mass, length and inertia by name.
    """

    joints: Mapping[str, Sizes]
    tendons: Mapping[str, Sizes]
    bodies: Mapping[str, Sizes]

    @staticmethod
    def of(model: Any) -> Scales:
        """Return the sizes of a compiled model at qpos0."""
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        inertia = _inertias(model, data)
        moments, limits = _moments(model, data), _limits(model)
        joints: dict[str, Sizes] = {}
        by_dof: dict[int, Sizes] = {}
        for name, k in element_names(model, JOINT).items():
            dof, unit = int(model.jnt_dofadr[k]), joint_unit(model, k)
            low, high = model.jnt_range[k]
            span = 0.5 * float(high - low) if model.jnt_limited[k] and high > low else FREE_RANGE[unit]
            by_dof[dof] = joints[name] = motion_sizes(
                max(float(limits @ np.abs(moments[:, dof])), _weight(model, data, k)),
                span,
                float(inertia[dof]),
                stiffness=float(model.jnt_stiffness[k]),
                damping=float(model.dof_damping[dof]),
                angle=1.0 if unit == "rad" else span,
            )
        tendons = {
            name: _tendon(model, data, k, by_dof, inertia, limits)
            for name, k in element_names(model, TENDON).items()
        }
        bodies = {name: _body(model, k) for name, k in element_names(model, BODY).items()}
        return Scales(joints, tendons, bodies)


def adapted_parameter(scales: Scales, kind: str, declared: EffectParameter) -> EffectParameter:
    """Return the parameter with its plausible range in the size of the places that the kind names."""
    plain, _, pattern = kind.partition(AT)
    place = PLACE_OF_KIND.get(plain, "")
    size = (MASSES if place == BODY else MOTIONS).get(declared.unit)
    if place not in REFERENCE or size is None:
        return declared
    sizes = {JOINT: scales.joints, TENDON: scales.tendons, BODY: scales.bodies}[place]
    found = [
        one[size] / REFERENCE[place][size]
        for name, one in sizes.items()
        if one and fnmatchcase(name, pattern or "*")
    ]
    return scaled(declared, float(np.median(found))) if found else declared


def scaled(declared: EffectParameter, factor: float) -> EffectParameter:
    """Return the parameter with its neutral value and plausible range times a factor, within its bounds.

    They are rounded to two digits, so that they can be read.
    """
    low, high = declared.bounds
    least, most = (min(max(float(f"{factor * end:.2g}"), low), high) for end in declared.plausible)
    neutral = min(max(factor * declared.neutral, low), high)
    if not least < most:
        return declared
    return replace(declared, neutral=neutral, plausible=(least, most))


def motion_sizes(
    force: float,
    span: float,
    inertia: float,
    *,
    stiffness: float = 0.0,
    damping: float = 0.0,
    angle: float = 1.0,
) -> Sizes:
    """Return the sizes of a joint or tendon with this force, range and inertia, and what the MJCF states."""
    inertia = max(inertia, LIGHTEST)
    force = force if force > 0.0 else ONE_HERTZ * inertia * span
    speed = float(np.sqrt(force * span / inertia))
    return {
        "force": force,
        "range": span,
        "speed": speed,
        "stiffness": max(force / span, stiffness),
        "damping": max(force / speed, damping),
        "angle": angle,
    }


REFERENCE: Mapping[str, Sizes] = {
    JOINT: motion_sizes(1.0, 1.0, 1.0),
    TENDON: motion_sizes(10.0, 0.1, 100.0),
    BODY: {"mass": 1.0, "length": 0.1, "inertia": 0.01},
}


def _inertias(model: Any, data: Any) -> Array:
    """Return (nv,) the inertia that each coordinate moves alone."""
    full = np.zeros((model.nv, model.nv))
    if model.nv:
        mujoco.mj_fullM(model, data, full)
    return np.diag(full).copy()


def _moments(model: Any, data: Any) -> Array:
    """Return (nu, nv) the moment arms of the actuators."""
    dense = np.zeros((model.nu, model.nv))
    for k in range(model.nu):
        start, count = int(data.moment_rowadr[k]), int(data.moment_rownnz[k])
        dense[k, data.moment_colind[start : start + count]] = data.actuator_moment[start : start + count]
    return dense


def _limits(model: Any) -> Array:
    """Return (nu,) the largest force of each actuator: its forcerange, else its ctrlrange times its gain; 0 if free."""
    found = np.zeros(model.nu)
    for k in range(model.nu):
        if model.actuator_forcelimited[k]:
            found[k] = np.abs(model.actuator_forcerange[k]).max()
        elif (
            model.actuator_ctrllimited[k]
            and int(model.actuator_gaintype[k]) == int(mujoco.mjtGain.mjGAIN_FIXED)
            and int(model.actuator_biastype[k]) == int(mujoco.mjtBias.mjBIAS_NONE)
        ):
            found[k] = np.abs(model.actuator_ctrlrange[k]).max() * abs(model.actuator_gainprm[k][0])
    return found


def _weight(model: Any, data: Any, joint: int) -> float:
    """Return the largest force or torque of gravity that a hinge or slide may carry."""
    body = int(model.jnt_bodyid[joint])
    weight = float(np.linalg.norm(model.opt.gravity)) * float(model.body_subtreemass[body])
    if int(model.jnt_type[joint]) == SLIDE:
        return weight
    arm = data.subtree_com[body] - data.xanchor[joint]
    axis = data.xaxis[joint]
    return weight * float(np.linalg.norm(arm - axis * (axis @ arm)))


def _tendon(
    model: Any, data: Any, k: int, joints: Mapping[int, Sizes], inertia: Array, limits: Array
) -> Sizes:
    """Return the sizes of a tendon; none where it moves no hinge or slide."""
    arms = np.abs(_tendon_arms(model, data, k))
    moved = [dof for dof in joints if arms[dof] > 0.0]
    if not moved:
        return {}
    own = sum(
        float(limits[a])
        for a in range(model.nu)
        if int(model.actuator_trntype[a]) == int(mujoco.mjtTrn.mjTRN_TENDON)
        and model.actuator_trnid[a][0] == k
    )
    return motion_sizes(
        own or min(joints[dof]["force"] / float(arms[dof]) for dof in moved),
        sum(joints[dof]["range"] * float(arms[dof]) for dof in moved),
        1.0 / float(np.sum(arms[moved] ** 2 / np.maximum(inertia[moved], LIGHTEST))),
        stiffness=float(model.tendon_stiffness[k]),
        damping=float(model.tendon_damping[k]),
    )


def _tendon_arms(model: Any, data: Any, k: int) -> Array:
    """Return (nv,) the derivative of a tendon's length by the coordinates."""
    found = np.zeros(model.nv)
    start, count = int(model.ten_J_rowadr[k]), int(model.ten_J_rownnz[k])
    found[model.ten_J_colind[start : start + count]] = data.ten_J[start : start + count]
    return found


def _body(model: Any, k: int) -> Sizes:
    """Return mass, radius of gyration and inertia of a body."""
    mass = float(model.body_mass[k])
    length = float(np.sqrt(0.5 * float(model.body_inertia[k].sum()) / mass))
    return {"mass": mass, "length": length, "inertia": mass * length**2}
