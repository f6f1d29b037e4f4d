"""Yeoh solid: a cubic in the first invariant.

    W(F) = C10 (Ī₁ − 3) + C20 (Ī₁ − 3)² + C30 (Ī₁ − 3)³ + K/2 (J − 1)²,   μ₀ = 2 C10

Constants and their names as in Abaqus (`*HYPERELASTIC, YEOH`: C10, C20, C30, D1 = 2/K; its D2, D3 are left at zero).
Source: Yeoh, Rubber Chem. Technol. 66 (1993) 754; Holzapfel, Nonlinear Solid Mechanics (2000), §6.5.
"""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from pliant.interfaces.material import Hyperelastic
from pliant.records.design import Array
from pliant.units import Pressure
from pliant_plugins.materials.invariants import Slopes, invariants, response
from pliant_plugins.materials.rubber import Rubber, RubberConfig, check_stiff


class YeohConfig(RubberConfig):
    """C10, C20 and C30; with C20 = C30 = 0 it is the neo-Hookean law with μ = 2 C10."""

    kind: Literal["yeoh"] = "yeoh"
    c10_pa: Pressure = Field(description="C10, weighs Ī₁ − 3")
    c20_pa: Pressure = Field(default=0.0, description="C20, weighs (Ī₁ − 3)²; often negative")
    c30_pa: Pressure = Field(default=0.0, description="C30, weighs (Ī₁ − 3)³")

    @model_validator(mode="after")
    def _stiff_at_rest(self) -> Self:
        check_stiff(2 * self.c10_pa, "2 C10", f"C10 = {self.c10_pa:g} Pa")
        return self


class Yeoh(Rubber):
    """W(F) = C10 (Ī₁ − 3) + C20 (Ī₁ − 3)² + C30 (Ī₁ − 3)³ + K/2 (J − 1)²."""

    config: YeohConfig

    @property
    def shear_modulus_pa(self) -> float:
        return 2 * self.config.c10_pa

    def energy(self, F: Array) -> Array:
        J, I1, _ = invariants(F)
        return np.asarray(self._slopes(I1).energy + self.bulk_modulus_pa / 2 * (J - 1) ** 2)

    def evaluate(self, F: Array) -> Hyperelastic:
        J, I1, _ = invariants(F)
        return response(F, J, I1, None, self._slopes(I1), self.bulk_modulus_pa)

    def _slopes(self, I1: Array) -> Slopes:
        c10, c20, c30 = self.config.c10_pa, self.config.c20_pa, self.config.c30_pa
        x = I1 - 3
        energy = x * (c10 + x * (c20 + x * c30))
        return Slopes(energy, c10 + x * (2 * c20 + 3 * x * c30), 2 * c20 + 6 * c30 * x)
