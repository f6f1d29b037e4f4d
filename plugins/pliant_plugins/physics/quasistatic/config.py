"""Config of the quasi-static engine."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.physics import PhysicsConfig
from pliant.units import Time


class QuasistaticConfig(PhysicsConfig):
    """``physics: {kind: quasistatic}``."""

    kind: Literal["quasistatic"] = "quasistatic"
    tolerance: float = Field(
        1e-9,
        gt=0.0,
        description="largest unbalanced effort of a converged equilibrium, N·m (N on prismatic joints)",
    )
    max_iterations: int = Field(
        60,
        ge=1,
        description="Newton iterations on one load level before the path to it is cut in smaller steps",
    )
    max_turn: float = Field(
        0.5,
        gt=0.0,
        description="longest move of a joint per iteration, in rad (prismatic joints: share of the module length)",
    )
    smallest_step: float = Field(
        1 / 256,
        gt=0.0,
        le=1.0,
        description="share of the path between two loads below which continuation gives up",
    )
    longest_step_s: Time = Field(
        1.0,
        gt=0.0,
        description="longest step in histories; samples further apart are reached in equal parts",
    )
