"""A small simulation of MuJoCo models with effects, and models with one property each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

from pliant.interfaces.model import SystemParts
from pliant.records.design import Array
from pliant.registry.discovery import discover
from pliant_mjcf.changes import DriveChange, ModelChange, SpecChange, StateForce

REGISTRY = discover().for_model("mjcf")
# A rotor of inertia 0.01 kg m² (its mass at its axis weighs nothing), undamped.
ROTOR = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
<body name="arm"><joint name="hinge" axis="0 1 0" {joint}/>
<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body>
</worldbody>{more}</mujoco>"""
# A point of 1 kg hanging at 0.5 m, and beside it a second one.
PENDULA = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody>
<body name="left"><joint name="left_hinge" axis="0 1 0" {joint}/>
<inertial pos="0 0 -0.5" mass="1" diaginertia="0.01 0.01 0.01"/><site name="tip" pos="0 0 -0.5"/></body>
<body name="right" pos="1 0 0"><joint name="right_hinge" axis="0 1 0" {joint}/>
<inertial pos="0 0 -0.5" mass="1" diaginertia="0.01 0.01 0.01"/></body>
</worldbody></mujoco>"""


def rotor(joint: str = "", more: str = "") -> str:
    return ROTOR.format(joint=joint, more=more)


def pendula(joint: str = "") -> str:
    return PENDULA.format(joint=joint)


def effect(kind: str, **values: Any) -> Any:
    """Return an effect, with a pattern behind the @ of its kind."""
    component = REGISTRY.get("effect", kind)
    return REGISTRY.build("effect", component.config_model()(kind=kind, **values))


def changes(*effects: Any) -> tuple[Any, ...]:
    parts = SystemParts()
    for one in effects:
        parts = one.apply(parts)
    return parts.changes


def compiled(mjcf: str, *effects: Any) -> Any:
    """Return the compiled model with the effects' numbers."""
    spec = mujoco.MjSpec.from_string(mjcf)
    for one in changes(*effects):
        if isinstance(one, SpecChange):
            one.edit(spec)
    model = spec.compile()
    for one in changes(*effects):
        if isinstance(one, ModelChange):
            one.change(model)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def exported(mjcf: str, *effects: Any) -> Any:
    """Return the model of the file that the effects write."""
    spec = mujoco.MjSpec.from_string(mjcf)
    for one in changes(*effects):
        one.edit(spec)
    spec.compile()
    return mujoco.MjSpec.from_string(spec.to_xml()).compile()


@dataclass
class Motion:
    """Runs: positions and velocities (steps, r, n), and the effects' forces (steps, r, nv)."""

    model: Any
    q: Array
    v: Array
    force: Array = field(repr=False)
    sites: Array = field(repr=False)


Controls = Callable[[float], Sequence[float]]


def moved(
    mjcf: str,
    *effects: Any,
    seconds: float = 1.0,
    q: Sequence[Sequence[float]] = ((0.0,),),
    v: Sequence[Sequence[float]] | None = None,
    u: Controls | None = None,
    prescribed: Callable[[float], float] | None = None,
) -> Motion:
    """Return runs from rest at `q` or with velocities `v`; `prescribed` moves the first joint by hand instead."""
    model = compiled(mjcf, *effects)
    data = [mujoco.MjData(model) for _ in q]
    for one, start in zip(data, q, strict=True):
        one.qpos[: len(start)] = start
    for one, start in zip(data, v or (), strict=v is not None):
        one.qvel[: len(start)] = start
    forces = [c for c in changes(*effects) if isinstance(c, StateForce)]
    drives = [c for c in changes(*effects) if isinstance(c, DriveChange)]
    states: list[Any] = [force.start(model, _q(data), _v(data)) for force in forces]
    inner: list[Any] = [drive.start(model) for drive in drives]
    found: list[tuple[Array, Array, Array, Array]] = []
    step = model.opt.timestep
    for k in range(round(seconds / step)):
        if prescribed:
            for one in data:
                one.qpos[0], one.qvel[0] = (
                    prescribed(k * step),
                    (prescribed((k + 1) * step) - prescribed(k * step)) / step,
                )
        controls = np.tile(u(k * step), (len(data), 1)) if u else np.zeros((len(data), model.nu))
        for i, drive in enumerate(drives):
            controls, inner[i] = drive.advance(model, inner[i], _q(data), _v(data), controls, step)
        total = np.zeros((len(data), model.nv))
        for i, force in enumerate(forces):
            more, states[i] = force.advance(model, states[i], _q(data), _v(data), step)
            total += more
        found.append((_q(data), _v(data), total, np.array([one.site_xpos.copy() for one in data])))
        for one, f, c in zip(data, total, controls, strict=True):
            one.qfrc_applied[:], one.ctrl[:] = f, c
            mujoco.mj_step(model, one)
    return Motion(model, *(np.array(one) for one in zip(*found, strict=True)))


def _q(data: Sequence[Any]) -> Array:
    return np.array([one.qpos.copy() for one in data])


def _v(data: Sequence[Any]) -> Array:
    return np.array([one.qvel.copy() for one in data])
