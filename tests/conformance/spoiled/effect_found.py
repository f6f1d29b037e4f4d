"""Effects that a diagnosis would not find: no run is named, a run shows nothing, a neighbour in disguise."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from pliant.interfaces.effect import EffectNotes, Model
from pliant.records.history import REFERENCE_TEMPERATURE_C, History
from spoiled.effect import Gain, spoils

CHECK = "is_found_when_injected"


@spoils.by(CHECK, r"declare exciting = \(.*slow_cycles")
class NamesNoRun(Gain):
    """Nobody knows how to show it."""

    exciting = ()


@spoils.by(CHECK, "'slow_cycle', which is no run of the menu; did you mean 'slow_cycles'")
class NamesAnotherRun(Gain):
    """A run that is not in the menu."""

    exciting = ("slow_cycle",)


@spoils.by(CHECK, "Nothing is missing.*These runs do not show it")
class ActsInTheWarmOnly(Gain):
    """A gain above the reference temperature, and no warm run among its own."""

    place = "input"

    def apply(self, model: Model) -> Model:
        gain = self.config.gain

        def warmed(history: History) -> History:
            share = 1.0 + (gain - 1.0) * (history.temperature_c > REFERENCE_TEMPERATURE_C + 5.0)
            return history.with_actuation(**{name: share * p for name, p in history.actuation.items()})

        return model.with_input(warmed)


@spoils.by(CHECK, "cannot tell it from actuation_gain, its look-alike")
class Disguised(Gain):
    """A factor on the pressure by another name, which says that its runs tell it from `actuation_gain`."""

    notes: ClassVar[EffectNotes] = replace(Gain.notes, look_alike="actuation_gain")
