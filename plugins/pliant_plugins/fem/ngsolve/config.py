"""Options of the NGSolve backend."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.fem import FemConfig


class NgsolveConfig(FemConfig):
    """Newton's tolerance is the strain, root mean square, that its last step adds; the error left is its square."""

    kind: Literal["ngsolve"] = "ngsolve"
    order: Literal[2, 3] = Field(
        default=3, description="polynomial order of displacements; pressures are one lower"
    )
    threads: int = Field(default=1, ge=1, le=256, description="threads that NGSolve's assembly uses")
    tolerance: float = Field(default=1e-6, gt=0, le=1e-3, description="strain of the last Newton step")
    max_iterations: int = Field(default=15, ge=2, le=200, description="Newton steps before a step is halved")
    max_halvings: int = Field(default=6, ge=0, le=20, description="how often a load step may be halved")
