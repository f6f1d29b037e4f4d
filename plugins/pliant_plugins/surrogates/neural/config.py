"""What a study may say about a neural surrogate."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.surrogate import SurrogateConfig


class NeuralConfig(SurrogateConfig):
    """A law from a small network of an energy, fitted to states or to a table, of one to three axes."""

    kind: Literal["neural"] = "neural"
    units: int = Field(default=48, ge=4, le=256, description="units of the network's one hidden layer")
    seed: int = Field(default=0, ge=0, description="of the start and of the parts that are left out")
