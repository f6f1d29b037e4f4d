"""Material: a hyperelastic law."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

from pydantic import Field

from pliant.interfaces.base import ComponentConfig, Configured
from pliant.mechanics.homogeneous import stability_remarks
from pliant.records.design import Array
from pliant.units import Density


class MaterialConfig(ComponentConfig):
    """Base of a material's config: constants in Pa and the density."""

    density_kg_m3: Density = Field(default=1150.0, gt=0, description="mass per volume at rest")


@dataclass(frozen=True, eq=False)
class Hyperelastic:
    """Strain energy density and its derivatives at points of any shape (...,).

    Attributes:
        energy: (...,) W in J/m³.
        stress: (..., 3, 3) first Piola–Kirchhoff stress P = ∂W/∂F in Pa.
        tangent: (..., 3, 3, 3, 3) A = ∂P/∂F in Pa.
    """

    energy: Array
    stress: Array
    tangent: Array


class Material(Configured[MaterialConfig]):
    """An isotropic hyperelastic solid. FEM backends call `evaluate` with all quadrature points at once."""

    @property
    def density_kg_m3(self) -> float:
        return self.config.density_kg_m3

    @property
    @abstractmethod
    def shear_modulus_pa(self) -> float:
        """μ at small strain, Pa."""

    @property
    @abstractmethod
    def bulk_modulus_pa(self) -> float:
        """K at small strain, Pa: mixed elements weigh the pressure by it."""

    @abstractmethod
    def energy(self, F: Array) -> Array:
        """W(F) in J/m³, shape (...,), of deformation gradients F of shape (..., 3, 3)."""

    @abstractmethod
    def evaluate(self, F: Array) -> Hyperelastic:
        """W, P and A at deformation gradients F of shape (..., 3, 3); J = det F > 0 is the caller's duty."""

    def remarks(self) -> tuple[str, ...]:
        """What speaks against these constants, in sentences that the FEM stage and `pliant calibrate` say.

        By default the stretches between 0.5 and 2 at which the nominal stress of a homogeneous test falls.
        """
        return stability_remarks(self)
