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
from benchmarks.evidence.forms import Drive, Forms, effort, healed, lagged, virgin
from benchmarks.evidence.protocols import SAMPLE_S, Protocol, Run
from benchmarks.evidence.robots import GRAVITY_M_S2, PRESSURE_MAX_PA, Array, Robot
from llvmlite import binding
from numba import njit, types

STEP_S = 0.004
STEPS_PER_SAMPLE = round(SAMPLE_S / STEP_S)
RAMP_S, SETTLE_S = 4.0, 2.0
# Air and joint: a ringing joint comes to rest within a second; its torque is below 0.1 % of the peak.
AIR_DAMPING = 5e-5
SLOPE_STEP_RAD = 1e-6

_LIBRARY = next(Path(mujoco.__file__).parent.glob("libmujoco*"))
ctypes.CDLL(str(_LIBRARY), mode=ctypes.RTLD_GLOBAL)
binding.load_library_permanently(str(_LIBRARY))
_step = types.ExternalFunction("mj_step", types.void(types.uintp, types.uintp))


def mjcf(robot: Robot, body: Any) -> str:
    """Nested bodies hanging along −z, hinges about −y, so that positive angles turn the tip toward +x.

    A half module before joint 1 is fixed to the world. Fittings are point masses on the pieces.
    """
    root = ElementTree.Element("mujoco")
    ElementTree.SubElement(root, "compiler", angle="radian")
    option = ElementTree.SubElement(
        root, "option", integrator="discrete", timestep=repr(STEP_S), jacobian="dense"
    )
    ElementTree.SubElement(option, "flag", contact="disable", energy="disable")
    parent = ElementTree.SubElement(root, "worldbody")
    before = robot.length_m / 2
    for length, mass in zip(robot.piece_lengths_m, robot.piece_masses_kg, strict=True):
        parent = ElementTree.SubElement(parent, "body", pos=f"0 0 {-before:.9e}")
        joint = ElementTree.SubElement(parent, "joint", type="hinge", axis="0 -1 0")
        joint.set("damping", f"{AIR_DAMPING + body.joint_damping:.9e}")
        joint.set("solreffriction", f"{2 * STEP_S} 1")
        joint.set("solimpfriction", "0.9999 0.9999 0.001 0.5 2")
        joint.set("frictionloss", f"{body.joint_friction:.9e}")
        _add_inertia(parent, length, mass, body)
        before = length
    return ElementTree.tostring(root, encoding="unicode")


def _add_inertia(parent: ElementTree.Element, length: float, rod_kg: float, body: Any) -> None:
    """A uniform rod and a point mass as one inertia."""
    mass = rod_kg + body.fitting_kg
    arm, side = body.fitting_share * length, body.fitting_side_m
    down = (rod_kg * length / 2 + body.fitting_kg * arm) / mass
    aside = body.fitting_kg * side / mass
    about_joint = rod_kg * length**2 / 3 + body.fitting_kg * (arm**2 + side**2)
    inertia = about_joint - mass * (down**2 + aside**2)
    ElementTree.SubElement(
        parent,
        "inertial",
        pos=f"{aside:.9e} 0 {-down:.9e}",
        mass=f"{mass:.9e}",
        diaginertia=f"{inertia:.9e} {inertia:.9e} {0.1 * inertia:.9e}",
    )


@njit
def _advance(
    handles: tuple[int, int],
    views: tuple[Array, Array, Array, Array],
    drive: Drive,
    before: Array,
    memory: Array,
    new: Array,
    f: Forms,
) -> None:
    """One MuJoCo step under the drive at its end; memory goes along with the motion that MuJoCo makes."""
    position, _, force, stiffness = views
    for j in range(len(position)):
        u, old, fresh = position[j], memory[j], new[j]
        value = effort(u, 0.0, STEP_S, drive, old, fresh, f)
        nearby = effort(u + SLOPE_STEP_RAD, SLOPE_STEP_RAD, STEP_S, drive, old, fresh, f)
        slope = max((value - nearby) / SLOPE_STEP_RAD, 0.0)
        before[j] = u
        stiffness[j] = slope
        force[j] = value - drive.moment_n_m + slope * u
    _step(handles[0], handles[1])
    for j in range(len(position)):
        effort(position[j], position[j] - before[j], STEP_S, drive, memory[j], new[j], f)
        memory[j, :] = new[j]


@njit
def _follow(
    handles: tuple[int, int],
    views: tuple[Array, Array, Array, Array],
    gravity: Array,
    pressure: Array,
    load: Array,
    temperature: float,
    pitch: float,
    memory: Array,
    cycles: float,
    f: Forms,
) -> tuple[Array, float]:
    """One run from rest: (t, n) angles and the cycles that the specimen has done after it."""
    position, velocity, _, _ = views
    n, count = len(position), len(pressure)
    new, before = memory.copy(), np.zeros(n)
    position[:], velocity[:] = 0.0, 0.0
    ramp = round(RAMP_S / STEP_S)
    for k in range(ramp + round(SETTLE_S / STEP_S)):
        share = min(1.0, (k + 1) / ramp)
        # The bench turns, the world stays: gravity is turned back by the base's pitch about y.
        gravity[0] = share * GRAVITY_M_S2 * np.sin(pitch)
        gravity[2] = -share * GRAVITY_M_S2 * np.cos(pitch)
        drive = Drive(share * pressure[0], 0.0, temperature, share * load[0], 0.0, cycles)
        _advance(handles, views, drive, before, memory, new, f)
    healed(memory)
    supply = np.full(2, pressure[0])
    angles = np.empty((count, n))
    angles[0] = position
    for i in range(1, count):
        rise, more = pressure[i] - pressure[i - 1], load[i] - load[i - 1]
        for k in range(1, STEPS_PER_SAMPLE + 1):
            share = k / STEPS_PER_SAMPLE
            tube = lagged(supply, pressure[i - 1] + share * rise, STEP_S, f)
            cycles += abs(rise) / STEPS_PER_SAMPLE / (2.0 * PRESSURE_MAX_PA)
            time = (i - 1 + share) * SAMPLE_S
            drive = Drive(tube, rise / SAMPLE_S, temperature, load[i - 1] + share * more, time, cycles)
            _advance(handles, views, drive, before, memory, new, f)
        angles[i] = position
    return angles, cycles


def follow(robot: Robot, protocol: Protocol, truth: Any) -> list[Array]:
    """(t, n) joint angles of every run, in order; specimens keep what does not heal.

    Raises:
        RuntimeError: MuJoCo's motion is not finite.
    """
    model = mujoco.MjModel.from_xml_string(mjcf(robot, truth.body))
    data = mujoco.MjData(model)
    handles = (model._address, data._address)
    views = (data.qpos, data.qvel, data.qfrc_applied, model.jnt_stiffness)
    memories: dict[str, tuple[Array, float]] = {}
    angles = []
    for run in protocol:
        mujoco.mj_resetData(model, data)
        memory, cycles = memories.get(run.specimen, (virgin(robot.modules), 0.0))
        inputs = _inputs(run)
        followed, cycles = _follow(handles, views, model.opt.gravity, *inputs, memory, cycles, truth.forms)
        if not np.isfinite(followed).all():
            raise RuntimeError(f"MuJoCo truth: run '{run.condition}' diverged")
        memories[run.specimen] = (memory, cycles)
        angles.append(followed)
    return angles


def _inputs(run: Run) -> tuple[Array, Array, float, float]:
    return run.pressure_pa, run.moment_n_m, run.temperature_c, run.base_pitch_rad
