"""Config of the MuJoCo engine."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.physics import PhysicsConfig
from pliant.units import Length, Time


class MujocoConfig(PhysicsConfig):
    """``physics: {kind: mujoco}``."""

    kind: Literal["mujoco"] = "mujoco"
    timestep_s: Time = Field(
        1.5e-2,
        gt=0.0,
        description="longest internal step h of `step`; its implicit integrator damps motion of angular "
        "frequency ω by ω² h / 2 per second",
    )
    joint_damping: float = Field(
        3e-4,
        ge=0.0,
        description="viscous damping of every joint coordinate in `step`, N·m·s/rad; equilibria do not depend on it",
    )
    bare_keys = ("drag_1_s",)
    drag_1_s: float = Field(
        7.0,
        ge=0.0,
        description="resistance to all motion of a chain alone in proportion to its mass, 1/s: its swings decay as "
        "exp(−drag t / 2), its equilibria stay. It makes steps of 15 ms end near equilibrium and is no property of "
        "a body: with 0 (and joint_damping 0) the chain has its own dynamics, that of its inertia, law and effects",
    )
    tolerance: float = Field(
        1e-9, gt=0.0, description="largest unbalanced effort of a settled chain, N·m (N on prismatic joints)"
    )
    settle_timestep_s: Time = Field(
        0.05, gt=0.0, description="pseudo-time step of the relaxation in `settle`"
    )
    max_settle_steps: int = Field(10000, ge=1, description="steps after which `settle` gives up")
    contact_timestep_s: Time = Field(
        2e-3,
        gt=0.0,
        description="longest internal step in a scene while an arm is near an object or an object moves; "
        "else it is `timestep_s`",
    )
    near_m: Length = Field(
        1e-3,
        gt=0.0,
        description="arm and object are near within this distance; steps are so short that none is jumped over",
    )
    contact_stiffness: float = Field(
        1e4,
        gt=0.0,
        description="stiffness of contacts per effective mass, 1/s²: softer ones need no shorter steps",
    )
    contact_damping: float = Field(400.0, gt=0.0, description="damping of contacts per effective mass, 1/s")
    slip_damping: float = Field(
        50.0,
        gt=0.0,
        description="damping of friction per effective mass, 1/s: sliding objects are lifted off in proportion to "
        "it, what is held creeps at a speed inverse to it",
    )
    contact_impedance: float = Field(
        0.95, gt=0.0, lt=1.0, description="MuJoCo's solimp: the closer to 1, the harder the contact"
    )
    impratio: float = Field(
        1000.0,
        gt=0.0,
        description="MuJoCo's ratio of frictional to normal impedance: what is held creeps at a speed inverse to it",
    )
    noslip_iterations: int = Field(
        0, ge=0, description="MuJoCo's iterations against creep after each contact solve"
    )
