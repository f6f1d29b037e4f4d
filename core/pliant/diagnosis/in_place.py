"""A candidate among effects that keep their values: what is fitted stands where a study has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pliant.diagnosis.candidates import Candidate
from pliant.errors import UserError
from pliant.interfaces.effect import EffectConfig
from pliant.records.design import Array
from pliant.registry.discovery import Registry


@dataclass(frozen=True)
class InPlace(Candidate):
    """Effects to fit in the order of a study, the others of the study between them.

    Attributes:
        fixed: the study's effects in their order, then those that it does not have yet.
        slots: for each effect that is fitted its place among `fixed`.
    """

    fixed: tuple[EffectConfig, ...] = ()
    slots: tuple[int, ...] = ()

    @staticmethod
    def among(registry: Registry, effects: Sequence[EffectConfig], kinds: Sequence[str]) -> InPlace:
        """Fit these kinds: in place those that the effects have, behind them the others.

        Raises:
            UserError: an unknown kind, or one that the effects have twice.
        """
        all_kinds = [effect.kind for effect in effects]
        for kind in kinds:
            if all_kinds.count(kind) > 1:
                raise UserError(
                    f"The study has the effect '{kind}' {all_kinds.count(kind)} times, so it is not clear which one "
                    "to fit; keep one of them."
                )
        plain = Candidate.of(registry, kinds)
        begun = plain.configs(plain.starts()[0])
        fixed = (*effects, *(config for config in begun if config.kind not in all_kinds))
        places = [effect.kind for effect in fixed]
        slots = tuple(places.index(kind) for kind in kinds)
        return InPlace(plain.kinds, plain.knobs, plain.models, fixed, slots)

    def configs(self, x: Array) -> tuple[EffectConfig, ...]:
        """All effects of the study, those that are fitted at x (k,)."""
        return self.with_values(self.values(x))

    def with_values(self, values: Mapping[str, float]) -> tuple[EffectConfig, ...]:
        """All effects of the study, those that are fitted at these values by ``kind.parameter``."""
        effects = list(self.fixed)
        for knob in self.knobs:
            slot = self.slots[knob.effect]
            effects[slot] = effects[slot].model_copy(update={knob.parameter.name: values[knob.name]})
        return tuple(effects)

    def present(self) -> Array:
        """(k,) x of the values that the effects have now."""
        return np.array(
            [k.x(float(getattr(self.fixed[self.slots[k.effect]], k.parameter.name))) for k in self.knobs]
        )
