"""Ends that are held round: of the first and the last module only a share bends.

    τ'(p, u) = τ(p, u/s),      Π'(p, u) = s Π(p, u/s)

with s = s_b at the first joint of a chain and s_c at the last. A clamp or a glued cap keeps its section from becoming
oval, as the wall next to it has to in order to bend, and that dies out along the wall (end effects in tubes: Brazier,
Proc. R. Soc. A 116, 1927; Whatham, J. Pressure Vessel Technol. 108, 1986). What is left of the module is s of its length
under the same moment, so that it turns by s times the angle. Pieces and joints stay where they are. Full FEM of one to
eight bending modules: s_b = 0.97, s_c = 0.65 (docs/chain_of_modules.md).
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Literal

from pydantic import Field

from pliant.errors import UserError
from pliant.interfaces.effect import Effect, EffectConfig, EffectNotes, EffectParameter, Model, Place
from pliant.records.chain import ChainModel
from pliant.units import Ratio
from pliant_plugins.effects.short_law import ShortLaw

BOUNDS = (0.2, 1.5)
PLAUSIBLE = (0.5, 1.0)


class EndRestraintConfig(EffectConfig):
    """s_b and s_c."""

    kind: Literal["end_restraint"] = "end_restraint"
    base_share: Ratio = Field(
        default=1.0, ge=BOUNDS[0], le=BOUNDS[1], description="share of the first module that bends"
    )
    cap_share: Ratio = Field(
        default=1.0, ge=BOUNDS[0], le=BOUNDS[1], description="share of the last module that bends"
    )


class EndRestraint(Effect):
    """Shortens what bends at both ends of the chain."""

    place: ClassVar[Place] = "law"
    parameters: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("base_share", "1", neutral=1.0, bounds=BOUNDS, plausible=PLAUSIBLE),
        EffectParameter("cap_share", "1", neutral=1.0, bounds=BOUNDS, plausible=PLAUSIBLE),
    )
    notes: ClassVar[EffectNotes] = EffectNotes(
        signature=(
            "the joints at the clamp and at the cap bend too little by the same share at every pressure and load, "
            "those between them are right; the tip's turn is off by a constant, however many modules there are."
        ),
        look_alike="stiffness",
        told_apart=(
            "read every joint's angle: a stiffness is wrong in all of them, and without pressure only; held ends are "
            "wrong at the ends alone."
        ),
        excited_by=(
            "film a marker on every module through a slow pressure sweep, without a load and with loads either way."
        ),
    )
    exciting: ClassVar[tuple[str, ...]] = ("second_sensor", "passive_load_steps")
    config: EndRestraintConfig

    def apply(self, model: Model) -> Model:
        """The model with its end joints shortened. Raises `UserError` for a chain of one joint: both ends are it."""
        chain = model.chain
        if chain.n_joints < 2:
            raise UserError(
                "effect 'end_restraint' tells the ends of a chain from its middle and needs two joints or more; "
                "this chain has one. Take it out of 'effects', or raise 'chain.modules'."
            )
        first = _shortened(chain, 0, self.config.base_share)
        return model.with_(chain=_shortened(first, chain.n_joints - 1, self.config.cap_share))


def _shortened(chain: ChainModel, joint: int, share: float) -> ChainModel:
    """The chain with a law of its own at one joint; whole shares change nothing."""
    if share == 1.0:
        return chain
    laws = (*chain.laws, ShortLaw(chain.laws[chain.joints[joint].law], share))
    own = replace(chain.joints[joint], law=len(laws) - 1)
    return chain.with_(laws=laws, joints=(*chain.joints[:joint], own, *chain.joints[joint + 1 :]))
