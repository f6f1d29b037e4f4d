"""Options of the FEM backends."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pliant.interfaces.fem import FemConfig

# How the volume ratio enters: linear in each cell, continuous, or point by point.
Dilatation = Literal["cell", "continuous", "point"]


class SkfemConfig(FemConfig):
    """Newton's tolerance is the strain, root mean square, that its last step adds; the error left is its square."""

    kind: Literal["skfem"] = "skfem"
    linear_solver: Literal["auto", "pardiso", "superlu"] = Field(
        default="auto", description="auto: pardiso where pypardiso is installed, SuperLU otherwise"
    )
    dilatation: Dilatation = Field(
        default="cell",
        description="cell: volume ratio averaged per cell, no locking, the fast converged element; continuous: "
        "Taylor–Hood cells with a continuous pressure, an independent check at the same cost; point: plain "
        "displacement cells, which lock at ν near ½ (only to compare with codes that use them). Tetrahedra are "
        "Taylor–Hood cells for cell and continuous alike",
    )
    tolerance: float = Field(default=1e-6, gt=0, le=1e-3, description="strain of the last Newton step")
    max_iterations: int = Field(default=15, ge=2, le=200, description="Newton steps before a step is halved")
    max_halvings: int = Field(default=6, ge=0, le=20, description="how often a load step may be halved")


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
