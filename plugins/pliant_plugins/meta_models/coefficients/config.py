"""What a study may say about the meta-model of coefficients."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.meta_model import MetaModelConfig


class CoefficientsConfig(MetaModelConfig):
    """A network of 64, 64 and 32 units from the design's parameters to the coefficients of its law."""

    kind: Literal["coefficients"] = "coefficients"
    form: Literal["adaptive", "study"] = Field(
        default="adaptive", description="laws in a common form whose degree the states choose, or the study's"
    )
    activation: Literal["tanh", "relu"] = Field(default="tanh", description="relu as in the study")
    starts: int = Field(default=4, ge=1, le=32, description="random starts whose mean is taken")
    decay: float = Field(default=1e-3, ge=0, description="of the weights: how smooth the network is held")
    seed: int = Field(default=0, ge=0, description="of the random starts")
