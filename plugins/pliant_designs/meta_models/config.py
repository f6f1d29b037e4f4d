"""Configuration of the meta-models that ship with Pliant."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant_designs.meta_model import MetaModelConfig


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


Regressor = Literal["gaussian_process", "kernel_ridge", "polynomial"]


class RegressionConfig(MetaModelConfig):
    """Laws of all designs in one form; each of its numbers is a function of the design's parameters."""

    kind: Literal["regression"] = "regression"
    regressor: Literal["auto", "gaussian_process", "kernel_ridge", "polynomial"] = Field(
        default="auto", description="auto: the best on designs left out, by the effort's error"
    )
    inputs: Literal["logarithm", "plain"] = Field(
        default="logarithm", description="how positive parameters enter: by their logarithm or as they are"
    )


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
