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
  and stiffness T / θ, so that size one is about critical damping.
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
# Unit of a parameter → powers of force, range, speed and angle; slides and tendons have the second spelling.
FORCES: Mapping[str, tuple[int, ...]] = {
    "N*m": (1, 0, 0, 0),
    "N": (1, 0, 0, 0),
    "N*m/rad": (1, -1, 0, 0),
    "N/m": (1, -1, 0, 0),
    "N*m*s": (1, 0, -1, 0),
    "N*m*s/rad": (1, 0, -1, 0),
    "N*s/m": (1, 0, -1, 0),
    "rad/s": (0, 0, 1, 0),
    "s^-1": (0, 0, 1, 0),
    "m/s": (0, 0, 1, 0),
    "m": (0, 1, 0, 0),
    "rad": (0, 0, 0, 1),
}
# The same for powers of mass and length of a body.
MASSES: Mapping[str, tuple[int, ...]] = {"kg": (1, 0), "m": (0, 1), "kg*m^2": (1, 2), "m^2*kg": (1, 2)}
REFERENCE = {
    JOINT: np.ones(4),
    TENDON: np.array([10.0, 0.1, 0.1, 1.0]),
    BODY: np.array([1.0, 0.1]),
}


@dataclass(frozen=True, eq=False)
class Scales:
    """Sizes by place.

    Attributes:
        joints, tendons: (4,) force, range, speed, and the range of a slide or 1 rad of a hinge, by name.
        bodies: (2,) mass and length by name.
    """

    joints: Mapping[str, Array]
    tendons: Mapping[str, Array]
    bodies: Mapping[str, Array]

    @staticmethod
    def of(model: Any) -> Scales:
        """Return the sizes of a compiled model at qpos0."""
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        inertia = _inertias(model, data)
        moments, limits = _moments(model, data), _limits(model)
        joints, by_dof = {}, np.zeros((model.nv, 4))
        for name, k in element_names(model, JOINT).items():
            dof, unit = int(model.jnt_dofadr[k]), joint_unit(model, k)
            low, high = model.jnt_range[k]
            span = 0.5 * float(high - low) if model.jnt_limited[k] and high > low else FREE_RANGE[unit]
            force = max(float(limits @ np.abs(moments[:, dof])), _weight(model, data, k))
            by_dof[dof] = _sizes(force, span, float(inertia[dof]), 1.0 if unit == "rad" else span)
            joints[name] = by_dof[dof]
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
    powers = (MASSES if place == BODY else FORCES).get(declared.unit)
    if place not in REFERENCE or powers is None:
        return declared
    sizes = {JOINT: scales.joints, TENDON: scales.tendons, BODY: scales.bodies}[place]
    found = [
        float(np.prod((one / REFERENCE[place]) ** np.array(powers)))
        for name, one in sizes.items()
        if fnmatchcase(name, pattern or "*") and (one > 0.0).all()
    ]
    return scaled(declared, float(np.median(found))) if found else declared


def scaled(declared: EffectParameter, factor: float) -> EffectParameter:
    """Return the parameter with its neutral value and plausible range times a factor, within its bounds.

    The factor is rounded to two digits, so that ranges can be read.
    """
    factor = float(f"{factor:.2g}")
    low, high = declared.bounds
    least, most = (min(max(factor * end, low), high) for end in declared.plausible)
    neutral = min(max(factor * declared.neutral, low), high)
    if not least < most:
        return declared
    return replace(declared, neutral=neutral, plausible=(least, most))


def _sizes(force: float, span: float, inertia: float, angle: float = 1.0) -> Array:
    """Return (4,) force, range, speed and angle."""
    inertia = max(inertia, 1e-12)
    force = force if force > 0.0 else ONE_HERTZ * inertia * span
    return np.array([force, span, np.sqrt(force * span / inertia), angle])


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


def _tendon(model: Any, data: Any, k: int, joints: Array, inertia: Array, limits: Array) -> Array:
    """Return (4,) force, range, speed and angle of a tendon."""
    arms = np.abs(_tendon_arms(model, data, k))
    moved = np.flatnonzero((arms > 0.0) & (joints[:, 0] > 0.0))
    own = [
        a
        for a in range(model.nu)
        if int(model.actuator_trntype[a]) == int(mujoco.mjtTrn.mjTRN_TENDON)
        and model.actuator_trnid[a][0] == k
    ]
    if not len(moved):
        return np.zeros(4)
    force = float(sum(limits[a] for a in own)) or float((joints[moved, 0] / arms[moved]).min())
    span = float(arms[moved] @ joints[moved, 1])
    mass = 1.0 / float(np.sum(arms[moved] ** 2 / np.maximum(inertia[moved], 1e-12)))
    return _sizes(force, span, mass)


def _tendon_arms(model: Any, data: Any, k: int) -> Array:
    """Return (nv,) the derivative of a tendon's length by the coordinates."""
    found = np.zeros(model.nv)
    start, count = int(model.ten_J_rowadr[k]), int(model.ten_J_rownnz[k])
    found[model.ten_J_colind[start : start + count]] = data.ten_J[start : start + count]
    return found


def _body(model: Any, k: int) -> Array:
    """Return (2,) mass and radius of gyration of a body."""
    mass = float(model.body_mass[k])
    if mass <= 0.0:
        return np.zeros(2)
    return np.array([mass, np.sqrt(0.5 * float(model.body_inertia[k].sum()) / mass)])
