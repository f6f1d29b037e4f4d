"""What a study may say about CMA-ES."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.optimizer import OptimizerConfig


class CmaesConfig(OptimizerConfig):
    """Covariance matrix adaptation: for one objective and up to some dozens of variables, from some hundreds of
    candidates on.

    A run that has converged before the budget is spent is followed by another one, from a random place.
    """

    kind: Literal["cmaes"] = "cmaes"
    sigma: float = Field(
        default=0.3,
        gt=0,
        le=1,
        description="standard deviation at first, as a share of each variable's range; 0.1 at most of a robust search "
        "that begins at the nominal design",
    )
    population: int | None = Field(
        default=None, ge=4, le=10_000, description="candidates of a generation; by default 4 + ⌊3 ln n⌋"
    )
    restarts: int = Field(
        default=0,
        ge=0,
        le=12,
        description="how many of the runs that follow double the population (IPOP); later ones keep it",
    )
