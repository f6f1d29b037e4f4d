"""Base of the nearly incompressible laws: W = W_iso(F̄) + K/2 (J − 1)², F̄ = J^(−1/3) F.

K = 2μ₀ (1 + ν) / (3 (1 − 2ν)) from the shear modulus μ₀ and Poisson's ratio ν at small strain; Abaqus' D1 is 2/K.
"""

from __future__ import annotations

from functools import cached_property

from pydantic import Field

from pliant.interfaces.material import Material, MaterialConfig
from pliant.mechanics.homogeneous import INCOMPRESSIBLE_RATIO
from pliant.units import Ratio


class RubberConfig(MaterialConfig):
    """Density and Poisson's ratio; 0.49, the default, is softer in volume than rubber, 0.4995 the largest."""

    poisson_ratio: Ratio = Field(default=0.49, ge=0, le=INCOMPRESSIBLE_RATIO, description="ν at small strain")


class Rubber(Material):
    """A solid whose volume is held by K/2 (J − 1)²."""

    config: RubberConfig

    @cached_property
    def bulk_modulus_pa(self) -> float:
        nu = self.config.poisson_ratio
        return 2 * self.shear_modulus_pa * (1 + nu) / (3 * (1 - 2 * nu))


def check_stiff(shear_modulus_pa: float, formula: str, given: str) -> None:
    """Raise `ValueError`, for pydantic, where the shear modulus at rest is not positive."""
    if not shear_modulus_pa > 0:
        raise ValueError(
            f"the shear modulus at rest, {formula}, is {shear_modulus_pa:.6g} Pa with {given}; it must be positive, "
            "else the solid is unstable unloaded"
        )
