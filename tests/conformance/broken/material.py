"""A good compressible solid, and the ways to get its derivatives and symmetries wrong."""

from dataclasses import replace
from typing import Literal

import numpy as np

from broken import Variants
from pliant.interfaces.material import Hyperelastic
from pliant.records.design import Array
from pliant.registry.component import Component
from pliant.testing.stand_ins import Ciarlet, CiarletConfig


class SolidConfig(CiarletConfig):
    """Lamé constants."""

    kind: Literal["small"] = "small"


class Solid(Ciarlet):
    """The stand-in solid under a kind of its own."""


variants = Variants(
    Component("material", "small", "broken.material:SolidConfig", "broken.material:Solid", "a small solid")
)
UNIT = np.eye(3)


@variants.by("stress_free_at_rest", "stress at F = I is not zero")
class Prestressed(Solid):
    """P with a constant."""

    def evaluate(self, F: Array) -> Hyperelastic:
        good = super().evaluate(F)
        return replace(good, stress=good.stress + 100.0 * UNIT)


@variants.by("energy_is_positive", "energy of a deformed state is -")
class NegativeEnergy(Solid):
    """−W."""

    def energy(self, F: Array) -> Array:
        return -super().energy(F)


@variants.by("stress_is_the_energys_slope", "P differs from the finite difference of W")
class MissingTerm(Solid):
    """P without its volumetric part."""

    def evaluate(self, F: Array) -> Hyperelastic:
        good = super().evaluate(F)
        G = np.swapaxes(np.linalg.inv(F), -1, -2)
        log_j = np.log(np.linalg.det(F))[..., None, None]
        return replace(good, stress=good.stress - self.config.lame_pa * log_j * G)


@variants.by("tangent_is_the_stress_slope", "A differs from the finite difference of P")
class FrozenTangent(Solid):
    """A of the rest state everywhere."""

    def evaluate(self, F: Array) -> Hyperelastic:
        good = super().evaluate(F)
        rest = super().evaluate(np.broadcast_to(UNIT, F.shape))
        return replace(good, tangent=rest.tangent)


@variants.by("tangent_is_symmetric", "A_ijkl ≠ A_klij")
class CrossedIndices(Solid):
    """A with its last two indices swapped."""

    def evaluate(self, F: Array) -> Hyperelastic:
        good = super().evaluate(F)
        return replace(good, tangent=np.swapaxes(good.tangent, -1, -2))


@variants.by("ignores_rotations_of_the_frame", "W changes under a rotation")
class SmallStrain(Solid):
    """W of the linear strain."""

    def energy(self, F: Array) -> Array:
        strain = (F + np.swapaxes(F, -1, -2)) / 2 - UNIT
        return self.config.shear_modulus_pa * np.einsum("...ij,...ij->...", strain, strain)


@variants.by("is_isotropic", "depends on the material's orientation")
class Fibres(Solid):
    """W with fibres along x."""

    def energy(self, F: Array) -> Array:
        stretch = np.einsum("...i,...i->...", F[..., 0], F[..., 0])
        return super().energy(F) + 1e4 * (stretch - 1) ** 2


@variants.by("is_stiff_at_rest", "smallest stiffness is -")
class SoftShear(Solid):
    """A negative shear modulus in the tangent."""

    def evaluate(self, F: Array) -> Hyperelastic:
        good = super().evaluate(F)
        unit = np.einsum("ik,jl->ijkl", UNIT, UNIT)
        return replace(good, tangent=good.tangent - 2 * self.config.shear_modulus_pa * unit)


@variants.by("states_its_moduli", "A at rest is not that of μ = 100000 Pa")
class LameForBulk(Solid):
    """λ where K is asked for."""

    @property
    def bulk_modulus_pa(self) -> float:
        return self.config.lame_pa


@variants.by("remarks_are_sentences", "a remark is 'soft', not a sentence")
class Mumbles(Solid):
    """A remark of one word."""

    def remarks(self) -> tuple[str, ...]:
        return ("soft",)


@variants.by("takes_points_of_any_shape", "IndexError|shape|ValueError")
class FlatOnly(Solid):
    """Only (n, 3, 3)."""

    def evaluate(self, F: Array) -> Hyperelastic:
        return super().evaluate(F.reshape(-1, 3, 3))


@variants.by("leaves_its_input_alone", "changed in place")
class Writes(Solid):
    """Scales F in place."""

    def energy(self, F: Array) -> Array:
        good = super().energy(F)
        F *= 1.001
        return good


class GramsConfig(SolidConfig):
    """The density in g/cm³."""

    density_kg_m3: float = 1.15


variants.add("has_a_density", "no solid has that", config="broken.material:GramsConfig")
