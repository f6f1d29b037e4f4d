"""Config of the PyBullet engine."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.physics import PhysicsConfig
from pliant.units import Time


class PybulletConfig(PhysicsConfig):
    """``physics: {kind: pybullet}``."""

    kind: Literal["pybullet"] = "pybullet"
    timestep_s: Time = Field(
        1 / 2400,
        gt=0.0,
        description="longest internal step of `step`; stiff joints ask for shorter ones, which are then taken",
    )
    joint_damping: float = Field(
        1e-4,
        ge=0.0,
        description="viscous damping of every joint coordinate in `step`, N·m·s/rad; equilibria do not depend on it",
    )
    tolerance: float = Field(
        1e-8, gt=0.0, description="largest unbalanced effort of a settled chain, N·m (N on prismatic joints)"
    )
    settle_timestep_s: Time = Field(
        0.02, gt=0.0, description="pseudo-time step of the relaxation in `settle`; inertia is scaled to it"
    )
    max_settle_steps: int = Field(20000, ge=1, description="steps after which `settle` gives up")
