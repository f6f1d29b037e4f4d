"""Mooney–Rivlin solid.

    W(F) = C10 (Ī₁ − 3) + C01 (Ī₂ − 3) + K/2 (J − 1)²,   μ₀ = 2 (C10 + C01)

Constants and their names as in Abaqus (`*HYPERELASTIC, MOONEY-RIVLIN`: C10, C01, D1 = 2/K).
Source: Mooney, J. Appl. Phys. 11 (1940) 582; Rivlin (1948); Holzapfel, Nonlinear Solid Mechanics (2000), §6.5.
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


class MooneyRivlinConfig(RubberConfig):
    """C10 and C01; with C01 = 0 it is the neo-Hookean law with μ = 2 C10."""

    kind: Literal["mooney_rivlin"] = "mooney_rivlin"
    c10_pa: Pressure = Field(description="C10, weighs Ī₁ − 3")
    c01_pa: Pressure = Field(default=0.0, description="C01, weighs Ī₂ − 3")

    @model_validator(mode="after")
    def _stiff_at_rest(self) -> Self:
        given = f"C10 = {self.c10_pa:g} Pa and C01 = {self.c01_pa:g} Pa"
        check_stiff(2 * (self.c10_pa + self.c01_pa), "2 (C10 + C01)", given)
        return self


class MooneyRivlin(Rubber):
    """W(F) = C10 (Ī₁ − 3) + C01 (Ī₂ − 3) + K/2 (J − 1)²."""

    config: MooneyRivlinConfig

    @property
    def shear_modulus_pa(self) -> float:
        return 2 * (self.config.c10_pa + self.config.c01_pa)

    def energy(self, F: Array) -> Array:
        J, I1, I2 = invariants(F, second=True)
        return np.asarray(self._isochoric(I1, I2) + self.bulk_modulus_pa / 2 * (J - 1) ** 2)

    def evaluate(self, F: Array) -> Hyperelastic:
        J, I1, I2 = invariants(F, second=True)
        c10, c01 = (np.full(J.shape, c) for c in (self.config.c10_pa, self.config.c01_pa))
        slopes = Slopes(self._isochoric(I1, I2), c10, w2=c01)
        return response(F, J, I1, I2, slopes, self.bulk_modulus_pa)

    def _isochoric(self, I1: Array, I2: Array | None) -> Array:
        assert I2 is not None
        return self.config.c10_pa * (I1 - 3) + self.config.c01_pa * (I2 - 3)
