"""Config of the MuJoCo engine."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.physics import PhysicsConfig
from pliant.units import Time


class MujocoConfig(PhysicsConfig):
    """``physics: {kind: mujoco}``."""

    kind: Literal["mujoco"] = "mujoco"
    timestep_s: Time = Field(
        2e-3,
        gt=0.0,
        description="longest internal step h of `step`; its implicit integrator damps motion of angular "
        "frequency ω by ω² h / 2 per second",
    )
    joint_damping: float = Field(
        1e-4,
        ge=0.0,
        description="viscous damping of every joint coordinate in `step`, N·m·s/rad; equilibria do not depend on it",
    )
    tolerance: float = Field(
        1e-9, gt=0.0, description="largest unbalanced effort of a settled chain, N·m (N on prismatic joints)"
    )
    settle_timestep_s: Time = Field(
        0.05, gt=0.0, description="pseudo-time step of the relaxation in `settle`"
    )
    max_settle_steps: int = Field(10000, ge=1, description="steps after which `settle` gives up")
