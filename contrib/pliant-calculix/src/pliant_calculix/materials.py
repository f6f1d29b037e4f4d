"""Materials as `*HYPERELASTIC` cards.

CalculiX and Abaqus write W = W_iso(F̄) + (J − 1)²/D₁, hence D₁ = 2/K (Abaqus Theory Guide, "Hyperelastic material
behavior"; CalculiX ccx manual, "*HYPERELASTIC"). Their Ogden law is Σ 2 μᵢ/αᵢ² (Σ λ̄^αᵢ − 3), as in `materials.ogden`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pliant.errors import UserError
from pliant.interfaces.material import Material

MOST_OGDEN_TERMS = 4  # ccx reads no more
Constant = tuple[float, bool]  # value, whether it is a stress in Pa
NO_TERM = 1e12  # a D that removes its power of J − 1: CalculiX replaces 0 by a default
PER_LINE = 8  # numbers on a data line


def hyperelastic(material: Material, pa: float) -> list[str]:
    """Return the card of a material and its data lines; `pa` is 1 Pa in the deck's unit of stress.

    Raises `UserError` for a law that the programs do not have.
    """
    material = material.resolved
    card = CARDS.get(material.config.kind)
    if card is None:
        raise UserError(
            f"fem 'calculix' has no card for material '{material.config.kind}'; use {', '.join(sorted(CARDS))}, "
            "or fem.kind 'skfem', which takes every law."
        )
    option, weights = card(material.config)
    constants = [c * pa if stress else c for c, stress in weights]
    d1 = 2 / (pa * material.bulk_modulus_pa)
    terms = int(option.rpartition("=")[2]) if option.startswith("OGDEN") else TERMS.get(option, 1)
    numbers = [f"{c:.10g}" for c in [*constants, d1, *[NO_TERM] * (terms - 1)]]
    rows = [", ".join(numbers[k : k + PER_LINE]) for k in range(0, len(numbers), PER_LINE)]
    return [f"*HYPERELASTIC, {option}", *rows]


TERMS = {"YEOH": 3}  # laws with several D


def _neo_hookean(config: Any) -> tuple[str, list[Constant]]:
    return "NEO HOOKE", [(config.shear_modulus_pa / 2, True)]


def _mooney_rivlin(config: Any) -> tuple[str, list[Constant]]:
    return "MOONEY-RIVLIN", [(config.c10_pa, True), (config.c01_pa, True)]


def _yeoh(config: Any) -> tuple[str, list[Constant]]:
    return "YEOH", [(c, True) for c in (config.c10_pa, config.c20_pa, config.c30_pa)]


def _ogden(config: Any) -> tuple[str, list[Constant]]:
    count = len(config.mu_pa)
    if count > MOST_OGDEN_TERMS:
        raise UserError(f"fem 'calculix' takes at most {MOST_OGDEN_TERMS} Ogden terms, not {count}.")
    pairs = zip(config.mu_pa, config.alpha, strict=True)
    return f"OGDEN, N={count}", [c for mu, alpha in pairs for c in ((mu, True), (alpha, False))]


CARDS: dict[str, Callable[[Any], tuple[str, list[Constant]]]] = {
    "neo_hookean": _neo_hookean,
    "mooney_rivlin": _mooney_rivlin,
    "yeoh": _yeoh,
    "ogden": _ogden,
}
