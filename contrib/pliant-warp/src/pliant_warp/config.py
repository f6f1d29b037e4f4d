"""Config of the engine."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant_plugins.physics.mujoco.config import MujocoConfig


class MujocoWarpConfig(MujocoConfig):
    """``physics: {kind: mujoco_warp}``: the settings of `mujoco`, and those of its batches."""

    kind: Literal["mujoco_warp"] = "mujoco_warp"  # type: ignore[assignment]
    device: str = Field(
        "auto",
        description="Warp's name of the device, 'cuda:0' or 'cpu'; 'auto': the first GPU, else the CPU",
    )
    batch_tolerance: float = Field(
        1e-6,
        gt=0.0,
        description="largest unbalanced effort of a chain that settled in a batch, N·m: numbers there have single "
        "precision",
    )
    batch_steps: int = Field(4000, ge=1, description="pseudo-time steps after which a batch gives up")
