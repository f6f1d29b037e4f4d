"""Configuration of the evolutionary searches."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant_search.optimizer import OptimizerConfig


class DeConfig(OptimizerConfig):
    """Differential evolution (Storn, Price 1997): every member is challenged by a mixture of others."""

    kind: Literal["de"] = "de"
    population: int | None = Field(
        default=None, ge=4, le=10_000, description="members; by default 5 per coordinate, 12 to 60"
    )
    base: Literal["best", "rand"] = Field(
        default="best", description="member that differences are added to: the best, or any (slower, surer)"
    )
    step: float = Field(default=0.6, gt=0, le=2, description="F: factor of the differences")
    crossover: float = Field(
        default=0.7,
        ge=0,
        le=1,
        description="CR: share of the coordinates that a challenger takes from the mixture",
    )


class Nsga2Config(OptimizerConfig):
    """NSGA-II (Deb and others, 2002): survival of the undominated, sparse regions of the front first."""

    kind: Literal["nsga2"] = "nsga2"
    population: int = Field(default=40, ge=4, le=10_000, description="members of a generation")
