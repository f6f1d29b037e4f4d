"""A correct compressible solid, and variants with wrong derivatives and symmetries."""

from dataclasses import replace
from typing import Any, Literal

import numpy as np
from tests.conformance.broken import Variants

from pliant.interfaces.material import Hyperelastic
from pliant.records.design import Array
from pliant.registry.component import Component
from pliant.testing.stand_ins import Ciarlet, CiarletConfig

UNIT = np.eye(3)


class SolidConfig(CiarletConfig):
    """Lamé constants."""

    kind: Literal["small"] = "small"


class Solid(Ciarlet):
    """The stand-in solid registered under a different kind."""


class GramsConfig(SolidConfig):
    """The density in g/cm³."""

    density_kg_m3: float = 1.15


variants = Variants(
    Component("material", "small", f"{__name__}:SolidConfig", f"{__name__}:Solid", "a small solid")
)
broken = variants.row_adder(Solid)
variants.add("has_a_density", config=f"{__name__}:GramsConfig")


def _without_volume(up: Any, self: Any, F: Array) -> Hyperelastic:
    G, log_j = np.swapaxes(np.linalg.inv(F), -1, -2), np.log(np.linalg.det(F))[..., None, None]
    return replace(up(F), stress=up(F).stress - self.config.lame_pa * log_j * G)


def _linear_strain_stress(up: Any, self: Any, F: Array) -> Array:
    strain = (F + np.swapaxes(F, -1, -2)) / 2 - UNIT
    return np.asarray(self.config.shear_modulus_pa * np.einsum("...ij,...ij->...", strain, strain))


def _with_fibres(up: Any, self: Any, F: Array) -> Array:
    return np.asarray(up(F) + 1e4 * (np.einsum("...i,...i->...", F[..., 0], F[..., 0]) - 1) ** 2)


def _soft_in_shear(up: Any, self: Any, F: Array) -> Hyperelastic:
    unit = np.einsum("ik,jl->ijkl", UNIT, UNIT)
    return replace(up(F), tangent=up(F).tangent - 2 * self.config.shear_modulus_pa * unit)


def _scaling_in_place(up: Any, self: Any, F: Array) -> Array:
    energy: Array = up(F)
    F *= 1.001
    return energy


broken("stress_free_at_rest", evaluate=lambda up, self, F: replace(up(F), stress=up(F).stress + 100.0 * UNIT))
broken("energy_is_positive", energy=lambda up, self, F: -up(F))
broken("stress_is_the_energys_slope", evaluate=_without_volume)
broken(
    "tangent_is_the_stress_slope",
    evaluate=lambda up, self, F: replace(up(F), tangent=up(np.broadcast_to(UNIT, F.shape)).tangent),
)
broken(
    "tangent_is_the_stress_slope",
    evaluate=lambda up, self, F: replace(up(F), tangent=np.swapaxes(up(F).tangent, -1, -2)),
)
broken("is_frame_indifferent", energy=_linear_strain_stress)
broken("is_isotropic", energy=_with_fibres)
broken("states_its_moduli", evaluate=_soft_in_shear)
broken("states_its_moduli", shear_modulus_pa=property(lambda self: -self.config.shear_modulus_pa))
broken("states_its_moduli", bulk_modulus_pa=property(lambda self: self.config.lame_pa))
broken("remarks_are_sentences", remarks=lambda up, self: ("soft",))
broken("accepts_points_in_any_shape", evaluate=lambda up, self, F: up(F.reshape(-1, 3, 3)))
broken("leaves_its_input_alone", energy=_scaling_in_place)
