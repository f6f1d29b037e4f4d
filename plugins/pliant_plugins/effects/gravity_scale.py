"""Weights that differ from the model's.

    g' = f g

for the pieces of the chain and its payload: masses are known worse than gravity (fittings, hoses, a density
from a data sheet), and in statics a mass and gravity enter only as their product, the weight.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, EffectParameter, Model, Place
from pliant.units import Ratio

BOUNDS = (0.0, 10.0)


class GravityScaleConfig(EffectConfig):
    """f, true weight / model's."""

    kind: Literal["gravity_scale"] = "gravity_scale"
    factor: Ratio = Field(default=1.0, ge=BOUNDS[0], le=BOUNDS[1], description="true weight / model's")


class GravityScale(Effect):
    """Scales the gravity of the chain."""

    place: ClassVar[Place] = "chain"
    parameters: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("factor", "1", neutral=1.0, bounds=BOUNDS, plausible=(0.8, 1.3)),
    )
    notes: ClassVar[EffectNotes] = EffectNotes(
        signature=(
            "the error changes with the orientation of the base, is largest with the chain held level, "
            "grows toward the base, and is gone where the chain lies on a table."
        ),
        look_alike="stiffness",
        told_apart=(
            "turn the base by 90° and 180°: the error of a weight turns with it, that of a stiffness stays."
        ),
        excited_by="repeat one pressure sweep with the base hanging, level and turned over.",
        where="chains that their weight or payload bends, every engine; a chain on a table does not show it.",
    )
    exciting: ClassVar[tuple[str, ...]] = ("level", "upside_down", "sideways")
    config: GravityScaleConfig

    def apply(self, model: Model) -> Model:
        """The model with its chain's gravity scaled."""
        gravity = self.config.factor * model.chain.gravity_m_s2
        return model.with_(chain=model.chain.with_(gravity_m_s2=gravity))
