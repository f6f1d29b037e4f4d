"""What a study may say about the neural meta-model."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.meta_model import MetaModelConfig


class NeuralMetaConfig(MetaModelConfig):
    """One network of 2 × 64 units for all designs: of their energy, or of each axis' torque as in the study."""

    kind: Literal["neural"] = "neural"
    activation: Literal["smooth", "relu"] = Field(
        default="smooth",
        description="smooth: an energy, from values and slopes; relu: torques, as in the study",
    )
    units: int = Field(default=64, ge=4, le=256, description="units of each of the two hidden layers")
    steps: int = Field(default=2000, ge=10, le=20000, description="of the smooth network's training")
    decay: float = Field(default=1e-2, ge=0, description="of the weights: how smooth the network is held")
    seed: int = Field(default=0, ge=0, description="of the random start")
