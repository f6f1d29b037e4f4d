"""Materials as symbols: strain energy densities that NGSolve differentiates.

A nearly incompressible law W = W_iso(F̄) + K/2 (J − 1)² is solved in its mixed form, with an independent pressure q:

    W_iso(F̄) + q (J − 1) − q²/(2K)

which does not lock however large K is, given elements that are stable for it.
Source: Holzapfel, Nonlinear Solid Mechanics (2000), §8.5 (perturbed Lagrangian).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pliant.errors import UserError
from pliant.interfaces.material import Material
from pliant_plugins.fem.ngsolve.library import ngs

LARGEST_POWER = 8  # of the stretches in Ogden's law


def is_mixed(material: Material) -> bool:
    """Whether the law is solved with an independent pressure. Raises `UserError` for a law without symbols."""
    kind = material.config.canonical()["kind"]
    if kind in COMPRESSIBLE:
        return False
    if kind not in ISOCHORIC:
        known = ", ".join(f"'{name}'" for name in ISOCHORIC)
        raise UserError(
            f"fem 'ngsolve' differentiates symbols and has none for material '{kind}'; it has {known}. Use one of "
            "these, or fem.kind 'skfem', which takes any material."
        )
    return True


def density(material: Material, F: Any, q: Any) -> Any:
    """Energy density (J/m³) of the deformation gradient F (3, 3) and, for a mixed law, the pressure q (Pa).

    Raises `UserError` for a law without symbols.
    """
    J = ngs.Det(F)
    if not is_mixed(material):
        return COMPRESSIBLE[material.config.canonical()["kind"]](material, F, J)
    isochoric = ISOCHORIC[material.config.canonical()["kind"]](material, F, J)
    return isochoric + q * (J - 1) - q * q / (2 * material.bulk_modulus_pa)


def _first(F: Any, J: Any) -> Any:
    """Ī₁ = J^(−2/3) F : F."""
    return J ** (-2 / 3) * ngs.InnerProduct(F, F)


def _second(F: Any, J: Any) -> Any:
    """Ī₂ = J^(−4/3) ½ ((F : F)² − C : C)."""
    I1, C = ngs.InnerProduct(F, F), F.trans * F
    return J ** (-4 / 3) * 0.5 * (I1 * I1 - ngs.InnerProduct(C, C))


def _neo_hookean(material: Material, F: Any, J: Any) -> Any:
    return material.shear_modulus_pa / 2 * (_first(F, J) - 3)


def _mooney_rivlin(material: Material, F: Any, J: Any) -> Any:
    constants: Any = material.config
    return constants.c10_pa * (_first(F, J) - 3) + constants.c01_pa * (_second(F, J) - 3)


def _yeoh(material: Material, F: Any, J: Any) -> Any:
    constants: Any = material.config
    x = _first(F, J) - 3
    return x * (constants.c10_pa + x * (constants.c20_pa + x * constants.c30_pa))


def _ogden(material: Material, F: Any, J: Any) -> Any:
    """Even powers only: Σ λ^2n = tr Cⁿ. Others need the stretches, whose slopes do not exist where two are equal."""
    constants: Any = material.config
    odd = [alpha for alpha in constants.alpha if alpha % 2 or abs(alpha) > LARGEST_POWER]
    if odd:
        raise UserError(
            f"fem 'ngsolve' differentiates Ogden's law for even powers up to ±{LARGEST_POWER} only, not for alpha = "
            f"{odd[0]:g}: other powers have no smooth symbols where two stretches are equal. Use fem.kind 'skfem'."
        )
    C = F.trans * F
    total = 0
    for mu, alpha in zip(constants.mu_pa, constants.alpha, strict=True):
        base = C if alpha > 0 else ngs.Inv(C)
        power = base
        for _ in range(int(abs(alpha)) // 2 - 1):
            power = power * base
        total = total + 2 * mu / alpha**2 * (J ** (-alpha / 3) * ngs.Trace(power) - 3)
    return total


def _ciarlet(material: Material, F: Any, J: Any) -> Any:
    """μ/2 (I₁ − 3 − 2 ln J) + λ/2 (ln J)², of the solid that the conformance checks use."""
    mu, K = material.shear_modulus_pa, material.bulk_modulus_pa
    log_j = ngs.log(J)
    return mu / 2 * (ngs.InnerProduct(F, F) - 3 - 2 * log_j) + (K - 2 / 3 * mu) / 2 * log_j * log_j


Law = Callable[[Material, Any, Any], Any]
ISOCHORIC: dict[str, Law] = {
    "neo_hookean": _neo_hookean,
    "mooney_rivlin": _mooney_rivlin,
    "yeoh": _yeoh,
    "ogden": _ogden,
}
COMPRESSIBLE: dict[str, Law] = {"ciarlet_sample": _ciarlet}
