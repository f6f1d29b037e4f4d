"""Effects that give a number of a Python model another value: `parameter@stiffness`, `state@coulomb`."""

from __future__ import annotations

from dataclasses import dataclass

from pliant.errors import UserError
from pliant.interfaces.effect import AT, EffectConfig, EffectNotes, parameter
from pliant.interfaces.model import SystemEffect, SystemParts, effect_kind
from pliant_systems.python_file import PARAMETER, STATE


@dataclass(frozen=True)
class NamedValue:
    """A change of a model: a number by the kind of its place and its name."""

    place: str
    name: str
    value: float


class ModelValue(EffectConfig):
    """A number of the model at another value."""

    value: float = parameter(
        unit="1", neutral=0.0, bounds=(-1e300, 1e300), plausible=(-1.0, 1.0), example=1.0
    )
    """value of the parameter, in the unit of the file"""


class ParameterValueConfig(ModelValue):
    """A parameter at another value: ``parameter@stiffness``."""

    kind: str = effect_kind(PARAMETER)


class StateEffectConfig(ModelValue):
    """A declared effect of the state with a strength: ``state@coulomb``."""

    kind: str = effect_kind(STATE)


class ValueEffect(SystemEffect):
    """A number of the model's file at another value than the file states."""

    models = ("python",)
    config: ModelValue

    def act(self, parts: SystemParts) -> SystemParts:
        """Return the parts with the value."""
        name = self.config.kind.partition(AT)[2]
        if not name:
            raise UserError(
                f"effect '{self.config.kind}' needs the name of a number of the model's file: "
                f"'{self.config.kind}{AT}stiffness'"
            )
        return parts.with_change(NamedValue(self.place, name, self.config.value))


class ParameterValue(ValueEffect):
    """A parameter that differs from the file's value."""

    place = "parameter"
    config: ParameterValueConfig
    notes = EffectNotes(
        signature="a number of the model differs from its stated value.",
        inspection="measure the quantity itself.",
        excitation="do runs in which the quantity changes the motion.",
        where="models with PARAMETERS.",
    )


class StateEffect(ValueEffect):
    """An effect of the state that the file declares and leaves out by default."""

    place = "state"
    config: StateEffectConfig
    notes = EffectNotes(
        excitation="do runs in which the effect changes the motion.",
        where="models with MISSING.",
    )
