"""What a study may say about the regression meta-model."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.meta_model import MetaModelConfig

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
