"""A third source of truth, which shares no equation with the other two: an elastic rod in MuJoCo, pulled by a tendon.

Eight short bodies with MuJoCo's springs, damping, dry friction and limits; a spatial tendon runs along them through
sites, and its tension is the drive; the load is a moment at the tip. All motion is `mujoco.rollout`: the test bed
provides only the inputs. The rod is not a joint with a law: the study's law and the weight that acts on the joint are
fitted to the clean rod at rest (`fitted`), as for a real rod on a bench.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import mujoco
import numpy as np
from benchmarks.evidence.forms import LOWEST_SHARE, NODE_SHARE, SHARE_NODES
from benchmarks.evidence.protocols import LOAD_N_M, Run
from benchmarks.evidence.robots import GRAVITY_M_S2, PRESSURE_MAX_PA, Array
from mujoco import rollout
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

PARTS, LENGTH_M, MASS_KG, ARM_M = 8, 0.080, 0.003, 0.010
STIFFNESS_N_M, PULL_N, RELAXES_S = 0.028, 2.2, 1e-3  # of the whole rod per rad; the tendon's largest tension
STEP_S, SETTLE_S = 0.01, 6.0
# Of a stop of strength 1 per N m/rad of the springs: what it takes to be felt, in MuJoCo's units of acceleration.
STOP_1_S2, STOP_1_S = 1e6, 1e4


@dataclass(frozen=True)
class Rod:
    """Hidden parameters of a rod; the defaults are a clean one.

    Attributes:
        rod_stiffness, rod_arm: relative changes of springs and of the tendon's arm.
        rod_damping_s: damping over stiffness; rod_friction_n_m: dry friction in every joint.
        rod_lag_s: of the actuator's filter.
        rod_limit_rad: of the whole bend, at which every joint reaches its stop; rod_stop: stiffness of the stop, 0
            without one.
        rod_pull: error of the tendon's pull over its largest, at the nodes of `law_shapes.draw_pull`; empty: none.
    """

    rod_stiffness: float = 0.0
    rod_arm: float = 0.0
    rod_damping_s: float = 0.0
    rod_friction_n_m: float = 0.0
    rod_lag_s: float = 0.0
    rod_limit_rad: float = 0.45
    rod_stop: float = 0.0
    rod_pull: tuple[float, ...] = ()


# Kinds that a rod can have: the largest strength, the field and its value at strength 1, whether it has either sign.
CHANGES: Mapping[str, tuple[float, str, float, bool]] = {
    "stiffness": (4.0, "rod_stiffness", 0.12, True),
    "actuation_gain": (5.0, "rod_arm", 0.07, True),
    "viscous_damping": (20.0, "rod_damping_s", 0.2, False),
    "friction_hysteresis": (6.0, "rod_friction_n_m", 1e-3, False),
    "supply_lag": (8.0, "rod_lag_s", 0.2, False),
    "self_contact": (10.0, "rod_stop", 0.3, False),
}
LIMITS_RAD = (0.3, 0.45)
NAMES = tuple(field.name for field in fields(Rod))


def mjcf(rod: Rod) -> str:
    """Return the rod, hanging along −z; its joints bend the tip toward +x."""
    part = LENGTH_M / PARTS
    arm = ARM_M * (1 + rod.rod_arm)
    spring = PARTS * STIFFNESS_N_M * (1 + rod.rod_stiffness)
    joint = (
        f'stiffness="{spring:.9g}" damping="{spring * (RELAXES_S + rod.rod_damping_s):.9g}" armature="1e-7"'
    )
    joint += f' frictionloss="{rod.rod_friction_n_m:.9g}" solreffriction="{2 * STEP_S} 1"'
    joint += ' solimpfriction="0.9999 0.9999 0.001 0.5 2"'
    if rod.rod_stop > 0.0:  # a spring beyond the limit: MuJoCo's soft constraint with its own stiffness
        joint += f' limited="true" range="-3 {rod.rod_limit_rad / PARTS:.9g}" solimplimit="0 0.95 0.05 0.5 2"'
        joint += f' solreflimit="{-spring * rod.rod_stop * STOP_1_S2:.9g} {-STOP_1_S * spring:.9g}"'
    lines = [f'<site name="s0" pos="{arm:.9g} 0 0"/>']
    for i in range(PARTS):
        place = -part / 2 if i == 0 else -part
        piece = part if i < PARTS - 1 else part / 2
        lines.append(f'<body pos="0 0 {place:.9g}"><joint type="hinge" axis="0 -1 0" {joint}/>')
        mass = MASS_KG * piece / LENGTH_M
        lines.append(f'<geom type="capsule" size="0.006" fromto="0 0 0 0 0 {-piece:.9g}" mass="{mass:.9g}"/>')
        lines.append(f'<site name="s{i + 1}" pos="{arm:.9g} 0 {-part / 2:.9g}"/>')
    lines.append(f'<site name="tip" pos="0 0 {-part / 2:.9g}"/>' + "</body>" * PARTS)
    sites = "".join(f'<site site="s{i}"/>' for i in range(PARTS + 1))
    filtered = f'dyntype="filterexact" dynprm="{rod.rod_lag_s:.9g}"' if rod.rod_lag_s > 0.0 else ""
    option = f'<option timestep="{STEP_S}" integrator="discrete"><flag contact="disable" energy="disable"/></option>'
    return (
        f'<mujoco><compiler angle="radian"/>{option}<worldbody>{"".join(lines)}</worldbody>'
        f'<tendon><spatial name="pull">{sites}</spatial></tendon>'
        f'<actuator><general tendon="pull" gainprm="{-PULL_N / PRESSURE_MAX_PA:.9g}" {filtered}/>'
        '<general site="tip" gear="0 0 0 0 1 0"/></actuator>'
        '<sensor><framepos objtype="site" objname="tip"/></sensor></mujoco>'
    )


def follow(runs: Sequence[Run], rod: Rod) -> list[dict[str, Array]]:
    """Return `angle_rad` and the tip of every run, (t,) each.

    Raises:
        RuntimeError: the motion is not finite.
    """
    model = mujoco.MjModel.from_xml_string(mjcf(rod))
    data = mujoco.MjData(model)
    return [_followed(model, data, run, rod) for run in runs]


def _followed(model: Any, data: Any, run: Run, rod: Rod) -> dict[str, Array]:
    model.opt.gravity[:] = Rotation.from_euler("xyz", run.base_angles_rad).inv().apply([0, 0, -GRAVITY_M_S2])
    settle = round(SETTLE_S / STEP_S)
    ends = settle + np.rint(run.time_s / STEP_S).astype(int)
    clock = np.arange(1, ends[-1] + 1) * STEP_S - SETTLE_S
    ramp = np.minimum(1.0, 2.0 * np.arange(1, settle + 1) / settle)
    drive = np.interp(clock, run.time_s, _in_the_tube(run)), np.interp(clock, run.time_s, run.moment_n_m)
    control = np.column_stack(drive)
    if rod.rod_pull:
        nodes = LOWEST_SHARE + NODE_SHARE * np.arange(SHARE_NODES)
        control[:, 0] += PRESSURE_MAX_PA * np.interp(control[:, 0] / PRESSURE_MAX_PA, nodes, rod.rod_pull)
    control[:settle] *= ramp[:, None]
    start = np.zeros((1, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    states, sensed = rollout.rollout(model, data, start, control[None])
    angle, tip = states[0, ends - 1, 1 : 1 + PARTS].sum(axis=1), sensed[0, ends - 1]
    if not np.isfinite(angle).all() or np.abs(angle).max() > 3.0:
        raise RuntimeError(f"run '{run.condition}' of the rod did not go well")
    return {"angle_rad": angle, **{f"tip_{axis}_m": tip[:, k] for k, axis in enumerate("xyz")}}


def _in_the_tube(run: Run) -> Array:
    """Return the commanded drive; while the valve is closed, the last value before."""
    drive = run.pressure_pa.copy()
    for i in np.flatnonzero(run.valve < 0.5):
        drive[i] = drive[i - 1]
    return drive


@cache
def fitted() -> tuple[tuple[float, float, float, float], float]:
    """Fit (k_n, m_a, m_e, b_e) of a single joint's law and the module's mass, kg, to the clean rod at rest."""
    hold = np.ones(12)
    grid = [(p, m, 0.0) for p in np.linspace(0, 1, 7) for m in (-1.0, 0.0, 1.0)]
    grid += [(p, 0.0, pitch) for p in np.linspace(0, 1, 7) for pitch in (np.pi / 2, -np.pi / 2)]
    runs = [
        Run(
            "at rest", "A", p * PRESSURE_MAX_PA * hold, m * LOAD_N_M * hold, base_angles_rad=(0.0, pitch, 0.0)
        )
        for p, m, pitch in grid
    ]
    u = np.array([read["angle_rad"][-1] for read in follow(runs, Rod())])
    p, load, pitch = (np.array([float(x) for x in column]) for column in zip(*grid, strict=True))

    def unbalance(x: Array) -> Array:
        torque = x[0] * p + x[1] * p * u - x[2] * u * np.abs(u) / 2 - x[3] * u
        weight = 0.5 * x[4] * MASS_KG * GRAVITY_M_S2 * LENGTH_M / 4 * np.sin(u - pitch)
        return (torque - load * LOAD_N_M - weight) / STIFFNESS_N_M

    x = least_squares(unbalance, [PULL_N * ARM_M, 0.0, 0.0, STIFFNESS_N_M, 1.3]).x
    k_n, m_a, m_e, b_e = x[0] / PRESSURE_MAX_PA, x[1] / PRESSURE_MAX_PA, x[2], x[3]
    return (float(k_n), float(m_a), float(m_e), float(b_e)), float(x[4] * MASS_KG)
