"""Config of the PyBullet engine."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from pliant.interfaces.physics import PhysicsConfig
from pliant.units import Ratio, Time

BULLET_MEMORY = 0.02  # Bullet's own


class PybulletConfig(PhysicsConfig):
    """``physics: {kind: pybullet}``."""

    kind: Literal["pybullet"] = "pybullet"
    preset: Literal["pliant", "published"] = Field(
        "pliant",
        description="`published` steps a chain as the published study did (friction motors, naive torques, one law "
        "call per joint and axis, fixed steps), as a baseline for benchmarks; scenes and `settle` support only "
        "`pliant`",
    )
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
    world_scale: float = Field(
        10.0,
        gt=0.0,
        description="how many times longer everything is inside Bullet in a scene; its contact margins suit metres",
    )
    friction_anchors: bool = Field(
        True, description="contacts in a scene remember where they began to stick and are pulled back there"
    )
    solver_iterations: int = Field(50, ge=1, description="iterations of the contact solver at every step")
    contact_memory: Ratio = Field(
        BULLET_MEMORY,
        gt=0.0,
        description="Bullet's contact breaking threshold: how far, as a share of a shape's size, bodies may slide "
        "before a stored contact point is dropped. Until then the force acts at the old point: 1e-5 where bodies roll "
        "or slide slowly on each other",
    )

    def canonical(self) -> dict[str, Any]:
        """Return the JSON values, without the default memory, so that keys of earlier studies stay equal."""
        return {k: v for k, v in super().canonical().items() if (k, v) != ("contact_memory", BULLET_MEMORY)}
