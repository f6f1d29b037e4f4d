"""Truth engine 2: the chain in MuJoCo, with inertia, MuJoCo's own joint damping and dry friction.

Steps of 4 ms with the `discrete` integrator. The joint's effort is applied as MuJoCo's joint spring (its local slope,
known to the integrator) and a generalised force; what has memory advances with MuJoCo's steps. The loop over steps
is compiled and calls `mj_step` of the installed library directly: one step of one joint takes microseconds, and a rich
protocol has 300 000.
"""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
from benchmarks.evidence.forms import Drive, Forms, healed, viscous_torque, with_wrap, wraps
from benchmarks.evidence.functional_truth import (
    AIR_DAMPING,
    Bones,
    Inputs,
    compile_bones,
    cycle_increment,
    driven,
    followed,
    own,
    ramped,
    resting,
)
from benchmarks.evidence.protocols import Protocol
from benchmarks.evidence.robots import Array, Robot
from benchmarks.evidence.skeleton import Skeleton, skeleton
from llvmlite import binding
from numba import njit, types

STEP_S = 0.004
RAMP_S, SETTLE_S = 4.0, 2.0
SLOPE_STEP_RAD = 1e-6

Views = tuple[Array, Array, Array, Array, Array]
_LIBRARY = next(Path(mujoco.__file__).parent.glob("libmujoco*"))
ctypes.CDLL(str(_LIBRARY), mode=ctypes.RTLD_GLOBAL)
binding.load_library_permanently(str(_LIBRARY))
_step = types.ExternalFunction("mj_step", types.void(types.uintp, types.uintp))


def mjcf(bones: Skeleton, body: Any) -> str:
    """Return nested bodies hanging along −z with a hinge each; bodies before the first hinge are fixed to the world."""
    root = ElementTree.Element("mujoco")
    ElementTree.SubElement(root, "compiler", angle="radian")
    option = ElementTree.SubElement(
        root, "option", integrator="discrete", timestep=repr(STEP_S), jacobian="dense"
    )
    ElementTree.SubElement(option, "flag", contact="disable", energy="disable")
    parent = ElementTree.SubElement(root, "worldbody")
    for j, axis in enumerate(bones.axes):
        parent = ElementTree.SubElement(parent, "body", pos=_numbers(bones.offsets_m[j]))
        joint = ElementTree.SubElement(parent, "joint", type="hinge", axis=_numbers(axis))
        own_friction = body.joint_friction if bones.module[j] >= 0 else 0.0
        joint.set("damping", f"{AIR_DAMPING + body.drag:.9e}")
        joint.set("solreffriction", f"{2 * STEP_S} 1")
        joint.set("solimpfriction", "0.9999 0.9999 0.001 0.5 2")
        joint.set("frictionloss", f"{own_friction:.9e}")
        inertia = bones.inertias_kg_m2[j]
        ElementTree.SubElement(
            parent,
            "inertial",
            pos=_numbers(bones.centres_m[j]),
            mass=f"{bones.masses_kg[j]:.9e}",
            diaginertia=_numbers(np.array([inertia, inertia, 0.1 * inertia])),
        )
    return ElementTree.tostring(root, encoding="unicode")


def _numbers(values: Array) -> str:
    return " ".join(f"{value:.9e}" for value in values)


@njit(cache=True)
def _advance(
    handles: tuple[int, int],
    views: Views,
    drive: Drive,
    bones: Bones,
    before: Array,
    memory: Array,
    new: Array,
    f: Forms,
    viscous: Forms,
) -> None:
    """Make one MuJoCo step under the drive at its end; the memory follows MuJoCo's motion.

    Damping is MuJoCo's own, at the secant of its form `viscous`; `f` has none.
    """
    position, velocity, force, stiffness, damping = views
    wrap = wraps(position, bones.module, f)
    for j in range(len(position)):
        u, old, fresh = position[j], memory[j], new[j]
        at = with_wrap(drive, wrap[j])
        value = own(j, u, 0.0, STEP_S, at, old, fresh, bones, f)
        nearby = own(j, u + SLOPE_STEP_RAD, SLOPE_STEP_RAD, STEP_S, at, old, fresh, bones, f)
        slope = max((value - nearby) / SLOPE_STEP_RAD, 0.0)
        before[j] = u
        stiffness[j] = slope
        if bones.module[j] >= 0:
            damping[j] = bones.damping + viscous_torque(velocity[j], viscous)
        force[j] = value - drive.moment_n_m * bones.load_share[j] + slope * u
    _step(handles[0], handles[1])
    for j in range(len(position)):
        at = with_wrap(drive, wrap[j])
        own(j, position[j], position[j] - before[j], STEP_S, at, memory[j], new[j], bones, f)
        memory[j, :] = new[j]


@njit(cache=True)
def _follow(
    handles: tuple[int, int],
    views: Views,
    gravity: Array,
    inputs: Inputs,
    bones: Bones,
    memory: Array,
    cycles: float,
    f: Forms,
    viscous: Forms,
) -> tuple[Array, float]:
    """Simulate one run from rest: (t, n) angles and the specimen's number of cycles after it."""
    position, velocity, _, _, _ = views
    n, count = len(position), len(inputs.pressure)
    new, before = memory.copy(), np.zeros(n)
    position[:], velocity[:] = 0.0, 0.0
    ramp = round(RAMP_S / STEP_S)
    for k in range(ramp + round(SETTLE_S / STEP_S)):
        share = min(1.0, (k + 1) / ramp)
        # A turn of the bench is modelled by turning gravity.
        gravity[:] = share * inputs.gravity
        drive = ramped(inputs, share, cycles)
        _advance(handles, views, drive, bones, before, memory, new, f, viscous)
    healed(memory)
    supply = resting(inputs)
    angles = np.empty((count, n))
    angles[0] = position
    for i in range(1, count):
        span = inputs.time[i] - inputs.time[i - 1]
        parts = max(1, round(span / STEP_S))
        for k in range(1, parts + 1):
            cycles += cycle_increment(inputs, i, parts)
            drive = driven(inputs, i, k / parts, 0.0, STEP_S, supply, cycles, f)
            _advance(handles, views, drive, bones, before, memory, new, f, viscous)
        angles[i] = position
    return angles, cycles


def follow(robot: Robot, protocol: Protocol, truth: Any) -> list[Array]:
    """Return (t, n) hinge angles of every run, in order. Raises `RuntimeError` if the motion is not finite."""
    loaded = {}
    for kg in {run.payload_kg for run in protocol}:
        found = skeleton(robot, truth.body, kg)
        model = mujoco.MjModel.from_xml_string(mjcf(found, truth.body))
        loaded[kg] = model, mujoco.MjData(model), compile_bones(found, truth.body, swings=False)
    dry = truth.forms._replace(viscous=0.0)

    def simulate_run(inputs: Inputs, memory: Array, cycles: float) -> tuple[Array, float, bool]:
        model, data, bones = loaded[inputs.payload]
        handles = (model._address, data._address)
        views = (data.qpos, data.qvel, data.qfrc_applied, model.jnt_stiffness, model.dof_damping)
        mujoco.mj_resetData(model, data)
        found = _follow(handles, views, model.opt.gravity, inputs, bones, memory, cycles, dry, truth.forms)
        return *found, True

    return followed(protocol, truth, len(next(iter(loaded.values()))[2].masses), simulate_run)
