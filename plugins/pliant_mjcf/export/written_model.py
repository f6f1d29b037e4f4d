"""What an improved model becomes: a specification with all that MJCF can say, and the rest for the module."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from pliant.interfaces.effect import Effect
from pliant.interfaces.model import SystemParts
from pliant_mjcf.changes import DriveChange, ModelChange, SpecChange, StateForce
from pliant_mjcf.channels import Driven
from pliant_mjcf.export.mjcf_text import Key, changed_elements, mjcf_text
from pliant_mjcf.export.native_inputs import BEFORE_DRIVES, is_exact, write_native
from pliant_plugins.physics.mujoco.warned import silent
from pliant_systems.signals import InputEffect, driven_by


@dataclass(eq=False)
class Destination:
    """Where an effect is written.

    Attributes:
        elements: of the MJCF that it changed.
        exact: whether these mean the same as in the study, to rounding.
        module: whether a part of it, or all, is in the module.
    """

    elements: list[Key] = field(default_factory=list)
    exact: bool = True
    module: bool = False


@dataclass(eq=False)
class WrittenModel:
    """A specification with the effects that MJCF can say, and the remaining effects for the module.

    Attributes:
        spec: changed in place.
        inputs: of the study.
        places: where each effect is written, in their order.
    """

    spec: Any
    inputs: Sequence[Driven]
    places: list[Destination] = field(default_factory=list)
    numbers: list[ModelChange] = field(default_factory=list)
    forces: list[StateForce] = field(default_factory=list)
    drives: list[DriveChange] = field(default_factory=list)
    input_maps: list[Any] = field(default_factory=list)
    output_maps: list[Any] = field(default_factory=list)

    def write(self, effects: Sequence[Effect], parts: SystemParts, native: bool = True) -> None:
        """Write all effects: those of the model first, then those of inputs from the last one on.

        Args:
            effects: in the study's order.
            parts: the system without them.
            native: whether effects of inputs that agree to a sample only may be numbers of actuators.
        """
        self.places = [Destination() for _ in effects]
        made: list[Any] = [effect.apply(parts) for effect in effects]  # type: ignore[arg-type]
        for place, one in zip(self.places, made, strict=True):
            assert isinstance(one, SystemParts)
            before = self._text()
            for change in one.changes:
                self._write_change(change, place)
            place.elements += changed_elements(before, self._text()) if one.changes else []
            self.output_maps += one.outputs
            place.module |= bool(one.outputs)
        self._write_inputs(effects, made, native)

    def _write_change(self, change: object, place: Destination) -> None:
        if isinstance(change, SpecChange):
            change.edit(self.spec)
        elif isinstance(change, ModelChange):
            try:
                with silent():
                    change.edit(self.spec)
            except NotImplementedError:
                self.numbers.append(change)
                place.module = True
        else:
            known = self.forces if isinstance(change, StateForce) else self.drives
            known.append(change)  # type: ignore[arg-type]
            place.module = True

    def _write_inputs(self, effects: Sequence[Effect], made: Sequence[SystemParts], native: bool) -> None:
        """Write effects of inputs into actuators as long as nothing behind them is in the module."""
        closed = {one.channel.name for one in self.inputs if one.curve}
        actuators = {one.channel.name: one.actuator for one in self.inputs}
        maps: list[Any] = []
        for effect, parts, place in reversed(list(zip(effects, made, self.places, strict=True))):
            if not parts.inputs:
                continue
            if not isinstance(effect, InputEffect):
                maps += reversed(parts.inputs)
                closed |= set(actuators)
                place.module = True
                continue
            left = {}
            for name, transform in effect.transforms(parts).items():
                if name in closed or not self._is_written(
                    effect, name, actuators[name], parts, native, place
                ):
                    left[name] = transform
                    closed.add(name)
            if left:
                maps.append(partial(driven_by, left))
                place.module = True
        self.input_maps = maps[::-1]

    def _is_written(
        self,
        effect: InputEffect,
        name: str,
        number: int,
        parts: SystemParts,
        native: bool,
        place: Destination,
    ) -> bool:
        if not is_exact(effect) and (not native or self.drives):
            return False
        if self.drives and not isinstance(effect, BEFORE_DRIVES):
            return False
        before, model = self._text(), self.spec.compile()
        actuator = model.actuator(number).name
        if not write_native(effect, parts.scales.get(name, 1.0), self.spec, model, actuator):
            return False
        place.elements += changed_elements(before, self._text())
        place.exact &= is_exact(effect)
        return True

    def _text(self) -> str:
        with silent():
            self.spec.compile()
        return mjcf_text(self.spec)
