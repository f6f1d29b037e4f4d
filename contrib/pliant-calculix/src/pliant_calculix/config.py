"""Options of the CalculiX backend."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from pliant.interfaces.fem import FemConfig
from pliant.units import Time

ElementType = Literal["C3D20", "C3D20R"]


class CalculixConfig(FemConfig):
    """Every state is a separate run from rest, in load increments that `ccx` chooses."""

    kind: Literal["calculix"] = "calculix"
    program: str = Field(default="ccx", description="name or path of the CalculiX program")
    element: ElementType = Field(
        default="C3D20R",
        description="C3D20R: eight integration points, no locking at ν near ½; C3D20: 27 points, locks there",
    )
    tolerance: float = Field(
        default=1e-7, gt=0, le=1e-2, description="largest residual force / mean force of the last iteration"
    )
    cap_stiffness: float = Field(
        default=1e-6,
        gt=0,
        le=1.0,
        description="modulus of the thin disc that closes the cavity / that of the material",
    )
    timeout_s: Time = Field(default=600.0, gt=0, description="longest run of one state")
    keep: Path | None = Field(default=None, description="folder in which decks and answers are kept")
